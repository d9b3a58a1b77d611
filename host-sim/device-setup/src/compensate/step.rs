//! The steps of compensation, and the parts that are tried and taken back one by one.

use control_core::compensation::{Compensation, Gain, Gains};
use std::fmt;

/// The next step, announced before it is done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CompensationStep {
    /// The person lays the device level: the report knows no weight, so that it is measured.
    Level,
    /// The roller turns slowly while the device is level.
    Weight,
    /// The person tilts the device.
    Tilt,
    /// The roller turns slowly, as it is.
    Before,
    /// The same, with what is fed forward.
    After,
    /// The same without one part of it, because with all of it the hand would feel more than
    /// before.
    Without(Part),
}

impl CompensationStep {
    /// Returns true if the motor moves in it.
    pub fn moves(self) -> bool {
        !matches!(self, CompensationStep::Level | CompensationStep::Tilt)
    }
}

impl fmt::Display for CompensationStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CompensationStep::Level => f.write_str("torque stays off: lay the device level and leave it so"),
            CompensationStep::Weight => f.write_str(
                "the roller turns slowly to and fro by one turn, to find the weight that the report does not have: hands off",
            ),
            CompensationStep::Tilt => {
                f.write_str("torque stays off: point the device down by some 30° and leave it so until the end")
            }
            CompensationStep::Before => {
                f.write_str("the roller turns slowly to and fro by one turn, then it is held: hands off")
            }
            CompensationStep::After => f.write_str("the same again, with what is fed forward: hands off"),
            CompensationStep::Without(part) => {
                write!(f, "with all of it the hand feels more than before; the same without {part}: hands off")
            }
        }
    }
}

/// The parts with one gain each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Cogging and an off-centre mass.
    Angle,
    /// Dry and viscous friction.
    Friction,
    /// The weight.
    Weight,
    /// Offset, ripple and deadband.
    Drive,
}

impl Part {
    /// All of them.
    pub(crate) const ALL: [Part; 4] = [Part::Angle, Part::Friction, Part::Weight, Part::Drive];

    /// Returns its gain.
    pub(crate) fn gain(self, gains: &mut Gains) -> &mut Gain {
        match self {
            Part::Angle => &mut gains.angle,
            Part::Friction => &mut gains.friction,
            Part::Weight => &mut gains.weight,
            Part::Drive => &mut gains.drive,
        }
    }

    /// Returns true if the device feeds any of it forward.
    pub(crate) fn is_fed(self, compensation: &Compensation) -> bool {
        let mut gains = compensation.gains;
        let is_some = match self {
            Part::Angle => compensation.angle[0].order != 0,
            Part::Friction => [compensation.inwards, compensation.outwards]
                .iter()
                .any(|way| way.dry.0 != 0 || way.viscous.0 != 0),
            Part::Weight => compensation.weight.0 != 0,
            Part::Drive => {
                compensation.offset.0 != 0
                    || compensation.deadband.0 != 0
                    || compensation.ripple[0].order != 0
            }
        };
        is_some && *self.gain(&mut gains) != Gain(0)
    }
}

impl fmt::Display for Part {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Part::Angle => "the waves by angle",
            Part::Friction => "friction",
            Part::Weight => "the weight",
            Part::Drive => "the drive's offset, ripple and deadband",
        })
    }
}
