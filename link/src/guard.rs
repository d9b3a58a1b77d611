//! The brown-out reset that guards the supply, as a board answers [`crate::Command::GuardSupply`].

use serde::{Deserialize, Serialize};

/// The reason why no brown-out reset guards the supply.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum GuardRefusal {
    /// It is off, and nobody asked to set it.
    Off,
    /// It has been set, and counts once a reset has loaded it.
    Restart,
    /// The option bytes are what no board has, and were left as they are.
    Implausible(u32),
    /// The flash was busy for too long, or an error flag says that it did not take the option
    /// bytes.
    NotTaken,
    /// The supply is too low to program them.
    SupplyLow,
}

impl core::fmt::Display for GuardRefusal {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            GuardRefusal::Off => {
                f.write_str("the board's brown-out reset is off; run host-sim commission, which sets it")
            }
            GuardRefusal::Restart => f.write_str(
                "the board's brown-out reset has been set and counts after a restart; switch the board off and on, then run host-sim commission again; if this comes again, replace the board",
            ),
            GuardRefusal::Implausible(options) => write!(
                f,
                "the board's option bytes read {options:#010x}, which cannot be right, and were left as they are; switch the board off and on, and if this comes again restore them with ST's programmer"
            ),
            GuardRefusal::NotTaken => f.write_str(
                "the board's flash did not take the brown-out reset; switch the board off and on, then run host-sim commission again, or replace the board",
            ),
            GuardRefusal::SupplyLow => f.write_str(
                "the board's supply is below 2.66 V; check its power, then run host-sim commission again",
            ),
        }
    }
}
