//! Rivals: every found effect is removed and others are fitted instead; those that fit nearly as
//! well form its class.

use crate::data::rig::Kind;
use crate::decide::material::SelectedByShare;
use crate::decide::thresholds::{
    BEHIND_PART, BEHIND_SLOW_NATS, BEHIND_SLOW_Z, BEHIND_Z, LEADS_Z, MOST_IN_CLASS,
};
use crate::evidence::effect_evidence::{EffectEvidence, Rival};
use crate::evidence::holdout_likelihood::evaluate_all;
use crate::evidence::holdout_set::HoldoutSet;
use crate::evidence::known_travel::known;
use crate::evidence::parameters;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::fit::nominal::Nominal;
use crate::laws::definition::ExcitationLimits;
use crate::laws::{Effect, EffectName};
use crate::propose::context::{FitContext, FittedModel};
use crate::propose::excitation::Excitation;
use crate::propose::predictive::left_out_costs;
use numerics::bootstrap::bootstrap;
use numerics::parallel;

/// The number of rivals of each effect that are fitted in full.
const RIVALS: usize = 4;
/// Standard errors behind within which a rival's shape is worth polishing.
const WITHIN_REACH: f64 = 8.0;

/// Costs per segment on left-out blocks of fitted and on held-out recordings under one noise.
fn costs(candidate: &FittedModel, nominal: &Nominal, holdout: &[BlockedRecording]) -> Vec<f64> {
    let mut out = left_out_costs(&candidate.fit);
    for evaluated in evaluate_all(candidate, nominal, holdout, &candidate.noise) {
        out.extend(evaluated.costs);
    }
    out
}

/// Fits the rivals of each effect instead of it, and returns how far behind they are.
pub(crate) fn fit_rivals(
    context: &FitContext,
    last: &FittedModel,
    coloured_fit: &FittedModel,
    holdout: &HoldoutSet,
    found: &mut [EffectEvidence],
) {
    let best = context.fit(last.model.clone(), &last.noise, Colour::White);
    let contest = Contest { context, best: &best, coloured_fit, holdout };
    for (i, found) in found.iter_mut().enumerate() {
        found.rivals = contest.rivals_of(i);
    }
}

/// The context in which rivals are compared with the effects of a model.
struct Contest<'a> {
    context: &'a FitContext<'a>,
    /// The model under white noise.
    best: &'a FittedModel,
    /// The model under coloured noise.
    coloured_fit: &'a FittedModel,
    holdout: &'a HoldoutSet,
}

/// A model with one more effect.
fn with(base: &Model, effect: &Effect) -> Model {
    let mut model = base.clone();
    model.effects.push(effect.clone());
    model
}

impl Contest<'_> {
    /// The best others in the place of effect `i`, with how far behind they are.
    fn rivals_of(&self, i: usize) -> Vec<Rival> {
        let Self { context, best, .. } = *self;
        let mut less = best.model.clone();
        less.effects.remove(i);
        let name = best.model.effects[i].name;
        let base_fit = Fit::new(&less, context.nominal, context.tracks, &best.noise);
        let base = FittedModel { model: less, noise: best.noise, fit: base_fit, log_score: 0.0 };
        let periodic = name.definition().has_own_phase();
        let others: Vec<(Effect, f64)> = context
            .screen(&base, &|other| other != name && (periodic || !other.definition().is_periodic()))
            .into_iter()
            .take(RIVALS)
            .collect();
        let mut rivals = parallel::map_all(&others, |(effect, _)| self.rival(&base.model, effect));
        self.tell_apart_by_slow_noise(&base.model, &others, &mut rivals);
        rivals
    }

    /// One effect fitted together with the others of the model, with how far behind it is.
    fn rival(&self, base: &Model, effect: &Effect) -> Rival {
        let Self { context, best, .. } = *self;
        let model = with(base, effect);
        let fit = Fit::new(&model, context.nominal, context.tracks, &best.noise);
        let mut rival = FittedModel { model, noise: best.noise, fit, log_score: 0.0 };
        // Both are judged where both know something.
        let holdout = self.holdout.judging(&best.model, context.span);
        let holdout = known(&holdout, &rival.model, context.span);
        let own = costs(best, context.nominal, &holdout);
        let fitted = rival.fit.prepared.iter().map(|one| one.segments.len()).sum::<usize>();
        let leads = |rival: &FittedModel| -> Vec<f64> {
            let theirs = costs(rival, context.nominal, &holdout);
            theirs.iter().zip(&own).map(|(a, b)| a - b).collect()
        };
        let mut lead = leads(&rival);
        let mut on_fit = bootstrap(&lead[..fitted]);
        if on_fit.z < WITHIN_REACH {
            // A rival that may be near is fitted as well as the winner was.
            let polished = FittedModel { noise: best.noise, ..context.polish_one(&rival) };
            let again = leads(&polished);
            let gain = bootstrap(&again[..fitted]);
            if gain.sum < on_fit.sum {
                (lead, on_fit, rival) = (again, gain, polished);
            }
        }
        let gain = bootstrap(&lead);
        let last = rival.model.effects.len() - 1;
        let is_near = gain.z.min(on_fit.z) < BEHIND_Z;
        let is_absent = is_near && parameters::is_absent(context, &rival, last);
        let effect = rival.model.effects[last].clone();
        let held_out_lead = lead[fitted..].iter().sum();
        let (z, lead, fit_z) = (gain.z, gain.sum, on_fit.z);
        Rival { name: effect.name, effect, z, fit_z, lead, held_out_lead, is_absent }
    }

    /// Puts those near rivals behind that only a white noise takes for as good as the winner.
    fn tell_apart_by_slow_noise(&self, base: &Model, others: &[(Effect, f64)], rivals: &mut [Rival]) {
        let log_score =
            |model: Model| self.context.fit_coloured(model, &[&self.coloured_fit.noise]).log_score;
        // Needed only where a rival is near, and the same for all of them.
        let mut without = None;
        let is_near = |rival: &Rival| rival.z < BEHIND_Z || rival.fit_z < -LEADS_Z;
        for (rival, (effect, _)) in rivals.iter_mut().zip(others).filter(|(rival, _)| is_near(rival)) {
            let theirs = log_score(with(base, effect));
            let without = *without.get_or_insert_with(|| log_score(base.clone()));
            let behind = self.coloured_fit.log_score - theirs;
            if behind > 0.5 * (self.coloured_fit.log_score - without) && behind > BEHIND_SLOW_NATS {
                (rival.z, rival.fit_z) = (rival.z.max(BEHIND_SLOW_Z), BEHIND_SLOW_Z);
                rival.lead = rival.lead.max(behind);
            }
        }
    }
}

/// Returns the rival that leads by most on left-out stretches of the fitted recordings, with the
/// place of the effect that it leads; none where no effect is led. Effects that shares of the force
/// error name met their rivals there.
pub(crate) fn leader(found: &[EffectEvidence], materials: &[SelectedByShare]) -> Option<(usize, Effect)> {
    let leads = |rival: &&Rival| rival.fit_z < -LEADS_Z && !rival.is_absent;
    let has_none = |one: &EffectEvidence| SelectedByShare::find(materials, one.effect.name).is_none();
    let by_likelihood = found.iter().enumerate().filter(|(_, one)| has_none(one));
    let all = by_likelihood.flat_map(|(i, one)| one.rivals.iter().filter(leads).map(move |rival| (i, rival)));
    let is_new = |rival: &Rival| found.iter().all(|one| one.effect.name != rival.name);
    let best = all.filter(|(_, rival)| is_new(rival)).min_by(|a, b| a.1.fit_z.total_cmp(&b.1.fit_z));
    best.map(|(i, rival)| (i, rival.effect.clone()))
}

/// Every effect that these recordings cannot distinguish from the one found, itself first.
pub(crate) fn class(
    found: &EffectEvidence,
    excitation: &Excitation,
    leaves_much: bool,
    context: &FitContext,
) -> Vec<EffectName> {
    let name = found.effect.name;
    let mut class = vec![name];
    let shown = ExcitationLimits {
        leaves_much,
        one_way: context.span.one_way,
        linear: context.nominal.rig.kind == Kind::Linear,
        count: context.span.count,
        ..excitation.limits()
    };
    for twin in found.effect.twins(&shown) {
        if !class.contains(&twin) {
            class.push(twin);
        }
    }
    let least = BEHIND_PART * (found.fit.sum + found.holdout.sum);
    let is_near = |r: &&Rival| (r.z < BEHIND_Z || r.lead < least) && !r.is_absent;
    let mut near: Vec<&Rival> = found.rivals.iter().filter(is_near).collect();
    near.sort_by(|a, b| a.z.total_cmp(&b.z));
    for rival in near {
        if class.len() < MOST_IN_CLASS && !class.contains(&rival.name) {
            class.push(rival.name);
        }
    }
    class
}

/// Standard errors that the nearest rival outside an effect's class is behind.
pub(crate) fn nearest(found: &EffectEvidence, class: &[EffectName]) -> f64 {
    let outside = found.rivals.iter().filter(|r| !class.contains(&r.name) && !r.is_absent);
    outside.map(|r| r.z).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unseen_gap_may_be_a_spring() {
        use EffectName as N;
        let twins = |name: N, shape: &[(&str, f64)], linear: bool| {
            let shown = ExcitationLimits { linear, count: 1e-6, ..ExcitationLimits::default() };
            Effect::shaped(name, shape).twins(&shown)
        };
        assert_eq!(twins(N::Backlash, &[("gap", 1.5e-6)], true), [N::DriveCompliance]);
        assert!(twins(N::Backlash, &[("gap", 3e-6)], true).is_empty());
        assert_eq!(twins(N::MassImbalance, &[], true), [N::Cogging]);
        assert!(twins(N::MassImbalance, &[], false).is_empty(), "there a mass turns");
    }
}
