//! The models that still contend for a name: each is a whole rig, fitted to the recordings, that an
//! experiment can distinguish from the others.

use crate::decide::assess::Assessment;
use crate::decide::diagnosis::Contender;
use crate::decide::patched_rig::patch;
use crate::decide::thresholds::MOST_IN_CLASS;
use crate::decide::weighed_model::{WeighedEffect, WeighedModel};
use crate::evidence::prepared::Prepared;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::laws::{Effect, EffectName};
use crate::propose::context::{FitContext, FittedModel};

/// Rivals beyond this many standard errors behind are out.
const OUT_Z: f64 = 4.0;
/// Probability, to begin with, of each effect that the score test favours but the search rejected.
const SCREENED: f64 = 0.1;
/// The number of effects that are fitted where nothing was found.
const SCREENED_COUNT: usize = 3;

/// Returns the contenders of the effect that is least decided, the most probable first; none where
/// every name is single.
pub(crate) fn contenders(prepared: &Prepared, assessment: &Assessment) -> Vec<Contender> {
    let weighed = &assessment.weighed;
    let context = prepared.context(&assessment.fit);
    let field = Field { prepared, assessment, context: &context };
    let mut out = match contested(weighed) {
        Some(contested) => field.around(contested),
        None if weighed.effects.is_empty() => field.screened(),
        None => Vec::new(),
    };
    out.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    out
}

/// The effect that explains most among those that are not named alone; one that was dropped where
/// no other is left.
fn contested(weighed: &WeighedModel) -> Option<&WeighedEffect> {
    let most = |a: &&WeighedEffect, b: &&WeighedEffect| a.found.holdout.sum.total_cmp(&b.found.holdout.sum);
    let is_single = |e: &&WeighedEffect| e.class.len() == 1 && weighed.doubt(e).is_none();
    let undecided = weighed.effects.iter().filter(|e| !is_single(e)).max_by(most);
    let dropped = || weighed.effects.is_empty().then(|| weighed.dropped.iter().max_by(most)).flatten();
    undecided.or_else(dropped)
}

/// Odds of a rival that is `z` standard errors behind the winner, which has 1: both are normal.
fn odds(z: f64) -> f64 {
    let behind = 0.5 * libm::erfc(z / std::f64::consts::SQRT_2);
    behind / (1.0 - behind).max(1e-12)
}

/// The recordings and the context that contenders are fitted with.
struct Field<'a> {
    prepared: &'a Prepared,
    assessment: &'a Assessment,
    context: &'a FitContext<'a>,
}

impl Field<'_> {
    /// A contested effect, the rest of its class, near rivals, and the model without it.
    fn around(&self, contested: &WeighedEffect) -> Vec<Contender> {
        let name = contested.found.effect.name;
        let all = &self.assessment.weighed.shown.patched.model.effects;
        let others: Vec<Effect> = all.iter().filter(|e| e.name != name).cloned().collect();
        let base = Model { effects: others, ..Model::default() };
        let mut rivals = vec![(contested.found.effect.clone(), 1.0)];
        for rival in &contested.found.rivals {
            let in_class = contested.class.contains(&rival.name);
            let is_near = !rival.is_absent && rival.z < OUT_Z;
            if in_class || (is_near && rivals.len() <= MOST_IN_CLASS) {
                rivals.push((rival.effect.clone(), odds(rival.z)));
            }
        }
        for twin in &contested.class {
            if rivals.iter().any(|(effect, _)| effect.name == *twin) {
                continue;
            }
            // A twin by physics that no fit ranked: as likely as the winner.
            let best = self.best_shape(&base, *twin);
            rivals.extend(best.into_iter().map(|effect| (effect, 1.0)));
        }
        let whole: f64 = rivals.iter().map(|(_, odds)| odds).sum();
        let sure = contested.confidence.clamp(0.05, 0.95);
        let of_rival = |(effect, odds): (Effect, f64)| {
            let model = with(&base, effect.clone());
            Contender {
                name: Some(effect.name),
                probability: sure * odds / whole,
                rig: self.rig(self.fitted(model)),
            }
        };
        let mut out: Vec<Contender> = rivals.into_iter().map(of_rival).collect();
        let rig = self.rig(self.fitted(base));
        out.push(Contender { name: None, probability: 1.0 - sure, rig });
        out
    }

    /// The refitted rig, and the effects that the score test favours where none was found.
    fn screened(&self) -> Vec<Contender> {
        let refit = &self.assessment.refit;
        let best = self.context.screen(refit, &|_| true).into_iter().take(SCREENED_COUNT);
        let contender = |(effect, _): (Effect, f64)| Contender {
            name: Some(effect.name),
            probability: SCREENED,
            rig: self.rig(self.fitted(with(&Model::default(), effect))),
        };
        let mut out: Vec<Contender> = best.map(contender).collect();
        let rest = 1.0 - SCREENED * out.len() as f64;
        let rig = self.rig(self.fitted(Model::default()));
        out.push(Contender { name: None, probability: rest, rig });
        out
    }

    /// The best shape of an effect that is added to a model.
    fn best_shape(&self, base: &Model, name: EffectName) -> Option<Effect> {
        let base = self.fitted(base.clone());
        self.context.screen(&base, &|other| other == name).into_iter().next().map(|(effect, _)| effect)
    }

    fn fitted(&self, model: Model) -> FittedModel {
        self.context.fit(model, &self.assessment.weighed.shown.patched.noise, Colour::White)
    }

    fn rig(&self, model: FittedModel) -> crate::data::rig::Rig {
        let Prepared { given, nominal, .. } = self.prepared;
        patch(given, nominal, &self.assessment.fit, &model)
    }
}

/// A model with one more effect.
fn with(base: &Model, effect: Effect) -> Model {
    let mut model = base.clone();
    model.effects.push(effect);
    model
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odds_follow_the_normal_distribution() {
        assert!((odds(0.0) - 1.0).abs() < 1e-6);
        // Φ(−1.96) = 0.025, and 0.025/0.975 = 1/39.
        assert!((odds(1.959_964) - 1.0 / 39.0).abs() < 1e-5);
        assert!((odds(-1.0) * odds(1.0) - 1.0).abs() < 1e-5);
    }
}
