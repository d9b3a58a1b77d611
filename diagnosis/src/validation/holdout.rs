//! Held-out recordings judge: coefficients stand as fitted, only what is each recording's own may move (its offset, and
//! the place along the travel at which it started).

use crate::estimation::blocked_recording::{BlockedRecording, Total};
use crate::estimation::filter::Noise;
use crate::estimation::fit::{Fit, Prepared};
use crate::estimation::model::{Key, Model, Nominal, total};
use crate::numerics::bootstrap::{Gain, bootstrap};
use crate::numerics::linear::Square;
use crate::selection::joint;
use crate::selection::search::FittedModel;

/// A model laid on one held-out recording.
pub(crate) struct HoldoutFit {
    pub(crate) total: Total,
    /// Acceleration by the force that is there all the time.
    pub(crate) bias: f64,
    /// Cost of each segment, in log-likelihood.
    pub(crate) costs: Vec<f64>,
    /// Whitened residual of each block of the segments that the model knows something of.
    pub(crate) residual: Vec<f64>,
    /// What the model pays for jumps found in this very recording, in log-likelihood.
    pub(crate) surcharge: f64,
}

impl HoldoutFit {
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
    crate::numerics::golden::golden(at(best.0) - width, at(best.0) + width, 12, value)
}

/// Lays a fitted model on a held-out recording under a noise.
pub(crate) fn evaluate(
    candidate: &FittedModel,
    nominal: &Nominal,
    track: &BlockedRecording,
    noise: &Noise,
) -> HoldoutFit {
    let mut best = evaluate_once(candidate, nominal, track, noise);
    if !candidate.model.effects.iter().any(joint::is_joint) {
        return best;
    }
    // The law of a joint takes up the force that is there all the time, which laying it finds.
    let mut own = track.clone();
    let mut bias = best.bias;
    for _ in 0..BIASES {
        own.bias = bias;
        let evaluated = evaluate_once(candidate, nominal, &own, noise);
        bias = evaluated.bias;
        if evaluated.cost() < best.cost() {
            best = HoldoutFit { bias: own.bias, ..evaluated };
        }
    }
    best
}

/// How often the force that is there all the time is found anew.
const BIASES: usize = 2;

fn evaluate_once(
    candidate: &FittedModel,
    nominal: &Nominal,
    track: &BlockedRecording,
    noise: &Noise,
) -> HoldoutFit {
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
            if !name.definition().has_own_phase() || places.is_empty() {
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
        .costs(&places, &step)
        .into_iter()
        .zip(track.known_segments())
        .map(|(cost, is_known)| if is_known { cost } else { 0.0 })
        .collect();
    let bias = offset.map_or(0.0, |o| theta[o]);
    let known = track.segments.windows(2).zip(track.known_segments()).filter(|(_, is_known)| *is_known);
    let residual =
        known.flat_map(|(w, _)| (w[0]..w[1]).map(|j| one.residual_at(j, &places, &step))).collect();
    let surcharge = one.surcharge();
    HoldoutFit { total: total(track, &one.columns, &theta), bias, costs, residual, surcharge }
}

/// Held-out gain of one model over another under the same noise.
pub(crate) fn compare(with: &[HoldoutFit], without: &[HoldoutFit]) -> Gain {
    let gains: Vec<f64> = with
        .iter()
        .zip(without)
        .flat_map(|(a, b)| a.costs.iter().zip(&b.costs).map(|(a, b)| b - a))
        .collect();
    bootstrap(&gains)
}
