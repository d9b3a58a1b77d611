//! Effects that cannot both be named, or that another cause explains together.

use crate::decide::thresholds::{ALIKE, BRISTLES, DOMINANT, MISTAKEN, MORE_THAN_SWING};
use crate::evidence::tonal::TonalDisturbance;
use crate::laws::definition::Span;
use crate::laws::{Effect, EffectName};

/// The effect that explains more of the joint between motor and load, where both are of it: what
/// the law of one leaves next to reversals the other takes. Effects with what they gain.
pub(super) fn same_joint(
    (name, gain): (EffectName, f64),
    mut all: impl Iterator<Item = (EffectName, f64)>,
) -> Option<EffectName> {
    let of_joint = |name: EffectName| name.definition().coupling().is_some();
    let more = |(other, theirs): &(EffectName, f64)| of_joint(*other) && *theirs > gain;
    all.find(more).filter(|_| of_joint(name)).map(|(other, _)| other)
}

/// True if gain and friction change by the same part: over an inertia that changes, both do.
pub(super) fn are_alike(gain: f64, friction: f64) -> bool {
    let ratio = friction / gain;
    ratio < ALIKE && ratio * ALIKE > 1.0
}

/// Part of the travel over which an effect gives way after a reversal, where that is more than
/// bristles do: such a spring creeps.
pub(super) fn creeps(effect: &Effect, span: &Span) -> Option<f64> {
    let part = effect.name.definition().gives_way_over(effect)? / span.travel();
    (part > BRISTLES).then_some(part)
}

/// True if the effects found explain a swing and little else.
pub(super) fn is_mistaken(swing: &TonalDisturbance) -> bool {
    swing.taken > MISTAKEN && swing.taken_beside < MORE_THAN_SWING
}

/// True if a swing is what was left out.
pub(super) fn is_left_out(swing: &TonalDisturbance) -> bool {
    swing.part > DOMINANT || is_mistaken(swing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gain_and_friction_drifting_alike_are_an_inertias_drift() {
        assert!(are_alike(-0.137, -0.137) && are_alike(-0.35, -0.5) && are_alike(0.2, 0.16));
        assert!(!are_alike(-0.1, -0.5) && !are_alike(-0.3, -0.1) && !are_alike(-0.2, 0.2));
    }

    #[test]
    fn a_joint_has_one_name() {
        let all = [
            (EffectName::DriveCompliance, 40.0),
            (EffectName::Backlash, 900.0),
            (EffectName::Cogging, 5000.0),
        ];
        let joint = |of: usize| same_joint(all[of], all.into_iter());
        assert_eq!(joint(0), Some(EffectName::Backlash));
        assert_eq!(joint(1), None, "the one that explains most keeps its name");
        assert_eq!(joint(2), None, "cogging is no joint");
    }
}
