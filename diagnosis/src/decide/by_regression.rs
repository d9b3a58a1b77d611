//! The third stage: what the regression names, fitted by the filter. No likelihood rejects it.

use crate::decide::acceptance_criteria::gather_evidence;
use crate::decide::elimination::{Found, SurvivingModel};
use crate::decide::material::{self, SelectedByShare};
use crate::decide::thresholds::MOST_IN_CLASS;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::known_travel::known;
use crate::evidence::prepared::Prepared;
use crate::evidence::residuals::residuals;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::laws::definition::NominalTerm;
use crate::laws::{Effect, EffectName};
use crate::propose::context::{FitContext, FittedModel};
use crate::propose::two_mass::in_its_own_motion;
use regression::Hypothesis;

/// The recordings with the effects that the regression names; none where it names nothing that the
/// filter can see.
pub(crate) fn by_regression(prepared: &Prepared, found: &Found, rounds: &[Vec<Hypothesis>]) -> Option<Found> {
    let context = prepared.context(&prepared.fit);
    let mut model = context.fit(Model::default(), &prepared.noise, Colour::White);
    if prepared.nominal.one_way {
        // Where an axis moves one way its dry friction is the offset that the regression gives each
        // recording, and never among its laws.
        let is_dry = |name: &&EffectName| name.definition().nominal_term() == Some(NominalTerm::Coulomb);
        let dry = EffectName::ALL.iter().find(is_dry);
        model = dry.and_then(|name| with_effect(&context, &model, *name)).unwrap_or(model);
    }
    let shown = prepared.limits(&found.fit);
    let mut materials = Vec::new();
    for mut material in material::named(rounds) {
        // The regression may not tell its name from one that the filter can fit.
        let fitted = material.class.iter().find_map(|name| with_effect(&context, &model, *name));
        let Some(fitted) = fitted else { continue };
        model = fitted;
        let effect = model.model.effects.last().expect("one was added");
        material.name = effect.name;
        let twins = effect.twins(&shown);
        material.class = class_of(material.name, twins, material.class);
        materials.push(material);
    }
    (!materials.is_empty()).then(|| standing(prepared, found, context.with_shapes_in_band(model), materials))
}

/// A model with one more effect, in the shape that fits best; none where the filter cannot see it.
fn with_effect(context: &FitContext, now: &FittedModel, name: EffectName) -> Option<FittedModel> {
    let best: Vec<(Effect, f64)> = context.screen(now, &|other| other == name).into_iter().take(1).collect();
    let mut finalists = context.finalists(now, &best);
    context.polish(&mut finalists);
    finalists.into_iter().next()
}

/// A class that begins with a name of it, followed by the effects that no such recordings
/// distinguish from that name.
fn class_of(name: EffectName, twins: Vec<EffectName>, near: Vec<EffectName>) -> Vec<EffectName> {
    let mut class = vec![name];
    for other in near.into_iter().chain(twins) {
        if class.len() < MOST_IN_CLASS && !class.contains(&other) {
            class.push(other);
        }
    }
    class
}

/// The found recordings with another model.
fn standing(
    prepared: &Prepared,
    found: &Found,
    first: FittedModel,
    materials: Vec<SelectedByShare>,
) -> Found {
    let context = prepared.context(&prepared.fit);
    let (fit, white) = in_its_own_motion(&prepared.fit, first, &context);
    let own = prepared.context(&fit);
    let mut holdout = prepared.holdout.clone();
    holdout.follow(&white, &prepared.nominal, &prepared.span, prepared.scale);
    let model = own.fit_in_band(white);
    let null = own.fit_at(Model::default(), &model.noise);
    let mut evidence = gather_evidence(&own, &model, &model.noise, &holdout);
    for (i, one) in evidence.iter_mut().enumerate() {
        one.off_force = off_force(&own, &model, i, &holdout);
    }
    let rejected = found.standing.rejected.clone();
    Found { fit, holdout, null, standing: SurvivingModel { model, effects: evidence, rejected, materials } }
}

/// The part that an effect takes off the held-out force error, beside a model without it that is
/// fitted to the force in the band as well.
fn off_force(context: &FitContext, model: &FittedModel, effect: usize, holdout: &HoldoutSet) -> f64 {
    let mut less = model.model.clone();
    less.effects.remove(effect);
    let less = context.fit_in_band(context.fit(less, &model.noise, Colour::White));
    let estimator = Estimator::new(context.tracks, &model.noise, context.scale);
    let known: &[BlockedRecording] = &known(&holdout.smoothed, &model.model, context.span);
    let left = residuals(context.nominal, &estimator, known, true, &less, model);
    1.0 - estimator.rms(&left.patched, known) / estimator.rms(&left.refit, known).max(1e-300)
}
