//! The encoder's wires, and what happens to them.

use serde::{Deserialize, Serialize};

/// One track's wire to the board.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Wire {
    /// It brings the track's level.
    #[default]
    Sound,
    /// It is off: nothing drives the pin.
    Off,
    /// It stays at a level, whatever the track does: a dead output, a short.
    Stuck(bool),
}

impl Wire {
    /// Returns the level that drives the pin, if anything does.
    fn level(self, track: bool) -> Option<bool> {
        match self {
            Self::Sound => Some(track),
            Self::Off => None,
            Self::Stuck(level) => Some(level),
        }
    }
}

/// Both of them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wires {
    /// To the pin of track A.
    pub a: Wire,
    /// To the pin of track B.
    pub b: Wire,
    /// True if each goes to the other's pin.
    pub swapped: bool,
    /// Its supply wire is off: both outputs, without power, are held near ground by their
    /// protection diodes.
    pub supply_off: bool,
    /// Its ground wire is off: what flows through it has no other way than its outputs, which are
    /// held near its supply.
    pub ground_off: bool,
    /// Pulses of this many nanoseconds on both pins, one at every step of the plant, as the motor's
    /// PWM leads bring them.
    pub glitches: Option<u64>,
}

impl Wires {
    /// Returns the levels that drive the pins of track A and track B.
    pub(super) fn drive(&self, (a, b): (bool, bool), is_in_glitch: bool) -> [Option<bool>; 2] {
        let (a, b) = if self.swapped { (b, a) } else { (a, b) };
        let (a, b) = match (self.supply_off, self.ground_off) {
            (true, _) => (false, false),
            (false, true) => (true, true),
            (false, false) => (a, b),
        };
        [self.a.level(a), self.b.level(b)].map(|level| level.map(|level| level != is_in_glitch))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_fault_shows_at_the_pins() {
        let tracks = (true, false);
        let drive = |wires: Wires| wires.drive(tracks, false);
        let sound = Wires::default();
        assert_eq!(drive(sound), [Some(true), Some(false)]);
        assert_eq!(sound.drive(tracks, true), [Some(false), Some(true)]);
        assert_eq!(drive(Wires { swapped: true, ..sound }), [Some(false), Some(true)]);
        assert_eq!(drive(Wires { a: Wire::Off, ..sound }), [None, Some(false)]);
        assert_eq!(drive(Wires { supply_off: true, ..sound }), [Some(false), Some(false)]);
        assert_eq!(drive(Wires { ground_off: true, ..sound }), [Some(true), Some(true)]);
        assert_eq!(drive(Wires { b: Wire::Stuck(true), ..sound }), [Some(true), Some(true)]);
    }
}
