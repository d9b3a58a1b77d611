//! Where the residual sits: maps over states that carry from the fitted to the held-out recordings, and intervals of time.

use crate::judge::{Gain, bootstrap};
use crate::track::Track;

/// A residual averaged over bins of a variable, moving forward and backward apart.
#[derive(Debug, Clone)]
pub struct Map {
    /// `speed`, `travel`, `angle`, `command` or `time`.
    pub variable: &'static str,
    /// Bounds of the bins.
    pub edges: Vec<f64>,
    /// Mean residual force per bin, moving forward and backward; none where there is too little.
    pub forward: Vec<Option<f64>>,
    /// The same, moving backward.
    pub backward: Vec<Option<f64>>,
    /// Part of the held-out mean square that the map of the fitted recordings predicts.
    pub carries: f64,
    /// Whether that is more than chance.
    pub significant: bool,
}

const BINS: usize = 14;
const LEAST: usize = 20;

fn variable(track: &Track, name: &str, turn: Option<f64>) -> Vec<f64> {
    match name {
        "speed" => track.v.clone(),
        "travel" => track.x.clone(),
        "angle" => track.x.iter().map(|x| turn.map_or(0.0, |turn| x.rem_euclid(turn))).collect(),
        "command" => track.block_mean(&track.command),
        _ => track.start.clone(),
    }
}

/// Averages residuals over bins on the fitted recordings and asks the held-out ones whether that was luck.
pub(crate) fn maps(
    fit: (&[Track], &[Vec<f64>]),
    held: (&[Track], &[Vec<f64>]),
    turn: Option<f64>,
) -> Vec<Map> {
    let mut names = vec!["speed", "travel", "command", "time"];
    if turn.is_some() {
        names.push("angle");
    }
    names
        .into_iter()
        .map(|name| {
            let values: Vec<Vec<f64>> = fit.0.iter().map(|t| variable(t, name, turn)).collect();
            let mut all: Vec<f64> = values.iter().flatten().copied().collect();
            all.sort_by(f64::total_cmp);
            let at = |p: usize| all[(all.len() - 1) * p / 1000];
            let (low, high) = (at(3), at(997).max(at(3) + 1e-12));
            let edges: Vec<f64> = (0..=BINS).map(|i| low + (high - low) * i as f64 / BINS as f64).collect();
            let bin = |x: f64| {
                (((x - low) / (high - low) * BINS as f64).floor().clamp(0.0, (BINS - 1) as f64)) as usize
            };
            let mut sums = vec![[(0.0, 0usize); 2]; BINS];
            for ((track, residual), values) in fit.0.iter().zip(fit.1).zip(&values) {
                for j in 0..track.blocks() {
                    if !track.rest[j] {
                        let cell = &mut sums[bin(values[j])][usize::from(track.v[j] < 0.0)];
                        cell.0 += residual[j];
                        cell.1 += 1;
                    }
                }
            }
            let mean = |cell: (f64, usize)| (cell.1 >= LEAST).then(|| cell.0 / cell.1 as f64);
            let mut gains = Vec::new();
            let mut whole = 0.0;
            for (track, residual) in held.0.iter().zip(held.1) {
                let values = variable(track, name, turn);
                for w in track.segments.windows(2) {
                    let mut gain = 0.0;
                    for j in w[0]..w[1] {
                        if track.rest[j] {
                            continue;
                        }
                        let guess = mean(sums[bin(values[j])][usize::from(track.v[j] < 0.0)]).unwrap_or(0.0);
                        gain += residual[j].powi(2) - (residual[j] - guess).powi(2);
                        whole += residual[j].powi(2);
                    }
                    gains.push(gain);
                }
            }
            // In units of a segment's mean square, so that the limit per witness means the same everywhere.
            let unit = (whole / gains.len().max(1) as f64).max(1e-300);
            gains.iter_mut().for_each(|gain| *gain /= unit);
            let gain: Gain = bootstrap(&gains);
            Map {
                variable: name,
                edges,
                forward: sums.iter().map(|s| mean(s[0])).collect(),
                backward: sums.iter().map(|s| mean(s[1])).collect(),
                carries: if whole > 0.0 { gain.sum / gains.len() as f64 } else { 0.0 },
                significant: gain.low > 0.0 && gain.z > 2.6,
            }
        })
        .collect()
}

/// Stretches of time, s, in which a weight per block is high, merged where they nearly touch; the strongest 24.
pub(crate) fn intervals(track: &Track, weight: &[f64]) -> Vec<[f64; 2]> {
    let n = track.blocks();
    let length = (0.1 * track.block_rate()).ceil().max(1.0) as usize;
    let means: Vec<f64> = weight.chunks(length).map(|c| c.iter().sum::<f64>() / c.len() as f64).collect();
    let average = means.iter().sum::<f64>() / means.len() as f64;
    if average.is_nan() || average <= 0.0 {
        return Vec::new();
    }
    let mut out: Vec<([f64; 2], f64)> = Vec::new();
    for (i, mean) in means.iter().enumerate() {
        if *mean < average {
            continue;
        }
        let (a, b) = (i * length, ((i + 1) * length).min(n) - 1);
        let (from, to) = (track.start[a], track.start[b] + track.span[b]);
        match out.last_mut() {
            Some((last, sum)) if from - last[1] < 0.15 => {
                last[1] = to;
                *sum += mean;
            }
            _ => out.push(([from, to], *mean)),
        }
    }
    out.sort_by(|a, b| b.1.total_cmp(&a.1));
    out.truncate(24);
    let mut intervals: Vec<[f64; 2]> = out.into_iter().map(|(i, _)| i).collect();
    intervals.sort_by(|a, b| a[0].total_cmp(&b[0]));
    intervals
}

/// Ends between which nine tenths of a weight lie.
pub(crate) fn range(values: &[f64], weights: &[f64]) -> Option<(f64, f64)> {
    let mut pairs: Vec<(f64, f64)> =
        values.iter().copied().zip(weights.iter().copied()).filter(|(_, w)| *w > 0.0).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = pairs.iter().map(|p| p.1).sum();
    let at = |part: f64| {
        let mut sum = 0.0;
        pairs.iter().find(|p| {
            sum += p.1;
            sum >= part * whole
        })
    };
    Some((at(0.05)?.0, at(0.95)?.0))
}
