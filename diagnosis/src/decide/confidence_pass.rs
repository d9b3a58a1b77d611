//! The confidence of each effect found. Effects that are too unsure are removed and the rest is
//! weighed again: a false effect takes evidence from a true one.

use crate::decide::acceptance_criteria::gather_evidence;
use crate::decide::confidence::{self, ResidualEvidence};
use crate::decide::elimination::{SurvivingModel, eliminate};
use crate::decide::material::SelectedByShare;
use crate::decide::out_of_library;
use crate::decide::rivals;
use crate::decide::thresholds::{
    BEHIND_Z, BRISTLES, LEAVES_MUCH, LIMITED_BY_PHYSICS, MUCH_OF_REFIT, NAMED, SUREST_BESIDE_PHYSICS,
    UNDECIDED, UNDERSTOOD,
};
use crate::decide::weighed_model::{WeighedEffect, WeighedModel};
use crate::evidence::comparison::ModelComparison;
use crate::evidence::effect_evidence::EffectEvidence;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::parameters;
use crate::evidence::repeats::correlation_of_repeats;
use crate::evidence::residuals::{Residuals, above};
use crate::evidence::tonal;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::laws::definition::Span;
use crate::laws::{Effect, EffectName};
use crate::propose::context::{FitContext, FittedModel};
use crate::propose::excitation::Excitation;

/// Least part of a residual's mean square that counts as more than chance.
const LEAST_ABOVE: f64 = 0.02;

/// Confidence of an effect in a model with an unsure one: if it does not survive without the unsure
/// one, its confidence is capped at that one's.
fn cap_by_unsure(own: f64, unsure: f64, name: EffectName, standing: &[EffectName]) -> f64 {
    if standing.contains(&name) { own } else { own.min(unsure) }
}

/// Part of the travel over which an effect gives way after a reversal, where that is more than
/// bristles do: such a spring creeps.
fn creeps(effect: &Effect, span: &Span) -> Option<f64> {
    let part = effect.name.definition().gives_way_over(effect)? / span.travel();
    (part > BRISTLES).then_some(part)
}

/// Weighs what the search found, and again without what is unsure as long as that makes the rest
/// surer.
pub(crate) fn weigh(weighing: &WeighingContext, found: SurvivingModel) -> WeighedModel {
    weighing.without_unsure(weighing.weigh_model(found))
}

/// The context in which every model is weighed.
pub(crate) struct WeighingContext<'a> {
    pub(crate) context: &'a FitContext<'a>,
    /// The null under white noise.
    pub(crate) refit: &'a FittedModel,
    /// The null under coloured noise.
    pub(crate) null: &'a FittedModel,
    pub(crate) holdout: &'a HoldoutSet,
    pub(crate) excitation: &'a Excitation,
}

impl WeighingContext<'_> {
    /// The best model, weighed without effect `i`.
    fn without(&self, best: &WeighedModel, i: usize) -> WeighedModel {
        let mut less = best.coloured_fit.model.clone();
        less.effects.remove(i);
        let model = self.context.fit_coloured(less, &[&self.null.noise, &best.coloured_fit.noise]);
        let noise = &best.shown.patched.noise;
        let mut standing =
            eliminate(model, self.context, self.holdout, &self.null.noise, noise, &best.materials);
        standing.rejected.splice(..0, best.rejected.iter().cloned());
        self.weigh_model(standing)
    }

    fn without_unsure(&self, mut best: WeighedModel) -> WeighedModel {
        loop {
            let least =
                best.effects.iter().enumerate().min_by(|a, b| a.1.confidence.total_cmp(&b.1.confidence));
            let Some((i, _)) = least.filter(|(_, e)| e.confidence < NAMED && best.effects.len() > 1) else {
                return best;
            };
            let mut next = self.without(&best, i);
            if next.surest() > best.surest() {
                next.dropped = best.dropped;
                next.dropped.push(best.effects.remove(i));
                best = next;
                continue;
            }
            let standing: Vec<EffectName> = next.effects.iter().map(|e| e.found.effect.name).collect();
            let unsure = best.effects[i].confidence;
            for one in &mut best.effects {
                one.confidence = cap_by_unsure(one.confidence, unsure, one.found.effect.name, &standing);
            }
            return best;
        }
    }

    /// Weighs a model.
    fn weigh_model(&self, standing: SurvivingModel) -> WeighedModel {
        let Self { context, refit, holdout, .. } = *self;
        let (SurvivingModel { model: coloured_fit, effects: found, rejected, materials }, patched) =
            self.against_rivals(standing);
        let estimator = Estimator::new(context.tracks, &patched.noise, context.scale);
        let shown = ModelComparison::new(context, &holdout.smoothed, &estimator, refit, patched);
        let left = self.left_over(&coloured_fit, &shown, &estimator);
        let ModelComparison { on_fit, on_holdout, .. } = &shown;
        let hertz = tonal::frequency(&estimator, &left_by(context.tracks, on_fit));
        let swing =
            hertz.and_then(|hertz| tonal::swing(&estimator, hertz, &left_by(&holdout.smoothed, on_holdout)));
        let repeats = self.repeats(&shown, &estimator);
        let effects = found.into_iter().enumerate();
        let effects = effects
            .map(|(i, found)| {
                let material = SelectedByShare::find(&materials, found.effect.name).cloned();
                self.weigh_effect(found, material, i, &shown.patched, &left)
            })
            .collect();
        WeighedModel {
            effects,
            dropped: Vec::new(),
            floor: left.floor,
            understood: left.understood,
            coloured_fit,
            rejected,
            materials,
            shown,
            estimator,
            swing,
            repeats,
        }
    }

    /// A model whose effects have met their rivals, and its fit under white noise. A rival that
    /// leads takes the effect's place, once: the search adds one effect after another, and what was
    /// best then need not be best in the end.
    fn against_rivals(&self, mut standing: SurvivingModel) -> (SurvivingModel, FittedModel) {
        let contest = |standing: &mut SurvivingModel, patched: &FittedModel| {
            let SurvivingModel { model, effects, .. } = standing;
            rivals::fit_rivals(self.context, patched, model, self.holdout, effects);
        };
        let SurvivingModel { model: last, materials, .. } = &standing;
        let patched = self.context.fit_shown(last.model.clone(), &last.noise, !materials.is_empty());
        contest(&mut standing, &patched);
        let leader = rivals::leader(&standing.effects, &standing.materials);
        match leader.and_then(|(i, rival)| self.replaced(&standing, i, rival)) {
            Some((mut other, patched)) => {
                contest(&mut other, &patched);
                (other, patched)
            }
            None => (standing, patched),
        }
    }

    /// A model with a rival in the place of effect `i`, and its fit under white noise; none where
    /// the rival may not be named.
    fn replaced(
        &self,
        standing: &SurvivingModel,
        i: usize,
        rival: Effect,
    ) -> Option<(SurvivingModel, FittedModel)> {
        let Self { context, holdout, .. } = *self;
        let SurvivingModel { model, rejected, materials, .. } = standing;
        let mut with = model.model.clone();
        with.effects[i] = rival;
        let coloured_fit = context.fit_coloured(with, &[&self.null.noise, &model.noise]);
        let white_fit =
            context.fit_shown(coloured_fit.model.clone(), &coloured_fit.noise, !materials.is_empty());
        let effects = gather_evidence(context, &white_fit, &coloured_fit.noise, holdout);
        let may_stand = effects.iter().all(|one| one.rejection().is_none())
            && !parameters::is_absent(context, &white_fit, i);
        let (rejected, materials) = (rejected.clone(), materials.clone());
        may_stand.then_some((SurvivingModel { model: coloured_fit, effects, rejected, materials }, white_fit))
    }

    /// The force that a model leaves.
    fn left_over(
        &self,
        coloured_fit: &FittedModel,
        shown: &ModelComparison,
        estimator: &Estimator,
    ) -> ResidualSummary {
        let Self { context, holdout, .. } = *self;
        let ModelComparison { patched, on_holdout, table, .. } = shown;
        let known: &[BlockedRecording] = &holdout.shown(&patched.model, context.span);
        let (inertia, _, _) = parameters::scale(context.nominal, patched);
        let count = 1.0 / context.nominal.rig.encoder.counts_per_unit;
        let floor = estimator.counting(context.tracks, &patched.noise, count) * inertia;
        let (refit_holdout, left_holdout) =
            (estimator.rms(&on_holdout.refit, known), estimator.rms(&on_holdout.patched, known));
        let left = coloured_fit.noise.slow * inertia * inertia;
        // What neither counting nor a white disturbance makes.
        let random = floor.hypot(estimator.white(&coloured_fit.noise) * inertia);
        let of_chance = |residual: f64| above(residual, random, LEAST_ABOVE).max(1e-300);
        let evidence = ResidualEvidence {
            of_force: left.sqrt() / table.force_rms.fit.max(1e-300),
            unexplained: [(left_holdout, refit_holdout), (table.patched.fit, table.refit.fit)]
                .map(|(left, refit)| of_chance(left) / of_chance(refit))
                .into_iter()
                .fold(1.0, f64::min),
        };
        let part_of_force = left_holdout / estimator.rms(&on_holdout.force, known).max(1e-300);
        let helps_much = left_holdout < MUCH_OF_REFIT * refit_holdout;
        let understood = part_of_force < UNDERSTOOD.0 || (helps_much && part_of_force < UNDERSTOOD.1);
        let leaves_much = table.patched.fit.powi(2) > LEAVES_MUCH * table.refit.fit.powi(2);
        let left = left_holdout.min(table.patched.fit);
        let is_other_physics = left >= LIMITED_BY_PHYSICS * floor;
        ResidualSummary { floor, evidence, understood, leaves_much, is_other_physics }
    }

    /// Correlation of the residual between repeats of a motion in all recordings.
    fn repeats(&self, shown: &ModelComparison, estimator: &Estimator) -> Option<f64> {
        let all: Vec<BlockedRecording> =
            self.context.tracks.iter().chain(&self.holdout.smoothed).cloned().collect();
        let left: Vec<Vec<f64>> =
            shown.on_fit.patched.iter().chain(&shown.on_holdout.patched).cloned().collect();
        let moving: Vec<Vec<bool>> = all.iter().map(|track| estimator.moving(track)).collect();
        correlation_of_repeats(&all, &left, &moving, estimator.bandwidth_hz)
    }

    /// Weighs effect `i` of a model.
    fn weigh_effect(
        &self,
        found: EffectEvidence,
        material: Option<SelectedByShare>,
        i: usize,
        patched: &FittedModel,
        left: &ResidualSummary,
    ) -> WeighedEffect {
        let context = self.context;
        let parameters = parameters::parameters(context, patched, i);
        let evidence = confidence::evidence(&found, left.evidence);
        let rather = out_of_library::rather(context, patched, i, found.fit.sum);
        let mut weighed = WeighedEffect {
            class: Vec::new(),
            confidence: 0.0,
            is_there: false,
            undecided: false,
            creeps: None,
            found,
            material,
            evidence,
            parameters,
            rather,
        };
        let found = &weighed.found;
        if let Some(material) = &weighed.material {
            weighed.is_there = parameters::has_size(found.effect.name, &weighed.parameters);
            (weighed.class, weighed.confidence) = (material.class.clone(), material.confidence());
            return weighed;
        }
        let class = rivals::class(found, self.excitation, left.leaves_much, context);
        weighed.undecided = rivals::nearest(found, &class) < BEHIND_Z;
        // Shares take each recording's bias off, so they do not see what may be constant.
        let is_seen = !found.effect.name.definition().may_be_constant();
        let most = match (weighed.undecided, left.is_other_physics && is_seen) {
            (true, _) => UNDECIDED,
            (false, true) => SUREST_BESIDE_PHYSICS,
            (false, false) => 1.0,
        };
        weighed.creeps = creeps(&found.effect, context.span)
            // A spring that creeps depends on time, so no law of the travel fits it everywhere,
            // however far it bends.
            .filter(|_| !found.fits_everywhere());
        weighed.is_there = parameters::is_there(found.effect.name, &weighed.parameters);
        weighed.confidence = confidence::confidence(&weighed.evidence).min(most);
        weighed.class = class;
        weighed
    }
}

/// The force that a model leaves.
struct ResidualSummary {
    /// Residual that reading whole counts alone causes, N·m or N.
    floor: f64,
    evidence: ResidualEvidence,
    /// True if the model leaves little enough of the force to have understood it.
    understood: bool,
    /// True if the model leaves much of what the refit left.
    leaves_much: bool,
    /// True if what the model leaves is other physics and not noise.
    is_other_physics: bool,
}

fn left_by<'a>(tracks: &'a [BlockedRecording], residuals: &'a Residuals) -> tonal::ResidualView<'a> {
    tonal::ResidualView { tracks, force: &residuals.force, refit: &residuals.refit }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_effect_that_needs_another_is_no_surer_than_it() {
        let drift = EffectName::FrictionDrift;
        assert_eq!(cap_by_unsure(0.92, 0.65, drift, &[]), 0.65);
        assert_eq!(cap_by_unsure(0.92, 0.65, drift, &[drift]), 0.92);
        assert_eq!(cap_by_unsure(0.5, 0.65, drift, &[]), 0.5);
    }
}
