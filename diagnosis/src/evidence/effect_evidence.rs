//! The evidence for each effect of a fitted model, on left-out blocks of the fitted recordings and
//! on held-out ones. Nothing here says what is enough to be named.

use crate::evidence::holdout_likelihood::{self, HoldoutFit, evaluate_all};
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::parameters;
use crate::evidence::residuals::{above, forces, relative_gain};
use crate::evidence::sizes::{played, sizes_on};
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::force_residual::Estimator;
use crate::fit::input::Total;
use crate::fit::linear_fit::{Fit, Prepared};
use crate::fit::model::Model;
use crate::fit::nominal::Key;
use crate::laws::{Effect, EffectName};
use crate::propose::candidates;
use crate::propose::comb;
use crate::propose::context::{FitContext, FittedModel};
use crate::propose::predictive::{left_out_costs, left_out_residuals, score_z};
use numerics::bootstrap::{Gain, bootstrap};

/// Least part of a refit's mean square that counts as above the noise: the noise itself is not
/// known exactly.
const LEAST_EXPLAINABLE: f64 = 0.2;

/// An effect as it came through the search, before it is judged.
#[derive(Clone)]
pub(crate) struct EffectEvidence {
    pub(crate) effect: Effect,
    /// The others fitted instead; empty before they are.
    pub(crate) rivals: Vec<Rival>,
    /// Held-out gain of the full model over the model without it.
    pub(crate) holdout: Gain,
    /// The same on blocks of the fitted recordings that were left out of its fit.
    pub(crate) fit: Gain,
    /// The reduction of the force residual on held-out recordings, over the square of the remaining
    /// one.
    pub(crate) force: Gain,
    /// Standard errors of its gain under heavy-tailed noise by block, on left-out blocks of the
    /// fitted or on held-out recordings, whichever are fewer; zero where it may be named without
    /// it.
    pub(crate) score_z: f64,
    /// Part of the refit's residual above the sensor's noise that it explains, on fitted or on
    /// held-out recordings.
    pub(crate) share: f64,
    /// Part of the held-out force error, root mean square, that it takes off.
    pub(crate) off_force: f64,
    /// True if one of its values is at a bound.
    pub(crate) at_bound: bool,
    /// True if its waves, if it has any, are those of teeth or poles.
    pub(crate) is_comb: bool,
    /// Size that it would have on each recording that plays it, over the size that it has on all,
    /// fitted ones first; none where no fitted or no held-out one does.
    pub(crate) sizes: Vec<f64>,
}

/// A rival and how far it is behind.
#[derive(Clone, Debug)]
pub(crate) struct Rival {
    pub(crate) name: EffectName,
    /// The effect with the shape that fits best.
    pub(crate) effect: Effect,
    /// Mean lead of the winner over its standard error, over all segments.
    pub(crate) z: f64,
    /// The same over the left-out stretches of the fitted recordings alone.
    pub(crate) fit_z: f64,
    /// Lead of the winner in log-likelihood, and how much of it is on held-out recordings.
    pub(crate) lead: f64,
    pub(crate) held_out_lead: f64,
    /// True if its size may be zero, where it is near.
    pub(crate) is_absent: bool,
}

/// Gathers the evidence for each effect of a model fitted under white noise. Where `asks_for_score`
/// says so of the rest of the evidence, the score is taken under `slow`.
pub(crate) fn gather_evidence(
    context: &FitContext,
    last: &FittedModel,
    slow: &Noise,
    holdout: &HoldoutSet,
    asks_for_score: impl Fn(&EffectEvidence) -> bool,
) -> Vec<EffectEvidence> {
    let judging = holdout.judging(&last.model, context.span);
    let shown = holdout.shown(&last.model, context.span);
    let judged = JudgedModel::new(context, last, &judging, &shown);
    (0..last.model.effects.len()).map(|i| judged.evidence(i, slow, &asks_for_score)).collect()
}

/// A model with what it leaves, to be compared with the model without one of its effects.
struct JudgedModel<'a> {
    context: &'a FitContext<'a>,
    last: &'a FittedModel,
    /// Held-out recordings in the motion that judges, and in the motion from which force errors
    /// come.
    judging: &'a [BlockedRecording],
    shown: &'a [BlockedRecording],
    estimator: Estimator,
    /// The model on the held-out recordings, and its cost on left-out blocks of the fitted ones.
    on_holdout: Vec<HoldoutFit>,
    on_fit: Vec<f64>,
    left: LeftForce,
    /// Mean square of the force that the null leaves beyond the noise, on fitted and on held-out
    /// recordings.
    explainable: [f64; 2],
}

/// Force that a model leaves, per recording and block.
struct LeftForce {
    fitted: Vec<Vec<f64>>,
    held_out: Vec<Vec<f64>>,
}

impl<'a> JudgedModel<'a> {
    fn new(
        context: &'a FitContext,
        last: &'a FittedModel,
        judging: &'a [BlockedRecording],
        shown: &'a [BlockedRecording],
    ) -> Self {
        let null = Fit::new(&Model::default(), context.nominal, context.tracks, &last.noise);
        let null = FittedModel { model: Model::default(), noise: last.noise, fit: null, log_score: 0.0 };
        let estimator = Estimator::new(context.tracks, &last.noise, context.scale);
        let force_left = |model: &FittedModel| left_force(context, &estimator, shown, model, &last.noise);
        let inertia = parameters::scale(context.nominal, last).0;
        let count = 1.0 / context.nominal.rig.encoder.counts_per_unit;
        let explainable = |left: &[Vec<f64>], tracks: &[BlockedRecording]| {
            let floor = estimator.counting(tracks, &last.noise, count) * inertia;
            above(estimator.rms(left, tracks), floor, LEAST_EXPLAINABLE).max(1e-300)
        };
        let by_null = force_left(&null);
        Self {
            context,
            last,
            judging,
            shown,
            on_holdout: evaluate_all(last, context.nominal, judging, &last.noise),
            on_fit: left_out_costs(&last.fit),
            left: force_left(last),
            explainable: [
                explainable(&by_null.fitted, context.tracks),
                explainable(&by_null.held_out, shown),
            ],
            estimator,
        }
    }

    /// Gathers the evidence for effect `i`; the score is taken under `slow` if it is asked for.
    fn evidence(
        &self,
        i: usize,
        slow: &Noise,
        asks_for_score: impl Fn(&EffectEvidence) -> bool,
    ) -> EffectEvidence {
        let Self { context, last, judging, shown, estimator, left, .. } = self;
        let mut less = last.model.clone();
        let effect = less.effects.remove(i);
        let fit = Fit::new(&less, context.nominal, context.tracks, &last.noise);
        let without = FittedModel { model: less, noise: last.noise, fit, log_score: 0.0 };
        let without_fit = left_out_costs(&without.fit);
        let gains: Vec<f64> = without_fit.iter().zip(&self.on_fit).map(|(a, b)| a - b).collect();
        let evaluated = evaluate_all(&without, context.nominal, judging, &last.noise);
        let less = left_force(context, estimator, shown, &without, &last.noise);
        let sizes = played(
            sizes_on(estimator, context.tracks, &left.fitted, &less.fitted),
            sizes_on(estimator, shown, &left.held_out, &less.held_out),
        );
        let mut found = EffectEvidence {
            score_z: 0.0,
            rivals: Vec::new(),
            holdout: holdout_likelihood::compare(&self.on_holdout, &evaluated),
            fit: bootstrap(&gains),
            force: relative_gain(estimator, shown, &less.held_out, &left.held_out),
            share: self.share(&effect, &less),
            off_force: self.off_force(&less),
            at_bound: self.is_at_bound(&effect, i),
            is_comb: comb::is_comb(&effect, &last.fit.amplitudes(i)),
            sizes,
            effect,
        };
        if asks_for_score(&found) {
            found.score_z = score_z_of(context, &last.model, &without.model, slow, judging);
        }
        found
    }

    /// Part of what the noise leaves that the model explains and one that leaves `less` does not.
    /// What one recording hardly shows another may be made for. Where the axis moves one way, any
    /// other friction stands for most of a dry one, which then counts as a part of the force that
    /// it would leave.
    fn share(&self, effect: &Effect, less: &LeftForce) -> f64 {
        let square =
            |left: &[Vec<f64>], tracks: &[BlockedRecording]| self.estimator.rms(left, tracks).powi(2);
        let (tracks, shown) = (self.context.tracks, self.shown);
        let is_hidden = self.context.span.one_way && effect.name.definition().is_dry();
        let [fitted, held_out] = match is_hidden {
            true => [square(&less.fitted, tracks), square(&less.held_out, shown)].map(|x| x.max(1e-300)),
            false => self.explainable,
        };
        ((square(&less.held_out, shown) - square(&self.left.held_out, shown)) / held_out)
            .max((square(&less.fitted, tracks) - square(&self.left.fitted, tracks)) / fitted)
    }

    /// Part of the held-out force error, root mean square, that the model takes off and one that
    /// leaves `less` does not.
    fn off_force(&self, less: &LeftForce) -> f64 {
        let rms = |left: &LeftForce| self.estimator.rms(&left.held_out, self.shown);
        1.0 - rms(&self.left) / rms(less).max(1e-300)
    }

    /// True if a value of effect `i` is at a bound.
    fn is_at_bound(&self, effect: &Effect, i: usize) -> bool {
        let fit = &self.last.fit;
        let definition = effect.name.definition();
        let mut ends = fit.keys.iter().zip(&fit.solution.bound).filter(|(_, bound)| **bound);
        let is_bound = ends.any(|((key, _), _)| match key {
            Key::Term { effect, term } => *effect == i && definition.is_in_doubt_at_limit(*term),
            _ => false,
        });
        is_bound || candidates::is_at_end(effect, self.context.span)
    }
}

/// Force that a model leaves on the fitted and on held-out recordings.
fn left_force(
    context: &FitContext,
    estimator: &Estimator,
    holdout: &[BlockedRecording],
    model: &FittedModel,
    noise: &Noise,
) -> LeftForce {
    let inertia = parameters::scale(context.nominal, model).0;
    let forces_left =
        |tracks: &[BlockedRecording], totals: &[Total]| forces(estimator, tracks, totals, inertia);
    let evaluated = evaluate_all(model, context.nominal, holdout, noise);
    LeftForce {
        fitted: forces_left(context.tracks, &model.fit.totals(context.tracks)),
        held_out: forces_left(holdout, &evaluated.into_iter().map(|one| one.total).collect::<Vec<_>>()),
    }
}

/// Standard errors of what one model gains over another under one noise with heavy tails, on
/// left-out blocks of the fitted or on held-out recordings, whichever are fewer.
fn score_z_of(
    context: &FitContext,
    with: &Model,
    without: &Model,
    noise: &Noise,
    holdout: &[BlockedRecording],
) -> f64 {
    // The residual, and what the model pays, on fitted and on held-out recordings.
    let residuals_and_costs = |model: &Model| {
        let fit = Fit::new(model, context.nominal, context.tracks, noise);
        let fitted = FittedModel { model: model.clone(), noise: *noise, fit, log_score: 0.0 };
        let evaluated = evaluate_all(&fitted, context.nominal, holdout, noise);
        let on_holdout: Vec<f64> = evaluated.iter().flat_map(|one| one.residual.iter().copied()).collect();
        let paid: f64 = fitted.fit.prepared.iter().map(Prepared::surcharge).sum();
        let paid_on_holdout: f64 = evaluated.iter().map(|one| one.surcharge).sum();
        [(left_out_residuals(&fitted.fit), paid), (on_holdout, paid_on_holdout)]
    };
    let both = residuals_and_costs(with).into_iter().zip(residuals_and_costs(without));
    both.map(|((with, paid), (without, before))| score_z(&with, &without, paid - before))
        .fold(f64::INFINITY, f64::min)
}
