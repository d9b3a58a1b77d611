//! The criteria that the evidence for an effect must meet for it to be named. Nothing here fits or
//! chooses between effects.

use crate::decide::rejection::Rejection;
use crate::decide::thresholds::{
    CERTAIN_Z, FAIR_SHARE, HALF_OF_FORCE, HARDLY_ANOTHER_SIZE, HARMLESS, LEAST_SHARE, MATERIAL, MOST_SHARE,
    NEARLY_ALL_SHARE, PROMISING_Z, SAME_SIZE, SHARE, SURE_Z, UNLIKELY_Z, UNSURE_SHARE, WORSE_Z,
};
use crate::evidence::effect_evidence::{self, EffectEvidence};
use crate::evidence::holdout_set::HoldoutSet;
use crate::fit::filter::Noise;
use crate::propose::context::{FitContext, FittedModel};
use numerics::bootstrap::Gain;
use std::ops::Range;

/// Gathers the evidence for each effect of a model; the score of those that may not be named
/// without it.
pub(crate) fn gather_evidence(
    context: &FitContext,
    last: &FittedModel,
    slow: &Noise,
    holdout: &HoldoutSet,
) -> Vec<EffectEvidence> {
    effect_evidence::gather_evidence(context, last, slow, holdout, |found| found.rejection().is_some())
}

impl EffectEvidence {
    /// True if its score is sure, however few moments it acts in. Presliding models pass this test
    /// on null data, so they are excluded.
    fn predicts(&self) -> bool {
        !self.effect.name.definition().bends_at_reversals() && self.score_z >= SURE_Z
    }

    /// True if its gain is certain on every stretch of the held-out recordings and on the fitted
    /// ones, however little it explains compared with larger effects.
    pub(crate) fn is_certain(&self) -> bool {
        self.steadiest_z() >= CERTAIN_Z
    }

    /// Standard errors of its gain, over every stretch of the held-out recordings, or on the fitted
    /// ones, whichever are fewer.
    fn steadiest_z(&self) -> f64 {
        self.holdout.z.min(self.holdout.clipped_z).min(self.fit.z.max(self.fit.clipped_z))
    }

    /// Standard errors of its gain on fitted or on held-out recordings, whichever are fewer.
    pub(crate) fn least_z(&self) -> f64 {
        let over_time = self.holdout.z.max(self.holdout.clipped_z).min(self.fit.z.max(self.fit.clipped_z));
        if self.predicts() { over_time.max(self.score_z) } else { over_time }
    }

    /// True if its gain is sure on fitted and on held-out recordings, with or without a limit on
    /// what a stretch counts.
    fn stands_out(&self) -> bool {
        self.least_z() >= CERTAIN_Z
    }

    /// True if it generalises to the held-out recordings: by likelihood, or, where it is most of
    /// what was left out, by the force that it leaves and the same size as on the fitted ones. Next
    /// to reversals a law of slightly another form may be less likely at many blocks and yet leave
    /// a third of the force.
    fn generalises(&self) -> bool {
        let likely = self.holdout.low > 0.0
            && self.holdout.z.max(self.holdout.clipped_z) >= UNLIKELY_Z
            && (self.least_z() >= SURE_Z || self.share >= UNSURE_SHARE || self.comes_in_events());
        let takes_most = self.force.low > 0.0 && self.share >= MOST_SHARE;
        let takes_all = self.takes_all() && self.holdout.sum > 0.0;
        let least = if takes_all { PROMISING_Z } else { SURE_Z };
        likely
            || (self.is_same_size() && (takes_most || takes_all) && self.fit.z >= least)
            || self.agrees_everywhere()
            || self.predicts()
    }

    /// True if each of its moments is decided by itself: no bias that wanders looks like a reading
    /// that jumps.
    fn comes_in_events(&self) -> bool {
        self.effect.name.definition().is_of_jumps()
    }

    /// True if (share ≥ 0.9 and sizes within 0.75–1.33) or (share ≥ 0.5 and sizes within
    /// 0.85–1.18), with no significant loss anywhere on held-out recordings.
    fn agrees_everywhere(&self) -> bool {
        let harms_nowhere = |gain: &Gain| gain.sum > 0.0 && gain.low >= -HARMLESS * gain.sum;
        let is_nearly_all = self.share >= NEARLY_ALL_SHARE && self.is_same_size();
        let is_most = self.share >= MOST_SHARE && self.has_sizes_in(&HARDLY_ANOTHER_SIZE);
        (is_nearly_all || is_most) && harms_nowhere(&self.holdout) && harms_nowhere(&self.force)
    }

    fn has_sizes_in(&self, range: &Range<f64>) -> bool {
        !self.sizes.is_empty() && self.sizes.iter().all(|size| range.contains(size))
    }

    fn is_same_size(&self) -> bool {
        self.has_sizes_in(&SAME_SIZE)
    }

    /// True if it takes most of the residual, surely, and as much of it everywhere: counts are lost
    /// now and then.
    fn recurs(&self) -> bool {
        self.is_same_size() && self.share >= MOST_SHARE && self.holdout.low > 0.0 && self.force.low > 0.0
    }

    /// True if it takes most of what the others leave, surely, however much they explain.
    fn takes_most_of_the_rest(&self) -> bool {
        self.is_same_size() && self.force.sum >= HALF_OF_FORCE && self.force.low > 0.0
    }

    fn takes_all(&self) -> bool {
        self.force.sum >= HALF_OF_FORCE && self.share >= NEARLY_ALL_SHARE
    }

    /// True if it leaves hardly anything and has the same size on every recording: its law is
    /// right, not only nearly right.
    pub(crate) fn fits_everywhere(&self) -> bool {
        self.takes_all() && self.is_same_size()
    }

    /// True if it may generalise together with another effect of the same size: sure on the fitted
    /// recordings, and not surely worse than nothing on the others.
    pub(crate) fn is_provisional(&self) -> bool {
        self.fit.z >= PROMISING_Z && self.holdout.z > WORSE_Z && self.share >= SHARE
    }

    /// The requirement of a sure gain on every recording that it does not meet, the first of them.
    fn unsure(&self) -> Rejection {
        let (fit, holdout) = (self.fit.z.max(self.fit.clipped_z), self.holdout.z.max(self.holdout.clipped_z));
        if self.holdout.sum <= 0.0 {
            Rejection::LessLikely { nats: -self.holdout.sum }
        } else if holdout < UNLIKELY_Z {
            Rejection::UnlikelyGain { z: holdout }
        } else if self.holdout.low <= 0.0 {
            Rejection::MayGainNothing { gain: self.holdout }
        } else {
            Rejection::NotSure { fit_z: fit, holdout_z: holdout, share: self.share }
        }
    }

    /// The requirement on its share that it does not meet, if there is one.
    fn too_small(&self) -> Option<Rejection> {
        let share = self.share;
        // Beside a much larger effect the share of what the refit leaves is small.
        if !self.takes_most_of_the_rest() {
            if share < LEAST_SHARE {
                return Some(Rejection::TooSmall { share });
            }
            if share < SHARE && !self.is_certain() {
                return Some(Rejection::SmallAndUnsure { share, least: SHARE, z: self.steadiest_z() });
            }
        }
        (share < FAIR_SHARE && !self.stands_out()).then(|| Rejection::SmallAndUnsure {
            share,
            least: FAIR_SHARE,
            z: self.least_z(),
        })
    }

    /// Returns why the simulation is right without an effect, however sure it is; none if it is
    /// not.
    pub(crate) fn immaterial(&self) -> Option<Rejection> {
        let part = self.off_force;
        (part < MATERIAL).then_some(Rejection::Immaterial { part })
    }

    /// Returns why an effect may not be named: the first requirement that it does not meet; none if
    /// it meets all.
    pub(crate) fn rejection(&self) -> Option<Rejection> {
        self.unsure_gain().or_else(|| self.doubtful_law())
    }

    /// The same of evidence that the search gathers on fitted recordings alone.
    pub(crate) fn rejection_in_search(&self) -> Option<Rejection> {
        let z = |gain: &Gain| gain.z.max(gain.clipped_z);
        let (fit_z, filter_z, share) = (z(&self.fit), z(&self.holdout), self.share);
        let unsure = self.unsure_gain().map(|_| Rejection::NotSureInSearch { fit_z, filter_z, share });
        unsure.or_else(|| self.doubtful_law())
    }

    /// The requirement on its gain that it does not meet, if there is one.
    fn unsure_gain(&self) -> Option<Rejection> {
        if !self.generalises() {
            return Some(self.unsure());
        }
        let on_fit = self.fit.z.max(self.fit.clipped_z);
        let rare = on_fit < UNLIKELY_Z && self.holdout.z < SURE_Z;
        (rare && !self.recurs() && !self.agrees_everywhere() && !self.predicts())
            .then_some(Rejection::FewMoments { fit_z: on_fit, holdout_z: self.holdout.z })
    }

    /// The requirement on its share, waves or values that it does not meet, if there is one.
    fn doubtful_law(&self) -> Option<Rejection> {
        self.too_small()
            .or_else(|| (!self.is_comb).then_some(Rejection::NotPeriodic))
            .or_else(|| self.at_bound.then_some(Rejection::AtLimit))
    }
}

#[cfg(test)]
mod tests;
