//! Lost counts: jumps of what the encoder reads that no force could bring about, found in the innovations.

use crate::fit::{Fit, dot};
use crate::track::{Input, Track};

/// Gain of log-likelihood of a single jump: above every jump that noise makes in a recording.
const PER_JUMP: f64 = 14.0;
/// A jump of position must explain this many times what a jump of speed would: impacts are forces.
const OVER_IMPACT: f64 = 1.3;
/// Most jumps per recording, fewest for it to be a fault, and the reach of a response in blocks.
const MOST: usize = 60;
const FEWEST: usize = 2;
const REACH: usize = 40;

/// Fills in `lost` of a recording from the residual of a fit; zero everywhere where too few jumps are seen.
pub(crate) fn find(track: &Track, fit: &Fit, r: usize, residual: &[f64], count: f64) -> Vec<f64> {
    let n = track.blocks();
    let mut lost = vec![0.0; n];
    if n < 4 * REACH {
        return lost;
    }
    let gains = &fit.prepared[r].gains;
    // Responses to a jump of position and to a jump of speed in the middle: elsewhere they are nearly the same.
    let at = n / 2;
    let mut step = vec![0.0; n];
    step[at..].fill(1.0);
    let position = &gains.response(track, &Input::Sensor(step))[at..at + REACH];
    let mut pulse = vec![0.0; n];
    pulse[at - 1] = 1.0 / track.span[at - 1];
    let speed = &gains.response(track, &Input::Held(pulse))[at..at + REACH];
    let (pp, ss) = (dot(position, position), dot(speed, speed));
    if pp <= 0.0 || ss <= 0.0 {
        return lost;
    }
    let mut peaks: Vec<(f64, usize, f64)> = Vec::new();
    for j in 5..n - REACH {
        if track.rest[j] {
            continue;
        }
        let e = &residual[j..j + REACH];
        let p = dot(position, e);
        let gain = 0.5 * p * p / pp;
        if gain > PER_JUMP {
            let s = (0..2)
                .map(|k| dot(speed, &residual[j + 1 - k..j + 1 - k + REACH]).powi(2) * 0.5 / ss)
                .fold(0.0, f64::max);
            if gain > OVER_IMPACT * s {
                peaks.push((gain, j, p / pp));
            }
        }
    }
    peaks.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let mut kept: Vec<(usize, f64)> = Vec::new();
    for (_, j, size) in peaks {
        if kept.len() < MOST
            && size.abs() > 0.7 * count
            && kept.iter().all(|(k, _)| k.abs_diff(j) > REACH / 2)
        {
            kept.push((j, size));
        }
    }
    if kept.len() >= FEWEST {
        for (j, size) in kept {
            for lost in &mut lost[j..] {
                *lost += size;
            }
        }
    }
    lost
}
