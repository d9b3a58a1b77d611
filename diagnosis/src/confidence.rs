//! How sure a name is: a logistic score of its evidence, calibrated on recordings whose truth is known.
//!
//! `prove --calibrate` finds such weights from the evidence that reports carry. The seeds that they come from may not
//! judge.

use crate::effects::EffectName as N;
use crate::pipeline::Found;
use std::collections::BTreeMap;

/// What speaks for and against a name, by key; logarithms are natural.
pub(crate) type Evidence = BTreeMap<String, f64>;

/// What the search leaves beside the effect itself.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Leftover {
    /// What hangs together over time and is not explained, as mean square over what the effects explain.
    pub(crate) of_explained: f64,
    /// Its root mean square over the force's.
    pub(crate) of_force: f64,
    /// Held-out residual of the patched model over the refit's.
    pub(crate) unexplained: f64,
}

/// Standard errors beyond which a rival is as far behind as it gets.
const SUREST: f64 = 12.0;

/// Names that physics without a name takes on most often: they bend to many shapes.
fn is_pliable(name: N) -> bool {
    matches!(name, N::PreslidingFriction | N::GainDrift)
}

/// The evidence for an effect; `rival_z` is how far the nearest rival outside its class is behind.
pub(crate) fn evidence(found: &Found, rival_z: f64, left: Leftover) -> Evidence {
    let log = |x: f64, low: f64, high: f64| x.max(low).min(high).ln();
    [
        ("rival_z", log(rival_z, 1.0, SUREST)),
        ("left_of_explained", log(left.of_explained, 0.02, 10.0)),
        ("left_of_force", log(left.of_force, 0.005, 0.3)),
        // What stands out of every stretch may be small.
        ("share_unless_certain", if found.is_certain() { 0.0 } else { log(found.share, 0.03, 1.0) }),
        ("unexplained", left.unexplained.powi(2).min(1.0)),
        ("pliable", f64::from(u8::from(is_pliable(found.effect.name)))),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

/// Score without any evidence, and the weight of each piece of it: a logistic regression on 248 names of seeds 101, 303
/// and 505 of `prove`, fifteen of them wrong, before anything was weighed twice.
const BIAS: f64 = 0.07;
const WEIGHTS: [(&str, f64); 6] = [
    ("rival_z", 0.50),
    ("left_of_explained", -0.26),
    ("left_of_force", -0.74),
    ("share_unless_certain", 0.66),
    ("unexplained", -2.20),
    ("pliable", -2.05),
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
        assert!(at("left_of_force", -1.5) < at("left_of_force", -4.0));
        assert!(at("share_unless_certain", -0.1) > at("share_unless_certain", -2.5));
        assert!(at("rival_z", 2.0) > at("rival_z", 0.5));
        assert!(at("unexplained", 0.9) < at("unexplained", 0.1));
    }
}
