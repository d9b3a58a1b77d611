//! The events and states of a run, for people and programs: tissue events, faults, limits in force.

use core::fmt;
use serde::{Deserialize, Serialize};

/// The state of needle and device, once a sample.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum State {
    /// Amplifier off, zero torque; waiting for a person to start.
    #[default]
    Idle = 0,
    /// Powered, the tip touches nothing.
    Approach = 1,
    /// Pressing a layer that has not given way.
    Elastic = 2,
    /// A layer has just given way and its relief is felt.
    Puncture = 3,
    /// Moving or resting inside tissue.
    Friction = 4,
    /// Moving out of tissue.
    Withdrawal = 5,
    /// Playing an excitation signal.
    Excitation = 6,
    /// A fault has latched; amplifier off.
    Fault = 7,
}

impl State {
    /// The state behind its number on the wire.
    pub fn from_code(code: u8) -> Option<Self> {
        use State::*;
        [Idle, Approach, Elastic, Puncture, Friction, Withdrawal, Excitation, Fault]
            .get(usize::from(code))
            .copied()
    }

    /// True if the amplifier may be on.
    pub fn is_powered(self) -> bool {
        !matches!(self, State::Idle | State::Fault)
    }
}

/// Why torque was taken away. It latches: a person has to clear it before the device starts again.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Fault {
    /// More counts in one tick than the needle can move.
    EncoderJump = 0,
    /// Deeper than the travel of the needle.
    Travel = 1,
    /// The PC has been silent for longer than the heartbeat timeout.
    HostSilent = 2,
    /// The tilt sensor is absent, stuck or answers nonsense.
    Tilt = 3,
    /// The tick took longer than its period.
    Overrun = 4,
    /// The USB link was suspended or pulled.
    LinkLost = 5,
    /// The watchdog reset the device.
    Watchdog = 6,
    /// The program panicked or took a hard fault.
    Crash = 7,
    /// The supply dipped.
    Brownout = 8,
    /// The stored configuration was damaged; the default is in use.
    StoredConfig = 9,
    /// The encoder does not count, neither under torque nor when the torque is taken away.
    EncoderFrozen = 10,
    /// The needle speeds up against the motor as no hand makes it: the motor's leads or the
    /// encoder's channels are swapped.
    WrongWay = 11,
    /// The needle is faster than a hand moves it.
    Overspeed = 12,
    /// Counts go to and fro and the needle does not get on: one of the encoder's channels is dead.
    EncoderChannel = 13,
    /// An encoder wire is off.
    EncoderWire = 14,
    /// The amplifier or its enable line is on although it was switched off.
    AmplifierStuckOn = 15,
    /// The amplifier says that it is not ready.
    AmplifierNotReady = 16,
    /// The motor's current is not the one that was asked for.
    Current = 17,
    /// The emergency stop.
    EmergencyStop = 18,
    /// The crystal stopped.
    Clock = 19,
}

impl Fault {
    /// All of them, each at the place of its number.
    pub const ALL: [Self; 20] = [
        Self::EncoderJump,
        Self::Travel,
        Self::HostSilent,
        Self::Tilt,
        Self::Overrun,
        Self::LinkLost,
        Self::Watchdog,
        Self::Crash,
        Self::Brownout,
        Self::StoredConfig,
        Self::EncoderFrozen,
        Self::WrongWay,
        Self::Overspeed,
        Self::EncoderChannel,
        Self::EncoderWire,
        Self::AmplifierStuckOn,
        Self::AmplifierNotReady,
        Self::Current,
        Self::EmergencyStop,
        Self::Clock,
    ];
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Fault::EncoderJump => "the encoder jumped further in one tick than the needle can move",
            Fault::Travel => "the needle is beyond its travel",
            Fault::HostSilent => "the PC went silent",
            Fault::Tilt => "the tilt sensor is absent, stuck or answers nonsense",
            Fault::Overrun => "a control tick took longer than its period",
            Fault::LinkLost => "the USB link was suspended or pulled",
            Fault::Watchdog => "the watchdog reset the device",
            Fault::Crash => "the program panicked or took a hard fault",
            Fault::Brownout => "the supply dipped",
            Fault::StoredConfig => "the stored configuration was damaged and the default is in use",
            Fault::EncoderFrozen => "the encoder does not count, whatever the torque: check its supply and its ground",
            Fault::WrongWay => {
                "the needle sped up against the motor: the motor's leads or the encoder's channels are swapped"
            }
            Fault::Overspeed => "the needle is faster than a hand moves it",
            Fault::EncoderChannel => "one of the encoder's channels is dead",
            Fault::EncoderWire => "an encoder wire is off",
            Fault::AmplifierStuckOn => "the amplifier is on although it was switched off",
            Fault::AmplifierNotReady => "the amplifier is not ready",
            Fault::Current => "the motor's current is not the one that was asked for",
            Fault::EmergencyStop => "the emergency stop was pressed, or its wire is off",
            Fault::Clock => "the crystal stopped",
        })
    }
}

/// Limits in force: the device works, but gives less than the law asks for. A set, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Limits(pub u8);

impl Limits {
    /// Torque is held at its limit.
    pub const TORQUE: Self = Self(1);
    /// Torque changes as fast as it may.
    pub const SLEW: Self = Self(2);
    /// Torque is still fading in.
    pub const FADE_IN: Self = Self(4);
    /// The motor's thermal model holds torque down.
    pub const THERMAL: Self = Self(8);
    /// The passivity observer adds damping.
    pub const PASSIVITY: Self = Self(16);
    /// Nothing was measured at this speed and angle: the force is an estimate.
    pub const ESTIMATED: Self = Self(32);

    /// Both sets together.
    pub fn with(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// True if all of `other` are in force.
    pub fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }
}

/// The tip's place as seen from a vessel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum VesselState {
    /// Above the vessel, or there is no vessel.
    #[default]
    Outside = 0,
    /// Pushing in the near wall.
    Touching = 1,
    /// Inside: blood shows in the hub.
    InLumen = 2,
    /// Through the far wall.
    Through = 3,
    /// As deep as the vessel, and beside it.
    Beside = 4,
}

impl VesselState {
    /// The state behind its number on the wire.
    pub fn from_code(code: u8) -> Option<Self> {
        use VesselState::*;
        [Outside, Touching, InLumen, Through, Beside].get(usize::from(code)).copied()
    }
}

/// The changes in the tissue in one tick: a bit a layer, bit 0 the outermost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Transitions {
    /// The tip has touched the layer.
    pub contact: u8,
    /// The layer has given way.
    pub puncture: u8,
    /// The tip has left the layer, which is whole again.
    pub exit: u8,
    /// The tip has come into a vessel's lumen, from either side: blood shows in the hub.
    pub flashback: bool,
    /// The needle has just been turned further than the tissue around it lets it.
    pub barrier: bool,
    /// Those of the layers in `contact` that had given way before: the tip is in its own track.
    pub in_track: u8,
}

impl Transitions {
    /// True if nothing changed.
    pub fn is_empty(self) -> bool {
        // As one number: compared field by field it takes three times as long.
        (self.contact | self.puncture | self.exit | u8::from(self.flashback) | u8::from(self.barrier)) == 0
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
    fn a_set_of_limits_holds_each_once() {
        let both = Limits::TORQUE.with(Limits::SLEW);
        assert_eq!(both.with(Limits::TORQUE), both);
        assert!(both.contains(Limits::SLEW) && !both.contains(Limits::THERMAL));
        assert!(!both.contains(Limits::SLEW.with(Limits::THERMAL)), "all of them");
    }

    #[test]
    fn any_transition_is_one() {
        assert!(Transitions::default().is_empty());
        for layer in [1, 0x80] {
            assert!(!Transitions { contact: layer, ..Transitions::default() }.is_empty());
            assert!(!Transitions { puncture: layer, ..Transitions::default() }.is_empty());
            assert!(!Transitions { exit: layer, ..Transitions::default() }.is_empty());
        }
    }

    #[test]
    fn a_state_is_its_number_and_six_of_the_eight_have_torque() {
        for code in 0..8 {
            let state = State::from_code(code).unwrap();
            assert_eq!(state as u8, code);
            assert_eq!(state.is_powered(), (1..=6).contains(&code), "{state:?}");
        }
        assert_eq!(State::from_code(8), None);
    }

    #[test]
    fn a_vessels_state_is_its_number() {
        for code in 0..5 {
            assert_eq!(VesselState::from_code(code).map(|state| state as u8), Some(code));
        }
        assert_eq!(VesselState::from_code(5), None);
    }

    #[test]
    fn each_fault_has_words_of_its_own() {
        for (number, fault) in Fault::ALL.into_iter().enumerate() {
            assert_eq!(fault as usize, number);
        }
        let faults = Fault::ALL;
        let words: BTreeSet<_> = faults.iter().map(ToString::to_string).collect();
        assert_eq!(words.len(), faults.len());
        assert!(words.iter().all(|word| word.len() > 10), "{words:?}");
    }
}
