//! Held-out recordings judge: coefficients stay as fitted, and only a recording's own values may
//! change (its offset, and the encoder's zero, on which the phase of periodic effects rests). For
//! likelihoods these values are found on other stretches of the recording than those it judges, as
//! on fitted recordings, so that no freedom on held-out rows speaks for an effect.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::input::Total;
use crate::fit::linear_fit::{Fit, Prepared};
use crate::fit::model::{Model, total};
use crate::fit::nominal::{Key, Nominal};
use crate::propose::context::FittedModel;
use crate::propose::predictive::{FOLDS, fold_of};
use crate::propose::two_mass;
use numerics::bootstrap::{Gain, bootstrap};
use numerics::linear::Square;
use numerics::parallel;

/// A model laid on one held-out recording.
pub(crate) struct HoldoutFit {
    /// The input of the model, with the recording's own values found on all of it.
    pub(crate) total: Total,
    /// Acceleration by the force that is there all the time, found on all of the recording.
    pub(crate) bias: f64,
    /// Cost of each segment with the own values of the others, in log-likelihood.
    pub(crate) costs: Vec<f64>,
    /// Whitened residual of each block of the segments that the model knows something of, with the
    /// own values of the others.
    pub(crate) residual: Vec<f64>,
    /// The price of the jumps found in this recording itself, in log-likelihood.
    pub(crate) surcharge: f64,
}

/// Pattern of an effect with its own phase: per wave (frequency, cosine, sine), with the
/// recordings' phases undone.
fn pattern(fit: &Fit, model: &Model, effect: usize) -> Vec<(f64, f64, f64)> {
    let waves: Vec<f64> = waves_of(model, effect);
    let mut sum = own_pattern(fit, &waves, effect, 0);
    let commensurate = model.effects[effect].turn().is_some();
    for r in 1..fit.prepared.len() {
        let other = own_pattern(fit, &waves, effect, r);
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

/// The same with the phases that one recording has.
fn own_pattern(fit: &Fit, waves: &[f64], effect: usize, recording: usize) -> Vec<(f64, f64, f64)> {
    let theta = fit.theta(recording);
    let columns = fit.prepared[recording].columns.iter().zip(&theta);
    let terms: Vec<f64> = columns
        .filter(|(c, _)| matches!(c.key, Key::Term { effect: e, .. } if e == effect))
        .map(|(_, theta)| *theta)
        .collect();
    waves.iter().zip(terms.chunks_exact(2)).map(|(w, t)| (*w, t[0], t[1])).collect()
}

pub(crate) fn waves_of(model: &Model, effect: usize) -> Vec<f64> {
    let effect = &model.effects[effect];
    let waves: Vec<f64> = effect.waves().into_iter().map(|(_, w)| w).collect();
    if waves.is_empty() {
        vec![std::f64::consts::TAU / effect.turn().unwrap_or(std::f64::consts::TAU)]
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

/// The shift within one period with the largest value: a grid finer than the highest wave, then
/// golden section.
fn best_shift(period: f64, highest: f64, value: impl Fn(f64) -> f64) -> f64 {
    let cycles = (period * highest / std::f64::consts::TAU).max(1.0);
    let count = (8.0 * cycles).ceil().clamp(16.0, 4000.0) as usize;
    let grid_shift = |i: usize| period * i as f64 / count as f64;
    let mut best = (0, f64::NEG_INFINITY);
    for i in 0..count {
        let v = value(grid_shift(i));
        if v > best.1 {
            best = (i, v);
        }
    }
    let width = period / count as f64;
    numerics::golden_section::golden(grid_shift(best.0) - width, grid_shift(best.0) + width, 12, value)
}

/// Lays a fitted model on a held-out recording under a noise.
pub(crate) fn evaluate(
    candidate: &FittedModel,
    nominal: &Nominal,
    track: &BlockedRecording,
    noise: &Noise,
) -> HoldoutFit {
    let mut evaluated = evaluate_once(candidate, nominal, track, noise);
    if candidate.model.effects.iter().any(two_mass::is_joint) {
        // The law of a joint takes up the force that is there all the time, which evaluating it
        // finds.
        let mut own = track.clone();
        for _ in 0..BIASES {
            own.bias = evaluated.bias;
            evaluated = evaluate_once(candidate, nominal, &own, noise);
        }
    }
    evaluated
}

/// Lays a model on every held-out recording.
pub(crate) fn evaluate_all(
    c: &FittedModel,
    nominal: &Nominal,
    tracks: &[BlockedRecording],
    noise: &Noise,
) -> Vec<HoldoutFit> {
    tracks.iter().map(|track| evaluate(c, nominal, track, noise)).collect()
}

/// The number of times that the constant force is estimated again.
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
    let mut fitted = one.reference.clone();
    for (theta, column) in fitted.iter_mut().zip(&one.columns).filter(|(_, column)| !column.own) {
        if let Some(value) = fit.value(column.key) {
            *theta = value;
        }
    }
    let patterns: Vec<Option<Pattern>> =
        (0..model.effects.len()).map(|effect| Pattern::new(fit, model, effect, &one)).collect();
    let known: Vec<bool> = track.known_segments().collect();
    let own = |is_used: &dyn Fn(usize) -> bool| {
        let sums = LikelihoodSums::new(&one, |segment| known[segment] && is_used(segment));
        sums.own_values(fitted.clone(), &one, &patterns)
    };
    let whole = own(&|_| true);
    let by_fold = parallel::map(FOLDS, |fold| own(&|segment| fold_of(0, segment) != fold));
    let step_of = |theta: &Vec<f64>| -> Vec<f64> {
        theta.iter().zip(&one.reference).map(|(value, reference)| value - reference).collect()
    };
    let steps: Vec<Vec<f64>> = by_fold.iter().map(step_of).collect();
    let places: Vec<usize> = (0..p).collect();
    let costs_by_fold: Vec<Vec<f64>> = steps.iter().map(|step| one.costs(&places, step)).collect();
    let (mut costs, mut residual) = (vec![0.0; known.len()], Vec::new());
    for segment in (0..known.len()).filter(|segment| known[*segment]) {
        let fold = fold_of(0, segment);
        costs[segment] = costs_by_fold[fold][segment];
        residual.extend(one.segment(segment).0.map(|j| one.residual_at(j, &places, &steps[fold])));
    }
    let offset = one.columns.iter().position(|c| c.key == Key::Offset);
    HoldoutFit {
        total: total(track, &one.columns, &whole),
        bias: offset.map_or(0.0, |offset| whole[offset]),
        costs,
        residual,
        surcharge: one.surcharge(),
    }
}

/// An effect of which each recording has its own phase: its waves, their columns, and what the
/// fitted recordings say of it.
struct Pattern {
    shape: Vec<(f64, f64, f64)>,
    /// Waves that share a shift, with the columns of their cosines and sines, the shift's period
    /// and their highest wave.
    groups: Vec<(Vec<usize>, Vec<usize>, f64, f64)>,
}

impl Pattern {
    fn new(fit: &Fit, model: &Model, effect: usize, one: &Prepared) -> Option<Self> {
        let places: Vec<usize> = (0..one.columns.len())
            .filter(|i| matches!(one.columns[*i].key, Key::Term { effect: e, .. } if e == effect))
            .collect();
        let which = &model.effects[effect];
        if !which.name.definition().has_own_phase() || places.is_empty() {
            return None;
        }
        let waves = waves_of(model, effect);
        let of_group = |group: Vec<usize>| {
            let reach = group.iter().map(|i| std::f64::consts::TAU / waves[*i]).fold(0.0, f64::max);
            let columns = group.iter().flat_map(|i| [places[2 * i], places[2 * i + 1]]).collect();
            let most = highest(&waves, &group);
            (group, columns, reach, most)
        };
        let groups = groups(waves.len(), which.turn().is_some()).into_iter().map(of_group);
        Some(Self { shape: pattern(fit, model, effect), groups: groups.collect() })
    }
}

/// Normal equations of some segments of a held-out recording, about the reference.
struct LikelihoodSums {
    m: Square,
    b: Vec<f64>,
}

impl LikelihoodSums {
    fn new(one: &Prepared, is_used: impl Fn(usize) -> bool) -> Self {
        let p = one.columns.len();
        let (mut m, mut b) = (Square::zero(p), vec![0.0; p]);
        for (_, segment) in one.segments.iter().enumerate().filter(|(s, _)| is_used(*s)) {
            for i in 0..p {
                b[i] += segment.at(i, p);
                for j in 0..p {
                    m.add(i, j, segment.at(i, j));
                }
            }
        }
        Self { m, b }
    }

    /// Returns the part of the score of column `i` that the others leave at `theta`.
    fn pull(&self, i: usize, theta: &[f64], one: &Prepared, is_other: impl Fn(usize) -> bool) -> f64 {
        let others = (0..theta.len()).filter(|j| is_other(*j));
        self.b[i] - others.map(|j| self.m.at(i, j) * (theta[j] - one.reference[j])).sum::<f64>()
    }

    /// `theta` with what is the recording's own, its offset and the phases of its patterns, found
    /// on these segments.
    fn own_values(&self, mut theta: Vec<f64>, one: &Prepared, patterns: &[Option<Pattern>]) -> Vec<f64> {
        let offset = one.columns.iter().position(|c| c.key == Key::Offset);
        // Twice round, because offset and phases lean on each other.
        for _ in 0..2 {
            if let Some(o) = offset {
                let prior = one.columns[o].prior;
                let weight = if prior.sd.is_finite() { prior.sd.powi(-2) } else { 0.0 };
                let information = self.m.at(o, o) + weight;
                if information > 0.0 {
                    theta[o] = one.reference[o] + self.pull(o, &theta, one, |j| j != o) / information;
                }
            }
            for Pattern { shape, groups } in patterns.iter().flatten() {
                for (group, columns, reach, most) in groups {
                    let pull: Vec<f64> = columns
                        .iter()
                        .map(|i| self.pull(*i, &theta, one, |j| !columns.contains(&j)))
                        .collect();
                    let amplitudes = |shift: f64| -> Vec<f64> {
                        let wave = |i: &usize| {
                            let (_, c, s) = turned(shape[*i], shift);
                            [c, s]
                        };
                        group.iter().flat_map(wave).collect()
                    };
                    let gain = |shift: f64| {
                        let x = amplitudes(shift);
                        let row = |i: usize| -> f64 {
                            columns.iter().zip(&x).map(|(j, x)| self.m.at(i, *j) * x).sum()
                        };
                        let terms = columns.iter().zip(&x).zip(&pull);
                        terms.map(|((i, x), pull)| x * (pull - 0.5 * row(*i))).sum()
                    };
                    let shift = best_shift(*reach, *most, gain);
                    for (i, x) in columns.iter().zip(amplitudes(shift)) {
                        theta[*i] = x;
                    }
                }
            }
        }
        theta
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;

    #[test]
    fn a_held_out_stretch_has_the_offset_of_the_others() {
        // Pushed on for the 0.6 s that are left out together, and gliding from then on.
        let moved = |t: f64| 5000.0 * (t + if t < 0.6 { t * t } else { 1.2 * t - 0.36 });
        let time_s: Vec<f64> = (0..5000).map(|row| f64::from(row) * 1e-3).collect();
        let recording = Recording {
            command: vec![0.0; time_s.len()],
            position_counts: time_s.iter().map(|t| moved(*t).floor()).collect(),
            time_s,
            ..Recording::default()
        };
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let track = BlockedRecording::new(&recording, &rig);
        let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
        let noise = Noise { sensor: 1.0, white: 1e-3, slow: 100.0, tau: 0.01, rest: 1.0, blur: 0.0 };
        let model = Model::default();
        let fit = Fit::new(&model, &nominal, std::slice::from_ref(&track), &noise);
        let fitted = FittedModel { model, noise, fit, log_score: 0.0 };
        let evaluated = evaluate(&fitted, &nominal, &track, &noise);
        let of_fold = |fold: usize| {
            (0..track.segment_count()).find(|s| fold_of(0, *s) == fold).expect("it is long enough")
        };
        let one = Prepared::new(&fitted.model, &nominal, &track, &noise);
        let offset = one.columns.iter().position(|c| c.key == Key::Offset).expect("every model has one");
        let places: Vec<usize> = (0..one.columns.len()).collect();
        let cost_at = |value: f64| {
            let mut step = vec![0.0; places.len()];
            step[offset] = value - one.reference[offset];
            one.costs(&places, &step)[of_fold(0)]
        };
        let (without, with_own) = (cost_at(0.0), cost_at(evaluated.bias));
        let of_itself = without - with_own;
        assert!(of_itself > 1.0, "the offset of all of it would explain the push: {without}, {with_own}");
        let left_out = evaluated.costs[of_fold(0)];
        assert!(left_out > without - 0.1 * of_itself, "it tells of itself: {left_out} of {without}");
    }
}
