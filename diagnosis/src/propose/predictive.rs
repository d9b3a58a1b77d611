//! The prediction of blocks of the fitted recordings that were left out of the fit (K-fold
//! cross-validation).
//!
//! Noise and shapes stay as they were fitted to all blocks; every coefficient, each recording's
//! offset and phases among them, is fitted anew without the blocks that it is judged on. A model
//! with more freedom pays for it here by itself.

use crate::fit::linear_fit::{Fit, normal_of};
use numerics::linear::{Prior, bounded};

/// Parts that segments are dealt into.
pub(crate) const FOLDS: usize = 6;
/// Neighbouring segments that are left out together: a disturbance lasts, and its neighbours must
/// not give information on the block that is judged.
const SEGMENTS_LEFT_OUT: usize = 3;

/// The fold in which a segment of a recording is left out.
pub(crate) fn fold_of(recording: usize, segment: usize) -> usize {
    (segment / SEGMENTS_LEFT_OUT + recording) % FOLDS
}

/// The steps from the reference that fits without each fold take.
fn left_out_solutions(fit: &Fit) -> impl Iterator<Item = Vec<f64>> + '_ {
    let mut priors = vec![Prior::FREE; fit.keys.len()];
    for (one, places) in fit.prepared.iter().zip(&fit.places) {
        for (column, place) in one.columns.iter().zip(places) {
            let p = column.prior;
            priors[*place] = Prior { mean: 0.0, sd: p.sd, low: p.low - p.mean, high: p.high - p.mean };
        }
    }
    (0..FOLDS).map(move |fold| {
        let kept = |recording: usize, segment: usize| fold_of(recording, segment) != fold;
        let (m, b) = normal_of(&fit.prepared, &fit.places, fit.keys.len(), kept);
        bounded(&m, &b, &priors).x
    })
}

/// Cost of each segment of each recording, in log-likelihood, predicted by a fit to the other
/// folds.
pub(crate) fn left_out_costs(fit: &Fit) -> Vec<f64> {
    let mut costs: Vec<Vec<f64>> = fit.prepared.iter().map(|one| vec![0.0; one.segments.len()]).collect();
    for (fold, x) in left_out_solutions(fit).enumerate() {
        for (r, (one, places)) in fit.prepared.iter().zip(&fit.places).enumerate() {
            for (s, cost) in one.costs(places, &x).into_iter().enumerate() {
                if fold_of(r, s) == fold {
                    costs[r][s] = cost;
                }
            }
        }
    }
    costs.concat()
}

/// Whitened residuals of all blocks, each predicted by a fit to the other folds and none weighed
/// down.
pub(crate) fn left_out_residuals(fit: &Fit) -> Vec<f64> {
    let mut out = Vec::new();
    for (fold, x) in left_out_solutions(fit).enumerate() {
        for (r, (one, places)) in fit.prepared.iter().zip(&fit.places).enumerate() {
            for s in (0..one.segments.len()).filter(|s| fold_of(r, *s) == fold) {
                let (blocks, weight) = one.segment(s);
                out.extend(blocks.map(|j| one.residual_at(j, places, &x) / weight.sqrt()));
            }
        }
    }
    out
}

/// Degrees of freedom of the noise of a block: moments that nothing here models (a stop, an impact)
/// are far off, not impossible.
const DEGREES: f64 = 4.0;
/// Rounds in which the scale of that noise is found.
const ROUNDS: usize = 25;
/// Blocks that share a disturbance: the longest that the noise of the filter remembers, 0.1 s.
const REMEMBERED: usize = 40;

/// Gain of log-likelihood over standard errors, of whitened residuals `with` over those `without`,
/// block by block, under Student's t with the scale likeliest for `with`; `paid` is what the gain
/// costs besides, nats.
///
/// The error is that of the score, by stretches as long as a disturbance (Newey and West,
/// Econometrica 55, 1987): noise that a difference between the models meets makes it unsure, and
/// that the difference is large in few blocks does not.
pub(crate) fn score_z(with: &[f64], without: &[f64], paid: f64) -> f64 {
    let square = t_square(with);
    let cost = |e: f64| 0.5 * (DEGREES + 1.0) * (e * e / square / DEGREES).ln_1p();
    let gain = without.iter().zip(with).map(|(a, b)| cost(*a) - cost(*b)).sum::<f64>() - paid;
    let score = |with: f64, without: f64| {
        (DEGREES + 1.0) / (DEGREES + with * with / square) / square * with * (without - with)
    };
    let stretches = with.chunks(REMEMBERED).zip(without.chunks(REMEMBERED));
    let variance: f64 =
        stretches.map(|(a, b)| a.iter().zip(b).map(|(a, b)| score(*a, *b)).sum::<f64>().powi(2)).sum();
    gain / variance.sqrt().max(1e-9)
}

/// Square of the likeliest scale of Student's t.
fn t_square(residuals: &[f64]) -> f64 {
    let n = residuals.len().max(1) as f64;
    let mean = |of: &dyn Fn(f64) -> f64| residuals.iter().map(|e| of(e * e)).sum::<f64>() / n;
    let mut square = mean(&|e| e.min(9.0)).max(1e-12);
    for _ in 0..ROUNDS {
        square = mean(&|e| (DEGREES + 1.0) / (DEGREES + e / square) * e).max(1e-12);
    }
    square
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::fit::blocked_recording::BlockedRecording;
    use crate::fit::filter::Noise;
    use crate::fit::model::Model;
    use crate::fit::nominal::Nominal;
    use crate::laws::{Effect, EffectName};

    /// Gain of an effect on left-out blocks of a recording of nothing but noise and, where asked,
    /// drag.
    fn gain(drag: f64) -> f64 {
        let rig = Rig::of_values(0.01, 0.0, 0.0);
        let (h, rows) = (1e-3, 12_000);
        let mut random = numerics::bootstrap::Random::new(5);
        let (mut x, mut v) = (0.0, 0.0);
        let mut recording = Recording::default();
        for i in 0..rows {
            let t = h * f64::from(i);
            let u = (1.3 * t).sin() + 0.6 * (4.1 * t).sin();
            recording.time_s.push(t);
            recording.command.push(u);
            recording.position_counts.push((1000.0_f64 * x).floor());
            let push = (random.below(2001) as f64 / 1000.0 - 1.0) * 2.0;
            let a: f64 = 10.0 * u - drag * v * f64::abs(v) + push;
            x += v * h + 0.5 * a * h * h;
            v += a * h;
        }
        let mut track = BlockedRecording::new(&recording, &rig);
        let v: Vec<f64> = (0..track.block_count())
            .map(|j| {
                let (a, b) = (j.saturating_sub(3), (j + 3).min(track.block_count() - 1));
                (track.blocks.z[b] - track.blocks.z[a]) / (track.blocks.start[b] - track.blocks.start[a])
            })
            .collect();
        track.motion.v = v;
        let tracks = [track];
        let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
        let noise = Noise { sensor: 1.0, white: 2e-3, slow: 1e-9, tau: 0.1, rest: 1.0, blur: 0.0 };
        let cost = |effects: Vec<Effect>| -> f64 {
            let model = Model { effects, ..Model::default() };
            left_out_costs(&Fit::new(&model, &nominal, &tracks, &noise)).iter().sum()
        };
        cost(Vec::new()) - cost(vec![Effect::shaped(EffectName::QuadraticDrag, &[])])
    }

    #[test]
    fn a_strong_rare_gain_is_sure_and_one_within_noise_is_not() {
        let mut random = numerics::bootstrap::Random::new(3);
        let mut noise = || (0..12).map(|_| random.below(1001) as f64 / 1000.0).sum::<f64>() - 6.0;
        let quiet: Vec<f64> = (0..6000).map(|_| noise()).collect();
        let plus = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
            quiet.iter().enumerate().map(|(j, e)| e + of(j)).collect()
        };
        // Ten times the noise in three stretches of ten blocks.
        let rare = |j: usize| if j % 2000 < 10 { 10.0 } else { 0.0 };
        assert!(score_z(&quiet, &plus(&rare), 0.0) > 6.0);
        // Half of what is there, in the same blocks: the residual is not noise.
        assert!(score_z(&plus(&|j| 0.5 * rare(j)), &plus(&rare), 0.0) < 3.0);
        // A difference that has nothing to do with what is there.
        assert!(score_z(&plus(&|j| 0.2 * (j as f64).sin()), &quiet, 0.0) < 0.0);
        let few = score_z(&quiet, &plus(&|j| 0.1 * (0.3 * j as f64).sin()), 30.0);
        assert!(few < 3.0, "what is paid for is no gain: {few}");
    }

    #[test]
    fn only_a_present_effect_predicts_blocks_that_were_left_out() {
        assert!(gain(0.3) > 50.0, "{}", gain(0.3));
        assert!(gain(0.0) < 3.0, "{}", gain(0.0));
    }
}
