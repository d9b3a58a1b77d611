//! Held-out recordings judge: coefficients stand as fitted, only what is each recording's own may move (its offset, and
//! the place along the travel at which it started).

use crate::fit::{Fit, Prepared};
use crate::joint;
use crate::kalman::{Noise, tolerant};
use crate::model::{Key, Model, Nominal, own_phase, total};
use crate::select::Candidate;
use crate::solve::Square;
use crate::track::{Total, Track};

/// A model laid on one held-out recording.
pub(crate) struct Laid {
    pub(crate) total: Total,
    /// Acceleration by the force that is there all the time.
    pub(crate) bias: f64,
    /// Cost of each segment, in log-likelihood.
    pub(crate) costs: Vec<f64>,
}

impl Laid {
    fn cost(&self) -> f64 {
        self.costs.iter().sum()
    }
}

/// Pattern of an effect with its own phase: per wave (frequency, cosine, sine), with the recordings' phases undone.
fn pattern(fit: &Fit, model: &Model, effect: usize) -> Vec<(f64, f64, f64)> {
    let waves: Vec<f64> = waves_of(model, effect);
    let of = |r: usize| -> Vec<(f64, f64, f64)> {
        let theta = fit.theta(r);
        let terms: Vec<f64> = fit.prepared[r]
            .columns
            .iter()
            .zip(&theta)
            .filter(|(c, _)| matches!(c.key, Key::Term { effect: e, .. } if e == effect))
            .map(|(_, theta)| *theta)
            .collect();
        waves.iter().zip(terms.chunks_exact(2)).map(|(w, t)| (*w, t[0], t[1])).collect()
    };
    let mut sum = of(0);
    let commensurate = model.effects[effect].shape.contains_key("turn");
    for r in 1..fit.prepared.len() {
        let other = of(r);
        let groups: Vec<Vec<usize>> = groups(waves.len(), commensurate);
        for group in groups {
            let reach = group.iter().map(|i| std::f64::consts::TAU / waves[*i]).fold(0.0, f64::max);
            let likeness =
                |shift: f64| group.iter().map(|i| dot2(sum[*i], turned(other[*i], shift))).sum::<f64>();
            let shift = best_shift(reach, highest(&waves, &group), likeness);
            for i in group {
                let (_, c, s) = turned(other[i], shift);
                let n = r as f64;
                sum[i].1 = (sum[i].1 * n + c) / (n + 1.0);
                sum[i].2 = (sum[i].2 * n + s) / (n + 1.0);
            }
        }
    }
    sum
}

pub(crate) fn waves_of(model: &Model, effect: usize) -> Vec<f64> {
    let effect = &model.effects[effect];
    let waves: Vec<f64> = effect.waves().into_iter().map(|(_, w)| w).collect();
    if waves.is_empty() {
        vec![std::f64::consts::TAU / effect.shape_or("turn", std::f64::consts::TAU)]
    } else {
        waves
    }
}

/// Waves of a turn share one shift; free periods have one each.
fn groups(count: usize, commensurate: bool) -> Vec<Vec<usize>> {
    if commensurate { vec![(0..count).collect()] } else { (0..count).map(|i| vec![i]).collect() }
}

fn highest(waves: &[f64], group: &[usize]) -> f64 {
    group.iter().map(|i| waves[*i]).fold(0.0, f64::max)
}

fn dot2(a: (f64, f64, f64), b: (f64, f64, f64)) -> f64 {
    a.1 * b.1 + a.2 * b.2
}

/// The wave as seen from a place `shift` further on.
fn turned((w, c, s): (f64, f64, f64), shift: f64) -> (f64, f64, f64) {
    let (sin, cos) = (w * shift).sin_cos();
    (w, c * cos + s * sin, s * cos - c * sin)
}

/// The shift within one period with the largest value: a grid finer than the highest wave, then golden section.
fn best_shift(period: f64, highest: f64, value: impl Fn(f64) -> f64) -> f64 {
    let cycles = (period * highest / std::f64::consts::TAU).max(1.0);
    let count = (8.0 * cycles).ceil().clamp(16.0, 4000.0) as usize;
    let at = |i: usize| period * i as f64 / count as f64;
    let mut best = (0, f64::NEG_INFINITY);
    for i in 0..count {
        let v = value(at(i));
        if v > best.1 {
            best = (i, v);
        }
    }
    let width = period / count as f64;
    crate::periodic::golden(at(best.0) - width, at(best.0) + width, 12, value)
}

/// Lays a fitted model on a held-out recording under a noise.
pub(crate) fn lay(candidate: &Candidate, nominal: &Nominal, track: &Track, noise: &Noise) -> Laid {
    let mut best = lay_once(candidate, nominal, track, noise);
    if !candidate.model.effects.iter().any(joint::is_joint) {
        return best;
    }
    // The law of a joint takes up the force that is there all the time, which laying it finds.
    let mut own = track.clone();
    let mut bias = best.bias;
    for _ in 0..BIASES {
        own.bias = bias;
        let laid = lay_once(candidate, nominal, &own, noise);
        bias = laid.bias;
        if laid.cost() < best.cost() {
            best = Laid { bias: own.bias, ..laid };
        }
    }
    best
}

/// How often the force that is there all the time is found anew.
const BIASES: usize = 2;

fn lay_once(candidate: &Candidate, nominal: &Nominal, track: &Track, noise: &Noise) -> Laid {
    let (model, fit) = (&candidate.model, &candidate.fit);
    let one = Prepared::new(model, nominal, track, noise);
    let p = one.columns.len();
    let mut theta = one.reference.clone();
    for (i, column) in one.columns.iter().enumerate() {
        if !column.own
            && let Some(value) = fit.value(column.key)
        {
            theta[i] = value;
        }
    }
    let (mut m, mut b) = (Square::zero(p), vec![0.0; p]);
    for (segment, _) in one.segments.iter().zip(track.known_segments()).filter(|(_, known)| *known) {
        for i in 0..p {
            b[i] += segment.at(i, p);
            for j in 0..p {
                m.add(i, j, segment.at(i, j));
            }
        }
    }
    let offset = one.columns.iter().position(|c| c.key == Key::Offset);
    // Twice round, because offset and phases lean on each other.
    for _ in 0..2 {
        if let Some(o) = offset {
            let prior = one.columns[o].prior;
            let weight = if prior.sd.is_finite() { prior.sd.powi(-2) } else { 0.0 };
            let rest: f64 =
                (0..p).filter(|j| *j != o).map(|j| m.at(o, j) * (theta[j] - one.reference[j])).sum();
            let information = m.at(o, o) + weight;
            if information > 0.0 {
                theta[o] = one.reference[o] + (b[o] - rest) / information;
            }
        }
        for effect in 0..model.effects.len() {
            let name = model.effects[effect].name;
            let places: Vec<usize> = (0..p)
                .filter(|i| matches!(one.columns[*i].key, Key::Term { effect: e, .. } if e == effect))
                .collect();
            if !own_phase(name) || places.is_empty() {
                continue;
            }
            let shape = pattern(fit, model, effect);
            let waves = waves_of(model, effect);
            for group in groups(waves.len(), model.effects[effect].shape.contains_key("turn")) {
                let reach = group.iter().map(|i| std::f64::consts::TAU / waves[*i]).fold(0.0, f64::max);
                let columns: Vec<usize> =
                    group.iter().flat_map(|i| [places[2 * i], places[2 * i + 1]]).collect();
                let pull: Vec<f64> = columns
                    .iter()
                    .map(|i| {
                        let rest: f64 = (0..p)
                            .filter(|j| !columns.contains(j))
                            .map(|j| m.at(*i, j) * (theta[j] - one.reference[j]))
                            .sum();
                        b[*i] - rest
                    })
                    .collect();
                let at = |shift: f64| -> Vec<f64> {
                    group
                        .iter()
                        .flat_map(|i| {
                            let (_, c, s) = turned(shape[*i], shift);
                            [c, s]
                        })
                        .collect()
                };
                let gain = |shift: f64| {
                    let x = at(shift);
                    let mut sum = 0.0;
                    for (a, i) in columns.iter().enumerate() {
                        let row: f64 = columns.iter().zip(&x).map(|(j, x)| m.at(*i, *j) * x).sum();
                        sum += x[a] * (pull[a] - 0.5 * row);
                    }
                    sum
                };
                let shift = best_shift(reach, highest(&waves, &group), gain);
                for (i, x) in columns.iter().zip(at(shift)) {
                    theta[*i] = x;
                }
            }
        }
    }
    let places: Vec<usize> = (0..p).collect();
    let step: Vec<f64> = theta.iter().zip(&one.reference).map(|(a, b)| a - b).collect();
    let costs = one
        .squares(&places, &step)
        .iter()
        .zip(one.weights())
        .zip(track.known_segments())
        .map(
            |((square, (_, count)), known)| {
                if known { 0.5 * count * tolerant(square / count).0 } else { 0.0 }
            },
        )
        .collect();
    let bias = offset.map_or(0.0, |o| theta[o]);
    Laid { total: total(track, &one.columns, &theta), bias, costs }
}

/// Deterministic pseudo-random numbers (xorshift64*), seeded by a constant.
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed | 1)
    }
    pub(crate) fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        ((self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 33) as usize) % n
    }
}

/// Gain over segments: mean, its standard error, and a bootstrap interval of the sum.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gain {
    pub(crate) sum: f64,
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Mean over standard error; neighbours are taken together so that what lasts longer than a segment counts once.
    pub(crate) z: f64,
    /// The same with the gain of each block limited.
    pub(crate) steady: f64,
}

/// Resamplings of the bootstrap.
const RESAMPLED: usize = 400;
/// Largest gain that one block counts with, in log-likelihood.
const WITNESS: f64 = 10.0;
/// Standard errors that stand for a gain without any spread.
const SUREST: f64 = 100.0;
/// Neighbouring segments that are taken together.
const TOGETHER: usize = 3;

/// Sum of gains with a block-bootstrap interval of 95 %.
pub(crate) fn bootstrap(gains: &[f64]) -> Gain {
    let blocks: Vec<f64> = gains.chunks(TOGETHER).map(|c| c.iter().sum()).collect();
    let n = blocks.len();
    let sum: f64 = blocks.iter().sum();
    let mut random = Random::new(0x9E37_79B9_7F4A_7C15);
    let mut sums: Vec<f64> = (0..RESAMPLED).map(|_| (0..n).map(|_| blocks[random.below(n)]).sum()).collect();
    sums.sort_by(f64::total_cmp);
    let over_error = |x: &[f64]| {
        let mean = x.iter().sum::<f64>() / n as f64;
        let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n.max(2) - 1) as f64;
        let error = (variance / n as f64).sqrt();
        // Every stretch at the limit is as sure as it gets.
        if error > 0.0 { mean / error } else { SUREST * mean.signum() * f64::from(mean != 0.0) }
    };
    let z = over_error(&blocks);
    // One stretch with a huge gain is one witness: each counts up to a limit.
    let limited: Vec<f64> = blocks.iter().map(|x| x.clamp(-WITNESS, WITNESS)).collect();
    let steady = over_error(&limited);
    Gain { sum, low: sums[RESAMPLED * 25 / 1000], high: sums[RESAMPLED * 975 / 1000], z, steady }
}

/// Held-out gain of one model over another under the same noise.
pub(crate) fn compare(with: &[Laid], without: &[Laid]) -> Gain {
    let gains: Vec<f64> = with
        .iter()
        .zip(without)
        .flat_map(|(a, b)| a.costs.iter().zip(&b.costs).map(|(a, b)| b - a))
        .collect();
    bootstrap(&gains)
}
