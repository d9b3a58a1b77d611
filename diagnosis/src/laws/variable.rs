//! The variables of forces without a name.

use serde::{Deserialize, Serialize};

/// The variables that a force without a name may depend on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Variable {
    /// Velocity with its sign, rad/s or m/s.
    Speed,
    /// Position since the start of the recording, rad or m.
    Travel,
    /// Position within a turn, rad or m.
    Angle,
    /// Command, in the rig's unit.
    Command,
    /// Time since the velocity last changed its sign, s.
    SinceReversal,
    /// Time since the start of the recording, s.
    Time,
}

impl Variable {
    /// Returns its name in reports.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Speed => "speed",
            Self::Travel => "travel",
            Self::Angle => "angle",
            Self::Command => "command",
            Self::SinceReversal => "time since the last reversal",
            Self::Time => "time",
        }
    }
}
