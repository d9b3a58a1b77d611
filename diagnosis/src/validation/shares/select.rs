//! Forward selection of effects by their shares of the force error.

use super::forms::forms;
use super::laws::{Columns, columns, taken_from_command};
use super::share::Share;
pub(crate) use super::state::Selection;
use super::state::State;
use crate::effects::definition::{NominalTerm, Unnamed};
use crate::effects::{Effect, EffectName as N};
use crate::selection::context::MOST;
use crate::thresholds::{AS_GOOD, FORM_LEAVES, NAMED_SHARE, TAKEN_SHARE};
use crate::validation::out_of_library::unnamed_like;
use numerics::parallel;

/// Additional share that a rival must take to replace an effect.
const SURELY: f64 = 0.01;

/// Part of what a law leaves by which a plain friction, which any rig may have, may leave more and
/// still go before it.
const PLAIN_LEAVES: f64 = 0.3;

/// An effect that was selected, and the others that could take its place.
pub(crate) struct Selected {
    pub(crate) share: Share,
    /// Best first.
    pub(crate) rivals: Vec<Share>,
    /// Residual of the best force of any form instead of it, over its own.
    pub(crate) form: f64,
    /// The share of the physics without a name that takes most instead.
    unnamed: f64,
}

impl Selected {
    /// True if it takes enough to be named and is about as large everywhere.
    pub(crate) fn is_named(&self) -> bool {
        let (share, fits) = (self.share.least(), self.share.fits());
        fits && share >= NAMED_SHARE && self.form >= FORM_LEAVES && self.unnamed < share
    }

    /// Every effect that takes nearly as much instead, itself first.
    pub(crate) fn class(&self) -> Vec<N> {
        let most = (1.0 - self.share.least()) * (1.0 + AS_GOOD);
        let near = self.rivals.iter().filter(|rival| rival.fits() && 1.0 - rival.least() <= most);
        std::iter::once(self.share.effect.name).chain(near.map(|rival| rival.effect.name)).collect()
    }
}

impl Selection<'_> {
    /// Laws that take `least` of the force error, from nothing or from what was found, whichever
    /// leaves less.
    pub(crate) fn grown(&self, least: f64, found: &[Effect]) -> Vec<Columns> {
        let first = State::new(self, Vec::new());
        let known = found
            .iter()
            .filter_map(|effect| columns(effect, &self.sights, self.context.nominal, &first.asked));
        let known: Vec<Columns> = known.take(MOST).collect();
        let taken = self.grown_from(Vec::new(), least);
        if known.is_empty() {
            return taken;
        }
        let other = self.grown_from(self.kept_of(known, least, &Share::fits), least);
        if self.left(&other) < (1.0 - SURELY) * self.left(&taken) { other } else { taken }
    }

    /// Judges laws without those that take less than `least` in addition to the rest.
    pub(crate) fn judged(&self, mut taken: Vec<Columns>, least: f64) -> Vec<Selected> {
        loop {
            let judged = self.swapped(&mut taken);
            let worst = judged.iter().min_by(|a, b| a.share.least().total_cmp(&b.share.least()));
            let Some(worst) = worst.filter(|one| judged.len() > 1 && one.share.least() < least) else {
                return judged;
            };
            let name = worst.share.effect.name;
            taken.retain(|law| law.effect.name != name);
        }
    }

    /// Geometric mean of what laws leave on folds of the fitted recordings and on held-out ones,
    /// root mean square.
    fn left(&self, laws: &[Columns]) -> f64 {
        let (fit, holdout) = State::new(self, laws.iter().collect()).left;
        (fit.sqrt() * holdout.sqrt()).sqrt()
    }

    /// The laws that take `least` in addition to the others and count, found by removing the least
    /// first.
    fn kept_of(
        &self,
        mut laws: Vec<Columns>,
        least: f64,
        counts: &(dyn Fn(&Share) -> bool + Sync),
    ) -> Vec<Columns> {
        loop {
            let part = |i: usize| {
                let others = laws.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, law)| law).collect();
                let share = State::new(self, others).share(&laws[i]).filter(counts);
                share.map_or(f64::NEG_INFINITY, |share| share.least())
            };
            let parts = parallel::map(laws.len(), part);
            let worst = parts.into_iter().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
            match worst.filter(|(_, part)| *part < least) {
                Some((i, _)) => drop(laws.remove(i)),
                None => return laws,
            }
        }
    }

    /// Adds effects one after another while the best takes `least` of the force error.
    fn grown_from(&self, mut taken: Vec<Columns>, least: f64) -> Vec<Columns> {
        while taken.len() < MOST {
            let state = State::new(self, taken.iter().collect());
            let best = state.ranked(&|_| true).into_iter().find(|(share, _)| share.fits());
            let Some((_, tried)) = best.filter(|(share, _)| share.least() >= least) else { break };
            taken.push(tried);
        }
        // What came first may have stood for two that came after it.
        self.kept_of(taken, least, &|_| true)
    }

    /// Swaps each effect once for what takes more, and judges all.
    fn swapped(&self, taken: &mut [Columns]) -> Vec<Selected> {
        let mut ranked: Vec<Option<Ranked>> = taken.iter().map(|_| None).collect();
        for i in 0..taken.len() {
            let mut place = self.in_place_of(taken, i);
            if let Some(better) = place.as_mut().and_then(|ranked| ranked.better.take()) {
                taken[i] = better;
                // The earlier ranks were with another effect in the model.
                ranked.iter_mut().for_each(|one| *one = None);
                continue;
            }
            ranked[i] = place;
        }
        let again = |(i, ranked): (usize, Option<Ranked>)| {
            let Ranked { share, rivals, .. } = ranked.or_else(|| self.in_place_of(taken, i))?;
            let form = self.form_in_place_of(taken, i, &share);
            let unnamed = self.unnamed_in_place_of(taken, i);
            Some(Selected { share, rivals, form, unnamed })
        };
        ranked.into_iter().enumerate().filter_map(again).collect()
    }

    /// True if a regression has a law of every effect.
    pub(crate) fn judges(&self, effects: &[Effect]) -> bool {
        let first = State::new(self, Vec::new());
        let nominal = self.context.nominal;
        effects.iter().all(|effect| columns(effect, &self.sights, nominal, &first.asked).is_some())
    }

    /// Root mean square that effects leave over what others leave, on folds of the fitted
    /// recordings or on held-out ones, whichever is more; none where a regression has no law of one
    /// of them.
    pub(crate) fn leaves_over(&self, effects: &[&Effect], others: &[&Effect]) -> Option<f64> {
        let first = State::new(self, Vec::new());
        let of = |effect: &&Effect| columns(effect, &self.sights, self.context.nominal, &first.asked);
        let laws = |effects: &[&Effect]| effects.iter().map(of).collect::<Option<Vec<Columns>>>();
        let left = |laws: &[Columns]| State::new(self, laws.iter().collect()).left;
        let (with, without) = (left(&laws(effects)?), left(&laws(others)?));
        let ratio = |with: f64, without: f64| (with / without.max(1e-300)).sqrt();
        Some(ratio(with.0, without.0).max(ratio(with.1, without.1)))
    }

    /// True if physics without a name takes more alone than effects take together.
    pub(crate) fn is_rather_unnamed(&self, effects: &[&Effect]) -> bool {
        let nominal = self.context.nominal;
        let first = State::new(self, Vec::new());
        let of = |effect: &Effect| columns(effect, &self.sights, nominal, &first.asked);
        let laws: Vec<Columns> = effects.iter().filter_map(|effect| of(effect)).collect();
        let together = State::new(self, laws.iter().collect()).left;
        let part = |left: f64, of: f64| 1.0 - (left / of.max(1e-300)).sqrt();
        let part = part(together.0, first.left.0).min(part(together.1, first.left.1));
        let all = unnamed_like(None, self.context);
        let shares = parallel::map_all(&all, |unnamed| first.share(&of(&unnamed.effect)?));
        shares.iter().flatten().any(|share| share.least() >= part)
    }

    /// Residual of the best force of any form instead of a law, over that of the law.
    fn form_in_place_of(&self, taken: &[Columns], i: usize, share: &Share) -> f64 {
        let others = taken.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| c).collect();
        let state = State::new(self, others);
        let sd = state.left.0.sqrt();
        let all = forms(&self.sights, self.fits, self.context.nominal, &share.effect, sd);
        let best = all.filter_map(|form| Some(state.share(&form)?.least())).fold(0.0, f64::max);
        (1.0 - best) / (1.0 - share.least()).max(1e-6)
    }

    /// The largest share that physics without a name takes in the place of a drift: a load that
    /// changes at once looks like one. Zero for other laws. Friction in proportion to the drive's
    /// force takes nearly all that any friction takes, so it says nothing here.
    fn unnamed_in_place_of(&self, taken: &[Columns], i: usize) -> f64 {
        let (nominal, effect) = (self.context.nominal, &taken[i].effect);
        if !effect.name.definition().drifts() {
            return 0.0;
        }
        let others = taken.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| c).collect();
        let state = State::new(self, others);
        let all = unnamed_like(Some(effect), self.context);
        let same: Vec<Unnamed> =
            all.into_iter().filter(|unnamed| unnamed.effect.name == effect.name).collect();
        let share =
            |unnamed: &Unnamed| state.share(&columns(&unnamed.effect, &self.sights, nominal, &state.asked)?);
        parallel::map_all(&same, share).iter().flatten().map(Share::least).fold(0.0, f64::max)
    }

    /// The share of an effect of known shape in addition to others.
    pub(crate) fn beside(&self, effect: &Effect, others: &[&Effect]) -> Option<Share> {
        let nominal = self.context.nominal;
        let first = State::new(self, Vec::new());
        let laws: Vec<Columns> =
            others.iter().filter_map(|other| columns(other, &self.sights, nominal, &first.asked)).collect();
        let state = State::new(self, laws.iter().collect());
        state.share(&columns(effect, &self.sights, nominal, &state.asked)?)
    }

    /// The force that the motion misses over the force that a law of the command takes from the
    /// recorded one, on fitted and on held-out recordings, with other effects in the model; none
    /// for an effect without such a law.
    pub(crate) fn size_of_map(&self, effect: &Effect, others: &[&Effect]) -> Option<(f64, f64)> {
        let nominal = self.context.nominal;
        let first = State::new(self, Vec::new());
        let laws: Vec<Columns> =
            others.iter().filter_map(|other| columns(other, &self.sights, nominal, &first.asked)).collect();
        let state = State::new(self, laws.iter().collect());
        Some(state.sizes(&taken_from_command(effect, &self.sights, nominal)?))
    }

    /// The share of law `i` in addition to the others, with its rivals.
    fn in_place_of(&self, taken: &[Columns], i: usize) -> Option<Ranked> {
        let others = taken.iter().enumerate().filter(|(k, _)| *k != i).map(|(_, c)| c).collect();
        let state = State::new(self, others);
        let name = taken[i].effect.name;
        let share = state.share(&taken[i])?;
        let ranked = state.ranked(&|other| other != name);
        let rivals = ranked.iter().map(|(share, _)| share.clone()).collect();
        let better = ranked.into_iter().find(|(rival, _)| goes_before(rival, &share));
        let better = better.map(|(_, columns)| columns);
        Some(Ranked { share, rivals, better })
    }
}

/// True if a rival surely takes more than a law does, or is a plain friction that takes enough by
/// itself and leaves little more.
fn goes_before(rival: &Share, law: &Share) -> bool {
    let is_plainer = is_plain(rival.effect.name) && !is_plain(law.effect.name);
    let most = (1.0 - law.least()) * (1.0 + PLAIN_LEAVES);
    let is_as_good = is_plainer && rival.least() >= TAKEN_SHARE && 1.0 - rival.least() <= most;
    rival.fits() && (is_as_good || rival.least() > law.least() + SURELY)
}

/// True for a friction that a rig may have.
fn is_plain(name: N) -> bool {
    matches!(name.definition().nominal_term(), Some(NominalTerm::Viscous | NominalTerm::Coulomb))
}

/// An effect with its rank among others.
struct Ranked {
    share: Share,
    rivals: Vec<Share>,
    /// The rival that surely takes more.
    better: Option<Columns>,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn share(name: N, part: f64) -> Share {
        let effect = Effect::shaped(name, &[]);
        Share { effect, on_fit: part, on_holdout: part, size: 1.0, at_bound: false }
    }

    #[test]
    fn a_plain_friction_goes_before_a_law_that_refines_it() {
        let law = share(N::StribeckFriction, 0.5);
        assert!(goes_before(&share(N::CoulombFriction, 0.4), &law));
        assert!(!goes_before(&share(N::CoulombFriction, 0.3), &law), "it leaves much more");
        assert!(!goes_before(&share(N::QuadraticDrag, 0.5), &law), "it is no plain friction");
        assert!(goes_before(&share(N::QuadraticDrag, 0.52), &law));
        assert!(!goes_before(&Share { size: 3.0, ..share(N::QuadraticDrag, 0.52) }, &law));
    }

    #[test]
    fn what_takes_nothing_goes_before_no_law() {
        let law = share(N::LoadDependentFriction, 0.14);
        for name in [N::CoulombFriction, N::ViscousFriction, N::MassImbalance] {
            assert!(!goes_before(&share(name, 0.0), &law), "{name}");
            assert!(!goes_before(&share(name, 0.05), &law), "{name}");
        }
        assert!(!goes_before(&share(N::MassImbalance, 0.12), &law), "gravity is no plain friction");
    }
}
