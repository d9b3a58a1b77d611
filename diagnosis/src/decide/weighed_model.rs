//! A model with the confidence of each of its effects, and what speaks against one of them.

use crate::data::schema::Parameter;
use crate::decide::confidence::{self, Evidence};
use crate::decide::elimination::RejectedHypothesis;
use crate::decide::material::SelectedByShare;
use crate::decide::rejection::{BetterExplanation, Rejection};
use crate::decide::thresholds::NAMED;
use crate::evidence::comparison::ModelComparison;
use crate::evidence::effect_evidence::EffectEvidence;
use crate::evidence::tonal::TonalDisturbance;
use crate::fit::force_residual::Estimator;
use crate::laws::EffectName;
use crate::propose::context::FittedModel;
use std::collections::BTreeMap;

/// One effect with what speaks for and against it.
pub(crate) struct WeighedEffect {
    pub(crate) found: EffectEvidence,
    /// Its part in the force error, where that names it.
    pub(crate) material: Option<SelectedByShare>,
    pub(crate) class: Vec<EffectName>,
    pub(crate) evidence: Evidence,
    pub(crate) confidence: f64,
    pub(crate) parameters: BTreeMap<String, Parameter>,
    pub(crate) is_there: bool,
    /// True if more effects than a class may hold explain it as well.
    pub(crate) undecided: bool,
    /// Part of the travel over which it bends, where that is more than bristles bend.
    pub(crate) creeps: Option<f64>,
    /// The better explanation, where something without a name explains significantly more.
    pub(crate) rather: Option<BetterExplanation>,
}

impl WeighedEffect {
    pub(crate) fn explains_more(&self, than: &Self) -> bool {
        self.found.holdout.sum > than.found.holdout.sum
    }
}

/// The model found, its effects weighed, and its residuals.
pub(crate) struct WeighedModel {
    pub(crate) effects: Vec<WeighedEffect>,
    /// The effects that were removed because they were unsure.
    pub(crate) dropped: Vec<WeighedEffect>,
    /// The model under coloured noise.
    pub(crate) coloured_fit: FittedModel,
    /// The hypotheses that were rejected on the way.
    pub(crate) rejected: Vec<RejectedHypothesis>,
    /// The effects that shares of the force error name.
    pub(crate) materials: Vec<SelectedByShare>,
    pub(crate) shown: ModelComparison,
    pub(crate) estimator: Estimator,
    /// Residual that reading whole counts alone causes, N·m or N.
    pub(crate) floor: f64,
    /// True if the model leaves little enough of the force to have understood it.
    pub(crate) understood: bool,
    /// The force that swings whatever the axis does, if there is one.
    pub(crate) swing: Option<TonalDisturbance>,
    /// Correlation of the residual between repeats of a motion, where there are any and it is
    /// surely more than chance.
    pub(crate) repeats: Option<f64>,
}

impl WeighedModel {
    /// Confidence of the surest effect.
    pub(crate) fn surest(&self) -> f64 {
        self.effects.iter().map(|e| e.confidence).fold(0.0, f64::max)
    }

    /// True if confidence, not a veto, decided.
    pub(crate) fn rests_on_evidence(&self, assessed: &WeighedEffect) -> bool {
        self.contradiction(assessed).is_none()
    }

    /// The effect that explains most, with what it would rather be, where something without a name
    /// explains more.
    pub(crate) fn resembled(&self) -> Option<(EffectName, BetterExplanation)> {
        let most = self.effects.iter().max_by(|a, b| a.found.holdout.sum.total_cmp(&b.found.holdout.sum))?;
        Some((most.found.effect.name, most.rather.clone()?))
    }

    /// Marks the effects at some places as having no size.
    pub(crate) fn have_no_size(&mut self, places: &[usize]) {
        for i in places {
            self.effects[*i].is_there = false;
        }
    }

    /// Marks the least sure of the named effects as immaterial: with all of them a model takes only
    /// this part off the held-out force error.
    pub(crate) fn weakest_is_immaterial(&mut self, part: f64) {
        let sure = |i: &usize| self.effects[*i].confidence;
        let weakest = self.named().into_iter().min_by(|a, b| sure(a).total_cmp(&sure(b)));
        if let Some(i) = weakest {
            self.effects[i].found.off_force = part;
        }
    }

    /// Takes this model's names and not another's: a name of both is as sure as the surer, and what
    /// only the other has is rejected.
    pub(crate) fn is_beside(&mut self, other: &Self) {
        let named: Vec<&WeighedEffect> = other.named().into_iter().map(|i| &other.effects[i]).collect();
        for one in &mut self.effects {
            let same = named.iter().filter(|other| other.class.contains(&one.found.effect.name));
            one.confidence = same.fold(one.confidence, |most, other| most.max(other.confidence));
        }
        let rejected = other.effects.iter().chain(&other.dropped).map(|one| RejectedHypothesis {
            name: one.found.effect.name,
            holdout_gain: Some(one.found.holdout.sum),
            why: other.doubt(one).unwrap_or(Rejection::LeavesMore),
        });
        self.rejected.splice(..0, rejected);
    }

    /// Places of the effects that are named.
    pub(crate) fn named(&self) -> Vec<usize> {
        let is_named = |(i, effect): (usize, &WeighedEffect)| self.doubt(effect).is_none().then_some(i);
        self.effects.iter().enumerate().filter_map(is_named).collect()
    }

    /// Returns why an effect is not named; none if it is.
    pub(crate) fn doubt(&self, assessed: &WeighedEffect) -> Option<Rejection> {
        self.contradiction(assessed).or_else(|| {
            if assessed.undecided {
                Some(Rejection::Undecided)
            } else if assessed.confidence < NAMED {
                let weakness = confidence::weakness(&assessed.evidence);
                Some(Rejection::Improbable { probability: assessed.confidence, weakness })
            } else {
                None
            }
        })
    }

    /// A larger effect with which it shares a class: either could be the other, so that both
    /// together are no finding.
    fn twin_beside(&self, assessed: &WeighedEffect) -> Option<EffectName> {
        let name = |effect: &WeighedEffect| effect.found.effect.name;
        let is_twin = |other: &&WeighedEffect| {
            name(other) != name(assessed)
                && assessed.class.contains(&name(other))
                && other.class.contains(&name(assessed))
                && other.explains_more(assessed)
        };
        self.effects.iter().find(is_twin).map(name)
    }

    /// Returns what rules an effect out however much it explains; none if nothing does.
    fn contradiction(&self, assessed: &WeighedEffect) -> Option<Rejection> {
        if let Some(from) = self.twin_beside(assessed) {
            return Some(Rejection::Indistinguishable { from });
        }
        if assessed.material.is_some() {
            // Its shares of the force error, fitted and held out, were judged before it was fitted.
            let no_size = (!assessed.is_there).then_some(Rejection::NoSize);
            return no_size.or_else(|| assessed.found.immaterial());
        }
        if !assessed.is_there {
            Some(Rejection::NoSize)
        } else if let Some(why) = assessed.found.immaterial() {
            Some(why)
        } else if let Some(part) = assessed.creeps {
            Some(Rejection::Creeps { part })
        } else if let Some(rather) = &assessed.rather {
            Some(Rejection::BetterExplanation(rather.clone()))
        } else if self.effects.iter().any(|other| other.rather.is_some() && other.explains_more(assessed)) {
            Some(Rejection::BesideUnknown)
        } else {
            None
        }
    }
}
