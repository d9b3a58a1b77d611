//! Whether a wire is there: a line that somebody drives stays where it is whichever way it is pulled, one without a wire
//! goes along.

/// Which way the inputs are pulled, by some 40 kΩ.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it all")]
pub enum Pull {
    Up,
    Down,
}

/// Up to eight inputs that are pulled together.
pub trait PulledLines {
    /// Those that are high, a bit each.
    fn high(&mut self) -> u8;
    /// Pulls all of them.
    fn pull(&mut self, pull: Pull);
    /// Waits until a line without a wire has gone where it is pulled.
    fn settle(&mut self);
}

/// Looks that must agree: an edge of a line that is driven may fall between two readings of one look, but hardly in two.
const LOOKS: u8 = 2;

/// Looks for wires that are off, every millisecond.
#[derive(Clone, Copy, Debug, Default)]
pub struct WireWatch {
    looks: u8,
}

impl WireWatch {
    /// Nothing seen.
    pub const fn new() -> Self {
        Self { looks: 0 }
    }

    /// Whether a wire of `lines`, which have been pulled up since the look before, is off.
    pub fn look(&mut self, lines: &mut impl PulledLines) -> bool {
        self.looks = if floating(lines) == 0 { 0 } else { (self.looks + 1).min(LOOKS) };
        self.looks == LOOKS
    }
}

/// The lines that go up, down and up again as they are pulled. Leaves them pulled up.
fn floating(lines: &mut impl PulledLines) -> u8 {
    let high = lines.high();
    if high == 0 {
        return 0;
    }
    lines.pull(Pull::Down);
    lines.settle();
    let fell = high & !lines.high();
    lines.pull(Pull::Up);
    if fell == 0 {
        return 0;
    }
    lines.settle();
    fell & lines.high()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What drives a line, if anything, reading by reading.
    type Driver = Option<fn(usize) -> bool>;

    /// Two lines.
    struct Two {
        driven: [Driver; 2],
        pull: Pull,
        readings: usize,
        settled: bool,
    }

    impl PulledLines for Two {
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

    fn trips(driven: [Driver; 2], looks: usize) -> Option<usize> {
        let mut lines = Two { driven, pull: Pull::Up, readings: 0, settled: true };
        let mut watch = WireWatch::new();
        (1..=looks).find(|_| {
            // A millisecond passes.
            lines.settled = true;
            watch.look(&mut lines)
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

    #[test]
    fn a_wire_that_comes_back_is_there_again() {
        let mut watch = WireWatch::new();
        let mut lines = Two { driven: [None, None], pull: Pull::Up, readings: 0, settled: true };
        assert!(!watch.look(&mut lines) && watch.look(&mut lines) && watch.look(&mut lines));
        lines.driven = [Some(|_| true), Some(|_| true)];
        assert!(!watch.look(&mut lines));
    }
}
