//! Detects a disconnected wire by toggling pull-up and pull-down: a driven line ignores them. Also
//! tells whether the encoder has power.
//!
//! A look takes two settling times, 40 µs, and up to 80 µs where ticks interrupt it. From 25 counts
//! a millisecond on, a sound line may be low for less than that, two counts of four, and be read as
//! if it went along: look after look, where a millisecond is a whole number of its periods. But a
//! count that runs needs the edges of both lines, and then both are driven.

use control_core::units::Counts;

/// Which way the inputs are pulled, by some 40 kΩ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it all")]
pub enum Pull {
    Up,
    Down,
}

/// The encoder's lines, up to eight inputs that are pulled together, and its supply.
pub trait PulledLines {
    /// All of them, a bit each.
    const ALL: u8;
    /// True if the encoder's supply is there, as far as it is wired to be sensed: without that wire
    /// it is not.
    fn has_supply(&self) -> bool;
    /// Those that are high, a bit each.
    fn high(&mut self) -> u8;
    /// Pulls all of them.
    fn pull(&mut self, pull: Pull);
    /// Waits until a line without a wire has gone where it is pulled.
    fn settle(&mut self);
}

/// Looks that must agree: an edge of a line that is driven may fall between two readings of one
/// look, but hardly in two.
const LOOKS: u8 = 2;

/// An encoder that counts so much from one look to the next has both of its lines: with one of them
/// off it counts two edges of the pulls and one of the other line before, between and behind them.
const RUNNING_COUNTS: u32 = 8;

/// Looks in a row for which the supply must have been there before its absence means anything: 0.1
/// s.
const SUPPLY_LOOKS: u8 = 100;

/// The finding of a look.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Wires {
    /// A wire is off, or the encoder has lost its supply.
    pub off: bool,
    /// All lines are at one level. Where they are not, one is held high and another low, both
    /// against their pulls, and the encoder has power.
    pub agree: bool,
    /// The encoder's supply is sensed: it has been there for long enough.
    pub supply_sensed: bool,
}

/// Looks for wires that are off, every millisecond.
#[derive(Clone, Copy, Debug, Default)]
pub struct WireWatch {
    looks: u8,
    /// The count at the look before.
    count: Counts,
    /// Looks in a row in which the supply was there; once they are enough, it is sensed.
    supplied: u8,
    unsupplied: u8,
}

impl WireWatch {
    /// Nothing seen.
    pub const fn new() -> Self {
        Self { looks: 0, count: Counts(0), supplied: 0, unsupplied: 0 }
    }

    /// A look at `lines`, which have been pulled up since the look before; `count` is the encoder's
    /// in the latest tick.
    pub fn look<L: PulledLines>(&mut self, lines: &mut L, count: Counts) -> Wires {
        let (driven_high, floating) = pulled(lines);
        let before = core::mem::replace(&mut self.count, count);
        let runs = self.count.0.wrapping_sub(before.0).unsigned_abs() >= RUNNING_COUNTS;
        self.looks = if floating == 0 || runs { 0 } else { (self.looks + 1).min(LOOKS) };
        let off = self.looks == LOOKS || self.has_lost_supply(lines.has_supply());
        let agree = driven_high == 0 || driven_high == L::ALL;
        Wires { off, agree, supply_sensed: self.is_sensed() }
    }

    fn is_sensed(&self) -> bool {
        self.supplied == SUPPLY_LOOKS
    }

    /// True if a supply that has been there is gone. It may come back.
    fn has_lost_supply(&mut self, has_supply: bool) -> bool {
        let is_sensed = self.is_sensed();
        if has_supply {
            (self.supplied, self.unsupplied) = ((self.supplied + 1).min(SUPPLY_LOOKS), 0);
        } else if is_sensed {
            self.unsupplied = (self.unsupplied + 1).min(LOOKS);
        } else {
            self.supplied = 0;
        }
        is_sensed && self.unsupplied == LOOKS
    }
}

/// The lines that are high against a pull down, and those that go up, down and up again as they are
/// pulled. Leaves them pulled up.
fn pulled(lines: &mut impl PulledLines) -> (u8, u8) {
    let high = lines.high();
    if high == 0 {
        return (0, 0);
    }
    lines.pull(Pull::Down);
    lines.settle();
    let driven_high = high & lines.high();
    let fell = high & !driven_high;
    lines.pull(Pull::Up);
    if fell == 0 {
        return (driven_high, 0);
    }
    lines.settle();
    (driven_high, fell & lines.high())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The driver of a line, if any, reading by reading.
    type Driver = Option<fn(usize) -> bool>;

    /// Two lines.
    struct Two {
        driven: [Driver; 2],
        pull: Pull,
        readings: usize,
        settled: bool,
        has_supply: bool,
    }

    impl PulledLines for Two {
        const ALL: u8 = 0b11;

        fn has_supply(&self) -> bool {
            self.has_supply
        }

        fn high(&mut self) -> u8 {
            assert!(self.settled, "read before the pull has acted");
            self.readings += 1;
            let level = |line: usize| self.driven[line].map_or(self.pull == Pull::Up, |at| at(self.readings));
            u8::from(level(0)) | u8::from(level(1)) << 1
        }

        fn pull(&mut self, pull: Pull) {
            (self.pull, self.settled) = (pull, false);
        }

        fn settle(&mut self) {
            self.settled = true;
        }
    }

    fn two(driven: [Driver; 2]) -> Two {
        Two { driven, pull: Pull::Up, readings: 0, settled: true, has_supply: false }
    }

    fn trips(driven: [Driver; 2], looks: usize) -> Option<usize> {
        let mut lines = two(driven);
        let mut watch = WireWatch::new();
        (1..=looks).find(|_| {
            // A millisecond passes.
            lines.settled = true;
            watch.look(&mut lines, Counts(0)).off
        })
    }

    #[test]
    fn a_line_without_a_wire_is_found_in_two_looks_whichever_it_is() {
        assert_eq!(trips([None, Some(|_| true)], 10), Some(2));
        assert_eq!(trips([Some(|_| false), None], 10), Some(2));
        assert_eq!(trips([None, None], 10), Some(2));
    }

    #[test]
    fn a_line_that_is_driven_is_not() {
        assert_eq!(trips([Some(|_| true), Some(|_| false)], 100), None);
        // It happens to go along once in seven readings.
        assert_eq!(trips([Some(|n| n % 7 != 2), Some(|n| n % 5 == 0)], 1_000), None);
    }

    /// 100 counts a millisecond, 25 periods of a line, which is high, low and high at the readings
    /// of each look. A roller of 4 mm with 65,535 counts a turn gives them at 38 mm/s.
    #[test]
    fn a_fast_encoder_is_not_taken_for_a_wire_that_is_off() {
        let in_step: Driver = Some(|n| n % 3 != 2);
        let off = |counts: i32| {
            let driven = [in_step, Some(|_| true)];
            let mut lines = two(driven);
            let mut watch = WireWatch::new();
            (1..1_000).any(|look| watch.look(&mut lines, Counts(look * counts)).off)
        };
        assert!(!off(100) && !off(-100) && !off(24));
        assert!(off(5), "a line without a wire, whose pulls are counted");
    }

    #[test]
    fn a_wire_that_comes_back_is_there_again() {
        let mut watch = WireWatch::new();
        let mut lines = two([None, None]);
        assert_eq!([0; 3].map(|_| watch.look(&mut lines, Counts(0)).off), [false, true, true]);
        lines.driven = [Some(|_| true), Some(|_| true)];
        assert!(!watch.look(&mut lines, Counts(0)).off);
    }

    #[test]
    fn lines_agree_where_no_two_are_held_apart() {
        let agree = |driven: [Driver; 2]| {
            let mut lines = two(driven);
            WireWatch::new().look(&mut lines, Counts(0)).agree
        };
        assert!(agree([Some(|_| true), Some(|_| true)]) && agree([Some(|_| false), Some(|_| false)]));
        assert!(!agree([Some(|_| true), Some(|_| false)]) && !agree([Some(|_| false), Some(|_| true)]));
        assert!(agree([None, Some(|_| false)]), "a pull is no encoder");
    }

    #[test]
    fn a_supply_that_was_there_is_missed_in_two_looks() {
        let mut watch = WireWatch::new();
        let driven: [Driver; 2] = [Some(|_| false), Some(|_| false)];
        let mut lines = two(driven);
        assert!(
            (0..1_000).all(|_| !watch.look(&mut lines, Counts(0)).off),
            "without its wire it is not sensed"
        );
        lines.has_supply = true;
        assert!((0..100).all(|_| !watch.look(&mut lines, Counts(0)).off));
        lines.has_supply = false;
        assert_eq!([0; 3].map(|_| watch.look(&mut lines, Counts(0)).off), [false, true, true]);
        lines.has_supply = true;
        assert!(!watch.look(&mut lines, Counts(0)).off);
    }
}
