//! The size of sensor noise and disturbance: maximum likelihood of the innovations, by a
//! deterministic pattern search.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::covariance::rhos;
use crate::fit::filter::{Noise, Observed, innovations, robust_loss};
use crate::fit::input::Total;
use numerics::parallel;
use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};

/// Blocks that the search looks at per recording: more would not change the answer by its own
/// uncertainty.
const LOOKED_AT: usize = 8000;

/// Blocks that are forgiven together where they are worse than the noise.
const STRETCH: usize = 100;

/// A stretch of a recording with the input of the current model.
struct Excerpt<'a> {
    track: &'a BlockedRecording,
    over: Range<usize>,
    /// Start of each block, s, and its mean reading, both counted from the stretch's first.
    start: Vec<f64>,
    z: Vec<f64>,
    total: Total,
    /// A correlation time, s, and the parts of the disturbance that are left after each block then:
    /// most trials of a search keep it.
    left: Mutex<(f64, Arc<Vec<f64>>)>,
}

fn excerpts<'a>(track: &'a BlockedRecording, total: &Total) -> Vec<Excerpt<'a>> {
    let n = track.block_count();
    if n <= LOOKED_AT {
        return vec![Excerpt::new(track, total, 0..n)];
    }
    let half = LOOKED_AT / 2;
    let first = (n / 2 - half) / 2;
    let second = n - half - first;
    [first, second].map(|from| Excerpt::new(track, total, from..from + half)).into()
}

impl<'a> Excerpt<'a> {
    fn new(track: &'a BlockedRecording, total: &Total, over: Range<usize>) -> Self {
        let since_first =
            |column: &[f64]| column[over.clone()].iter().map(|x| x - column[over.start]).collect();
        let (start, z) = (since_first(&track.blocks.start), since_first(&track.blocks.z));
        let cut = |column: &[f64]| column[over.clone()].to_vec();
        let total = Total { dv: cut(&total.dv), dq: cut(&total.dq), dz: cut(&total.dz) };
        Self { track, over, start, z, total, left: Mutex::new((f64::NAN, Arc::default())) }
    }

    fn rhos(&self, tau: f64) -> Arc<Vec<f64>> {
        let mut left = self.left.lock().unwrap_or_else(PoisonError::into_inner);
        if left.0 != tau {
            *left = (tau, Arc::new(rhos(&self.observed(), tau)));
        }
        Arc::clone(&left.1)
    }

    fn observed(&self) -> Observed<'_> {
        let Observed { span, tau1, tau2, reading_lag, quantum, any_force, stuck, .. } = self.track.observed();
        let over = self.over.clone();
        Observed {
            start: &self.start,
            span: &span[over.clone()],
            tau1: &tau1[over.clone()],
            tau2: &tau2[over.clone()],
            reading_lag: reading_lag.get(over.clone()).unwrap_or_default(),
            z: &self.z,
            quantum: &quantum[over.clone()],
            any_force: &any_force[over.clone()],
            stuck: &stuck[over],
        }
    }
}

fn log_likelihood(parts: &[Excerpt], noise: &Noise) -> f64 {
    let each = parallel::map_all(parts, |part| {
        let observed = part.observed();
        let (e, log_det) = innovations(&observed, noise, &part.rhos(noise.tau), &part.total);
        let cost: f64 = e
            .chunks(STRETCH)
            .map(|e| {
                let square: f64 = e.iter().map(|e| e * e).sum();
                e.len() as f64 * robust_loss(square / e.len() as f64).0
            })
            .sum();
        log_det - 0.5 * cost
    });
    each.iter().sum()
}

/// The assumed disturbance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Colour {
    /// White force: every frequency of the band counts the same, as in a plain force error. Ranks
    /// effects.
    White,
    /// White force and a slow disturbance: what wanders by itself proves nothing. Tests effects.
    Slow,
}

/// Bounds of the correlation time of the disturbance, s: longer would be an offset, shorter would
/// be white.
const TAU: (f64, f64) = (0.004, 0.1);

/// The noise under which the innovations of these recordings are the most likely, starting from
/// `from`.
pub(crate) fn estimate(
    tracks: &[BlockedRecording],
    totals: &[Total],
    from: &Noise,
    scale: f64,
    colour: Colour,
) -> Noise {
    let parts: Vec<Excerpt> =
        tracks.iter().zip(totals).flat_map(|(track, total)| excerpts(track, total)).collect();
    let span = tracks[0].blocks.span.iter().sum::<f64>() / tracks[0].block_count() as f64;
    let mut at = [from.sensor.ln(), from.white.ln(), from.slow.ln(), from.tau.ln()];
    let floor = scale * scale * 1e-12;
    let lower = [0.3_f64.ln(), (floor * span).ln(), floor.ln(), TAU.0.ln()];
    let upper = [1e9_f64.ln(), (scale * scale * 10.0 * span).ln(), (scale * scale * 10.0).ln(), TAU.1.ln()];
    if colour == Colour::White {
        at[2] = lower[2];
    } else if at[2] <= lower[2] + 1e-9 {
        // Coming from white noise: start where both kinds are as strong at the correlation time.
        at[2] = (0.5 * at[1].exp() / TAU.1).ln();
    }
    for i in 0..4 {
        at[i] = at[i].clamp(lower[i], upper[i]);
    }
    let noise_at = |at: &[f64; 4]| Noise {
        sensor: at[0].exp(),
        white: at[1].exp(),
        slow: at[2].exp(),
        tau: at[3].exp(),
        rest: from.rest,
        blur: 0.0,
    };
    let moved_values = match colour {
        Colour::White => 2,
        Colour::Slow => 4,
    };
    let value = |at: &[f64; 4]| log_likelihood(&parts, &noise_at(at));
    noise_at(&pattern_search(at, (lower, upper), moved_values, &value))
}

/// Searches for the largest value within bounds by a pattern search; only the first `moved_values`
/// values move.
fn pattern_search(
    mut at: [f64; 4],
    (lower, upper): ([f64; 4], [f64; 4]),
    moved_values: usize,
    value: &dyn Fn(&[f64; 4]) -> f64,
) -> [f64; 4] {
    let mut step = [1.5, 2.0, 2.0, 1.0];
    let mut best = value(&at);
    for _ in 0..14 {
        let mut moved = false;
        for i in 0..moved_values {
            for way in [1.0, -1.0] {
                let mut trial = at;
                trial[i] = (at[i] + way * step[i]).clamp(lower[i], upper[i]);
                if trial[i] == at[i] {
                    continue;
                }
                let value = value(&trial);
                if value > best + 0.05 {
                    best = value;
                    at = trial;
                    step[i] *= 1.3;
                    moved = true;
                    break;
                }
            }
        }
        if !moved {
            for step in &mut step {
                *step *= 0.45;
            }
            if step[..moved_values].iter().all(|step| *step < 0.12) {
                break;
            }
        }
    }
    at
}

/// Returns the start of the search before anything is known; `scale` is the acceleration that the
/// command makes.
pub(crate) fn guess(tracks: &[BlockedRecording], scale: f64) -> Noise {
    let span = tracks[0].blocks.span.iter().sum::<f64>() / tracks[0].block_count() as f64;
    Noise {
        sensor: 1.0,
        white: (0.01 * scale).powi(2) * span,
        slow: (0.1 * scale).powi(2),
        tau: 0.1,
        rest: scale * scale * span.max(1e-3),
        blur: 0.0,
    }
}
