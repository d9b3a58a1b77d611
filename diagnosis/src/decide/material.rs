//! The effects that the regression names, where other physics and not noise limits.

use crate::decide::thresholds::{
    CLAIMED, FOLLOWS_SHARE, MOST_IN_CLASS, NAMED_SHARE, NEAR_LEAD_Z, NEAR_SHARE, SHARE_ODDS, SIZES_AGREE,
    TAKEN_Z, UNLIKELY_Z,
};
use crate::laws::EffectName;
use crate::propose::context::MOST_EFFECTS;
use regression::{HeldOut, Hypothesis};

/// An effect that takes a material part of the force error, on fitted and on held-out recordings,
/// ahead of its rivals.
#[derive(Clone, Debug)]
pub(crate) struct SelectedByShare {
    pub(crate) name: EffectName,
    /// Part of the force error that it takes on both.
    pub(crate) share: f64,
    /// Every effect that takes nearly as much instead, itself first.
    pub(crate) class: Vec<EffectName>,
}

impl SelectedByShare {
    /// Probability that the name or its class is right.
    pub(crate) fn confidence(&self) -> f64 {
        let score = SHARE_ODDS.0 + SHARE_ODDS.1 * self.share;
        (1.0 / (1.0 + (-score).exp())).clamp(CLAIMED.0, CLAIMED.1)
    }

    /// Returns the one of some that is of an effect.
    pub(crate) fn find(all: &[Self], name: EffectName) -> Option<&Self> {
        all.iter().find(|one| one.name == name)
    }
}

/// The effects that a regression's rounds name, the first first. A round whose first law is refused
/// stops nothing: the order is of the fitted recordings, and the held-out ones only refuse.
pub(crate) fn named(rounds: &[Vec<Hypothesis>]) -> Vec<SelectedByShare> {
    rounds.iter().filter_map(|round| material(round)).take(MOST_EFFECTS).collect()
}

/// The effect that takes most of the force error where none is named, and its share; none where the
/// error depends on nothing that was recorded.
pub(crate) fn follows(rounds: &[Vec<Hypothesis>]) -> Option<(EffectName, f64)> {
    let first = rounds.first()?.first().filter(|one| one.valid)?;
    let (e, held) = (&first.evidence, first.evidence.held_out?);
    let share = held.share.min(e.share);
    (share >= FOLLOWS_SHARE && held.z.min(e.z) >= UNLIKELY_Z)
        .then(|| Some((EffectName::find(first.law.key)?, share)))?
}

/// The first law of a round with those that the recordings hardly tell from it; none where it may
/// not be named.
fn material(round: &[Hypothesis]) -> Option<SelectedByShare> {
    let (first, others) = round.split_first()?;
    let (e, HeldOut { share, z, size_agreement }) = (&first.evidence, first.evidence.held_out?);
    let least = share.min(e.share);
    let is_named = first.valid
        && least >= NAMED_SHARE
        && z.min(e.z) >= TAKEN_Z
        && size_agreement.min(e.size_agreement) >= SIZES_AGREE;
    let is_near = |rival: &&Hypothesis| {
        rival.valid && rival.evidence.share >= NEAR_SHARE * e.share && rival.evidence.lead_z > -NEAR_LEAD_Z
    };
    let near = others.iter().filter(is_near).take(MOST_IN_CLASS - 1);
    let class = [first].into_iter().chain(near).filter_map(|one| EffectName::find(one.law.key)).collect();
    let name = EffectName::find(first.law.key)?;
    is_named.then_some(SelectedByShare { name, share: least, class })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::decide::thresholds::NAMED;
    use regression::{Evidence, laws};

    /// A law that takes these shares of the fit and of the held-out recordings.
    fn law(name: &str, share: f64, held_out: f64) -> Hypothesis {
        let evidence = Evidence {
            share,
            z: 5.0,
            size_agreement: 0.9,
            lead_z: if share < 0.5 { -1.0 } else { 3.0 },
            free_form_more: 0.0,
            residual_over_noise: 10.0,
            rows: 1000.0,
            held_out: Some(HeldOut { share: held_out, z: 5.0, size_agreement: 0.9 }),
        };
        let law = laws::library().find(|law| law.key == name).expect("a law of the library");
        Hypothesis { law, shapes: Vec::new(), coefficients: vec![1.0], valid: true, evidence }
    }

    fn names(rounds: &[Vec<Hypothesis>]) -> Vec<EffectName> {
        named(rounds).into_iter().map(|one| one.name).collect()
    }

    #[test]
    fn held_out_recordings_refuse_and_never_choose() {
        let better_held_out = vec![law("quadratic_drag", 0.5, 0.2), law("stribeck_friction", 0.3, 0.9)];
        assert_eq!(names(&[better_held_out]), [EffectName::QuadraticDrag]);
        let refused = vec![law("quadratic_drag", 0.5, 0.1), law("stribeck_friction", 0.3, 0.9)];
        let next = vec![law("cogging", 0.3, 0.3)];
        assert_eq!(names(&[refused, next]), [EffectName::Cogging], "a rival takes no refused one's place");
    }

    #[test]
    fn a_law_needs_a_sign_a_sure_gain_and_one_size() {
        let change = |change: fn(&mut Hypothesis)| {
            let mut one = law("command_delay", 0.4, 0.4);
            change(&mut one);
            names(&[vec![one]])
        };
        assert_eq!(change(|_| ()), [EffectName::CommandDelay]);
        assert!(change(|one| one.valid = false).is_empty());
        assert!(change(|one| one.evidence.z = 0.5).is_empty());
        assert!(change(|one| one.evidence.size_agreement = 0.3).is_empty());
        assert!(change(|one| one.evidence.held_out = None).is_empty(), "nothing was held out");
    }

    #[test]
    fn laws_that_take_nearly_as_much_share_a_class() {
        let round = |second: f64| {
            let all = [law("command_delay", 0.49, 0.5), law("electrical_lag", second, 0.0)];
            named(&[all.to_vec()]).remove(0).class
        };
        assert_eq!(round(0.45), [EffectName::CommandDelay, EffectName::ElectricalLag]);
        assert_eq!(round(0.3), [EffectName::CommandDelay]);
    }

    #[test]
    fn the_least_share_is_sure_enough_and_a_larger_one_surer() {
        let confidence_at = |share| {
            SelectedByShare { name: EffectName::QuadraticDrag, share, class: Vec::new() }.confidence()
        };
        assert!(
            confidence_at(NAMED_SHARE) >= NAMED
                && confidence_at(0.5) > confidence_at(0.3)
                && confidence_at(0.9) < 1.0
        );
    }
}
