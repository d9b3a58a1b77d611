//! Torque periodic in the angle, independent of the command: teeth and poles, or a screw. Its
//! orders are sought in the residual.

use super::definition::{EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, Reported, Span};
use super::joint_terms::{JointTerms, Wave};
use super::shape::ShapeKey;
use super::waves::{self, Waves};
use super::{Effect, EffectName, Variable};

pub(super) struct Cogging;

impl EffectLaw for Cogging {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(Waves::new(effect, false)))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[waves::KEYS]
    }
    fn has_own_phase(&self) -> bool {
        true
    }
    fn add_to_joint(&self, effect: &Effect, joint: &mut JointTerms) -> bool {
        joint.waves.extend(effect.waves().into_iter().map(|(name, wave)| {
            let [cos, sin] = ["cos", "sin"].map(|part| effect.coefficient(&format!("{part}_{name}")));
            Wave { amplitude: cos.hypot(sin), wave, phase: cos.atan2(sin) }
        }));
        true
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Angle)
    }
}

impl EffectSearch for Cogging {
    fn is_periodic(&self) -> bool {
        true
    }
    fn grid(&self, _name: EffectName, _span: &Span) -> Vec<Effect> {
        Vec::new()
    }
    fn freedom(&self, effect: &Effect, recordings: usize) -> usize {
        waves::freedom(effect, recordings)
    }
    fn is_of_orders(&self, orders: &[f64]) -> bool {
        // Once per turn and nothing else is an off-centre mass.
        orders.iter().any(|order| *order != 1.0)
    }
}

impl EffectReport for Cogging {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        waves::report(fitted, false)
    }
    fn variable(&self) -> &'static str {
        "angle"
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        (other == EffectName::TorqueRipple).then_some(
            "slow turns with a small and with a large constant load: ripple grows with the command, cogging does not",
        )
    }
}
