//! The test whether the residual repeats where the motion repeats: recordings of one trajectory, or
//! periods of one recording.
//!
//! Repeats are found from the motion itself (or from what the loop was asked to follow, where that
//! is recorded); the residuals of aligned stretches are then correlated. A disturbance that comes
//! from outside does not know when the motion repeats.

use crate::fit::blocked_recording::BlockedRecording;
use numerics::linear::correlation;

/// The smallest correlation of the motion at which one stretch repeats another.
const SAME_MOTION: f64 = 0.97;
/// The smallest correlation of residuals that repeat, and the standard errors by which it must
/// exceed chance.
const REPEATS: f64 = 0.5;
const REPEATS_Z: f64 = 4.0;
/// Shortest stretch that is compared, s, and shift within which recordings are aligned, s.
const SHORTEST_S: f64 = 1.0;
const SHIFT_S: f64 = 1.0;
/// Samples per second that are compared: enough for the motion of most machines.
const RATE_HZ: f64 = 50.0;

/// One recording with its residual, evenly sampled: the speed or the reference's, and the residual,
/// zero where not known.
struct Sampled {
    motion: Vec<f64>,
    left: Vec<f64>,
}

fn sampled(track: &BlockedRecording, residual: &[f64], moving: &[bool]) -> Sampled {
    let every = ((track.block_rate() / RATE_HZ).round() as usize).max(1);
    let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len() as f64;
    let rate: Vec<f64> = match &track.blocks.reference {
        Some(reference) => reference.windows(2).map(|w| w[1] - w[0]).chain([0.0]).collect(),
        None => track.motion.v.clone(),
    };
    let left: Vec<f64> =
        residual.iter().zip(moving).map(|(x, moving)| if *moving { *x } else { 0.0 }).collect();
    Sampled {
        motion: rate.chunks_exact(every).map(mean).collect(),
        left: left.chunks_exact(every).map(mean).collect(),
    }
}

/// Correlation of two stretches' residuals where their motion is the same; nothing where it is not.
fn compared(a: (&[f64], &[f64]), b: (&[f64], &[f64])) -> Option<(f64, f64)> {
    let n = a.0.len().min(b.0.len());
    if (n as f64) < SHORTEST_S * RATE_HZ || correlation(&a.0[..n], &b.0[..n]) < SAME_MOTION {
        return None;
    }
    Some((correlation(&a.1[..n], &b.1[..n]), n as f64))
}

/// Correlation of the residual between repeats of a motion, where the recordings hold any and it is
/// surely more than chance; `independent_hz` is how many samples a second say something of their
/// own.
pub(crate) fn correlation_of_repeats(
    tracks: &[BlockedRecording],
    residuals: &[Vec<f64>],
    moving: &[Vec<bool>],
    independent_hz: f64,
) -> Option<f64> {
    let all: Vec<Sampled> =
        tracks.iter().zip(residuals).zip(moving).map(|((t, x), m)| sampled(t, x, m)).collect();
    let shift = (SHIFT_S * RATE_HZ) as usize;
    let (mut sum, mut samples) = (0.0, 0.0);
    let mut add = |found: Option<(f64, f64)>| {
        if let Some((correlation, n)) = found {
            sum += correlation * n;
            samples += n;
        }
    };
    for (i, a) in all.iter().enumerate() {
        for b in &all[i + 1..] {
            let correlations = |lag: usize, first: &Sampled, second: &Sampled| {
                let from = lag.min(first.motion.len());
                let rows_from =
                    |one: &Sampled, from: usize| (one.motion[from..].to_vec(), one.left[from..].to_vec());
                let (a, b) = (rows_from(first, from), rows_from(second, 0));
                let n = a.0.len().min(b.0.len());
                (correlation(&a.0[..n], &b.0[..n]), compared((&a.0, &a.1), (&b.0, &b.1)))
            };
            let lags = (0..=shift).flat_map(|lag| [correlations(lag, a, b), correlations(lag, b, a)]);
            add(lags.max_by(|x, y| x.0.total_cmp(&y.0)).and_then(|(_, found)| found));
        }
        // The shortest period after which the motion is the same again.
        let n = a.motion.len();
        let least = (0.3 * RATE_HZ) as usize;
        let period = (least..n / 2).find(|lag| {
            let (x, y) = (&a.motion[..n - lag], &a.motion[*lag..]);
            (x.len() as f64) >= SHORTEST_S * RATE_HZ && correlation(x, y) > SAME_MOTION
        });
        if let Some(period) = period.filter(|period| is_period(&a.motion, *period)) {
            add(compared((&a.motion, &a.left), (&a.motion[period..], &a.left[period..])));
        }
    }
    let correlation = sum / f64::max(samples, 1.0);
    let independent = samples * (independent_hz / RATE_HZ).min(1.0);
    (correlation > REPEATS && correlation * independent.sqrt() > REPEATS_Z).then_some(correlation)
}

/// True if the motion differs within a period: a slow one is like itself a moment later too.
fn is_period(motion: &[f64], period: usize) -> bool {
    let half = period / 2;
    half > 0 && correlation(&motion[..motion.len() - half], &motion[half..]) < 0.5
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use numerics::bootstrap::Random;
    use std::sync::Arc;

    /// A motion to and fro that starts `late`, with a residual of time since its start.
    fn track(late: f64, residual: impl FnMut(f64) -> f64) -> (BlockedRecording, Vec<f64>) {
        let time_s: Vec<f64> = (0..3000).map(|i| f64::from(i) * 2e-3).collect();
        let recording = Recording {
            command: vec![0.0; 3000],
            position_counts: time_s.clone(),
            time_s,
            ..Recording::default()
        };
        let mut track = BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.0));
        let since: Vec<f64> = track.blocks.start.iter().map(|t| t - late).collect();
        track.motion.v = since.iter().map(|t| (1.1 * t * t.abs().sqrt()).sin()).collect();
        (track, since.into_iter().map(residual).collect())
    }

    fn repeats(all: Vec<(BlockedRecording, Vec<f64>)>) -> Option<f64> {
        let (tracks, residuals): (Vec<_>, Vec<_>) = all.into_iter().unzip();
        let moving: Vec<Vec<bool>> = tracks.iter().map(|t| vec![true; t.block_count()]).collect();
        correlation_of_repeats(&tracks, &residuals, &moving, 20.0)
    }

    #[test]
    fn only_a_force_of_the_motion_repeats_with_it() {
        let of_motion = |t: f64| (7.0 * t + (3.0 * t).sin()).sin();
        let told = repeats(vec![track(0.0, of_motion), track(0.3, of_motion)]);
        assert!(told.is_some_and(|correlation| correlation > 0.9), "{told:?}");
        let outside = |seed: u64| {
            let mut random = Random::new(seed);
            let mut last = 0.0;
            move |_: f64| {
                last = 0.95 * last + random.below(2001) as f64 / 1000.0 - 1.0;
                last
            }
        };
        assert_eq!(repeats(vec![track(0.0, outside(3)), track(0.3, outside(9))]), None);
        assert_eq!(repeats(vec![track(0.0, of_motion)]), None, "one recording without periods");
        // If the motions differ, the reference that the loop was asked to follow shows the
        // repetition.
        let asked = |late: f64, reads: fn(f64) -> f64| {
            let (mut track, left) = track(late, of_motion);
            let followed = |t: &f64| (0.9 * (t - late) * (t - late).abs().sqrt()).sin();
            let reference = track.blocks.start.iter().map(followed).collect();
            Arc::make_mut(&mut track.blocks).reference = Some(reference);
            track.motion.v.iter_mut().for_each(|v| *v = reads(*v));
            (track, left)
        };
        let both = || vec![asked(0.0, |v| v), asked(0.3, |_| 0.0)];
        assert!(repeats(both()).is_some());
        let unasked = both().into_iter().map(|(mut track, left)| {
            Arc::make_mut(&mut track.blocks).reference = None;
            (track, left)
        });
        assert_eq!(repeats(unasked.collect()), None);
    }
}
