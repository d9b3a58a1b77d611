//! The law of an effect.
//!
//! Forces are in N·m or N when a plant runs and per inertia, as accelerations, when a recording is
//! fitted; a law is written once for both.

use crate::laws::joint_terms::JointTerms;
use crate::laws::shape::ShapeKey;
use crate::laws::{CommandLaw, Effect, State, Variable};

/// A law with its state. The force is the sum of coefficient times term; laws in the sensor give
/// travel instead.
pub(crate) trait ForceLaw: std::fmt::Debug + Send + Sync {
    /// Names of the terms, in the order of [`ForceLaw::terms`].
    fn names(&self) -> Vec<String>;
    /// The terms for one step; `out` has one place per name. `velocity` is zero where its sign is
    /// unknown.
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]);
    /// The part of the force that holds an axis at rest, per unit of the first coefficient, where
    /// only a part does.
    fn dry_part(&self, _state: &State) -> f64 {
        0.0
    }
    /// The same law with the same state.
    fn copy(&self) -> Box<dyn ForceLaw>;
}

/// A term of the rig's own model that is the same force as an effect: where the rig holds it, the
/// effect cannot have been left out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum NominalTerm {
    /// Friction that grows with speed.
    Viscous,
    /// Dry friction.
    Coulomb,
    /// The gravity of an off-centre mass.
    Gravity,
    /// A weight that acts through the tilt.
    Weight,
}

/// The coupling that holds a second mass.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coupling {
    /// Something stiff, a shaft or flanks that touch, which rings with the masses.
    Stiff,
    /// A grip, which lets go and does not ring.
    Grip,
}

/// The law of an effect, and the facts of physics that follow from it.
pub(crate) trait EffectLaw: Sync {
    /// Its law, where it is a force or in the sensor.
    fn law(&self, _effect: &Effect) -> Option<Box<dyn ForceLaw>> {
        None
    }

    /// Its law, where it acts on the command.
    fn command_law(&self, _effect: &Effect) -> Option<CommandLaw> {
        None
    }

    /// True if the law's terms are travel added to what the encoder reads.
    fn in_sensor(&self) -> bool {
        false
    }

    /// True if its force is dry friction, which holds an axis at rest rather than moving it.
    fn is_dry(&self) -> bool {
        false
    }

    /// True if its terms are proportional to the command.
    fn scales_drive(&self) -> bool {
        false
    }

    /// True if its coefficients in a rig are parts of the gain rather than forces.
    fn is_relative_to_gain(&self) -> bool {
        self.scales_drive()
    }

    /// True if each recording has its own phase, so that coefficients are not shared.
    fn has_own_phase(&self) -> bool {
        false
    }

    /// Returns the coupling of a second mass, where the law has one: such a law is faster than a
    /// block.
    fn coupling(&self) -> Option<Coupling> {
        None
    }

    /// The term of the rig that is the same force.
    fn nominal_term(&self) -> Option<NominalTerm> {
        None
    }

    /// True if its law reads the command in addition to the motion.
    fn reads_command(&self, _effect: &Effect) -> bool {
        false
    }

    /// True if it changes with the time of the recording.
    fn drifts(&self) -> bool {
        false
    }

    /// True if its law is of the travel as far as that was fitted, and says nothing beyond.
    fn follows_travel(&self) -> bool {
        false
    }

    /// True if its one term is the jumps of each recording's readings, which are found before any
    /// effect is: each of its moments is decided by itself.
    fn is_of_jumps(&self) -> bool {
        false
    }

    /// Puts jumps that were found into an effect that is of them: times, s, and how far the reading
    /// jumps, rad or m.
    fn put_jumps(&self, _effect: &mut Effect, _jumps: &[(f64, f64)]) {}

    /// Returns the keys of its shape, in groups.
    fn shape_keys(&self) -> &'static [&'static [ShapeKey]] {
        &[]
    }

    /// Adds the effect to a joint and its motor, as other simulators have them; whether those can
    /// say it.
    fn add_to_joint(&self, _effect: &Effect, _joint: &mut JointTerms) -> bool {
        false
    }

    /// The variable that its force is a function of, where there is one alone.
    fn depends_on(&self) -> Option<Variable> {
        None
    }

    /// True if it may act as a constant force as long as the axis moves: then each recording's own
    /// bias, and a disturbance that wanders, takes nearly all of it.
    fn may_be_constant(&self) -> bool {
        false
    }
}
