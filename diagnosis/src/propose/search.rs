//! Screens effects, refines their shapes and fits the finalists.

use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::laws::definition::NominalTerm;
use crate::laws::{Effect, EffectName as N};
use crate::propose::candidates;
use crate::propose::context::{FitContext, FittedModel, cost};
use crate::propose::periodic::{self, Searched};
use crate::propose::score_statistic;
use crate::propose::shape_search::descend;
use crate::propose::two_mass;
use numerics::golden_section::golden;
use numerics::parallel;
use regression::laws::Need;

/// The number of effects that are fitted in full at each step.
const FINALISTS: usize = 8;
/// The number of those whose shapes are refined in full fits.
const POLISHED: usize = 3;
/// Factors at which optima are looked for that lie apart.
const APART: [f64; 8] = [0.4, 0.55, 0.7, 0.85, 1.2, 1.45, 1.8, 2.4];
/// The number of values of a shape that the score test refines, and refines again.
const MOVED: usize = 3;
const MOVED_AGAIN: usize = 2;
/// The number of searches farther away.
const FARTHER: usize = 4;
/// The number of searches for waves under the noise that they leave.
const SEARCHES: usize = 3;
/// The largest value along one value of a shape between two ends, in its logarithm, and the effect
/// that has it.
fn along(
    effect: &Effect,
    key: &str,
    (low, high): (f64, f64),
    steps: usize,
    value: &dyn Fn(&Effect) -> f64,
) -> Option<(f64, Effect)> {
    let moved_to = |x: f64| {
        let mut trial = effect.clone();
        trial.shape.insert(key.to_owned(), x.exp());
        trial
    };
    let (a, b) = (low.ln(), high.ln());
    (b > a).then(|| {
        let found = moved_to(golden(a, b, steps, |x| value(&moved_to(x))));
        (value(&found), found)
    })
}

impl FitContext<'_> {
    /// The wanted effects that are not in a model yet and that these recordings may show in
    /// addition to it.
    pub(crate) fn addable_effects(&self, model: &Model, wanted: &dyn Fn(N) -> bool) -> Vec<N> {
        let is_dry = |e: &Effect| e.name.definition().nominal_term() == Some(NominalTerm::Coulomb);
        let dry = self.nominal.has(NominalTerm::Coulomb) || model.effects.iter().any(is_dry);
        self.that_may_show(model, &|name| (dry || !name.needs(Need::DryFriction)) && wanted(name))
    }

    /// The same, with those that refine a dry friction which neither the rig nor the model has.
    pub(crate) fn that_may_show(&self, model: &Model, wanted: &dyn Fn(N) -> bool) -> Vec<N> {
        let there = |name: N| model.effects.iter().any(|e| e.name == name);
        let no_losses = self.tracks.iter().all(|t| t.jumps.lost.iter().all(|x| *x == 0.0));
        let is_tried = |name: &N| {
            !there(*name)
                && !self.unsought.contains(name)
                && (!name.definition().is_of_jumps() || !no_losses)
                && candidates::is_seen(*name, self.nominal)
                && wanted(*name)
        };
        N::ALL.iter().chain(&self.nominal.rig.searched).copied().filter(is_tried).collect()
    }

    /// The best shape of every effect that is not in the model yet, with the gain of its score
    /// test, best first.
    pub(crate) fn screen(
        &self,
        now: &FittedModel,
        wanted: &(dyn Fn(N) -> bool + Sync),
    ) -> Vec<(Effect, f64)> {
        let residuals: Vec<Vec<f64>> = (0..self.tracks.len()).map(|r| now.fit.residual(r)).collect();
        let all = self.addable_effects(&now.model, wanted);
        let periodic: Vec<N> = all.iter().copied().filter(|name| name.definition().is_periodic()).collect();
        let searched = Searched { fit: &now.fit, residuals: &residuals, model: &now.model };
        let waves = periodic::search(&periodic, self, &searched);
        let worth_adding = |name: &N| -> Option<(Effect, f64)> {
            let best = match name.definition().is_periodic() {
                true => {
                    waves.iter().find(|(effect, _)| effect.name == *name).map(|(effect, _)| effect.clone())
                }
                false => self.best_on_grid(now, &residuals, *name),
            };
            let (effect, gain) = self.refine(now, &residuals, best?);
            let worth = gain - cost(&effect, self.tracks.len(), self.span);
            (worth > 0.0).then_some((effect, worth))
        };
        let found = parallel::map_all(&all, worth_adding);
        let mut found: Vec<(Effect, f64)> = found.into_iter().flatten().collect();
        found.sort_by(|a, b| b.1.total_cmp(&a.1));
        found
    }

    /// The shape of an effect's grid with the largest score gain.
    fn best_on_grid(&self, now: &FittedModel, residuals: &[Vec<f64>], name: N) -> Option<Effect> {
        let grid = candidates::shapes(name, self.span, self.nominal);
        let (fit, model) = (&now.fit, &now.model);
        score_statistic::best_on_grid(fit, residuals, model, self.tracks, &grid, self.nominal)
            .map(|(effect, _)| effect)
    }

    /// Moves the shape of an effect to its largest score gain, one value after another.
    fn refine(&self, now: &FittedModel, residuals: &[Vec<f64>], mut effect: Effect) -> (Effect, f64) {
        let gain = |effect: &Effect| {
            score_statistic::score(&now.fit, residuals, &now.model, self.tracks, effect, self.nominal).gain
        };
        let movable = candidates::movable(&effect, self.span);
        let mut best = gain(&effect);
        for round in 0..2 {
            // What matters most comes first; the rest is moved where it is fitted.
            for (key, low, high) in movable.iter().take(if round == 0 { MOVED } else { MOVED_AGAIN }) {
                let at = effect.shape[*key];
                let reach = if round == 0 { 2.2_f64 } else { 1.3 };
                let ends = ((at / reach).max(*low), (at * reach).min(*high));
                if let Some((value, trial)) = along(&effect, key, ends, 9, &gain).filter(|(v, _)| *v > best) {
                    (best, effect) = (value, trial);
                }
            }
            if movable.is_empty() {
                break;
            }
        }
        (effect, best)
    }

    /// Fits the best effects of a screening in full, each with noise of its own; best first.
    pub(crate) fn finalists(&self, now: &FittedModel, found: &[(Effect, f64)]) -> Vec<FittedModel> {
        let mut full = parallel::map_all(&found[..found.len().min(FINALISTS)], |(effect, _)| {
            let mut model = now.model.clone();
            model.effects.push(effect.clone());
            self.fit(model, &now.noise, Colour::White)
        });
        full.sort_by(|a, b| b.log_score.total_cmp(&a.log_score));
        full
    }

    /// Polishes the best few candidates and puts them in order again.
    pub(crate) fn polish(&self, candidates: &mut [FittedModel]) {
        let polished =
            parallel::map_all(&candidates[..candidates.len().min(POLISHED)], |c| self.polish_one(c));
        for (old, new) in candidates.iter_mut().zip(polished) {
            if new.log_score > old.log_score {
                *old = new;
            }
        }
        candidates.sort_by(|a, b| b.log_score.total_cmp(&a.log_score));
    }

    /// Looks for waves again under the noise that those found first have left: weak ones hide in
    /// the noise of a null that knows of none.
    fn search_waves_again(&self, candidate: &FittedModel) -> FittedModel {
        let mut best = self.fit(candidate.model.clone(), &candidate.noise, Colour::White);
        for _ in 0..SEARCHES {
            let Some(found) = self.with_better_waves(&best) else { break };
            best = found;
        }
        best
    }

    /// Fits the model with the waves that a search under its noise finds; none where they are no
    /// better.
    fn with_better_waves(&self, from: &FittedModel) -> Option<FittedModel> {
        let mut model = from.model.clone();
        let name = model.effects.pop()?.name;
        let base = Fit::new(&model, self.nominal, self.tracks, &from.noise);
        let residuals: Vec<Vec<f64>> = (0..self.tracks.len()).map(|r| base.residual(r)).collect();
        let searched = Searched { fit: &base, residuals: &residuals, model: &model };
        let (effect, _) = periodic::search(&[name], self, &searched).pop()?;
        model.effects.push(effect);
        Some(self.fit(model, &from.noise, Colour::White)).filter(|found| found.log_score > from.log_score)
    }

    /// Moves the shape of the last effect to the largest likelihood of the whole fit.
    pub(crate) fn polish_one(&self, candidate: &FittedModel) -> FittedModel {
        let last = candidate.model.effects.len() - 1;
        if candidate.model.effects[last].name.definition().is_periodic() {
            return self.search_waves_again(candidate);
        }
        let mut model = candidate.model.clone();
        let log_score = |model: &Model| self.log_score_of(model, &candidate.noise);
        let mut best = candidate.fit.log_likelihood;
        let movable = candidates::movable(&candidate.model.effects[last], self.span);
        // The score test holds the gain and looks near by: delays, drifts and events have optima
        // that lie apart.
        if let (true, Some((key, low, high))) =
            (candidate.model.effects[last].name.definition().has_optima_apart(), movable.first().copied())
        {
            for _ in 0..FARTHER {
                let at = model.effects[last].shape[key];
                let mut taken = None;
                for factor in APART {
                    let mut trial = model.clone();
                    trial.effects[last].shape.insert(key.to_owned(), (at * factor).clamp(low, high));
                    let value = log_score(&trial);
                    if value > best {
                        best = value;
                        taken = Some((factor, trial));
                    }
                }
                let Some((factor, trial)) = taken else { break };
                model = trial;
                // Only from the edge of what was looked at is it worth looking farther.
                if factor > APART[0] && factor < APART[APART.len() - 1] {
                    break;
                }
            }
        }
        if let Some((value, found)) =
            two_mass::search(self, &model, &candidate.noise, &log_score).filter(|f| f.0 > best)
        {
            (best, model) = (value, found);
        }
        for (key, low, high) in movable.iter().copied() {
            let at = model.effects[last].shape[key];
            let ends = ((at / 1.6).max(low), (at * 1.6).min(high));
            let with_last = |effect: &Effect| {
                let mut trial = model.clone();
                trial.effects[last] = effect.clone();
                trial
            };
            let found = along(&model.effects[last], key, ends, 8, &|effect| log_score(&with_last(effect)));
            if let Some((value, effect)) = found.filter(|(value, _)| *value > best) {
                best = value;
                model.effects[last] = effect;
            }
        }
        let found = descend(self, model, &candidate.noise, best, &log_score);
        let (_, model) = two_mass::settle(self, found, &candidate.noise, &log_score);
        self.fit(model, &candidate.noise, Colour::White)
    }
}
