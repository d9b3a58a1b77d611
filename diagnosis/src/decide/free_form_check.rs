//! The check of every name against forces of any form, which represent physics outside the library.

use crate::decide::acceptance_criteria::gather_evidence;
use crate::decide::against_forms::is_reportable;
use crate::decide::rejection::BetterExplanation;
use crate::decide::thresholds::FORM_OF_CONSTANT;
use crate::decide::weighed_model::WeighedModel;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::parameters;
use crate::fit::filter::Noise;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::laws::{Effect, Variable};
use crate::propose::context::{FitContext, FittedModel};
use crate::propose::free_form::{Evaluator, Shape, Taken};

/// The gain of a force of any form in addition to a model.
pub(crate) struct FreeFormShare {
    pub(crate) taken: Taken,
    /// Part of what model and form take of left-out blocks that the model takes, 0 to 1.
    pub(crate) share: f64,
}

fn share(of_model: f64, taken: &Taken) -> f64 {
    let beyond = taken.gain.sum.max(0.0);
    if of_model <= 0.0 { 0.0 } else { of_model / (of_model + beyond) }
}

/// Compares every effect that would be named with forces of any form; an effect is not named if one
/// of them explains the data without it. Gives the weighed model with the forms that replace its
/// effects, and the gain of a form in addition to all names, if there are any.
pub(crate) fn check(
    mut weighed: WeighedModel,
    context: &FitContext,
) -> (WeighedModel, Option<FreeFormShare>) {
    let named = weighed.named();
    if named.is_empty() {
        return (weighed, None);
    }
    let evaluator =
        Evaluator::new(context.nominal, context.tracks, &weighed.coloured_fit.noise, context.scale);
    let model = weighed.shown.patched.model.clone();
    let whole = evaluator.densities(&model);
    for i in named {
        if weighed.effects[i].material.is_some() {
            continue;
        }
        let mut less = model.clone();
        less.effects.remove(i);
        let definition = model.effects[i].name.definition();
        let standing = whole.standing(&evaluator.densities(&less), definition.depends_on());
        let enough = if definition.may_be_constant() { FORM_OF_CONSTANT } else { 0.0 };
        let least = enough * weighed.effects[i].found.holdout.sum;
        if let Some(against) = standing.against.filter(|against| against.most > least) {
            let (over, form) = (against.inputs, against.most);
            weighed.effects[i].rather =
                Some(BetterExplanation::FreeForm { over, form, effect: standing.own.sum });
        }
    }
    let taken = whole.taken().into_iter().next().filter(|_| !weighed.named().is_empty());
    let beside = taken.map(|taken| {
        let of_model = whole.alone.over(&evaluator.alone(&Model::default())).sum;
        FreeFormShare { share: share(of_model, &taken), taken }
    });
    (weighed, beside)
}

/// A force without a name where nothing is named.
pub(crate) struct Unnamed {
    pub(crate) taken: Taken,
    pub(crate) shape: Shape,
    /// Held-out gain of log-likelihood over the refit.
    pub(crate) holdout_gain: Option<f64>,
}

/// The force of any form that explains most of the residual of a refit, where that is sure and
/// enough to be reported; with the refit that includes the force, except where each recording has
/// its own place of it.
pub(crate) fn alone(
    context: &FitContext,
    refit: &FittedModel,
    holdout: &HoldoutSet,
    noise: &Noise,
) -> Option<(Unnamed, Option<FittedModel>)> {
    let evaluator = Evaluator::new(context.nominal, context.tracks, noise, context.scale);
    let all = evaluator.densities(&Model::default()).taken();
    let taken = all.into_iter().find(|taken| is_reportable(taken, context.tracks))?;
    let (inertia, _, _) = parameters::scale(context.nominal, refit);
    let shape = evaluator.shape(&Model::default(), taken.inputs, inertia)?;
    let over_angle = shape.table.over.contains(&Variable::Angle);
    let fitted = (!over_angle).then(|| {
        let effects = vec![Effect::tabled(shape.table.clone(), context.nominal.rig.turn())];
        context.fit(Model { effects, ..Model::default() }, &refit.noise, Colour::White)
    });
    let judged = fitted.as_ref().and_then(|fitted| gather_evidence(context, fitted, noise, holdout).pop());
    Some((Unnamed { taken, shape, holdout_gain: judged.map(|found| found.holdout.sum) }, fitted))
}
