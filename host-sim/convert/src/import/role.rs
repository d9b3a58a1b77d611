//! The roles that a column of a recording may have.

use super::units::Quantity;
use std::fmt;

/// The role of a column of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Time stamps.
    Time,
    /// The command that was sent to the drive.
    Command,
    /// The coordinate.
    Position,
    /// Its speed.
    Velocity,
    /// The reference of a position loop.
    Reference,
    /// Inclination below the horizontal.
    Tilt,
    /// A measured external load.
    Force,
    /// 1 where the drive was on, 0 where it was off.
    Enabled,
}

impl Role {
    /// All of them.
    pub const ALL: [Self; 8] = [
        Self::Time,
        Self::Command,
        Self::Position,
        Self::Velocity,
        Self::Reference,
        Self::Tilt,
        Self::Force,
        Self::Enabled,
    ];

    /// As `--column` has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Command => "command",
            Self::Position => "position",
            Self::Velocity => "velocity",
            Self::Reference => "reference",
            Self::Tilt => "tilt",
            Self::Force => "force",
            Self::Enabled => "enabled",
        }
    }

    /// The quantities that its unit may measure. A position, a speed or a time is no command.
    pub(super) fn takes(self, quantity: Quantity) -> bool {
        use Quantity as Q;
        match self {
            Self::Time => quantity == Q::Time,
            Self::Command => matches!(quantity, Q::Torque | Q::Force | Q::Current | Q::Voltage | Q::Plain),
            Self::Position | Self::Reference => matches!(quantity, Q::Angle | Q::Length | Q::Counts),
            Self::Velocity => matches!(quantity, Q::AngularSpeed | Q::Speed),
            Self::Tilt => quantity == Q::Angle,
            Self::Force => matches!(quantity, Q::Torque | Q::Force),
            Self::Enabled => quantity == Q::Plain,
        }
    }
}

impl fmt::Display for Role {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.name())
    }
}
