//! The confidence in a name: a logistic score of its evidence, calibrated on recordings whose truth
//! is known.
//!
//! `prove --calibrate` finds such weights from the evidence that reports carry. The seeds that they
//! come from may not judge.

use crate::data::schema::Simulation;
use crate::decide::rejection::Weakness;
use crate::decide::thresholds::{
    BIAS, CERTAIN_SHARE, CLAIMED, COUNTED_SHARE, LEFT_OF_FORCE, NAMED, SUREST_Z, UNLIKELY_Z, WEIGHTS,
    WORSE_MOTION,
};
use crate::evidence::effect_evidence::EffectEvidence;
use std::collections::BTreeMap;

/// The evidence for and against a name, by key; logarithms are natural.
pub(crate) type Evidence = BTreeMap<String, f64>;

/// The residual that the search leaves with the effect in the model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ResidualEvidence {
    /// Root mean square of what hangs together over time and is not explained, over the force's.
    pub(crate) of_force: f64,
    /// Mean square that the patched model leaves over the refit's, both above what counting and a
    /// white disturbance make, on fitted or on held-out recordings, whichever is less: if the
    /// residual of a model with an effect hangs together, the law is wrong or there is another
    /// effect.
    pub(crate) unexplained: f64,
}

/// The evidence for an effect.
pub(crate) fn evidence(found: &EffectEvidence, left: ResidualEvidence) -> Evidence {
    let log = |x: f64, low: f64, high: f64| x.max(low).min(high).ln();
    let least_share = if found.is_certain() { CERTAIN_SHARE } else { COUNTED_SHARE };
    let unexplained = left.unexplained.min(1.0 - found.share).max(0.0);
    // A residual that is hardly more than nothing, compared with the force, says little.
    let of_force = log(left.of_force / LEFT_OF_FORCE.0, 1.0, LEFT_OF_FORCE.1 / LEFT_OF_FORCE.0);
    let share = log(found.share, least_share, 1.0);
    let bends = found.effect.name.definition().bends_at_reversals();
    [
        ("least_z", log(found.least_z(), UNLIKELY_Z, SUREST_Z)),
        ("share", share),
        ("unexplained", unexplained),
        ("unexplained_of_force", unexplained * of_force),
        // What bends to the little that any model leaves next to reversals must take more of it.
        ("share_of_bristles", if bends { share } else { 0.0 }),
    ]
    .map(|(key, value)| (key.to_owned(), value))
    .into()
}

/// Returns how much each piece of evidence lowers the score, relative to an effect that is certain,
/// explains everything and leaves nothing.
fn takes(evidence: &Evidence) -> impl Iterator<Item = (&'static str, f64)> {
    let best = |key: &str| if key == "least_z" { SUREST_Z.ln() } else { 0.0 };
    WEIGHTS.iter().map(move |(key, weight)| (*key, weight * (best(key) - evidence[*key])))
}

/// Probability that the name or its class is right.
pub(crate) fn confidence(evidence: &Evidence) -> f64 {
    let score: f64 = WEIGHTS.iter().map(|(key, weight)| weight * evidence[*key]).sum();
    (1.0 / (1.0 + (-(BIAS + score)).exp())).clamp(CLAIMED.0, CLAIMED.1)
}

/// Lowers the confidence of a name whose simulation follows the motion less well in short windows
/// than the simulation without it, but never below the naming limit.
pub(crate) fn with_worse_motion(confidence: f64) -> f64 {
    let odds = confidence / (1.0 - confidence) * (-WORSE_MOTION.0).exp();
    (odds / (1.0 + odds)).max(confidence.min(NAMED))
}

/// Returns the piece of evidence that lowers the probability most.
pub(crate) fn weakness(evidence: &Evidence) -> Weakness {
    match takes(evidence).max_by(|a, b| a.1.total_cmp(&b.1)).map_or("", |(key, _)| key) {
        "least_z" => Weakness::UnsureGain { z: evidence["least_z"].exp() },
        "share" | "share_of_bristles" => Weakness::SmallShare { share: evidence["share"].exp() },
        _ => Weakness::Unexplained { part: evidence["unexplained"] },
    }
}

/// True if the patched simulation follows the motion less well than the refitted one in windows of
/// half a second or less, in the geometric mean over their lengths: a wrong starting speed may
/// spoil the shortest windows of the better simulation.
pub(crate) fn follows_worse(simulation: &Simulation) -> bool {
    let short = simulation.windows.iter().filter(|w| w.seconds <= 0.5);
    let both = short.filter_map(|w| w.position.patched.zip(w.position.refit));
    let ratios: Vec<f64> = both.map(|(patched, refit)| (patched / refit).ln()).collect();
    !ratios.is_empty() && ratios.iter().sum::<f64>() / ratios.len() as f64 > WORSE_MOTION.1.ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::schema::{ByModel, WindowsOff};

    fn evidence(change: &[(&str, f64)]) -> Evidence {
        let mut all: Evidence = WEIGHTS.iter().map(|(key, _)| ((*key).to_owned(), 0.0)).collect();
        for (key, value) in change {
            assert!(all.insert((*key).to_owned(), *value).is_some(), "{key} is weighed");
        }
        all
    }

    #[test]
    fn the_weakness_is_what_takes_most_from_the_probability() {
        let sure = ("least_z", SUREST_Z.ln());
        let weakest = |change: &[(&str, f64)]| weakness(&evidence(&[&[sure], change].concat()));
        let near = |a: f64, b: f64| (a - b).abs() < 1e-12;
        let unsure = weakest(&[("least_z", 2.5_f64.ln())]);
        assert!(matches!(unsure, Weakness::UnsureGain { z } if near(z, 2.5)), "{unsure:?}");
        let small = weakest(&[("share", 0.04_f64.ln())]);
        assert!(matches!(small, Weakness::SmallShare { share } if near(share, 0.04)), "{small:?}");
        let left = weakest(&[("unexplained", 0.6), ("unexplained_of_force", 1.8)]);
        assert_eq!(left, Weakness::Unexplained { part: 0.6 });
    }

    #[test]
    fn a_worse_motion_makes_a_name_less_sure_and_takes_none() {
        let [sure, hardly, unnamed] = [0.97, 0.7, 0.5].map(with_worse_motion);
        assert!((0.9..0.95).contains(&sure), "{sure}");
        assert!(hardly == NAMED && unnamed == 0.5, "{hardly} {unnamed}");
    }

    #[test]
    fn more_left_over_is_less_sure_and_more_explained_is_surer() {
        let confidence_at = |key: &str, value: f64| confidence(&evidence(&[(key, value)]));
        assert!(confidence_at("unexplained_of_force", 2.0) < confidence_at("unexplained_of_force", 0.1));
        assert!(confidence_at("share", -0.1) > confidence_at("share", -2.5));
        assert!(confidence_at("least_z", 2.0) > confidence_at("least_z", 0.7));
        assert!(confidence_at("unexplained", 0.9) < confidence_at("unexplained", 0.1));
    }

    #[test]
    fn a_simulation_follows_worse_if_it_does_over_all_short_windows() {
        let windows = |off: [(f64, f64); 3]| Simulation {
            windows: [0.1, 0.5, 2.0]
                .into_iter()
                .zip(off)
                .map(|(seconds, (refit, patched))| WindowsOff {
                    seconds,
                    position: ByModel { nominal: None, refit: Some(refit), patched: Some(patched) },
                })
                .collect(),
            ..Simulation::default()
        };
        assert!(follows_worse(&windows([(1.0, 1.2), (1.0, 1.0), (1.0, 0.1)])), "long windows do not count");
        assert!(
            !follows_worse(&windows([(1.0, 1.1), (1.0, 0.4), (1.0, 1.0)])),
            "much better over half a second"
        );
        assert!(!follows_worse(&Simulation::default()), "nothing was run");
    }
}
