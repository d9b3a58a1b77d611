//! Lost counts: jumps of what the encoder reads that no force could bring about, found in the innovations.

use crate::fit::{Fit, dot};
use crate::solve::{Factor, Square};
use crate::track::{Input, Track};

/// Gain of log-likelihood of a single jump: above every jump that noise makes in a recording.
const PER_JUMP: f64 = 14.0;
/// A jump of position must explain this many times what a jump of speed would: impacts are forces.
const OVER_IMPACT: f64 = 1.3;
/// Most jumps per recording, fewest for it to be a fault, and the reach of a response in blocks.
const MOST: usize = 80;
const FEWEST: usize = 2;
const REACH: usize = 40;
/// How often what is left is looked through again: a large jump hides its neighbours.
const ROUNDS: usize = 3;

/// Travel lost so far per block, from the residual of a fit that knows of no jumps; zero everywhere where too few are seen.
pub(crate) fn find(track: &Track, fit: &Fit, r: usize, residual: &[f64], count: f64) -> Vec<f64> {
    let n = track.blocks();
    let Some(templates) = Templates::new(track, fit, r) else { return vec![0.0; n] };
    let mut jumps: Vec<usize> = Vec::new();
    let mut sizes: Vec<f64> = Vec::new();
    let mut left = residual.to_vec();
    for _ in 0..ROUNDS {
        let before = jumps.len();
        for (j, size) in templates.peaks(track, &left) {
            let is_new = jumps.iter().all(|k| k.abs_diff(j) > 1);
            if jumps.len() < MOST && size.abs() > 0.7 * count && is_new {
                jumps.push(j);
            }
        }
        if jumps.len() == before {
            break;
        }
        jumps.sort_unstable();
        (jumps, sizes, left) = together(track, fit, r, residual, &jumps, count);
    }
    let mut lost = vec![0.0; n];
    if jumps.len() >= FEWEST {
        for (j, size) in jumps.into_iter().zip(sizes) {
            lost[j..].iter_mut().for_each(|lost| *lost += size);
        }
    }
    lost
}

/// What a jump of position and a jump of speed look like where the axis moves: elsewhere they are nearly the same.
struct Templates {
    position: Vec<f64>,
    speed: Vec<f64>,
}

impl Templates {
    fn new(track: &Track, fit: &Fit, r: usize) -> Option<Self> {
        let n = track.blocks();
        let moves = |j: &usize| !track.rest[*j - 1..*j + REACH].iter().any(|rest| *rest);
        let at = (1..n.checked_sub(REACH)?)
            .filter(moves)
            .min_by_key(|j| j.abs_diff(n / 2))
            .or_else(|| (n >= 4 * REACH).then_some(n / 2))?;
        let gains = &fit.prepared[r].gains;
        let mut step = vec![0.0; n];
        step[at..].fill(1.0);
        let mut pulse = vec![0.0; n];
        pulse[at - 1] = 1.0 / track.span[at - 1];
        let cut = |input: Input| gains.response(track, &input)[at..at + REACH].to_vec();
        Some(Self { position: cut(Input::Sensor(step)), speed: cut(Input::Held(pulse)) })
    }

    /// Blocks at which a jump of position stands out, with its size, the clearest first.
    fn peaks(&self, track: &Track, residual: &[f64]) -> Vec<(usize, f64)> {
        let (pp, ss) = (dot(&self.position, &self.position), dot(&self.speed, &self.speed));
        let mut found: Vec<(f64, usize, f64)> = Vec::new();
        if pp <= 0.0 || ss <= 0.0 {
            return Vec::new();
        }
        for j in 5..residual.len().saturating_sub(REACH) {
            let p = dot(&self.position, &residual[j..j + REACH]);
            let gain = 0.5 * p * p / pp;
            // What is lost is lost on the way: the reading falls behind the motion.
            if track.rest[j] || gain <= PER_JUMP || p * track.v[j] >= 0.0 {
                continue;
            }
            let impact =
                |k: usize| dot(&self.speed, &residual[j + 1 - k..j + 1 - k + REACH]).powi(2) * 0.5 / ss;
            if gain > OVER_IMPACT * impact(0).max(impact(1)) {
                found.push((gain, j, p / pp));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut apart: Vec<(usize, f64)> = Vec::new();
        for (_, j, size) in found {
            if apart.iter().all(|(k, _)| k.abs_diff(j) > REACH / 4) {
                apart.push((j, size));
            }
        }
        apart
    }
}

/// Fits the sizes of all jumps at once and drops those that do not stand: places, sizes, and the residual without them.
fn together(
    track: &Track,
    fit: &Fit,
    r: usize,
    residual: &[f64],
    jumps: &[usize],
    count: f64,
) -> (Vec<usize>, Vec<f64>, Vec<f64>) {
    let n = track.blocks();
    let responses: Vec<Vec<f64>> = jumps
        .iter()
        .map(|j| {
            let mut step = vec![0.0; n];
            step[*j..].fill(1.0);
            fit.prepared[r].gains.response(track, &Input::Sensor(step))
        })
        .collect();
    let solve = |kept: &[usize]| -> Vec<f64> {
        let mut m = Square::zero(kept.len());
        for (a, i) in kept.iter().enumerate() {
            for (b, j) in kept.iter().enumerate() {
                m.add(a, b, dot(&responses[*i], &responses[*j]));
            }
        }
        let right: Vec<f64> = kept.iter().map(|i| dot(&responses[*i], residual)).collect();
        Factor::new(&m).solve(&right)
    };
    let all: Vec<usize> = (0..jumps.len()).collect();
    let first = solve(&all);
    let stands = |i: &usize| {
        let size = first[*i];
        0.5 * size * size * dot(&responses[*i], &responses[*i]) > PER_JUMP && size.abs() > 0.7 * count
    };
    let kept: Vec<usize> = all.into_iter().filter(stands).collect();
    let sizes = solve(&kept);
    let mut left = residual.to_vec();
    for (i, size) in kept.iter().zip(&sizes) {
        for (left, x) in left.iter_mut().zip(&responses[*i]) {
            *left -= size * x;
        }
    }
    (kept.iter().map(|i| jumps[*i]).collect(), sizes, left)
}
