//! A tonal disturbance: a force that swings at a frequency of its own, whatever the axis does, and
//! explains a residual without being an effect. Under a loop the command answers it, and delays,
//! lags and springs take it on.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use numerics::golden_section::golden;
use numerics::parallel;
use std::f64::consts::TAU;

/// Samples per second that the search looks at, over the bandwidth of the residual.
const OVERSAMPLED: f64 = 2.6;
/// Fewest cycles over the longest recording: less is a drift.
const FEWEST_CYCLES: f64 = 12.0;
/// At most 6 % of the motion's power may be at the tone and 2 % near it, both scaled up to 4× where
/// the tone is most of the residual. A light axis gives way to a tone; a force that repeats with
/// the motion swings at its frequency too, and leaves a large residual.
const GIVES_WAY: f64 = 0.06;
const FAST_MOTION: f64 = 0.02;
const ROOM: f64 = 4.0;
/// Most power of the drive at that frequency, over the tone's. A loop answers an outside force with
/// 1.5 times its amplitude at most; a lag or a short delay leaves less than the drive makes.
const DRIVEN: f64 = 2.25;

/// A force at one frequency on the held-out recordings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct TonalDisturbance {
    pub(crate) hertz: f64,
    /// Part of what the refit leaves that swings so.
    pub(crate) part: f64,
}

/// The drive's force, and the residual of the refitted model.
pub(crate) struct ResidualView<'a> {
    pub(crate) tracks: &'a [BlockedRecording],
    pub(crate) force: &'a [Vec<f64>],
    pub(crate) refit: &'a [Vec<f64>],
}

/// One recording's samples, evenly spaced.
struct Samples {
    step_s: f64,
    values: Vec<f64>,
}

fn samples(estimator: &Estimator, tracks: &[BlockedRecording], signals: &[Vec<f64>]) -> Vec<Samples> {
    tracks.iter().zip(signals).map(|(track, signal)| Samples::new(estimator, track, signal)).collect()
}

impl Samples {
    /// A signal over blocks, thinned by means; zero where the axis rests.
    fn new(estimator: &Estimator, track: &BlockedRecording, signal: &[f64]) -> Self {
        let rate = track.block_rate();
        let every = (rate / (OVERSAMPLED * estimator.bandwidth_hz)).floor().max(1.0) as usize;
        let blocks = signal.iter().zip(estimator.moving(track));
        let moving: Vec<f64> = blocks.map(|(x, moving)| if moving { *x } else { 0.0 }).collect();
        let mean = |chunk: &[f64]| chunk.iter().sum::<f64>() / every as f64;
        Self { step_s: every as f64 / rate, values: moving.chunks_exact(every).map(mean).collect() }
    }

    fn seconds(&self) -> f64 {
        self.step_s * self.values.len() as f64
    }

    /// Sum of squares that a swing of any size and phase explains.
    fn explained(&self, hertz: f64) -> f64 {
        let (turn_sin, turn_cos) = (TAU * hertz * self.step_s).sin_cos();
        let (mut cos, mut sin) = (1.0, 0.0);
        let (mut along_cos, mut along_sin) = (0.0, 0.0);
        for x in &self.values {
            along_cos += x * cos;
            along_sin += x * sin;
            (cos, sin) = (cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin);
        }
        2.0 * (along_cos.powi(2) + along_sin.powi(2)) / self.values.len().max(1) as f64
    }

    /// Sum of squares of what is about as fast as `hertz` or faster: of what a mean over a period
    /// leaves.
    fn faster_than(&self, hertz: f64) -> f64 {
        let reach = ((0.5 / hertz / self.step_s).round() as usize).max(1);
        let Some(first) = self.values.get(..2 * reach + 1) else { return 0.0 };
        let mut sum: f64 = first.iter().sum();
        let mut square = 0.0;
        for (i, middle) in self.values.iter().enumerate().skip(reach) {
            square += (middle - sum / (2 * reach + 1) as f64).powi(2);
            let Some(next) = self.values.get(i + reach + 1) else { break };
            sum += next - self.values[i - reach];
        }
        square
    }
}

fn explained(all: &[Samples], hertz: f64) -> f64 {
    all.iter().map(|one| one.explained(hertz)).sum()
}

fn square(all: &[Samples]) -> f64 {
    all.iter().flat_map(|one| &one.values).map(|x| x * x).sum::<f64>().max(1e-300)
}

fn faster_than(all: &[Samples], hertz: f64) -> f64 {
    all.iter().map(|one| one.faster_than(hertz)).sum()
}

/// True if a swing that is `part` of the residual may go its own way, for the axis does not move as
/// fast.
fn is_apart(motion: &[Samples], hertz: f64, part: f64) -> bool {
    let room = (1.0 / (1.0 - part)).clamp(1.0, ROOM);
    let (whole, there) = (square(motion), explained(motion, hertz));
    there < GIVES_WAY * room * whole && faster_than(motion, hertz) - there < FAST_MOTION * room * whole
}

/// The frequency at which a swing would explain the most of what the refit leaves on the fitted
/// recordings.
pub(crate) fn frequency(estimator: &Estimator, fit: &ResidualView) -> Option<f64> {
    let left = samples(estimator, fit.tracks, fit.refit);
    let apart = apart(&left);
    let first = 2.0 * FEWEST_CYCLES * apart;
    let count = ((estimator.bandwidth_hz - first) / apart).max(0.0) as usize;
    let tried = parallel::map(count, |i| {
        let hertz = first + apart * i as f64;
        (hertz, explained(&left, hertz))
    });
    let (coarse, _) = tried.into_iter().max_by(|a, b| a.1.total_cmp(&b.1).then(b.0.total_cmp(&a.0)))?;
    Some(nearby(coarse, apart, &left))
}

/// Distance of frequencies that recordings of this length distinguish, halved.
fn apart(all: &[Samples]) -> f64 {
    0.5 / all.iter().map(Samples::seconds).fold(f64::MIN_POSITIVE, f64::max)
}

fn nearby(hertz: f64, apart: f64, all: &[Samples]) -> f64 {
    golden(hertz - apart, hertz + apart, 10, |hertz| explained(all, hertz))
}

/// The swing at about `hertz` as held-out recordings show it; none where the axis itself moves or
/// is driven so.
pub(crate) fn swing(estimator: &Estimator, hertz: f64, holdout: &ResidualView) -> Option<TonalDisturbance> {
    let of_held = |signals: &[Vec<f64>]| samples(estimator, holdout.tracks, signals);
    let before = of_held(holdout.refit);
    // Each recorder has a clock of its own.
    let hertz = nearby(hertz, apart(&before), &before);
    let swings = explained(&before, hertz);
    let speeds: Vec<Vec<f64>> = holdout.tracks.iter().map(|track| track.motion.v.clone()).collect();
    let whole = square(&before);
    let part = swings / whole;
    if explained(&of_held(holdout.force), hertz) > DRIVEN * swings
        || !is_apart(&of_held(&speeds), hertz, part)
    {
        return None;
    }
    Some(TonalDisturbance { hertz, part })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_more_swings_the_more_the_axis_may_give_way() {
        let (hertz, step_s) = (12.0, 0.01);
        let motion = |there: f64| {
            let swing = |i: u32| {
                let t = step_s * f64::from(i);
                (TAU * 0.5 * t).sin() + there.sqrt() * (TAU * hertz * t).sin()
            };
            [Samples { step_s, values: (0..2000).map(swing).collect() }]
        };
        let (still, light, follows) = (motion(0.01), motion(0.1), motion(0.5));
        assert!(is_apart(&still, hertz, 0.3));
        assert!(!is_apart(&light, hertz, 0.3));
        assert!(is_apart(&light, hertz, 0.98));
        assert!(!is_apart(&follows, hertz, 0.98));
    }
}
