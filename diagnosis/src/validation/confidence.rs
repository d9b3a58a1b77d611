//! How sure a name is: a logistic score of its evidence, calibrated on recordings whose truth is known.
//!
//! `prove --calibrate` finds such weights from the evidence that reports carry. The seeds that they come from may not
//! judge.

use crate::effects::EffectName as N;
use crate::validation::evidence::EffectEvidence;
use std::collections::BTreeMap;

/// What speaks for and against a name, by key; logarithms are natural.
pub(crate) type Evidence = BTreeMap<String, f64>;

/// What the search leaves beside the effect itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leftover {
    /// Root mean square of what hangs together over time and is not explained, over the force's.
    pub(crate) of_force: f64,
    /// Mean square that the patched model leaves over the refit's, both above what counting and a white disturbance make, on
    /// fitted or on held-out recordings, whichever is less: what hangs together beside an effect is its wrong law, or another
    /// effect.
    pub(crate) unexplained: f64,
}

/// Standard errors beyond which a gain is as sure as it gets.
const SUREST: f64 = 20.0;
/// Parts of the force: less is hardly anything left, more is as bad as it gets.
const LITTLE: f64 = 0.005;
const MUCH: f64 = 0.3;
/// Least part that what stands out of every stretch counts with: it may be small beside larger effects.
const CERTAIN_SHARE: f64 = 0.15;

/// The evidence for an effect.
pub(crate) fn evidence(found: &EffectEvidence, left: Leftover) -> Evidence {
    let log = |x: f64, low: f64, high: f64| x.max(low).min(high).ln();
    let least_share = if found.is_certain() { CERTAIN_SHARE } else { 0.03 };
    let unexplained = left.unexplained.min(1.0 - found.share).max(0.0);
    // What is left and is hardly more than nothing beside the force says little.
    let of_force = log(left.of_force / LITTLE, 1.0, MUCH / LITTLE);
    let share = log(found.share, least_share, 1.0);
    [
        ("least_z", log(found.least_z(), 2.0, SUREST)),
        ("share", share),
        ("unexplained", unexplained),
        ("unexplained_of_force", unexplained * of_force),
        // They bend to the little that any model leaves next to reversals.
        ("share_of_bristles", if found.effect.name == N::PreslidingFriction { share } else { 0.0 }),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

/// Score without any evidence, and the weight of each piece of it: a logistic regression, rounded towards doubt, on 728 names
/// of seeds 14 and 16 (whole), 13 and 1701 to 1703 (one effect, nulls), 13 and 505 (pairs) and 1501, 1601, 1711 and 1712
/// (physics without a name), 22 of them wrong.
const BIAS: f64 = 2.0;
const WEIGHTS: [(&str, f64); 5] = [
    ("least_z", 1.4),
    ("share", 0.8),
    ("unexplained", -1.0),
    ("unexplained_of_force", -3.4),
    ("share_of_bristles", 2.0),
];

/// Least and most that is ever claimed.
const CLAIMED: (f64, f64) = (0.01, 0.99);

/// Probability that the name or its class is right.
pub(crate) fn confidence(evidence: &Evidence) -> f64 {
    let score: f64 = WEIGHTS.iter().map(|(key, weight)| weight * evidence[*key]).sum();
    (1.0 / (1.0 + (-(BIAS + score)).exp())).clamp(CLAIMED.0, CLAIMED.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn evidence(change: &[(&str, f64)]) -> Evidence {
        let mut all: Evidence = WEIGHTS.iter().map(|(key, _)| ((*key).to_owned(), 0.0)).collect();
        for (key, value) in change {
            assert!(all.insert((*key).to_owned(), *value).is_some(), "{key} is weighed");
        }
        all
    }

    #[test]
    fn more_left_over_is_less_sure_and_more_explained_is_surer() {
        let at = |key: &str, value: f64| confidence(&evidence(&[(key, value)]));
        assert!(at("unexplained_of_force", 2.0) < at("unexplained_of_force", 0.1));
        assert!(at("share", -0.1) > at("share", -2.5));
        assert!(at("least_z", 2.0) > at("least_z", 0.7));
        assert!(at("unexplained", 0.9) < at("unexplained", 0.1));
    }
}
