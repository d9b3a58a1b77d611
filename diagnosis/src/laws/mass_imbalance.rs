//! Gravity on an off-centre mass: once per turn of the axis, or of the motor.

use super::definition::{
    EffectLaw, EffectReport, EffectSearch, Fitted, ForceLaw, NominalTerm, Plain, Reported, Span,
};
use super::shape::ShapeKey;
use super::waves::{self, Waves};
use super::{Effect, EffectName, Variable};

/// Part of a turn of the motor over which once a turn is distinguished from a slope, and of the
/// axis over which gravity bends from a spring's straight line.
pub(super) const LEAST_TURNS: f64 = 0.6;
const LEAST_OF_AXIS: f64 = 0.15;

pub(super) fn once_a_turn(name: EffectName, turn: f64) -> Effect {
    Effect::shaped(name, &[("turn", turn), ("order_1", 1.0)])
}

pub(super) struct MassImbalance;

impl EffectLaw for MassImbalance {
    fn law(&self, effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        Some(Box::new(Waves::new(effect, false)))
    }
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[waves::KEYS]
    }
    fn has_own_phase(&self) -> bool {
        true
    }
    fn nominal_term(&self) -> Option<NominalTerm> {
        Some(NominalTerm::Gravity)
    }
    fn depends_on(&self) -> Option<Variable> {
        Some(Variable::Angle)
    }
}

impl EffectSearch for MassImbalance {
    fn grid(&self, name: EffectName, span: &Span) -> Vec<Effect> {
        if span.rig.has_gravity {
            // It is the gravity of that very mass.
            return Vec::new();
        }
        let axis = span.rig.axis_turn;
        let motor = span.rig.turn.filter(|turn| axis.is_none_or(|axis| (turn / axis - 1.0).abs() > 1e-6));
        let axis = axis.filter(|turn| span.travel() > LEAST_OF_AXIS * turn);
        let motor = motor.filter(|turn| span.travel() > LEAST_TURNS * turn);
        axis.into_iter().chain(motor).map(|turn| once_a_turn(name, turn)).collect()
    }
    fn freedom(&self, effect: &Effect, recordings: usize) -> usize {
        waves::freedom(effect, recordings)
    }
    fn plain(&self, _effect: &Effect) -> Option<Plain> {
        Some(Plain { rank: 3, has_twin: true })
    }
}

impl EffectReport for MassImbalance {
    fn report(&self, fitted: &Fitted) -> Vec<Reported> {
        vec![Reported::new("amplitude", fitted.scaled(waves::amplitude(fitted)), fitted.force)]
    }
    fn variable(&self) -> &'static str {
        "angle"
    }
    fn experiment(&self, other: EffectName) -> Option<&'static str> {
        match other {
            EffectName::EncoderEccentricity => Some(
                "the same turns at a low and at a high constant speed: the error of an eccentric encoder grows with the square of speed, gravity does not",
            ),
            EffectName::PositionSpring => Some(
                "many turns in one direction at two tilts: gravity repeats every turn, a spring grows with travel",
            ),
            EffectName::Cogging => {
                Some("slow turns at two tilts of the axis: gravity changes with tilt, cogging does not")
            }
            _ => None,
        }
    }
}
