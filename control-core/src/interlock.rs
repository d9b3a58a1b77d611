//! The conditions that prevent a start and that end a run: they last, unlike a
//! fault, which happens. Whoever sees the condition sets it and takes it back; nobody else does.

use crate::event::Fault;
use core::fmt;
use serde::{Deserialize, Serialize};

/// A condition under which no torque is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Interlock {
    /// The supply is below the level at which the core surely runs, or no brown-out reset guards
    /// it.
    Supply = 0,
    /// The emergency stop's loop is open: pressed, or its wire is off.
    EmergencyStop = 1,
    /// The amplifier does not say that it is ready.
    AmplifierNotReady = 2,
    /// The amplifier's enable line, or the current that it measures, is on although it was switched
    /// off.
    AmplifierStuckOn = 3,
    /// An encoder wire is off.
    EncoderWire = 4,
    /// The configuration is being saved, which stops the processor.
    Saving = 5,
    /// Nobody has found out how the device is wired.
    NotCommissioned = 6,
    /// Nobody has said where depth 0 is since the last reset.
    NotZeroed = 7,
    /// The tilt sensor is absent, stuck or answers nonsense, or has not measured yet.
    TiltSensor = 8,
    /// The encoder's supply was sensed at commissioning, and is not.
    EncoderSupplyUnsensed = 9,
    /// The motor's current was measured at commissioning, and is not.
    CurrentUnmeasured = 10,
}

impl Interlock {
    /// All of them, each at the place of its number.
    pub const ALL: [Self; 11] = [
        Self::Supply,
        Self::EmergencyStop,
        Self::AmplifierNotReady,
        Self::AmplifierStuckOn,
        Self::EncoderWire,
        Self::Saving,
        Self::NotCommissioned,
        Self::NotZeroed,
        Self::TiltSensor,
        Self::EncoderSupplyUnsensed,
        Self::CurrentUnmeasured,
    ];

    /// The fault that it is where torque is on.
    pub const fn fault(self) -> Fault {
        match self {
            Self::Supply => Fault::Brownout,
            Self::EmergencyStop => Fault::EmergencyStop,
            Self::AmplifierNotReady => Fault::AmplifierNotReady,
            Self::AmplifierStuckOn => Fault::AmplifierStuckOn,
            Self::EncoderWire => Fault::EncoderWire,
            Self::TiltSensor => Fault::Tilt,
            // Nobody begins to save while torque is on; the others keep a device from being started
            // and come at no other time.
            Self::Saving
            | Self::NotCommissioned
            | Self::NotZeroed
            | Self::EncoderSupplyUnsensed
            | Self::CurrentUnmeasured => Fault::Overrun,
        }
    }
}

impl fmt::Display for Interlock {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Supply => {
                "the supply is too low, or no brown-out reset guards it; check the board's power, then run host-sim commission"
            }
            Self::EmergencyStop => "the emergency stop is open; release it, or fit its jumper if there is none",
            Self::AmplifierNotReady => {
                "the amplifier is not ready; check its supply, or fit the jumper if it has no such output"
            }
            Self::AmplifierStuckOn => {
                "the amplifier is on although it was switched off; switch off its supply and check the enable line"
            }
            Self::EncoderWire => "an encoder wire is off; check the encoder's plug",
            Self::Saving => "the configuration is being saved; try again in two seconds",
            Self::NotCommissioned => "the device has not been commissioned; run host-sim commission first",
            Self::NotZeroed => "the depth is unknown since the device was switched on; hold the tip on the skin and press Zero depth here",
            Self::TiltSensor => {
                "the tilt sensor does not measure; check its wires, or replace the board if the sensor is on it"
            }
            Self::EncoderSupplyUnsensed => {
                "the encoder's supply was sensed at commissioning and is not now; check its sense wire and the encoder's plug, or commission again without it"
            }
            Self::CurrentUnmeasured => {
                "the motor's current was measured at commissioning and is not now; check the monitor's wires and switch the board off and on, or commission again without it"
            }
        })
    }
}

/// A set of them, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interlocks(pub u16);

impl Interlocks {
    /// The set of one.
    pub const fn of(interlock: Interlock) -> Self {
        Self(1 << interlock as u8)
    }

    /// True if `interlock` is among them.
    pub const fn contains(self, interlock: Interlock) -> bool {
        self.0 & Self::of(interlock).0 != 0
    }

    /// The one with the lowest number; none where the device may start.
    pub fn first(self) -> Option<Interlock> {
        Interlock::ALL.get(self.0.trailing_zeros() as usize).copied()
    }
}

#[cfg(test)]
#[expect(clippy::unwrap_used, reason = "a test")]
mod tests {
    extern crate std;
    use super::*;
    use std::collections::BTreeSet;
    use std::string::ToString;

    #[test]
    fn each_is_itself_alone_and_among_later_ones() {
        assert_eq!(Interlocks::default().first(), None);
        for (number, interlock) in Interlock::ALL.into_iter().enumerate() {
            assert_eq!(interlock as usize, number);
            let set = Interlocks::of(interlock);
            assert_eq!(set.first(), Some(interlock));
            assert_eq!(Interlocks(set.0 | 1 << 15).first(), Some(interlock));
            let others = Interlock::ALL.into_iter().filter(|&other| other != interlock);
            assert!(set.contains(interlock) && others.into_iter().all(|other| !set.contains(other)));
        }
    }

    #[test]
    fn each_says_what_to_do() {
        let words: BTreeSet<_> = Interlock::ALL.iter().map(ToString::to_string).collect();
        assert_eq!(words.len(), Interlock::ALL.len());
        assert!(words.iter().all(|word| word.contains(';')), "{words:?}");
        let last = Interlock::ALL.last().unwrap();
        assert_eq!(Interlocks(u16::MAX << (*last as u8 + 1)).first(), None);
    }
}
