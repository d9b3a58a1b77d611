//! The servo amplifier at the board's pins, and what goes wrong with it.

use rigless::device::Level;
use serde::{Deserialize, Serialize};

use super::plant::Drive;

/// The amplifier's fault.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Amplifier {
    /// Nothing.
    #[default]
    Sound,
    /// Its enable line is shorted high.
    LineHigh,
    /// It stays on, whatever its enable line says.
    StuckOn,
    /// It gives no current, and says that all is well.
    Dead,
    /// Its power stage is broken through: full current one way, whatever it is asked for.
    Full,
}

impl Amplifier {
    /// Returns the motor's drive when the board outputs `asked`.
    pub(super) fn drive(self, asked: Drive) -> Drive {
        match self {
            Self::Sound => asked,
            Self::LineHigh | Self::StuckOn => Drive { enabled: true, ..asked },
            Self::Dead => Drive { enabled: false, ..asked },
            Self::Full => Drive { code: Some(4_095), enabled: true },
        }
    }

    /// Returns the level of the enable line when the board drives it to `level`.
    pub(super) fn line(self, level: bool) -> bool {
        level || self == Self::LineHigh
    }

    /// The voltage of its current monitor in mV, of a full scale of `full_scale`: as for the set
    /// value, mid-scale is zero.
    pub(super) fn monitor(self, asked: Drive, full_scale: u32) -> u32 {
        let drive = self.drive(asked);
        let code = if drive.enabled { drive.code.unwrap_or(2_048) } else { 2_048 };
        u32::from(code) * full_scale / 4_096
    }
}

/// The connection of a line of the drive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Contact {
    /// The board's supply: the contact is closed.
    Closed,
    /// Nothing: it is open, or its wire is off.
    Open,
    /// Ground: its wire is shorted.
    Ground,
}

impl Contact {
    pub(super) fn level(self) -> Option<Level> {
        match self {
            Self::Closed => Some(Level::High),
            Self::Open => None,
            Self::Ground => Some(Level::Low),
        }
    }

    pub(super) fn closed_if(is_closed: bool) -> Self {
        if is_closed { Self::Closed } else { Self::Open }
    }
}
