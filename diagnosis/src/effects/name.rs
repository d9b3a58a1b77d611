//! The names of the effects and the subsystems they belong to, as reports use them.

use serde::{Deserialize, Serialize};
use std::fmt;

/// Where an effect sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Subsystem {
    Transmission,
    Actuator,
    Load,
    Sensor,
}

macro_rules! names {
    ($($variant:ident $text:literal $subsystem:ident $plain:literal;)*) => {
        /// The effects, by the name that the report uses.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        #[allow(missing_docs)]
        pub enum EffectName { $($variant,)* }

        impl EffectName {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];
            /// The name in reports.
            pub fn as_str(self) -> &'static str { match self { $(Self::$variant => $text,)* } }
            /// Where it sits.
            pub fn subsystem(self) -> Subsystem { match self { $(Self::$variant => Subsystem::$subsystem,)* } }
            /// What it is, in words a technician uses.
            pub fn in_words(self) -> &'static str { match self { $(Self::$variant => $plain,)* } }
        }
    };
}

names! {
    ViscousFriction "viscous_friction" Transmission "friction that grows with speed";
    CoulombFriction "coulomb_friction" Transmission "dry friction";
    AsymmetricFriction "asymmetric_friction" Transmission "friction that differs with direction";
    StribeckFriction "stribeck_friction" Transmission "friction that falls as speed rises from zero";
    PreslidingFriction "presliding_friction" Transmission "elastic bristles before sliding";
    QuadraticDrag "quadratic_drag" Transmission "drag with the square of speed";
    PositionDependentFriction "position_dependent_friction" Transmission "dry friction that changes along the travel";
    LoadDependentFriction "load_dependent_friction" Transmission "dry friction that grows with the load";
    FrictionDrift "friction_drift" Transmission "friction that changes as the recording goes on";
    Cogging "cogging" Actuator "torque periodic in the angle";
    TorqueRipple "torque_ripple" Actuator "torque periodic in the angle and proportional to the command";
    CommandDeadband "command_deadband" Actuator "small commands do nothing";
    CommandSaturation "command_saturation" Actuator "the drive clips large commands";
    CommandDelay "command_delay" Actuator "the drive applies the command late";
    ElectricalLag "electrical_lag" Actuator "a first-order lag between command and torque";
    GainDrift "gain_drift" Actuator "the torque constant changes as the recording goes on";
    Backlash "backlash" Transmission "a gap at reversals";
    DriveCompliance "drive_compliance" Transmission "a spring between motor and load";
    RollerSlip "roller_slip" Transmission "the drive lets go above a force ceiling";
    MassImbalance "mass_imbalance" Load "gravity on an off-centre mass";
    TiltGravity "tilt_gravity" Load "a weight that acts through the tilt";
    PositionSpring "position_spring" Load "a spring along the travel";
    PositionDependentDamping "position_dependent_damping" Load "damping that changes along the travel";
    EncoderEccentricity "encoder_eccentricity" Sensor "the encoder errs once per turn";
    MissedCounts "missed_counts" Sensor "the encoder loses counts";
}

impl EffectName {
    /// Whether a single coefficient must be positive for the effect to be what its name says.
    pub(crate) fn is_positive(self) -> bool {
        matches!(
            self,
            Self::ViscousFriction
                | Self::CoulombFriction
                | Self::StribeckFriction
                | Self::PreslidingFriction
                | Self::QuadraticDrag
                | Self::LoadDependentFriction
                | Self::PositionSpring
        )
    }
}

impl fmt::Display for EffectName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.as_str())
    }
}
