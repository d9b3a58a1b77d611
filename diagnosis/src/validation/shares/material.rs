//! An effect that shares of the force error name, where other physics and not noise limits.

use crate::effects::EffectName;
use crate::thresholds::{CLAIMED, SHARE_ODDS};

/// An effect that takes a material part of the force error, on fitted and on held-out recordings,
/// ahead of its rivals.
#[derive(Clone, Debug)]
pub(crate) struct Material {
    pub(crate) name: EffectName,
    /// Part of the force error that it takes on both.
    pub(crate) share: f64,
    /// Every effect that takes nearly as much instead, itself first.
    pub(crate) class: Vec<EffectName>,
    /// True where the filter finds hardly more than noise, so that its likelihood counts.
    pub(crate) beside_noise: bool,
}

impl Material {
    /// Probability that the name or its class is right.
    pub(crate) fn confidence(&self) -> f64 {
        let score = SHARE_ODDS.0 + SHARE_ODDS.1 * self.share;
        (1.0 / (1.0 + (-score).exp())).clamp(CLAIMED.0, CLAIMED.1)
    }

    /// True if an effect is in the class of one of some.
    pub(crate) fn is_of_class(all: &[Self], name: EffectName) -> bool {
        all.iter().any(|one| one.class.contains(&name))
    }

    /// Returns the one of some that is of an effect.
    pub(crate) fn find(all: &[Self], name: EffectName) -> Option<&Self> {
        all.iter().find(|one| one.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thresholds::{NAMED, NAMED_SHARE};

    #[test]
    fn a_larger_share_is_surer_and_the_least_is_sure_enough() {
        let at = |share| {
            Material { name: EffectName::QuadraticDrag, share, class: Vec::new(), beside_noise: false }
                .confidence()
        };
        assert!(at(NAMED_SHARE) >= NAMED && at(0.5) > at(0.3) && at(0.9) < 1.0);
    }
}
