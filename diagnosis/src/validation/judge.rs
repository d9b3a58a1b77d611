//! What speaks for each effect of a fitted model, on left-out blocks of the fitted recordings and on held-out ones. Nothing here
//! says what is enough to be named.

use crate::effects::EffectName;
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::filter::Noise;
use crate::estimation::fit::{Fit, Prepared};
use crate::estimation::force_residual::Estimator;
use crate::estimation::input::Total;
use crate::estimation::model::{Key, Model};
use crate::numerics::bootstrap::bootstrap;
use crate::selection::candidates;
use crate::selection::context::{FitContext, FittedModel};
use crate::selection::periodic;
use crate::selection::predictive::{left_out_costs, left_out_residuals, score_z};
use crate::thresholds::DRIFT;
use crate::validation::evidence::EffectEvidence;
use crate::validation::held_out::HeldOut;
use crate::validation::holdout::{self, evaluate_all};
use crate::validation::parameters;
use crate::validation::residuals::{above, forces, relative_gain};
use crate::validation::sizes::{played, sizes_on};

/// Part of a refit's mean square that counts as above the noise at the least: how much of it the noise is, is itself unsure.
const LEAST_EXPLAINABLE: f64 = 0.2;

/// What speaks for each effect of a model fitted under white noise; its score is that under `slow`.
pub(crate) fn judge_all(
    context: &FitContext,
    last: &FittedModel,
    slow: &Noise,
    holdout: &HeldOut,
) -> Vec<EffectEvidence> {
    let judging: &[BlockedRecording] = &holdout.judging(&last.model, context.span);
    let holdout: &[BlockedRecording] = &holdout.shown(&last.model, context.span);
    let with = evaluate_all(last, context.nominal, judging, &last.noise);
    let with_fit = left_out_costs(&last.fit);
    let estimator = Estimator::new(context.tracks, &last.noise, context.scale);
    let left = |c: &FittedModel, tracks: &[BlockedRecording], totals: &[Total]| {
        forces(&estimator, tracks, totals, parameters::scale(context.nominal, c).0)
    };
    let left_on_fit = |c: &FittedModel| left(c, context.tracks, &c.fit.totals(context.tracks));
    let left_on_holdout = |c: &FittedModel| {
        let evaluated = evaluate_all(c, context.nominal, holdout, &last.noise);
        left(c, holdout, &evaluated.into_iter().map(|one| one.total).collect::<Vec<_>>())
    };
    let square = |left: &[Vec<f64>], tracks: &[BlockedRecording]| estimator.rms(left, tracks).powi(2);
    let null = Fit::new(&Model::default(), context.nominal, context.tracks, &last.noise);
    let null = FittedModel { model: Model::default(), noise: last.noise, fit: null, merit: 0.0 };
    let inertia = parameters::scale(context.nominal, last).0;
    let count = 1.0 / context.nominal.rig.encoder.counts_per_unit;
    let explainable = |left: &[Vec<f64>], tracks: &[BlockedRecording]| {
        let floor = estimator.counting(tracks, &last.noise, count) * inertia;
        above(estimator.rms(left, tracks), floor, LEAST_EXPLAINABLE).max(1e-300)
    };
    let held_out = explainable(&left_on_holdout(&null), holdout);
    let fitted = explainable(&left_on_fit(&null), context.tracks);
    let (left_held_out, left_fitted) = (left_on_holdout(last), left_on_fit(last));
    (0..last.model.effects.len())
        .map(|i| {
            let mut less = last.model.clone();
            let effect = less.effects.remove(i);
            let fit = Fit::new(&less, context.nominal, context.tracks, &last.noise);
            let without = FittedModel { model: less, noise: last.noise, fit, merit: 0.0 };
            let without_fit = left_out_costs(&without.fit);
            let gains: Vec<f64> = without_fit.iter().zip(&with_fit).map(|(a, b)| a - b).collect();
            let evaluated = evaluate_all(&without, context.nominal, judging, &last.noise);
            let holdout_gain = holdout::compare(&with, &evaluated);
            // What one recording hardly plays another may be made for.
            let (less_held_out, less_fitted) = (left_on_holdout(&without), left_on_fit(&without));
            let share = ((square(&less_held_out, holdout) - square(&left_held_out, holdout)) / held_out)
                .max((square(&less_fitted, context.tracks) - square(&left_fitted, context.tracks)) / fitted);
            let force = relative_gain(&estimator, holdout, &less_held_out, &left_held_out);
            let sizes = played(
                sizes_on(&estimator, context.tracks, &left_fitted, &less_fitted),
                sizes_on(&estimator, holdout, &left_held_out, &less_held_out),
            );
            let definition = effect.name.definition();
            let mut ends = last.fit.keys.iter().zip(&last.fit.solution.bound).filter(|(_, bound)| **bound);
            let is_bound = ends.any(|((key, _), _)| match key {
                Key::Term { effect, term } => *effect == i && definition.is_in_doubt_at_limit(*term),
                _ => false,
            });
            let at_bound = is_bound
                || candidates::is_at_end(&effect, context.span)
                || drifts_too_far(&last.fit, i, effect.name);
            let is_comb = periodic::is_comb(&effect, &last.fit.amplitudes(i));
            let mut found = EffectEvidence {
                effect,
                score_z: 0.0,
                rivals: Vec::new(),
                holdout: holdout_gain,
                fit: bootstrap(&gains),
                force,
                share,
                at_bound,
                is_comb,
                sizes,
            };
            if found.rejection().is_some() {
                found.score_z = score_z_of(context, &last.model, &without.model, slow, judging);
            }
            found
        })
        .collect()
}

/// Standard errors of what one model gains over another under one noise with heavy tails, on left-out blocks of the fitted or on
/// held-out recordings, whichever are fewer.
fn score_z_of(
    context: &FitContext,
    with: &Model,
    without: &Model,
    noise: &Noise,
    holdout: &[BlockedRecording],
) -> f64 {
    // What is left, and what the model pays, on fitted and on held-out recordings.
    let left = |model: &Model| {
        let fit = Fit::new(model, context.nominal, context.tracks, noise);
        let fitted = FittedModel { model: model.clone(), noise: *noise, fit, merit: 0.0 };
        let evaluated = evaluate_all(&fitted, context.nominal, holdout, noise);
        let on_holdout: Vec<f64> = evaluated.iter().flat_map(|one| one.residual.iter().copied()).collect();
        let paid: f64 = fitted.fit.prepared.iter().map(Prepared::surcharge).sum();
        let paid_on_holdout: f64 = evaluated.iter().map(|one| one.surcharge).sum();
        [(left_out_residuals(&fitted.fit), paid), (on_holdout, paid_on_holdout)]
    };
    let both = left(with).into_iter().zip(left(without));
    both.map(|((with, paid), (without, before))| score_z(&with, &without, paid - before))
        .fold(f64::INFINITY, f64::min)
}

/// Whether more of the dry friction goes or comes with time than warming explains.
fn drifts_too_far(fit: &Fit, effect: usize, name: EffectName) -> bool {
    let definition = name.definition();
    let drifts = definition.drifts() && definition.needs_dry();
    let dry = fit.value(Key::Coulomb).filter(|dry| drifts && *dry > 0.0);
    let change = fit.value(Key::Term { effect, term: 0 });
    dry.zip(change).is_some_and(|(dry, change)| !DRIFT.contains(&(change / dry)))
}
