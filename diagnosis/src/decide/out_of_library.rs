//! Physics that has no name in the library and looks like some that has: a spring that creeps, a
//! load that changes at once, an inertia that changes along the travel, a gear that loses a part of
//! what it carries. Nothing here is named; it only speaks against a name. Such forces are defined
//! with the laws that they are a form of, in `effects`.

use crate::decide::acceptance_criteria::gather_evidence;
use crate::decide::rejection::BetterExplanation;
use crate::decide::thresholds::{OUTSIDE_ALONE, OUTSIDE_PART};
use crate::evidence::holdout_set::HoldoutSet;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::laws::definition::Unnamed;
use crate::laws::{Effect, EffectName};
use crate::propose::context::{FitContext, FittedModel, PER_COEFFICIENT};
use numerics::parallel;

/// Physics without a name that may look like a fitted effect; all there is where nothing is fitted.
pub(crate) fn unnamed_like(fitted: Option<&Effect>, context: &FitContext) -> Vec<Unnamed> {
    EffectName::ALL.iter().flat_map(|name| name.definition().unnamed(*name, fitted, context.span)).collect()
}

/// Physics without a name that explains most of what a refit leaves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct UnnamedPhysics {
    /// A noun phrase that says what it is.
    pub(crate) what: String,
    /// The part that it explains, at most 1.
    pub(crate) share: f64,
}

/// Physics without a name that explains most of what a refit leaves where nothing is named, as
/// surely as a name must.
pub(crate) fn alone(
    context: &FitContext,
    refit: &FittedModel,
    holdout: &HoldoutSet,
) -> Option<UnnamedPhysics> {
    let all = unnamed_like(None, context);
    let model = |foreign: &Unnamed| Model { effects: vec![foreign.effect.clone()], ..Model::default() };
    let merit = |foreign: &Unnamed| {
        let fit = Fit::new(&model(foreign), context.nominal, context.tracks, &refit.noise);
        fit.log_likelihood - foreign.freedom * PER_COEFFICIENT
    };
    let merits = parallel::map_all(&all, merit);
    let (_, best) = merits.into_iter().zip(all).max_by(|a, b| a.0.total_cmp(&b.0))?;
    let fitted = context.fit(model(&best), &refit.noise, Colour::White);
    let found = gather_evidence(context, &fitted, &refit.noise, holdout).pop()?;
    let is_sure = found.rejection().is_none() && found.is_certain() && found.share > OUTSIDE_ALONE;
    is_sure.then_some(UnnamedPhysics { what: best.what, share: found.share.min(1.0) })
}

/// Returns the physics without a name that explains more, with certainty, than a fitted effect;
/// `gain` is the effect's own.
pub(crate) fn rather(
    context: &FitContext,
    fitted: &FittedModel,
    effect: usize,
    gain: f64,
) -> Option<BetterExplanation> {
    let lead = |foreign: &Unnamed| {
        let mut model = fitted.model.clone();
        model.effects[effect] = foreign.effect.clone();
        let fit = Fit::new(&model, context.nominal, context.tracks, &fitted.noise);
        let least = (OUTSIDE_PART * gain).max(foreign.freedom * PER_COEFFICIENT);
        fit.log_likelihood - fitted.fit.log_likelihood - least
    };
    let all = unnamed_like(Some(&fitted.model.effects[effect]), context);
    parallel::map_all(&all, lead)
        .into_iter()
        .zip(all)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(lead, _)| *lead > 0.0)
        .map(|(_, foreign)| BetterExplanation::Unnamed { what: foreign.what })
}
