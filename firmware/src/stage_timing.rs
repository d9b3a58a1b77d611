//! Last and longest time of each stage, kept where the stage runs and read where it is reported,
//! without a lock.

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use link::frames::{STAGES, Stage, StageTime};

/// Times of every stage. Each stage has one writer; a reader that resets the longest time may lose
/// one that is being written, which the next one brings back.
pub struct Stages {
    last: [AtomicU32; STAGES],
    longest: [AtomicU32; STAGES],
}

impl Default for Stages {
    fn default() -> Self {
        Self::new()
    }
}

impl Stages {
    /// All zero.
    pub const fn new() -> Self {
        Self { last: [const { AtomicU32::new(0) }; STAGES], longest: [const { AtomicU32::new(0) }; STAGES] }
    }

    /// `stage` has taken `cycles`.
    pub fn note(&self, stage: Stage, cycles: u32) {
        let place = stage as usize;
        self.last[place].store(cycles, Relaxed);
        if cycles > self.longest[place].load(Relaxed) {
            self.longest[place].store(cycles, Relaxed);
        }
    }

    /// Returns the times to report.
    pub fn read(&self) -> [StageTime; STAGES] {
        core::array::from_fn(|place| StageTime {
            last: self.last[place].load(Relaxed),
            longest: self.longest[place].load(Relaxed),
        })
    }

    /// Begins a session: the longest times count anew.
    pub(crate) fn forget_longest(&self) {
        for longest in &self.longest {
            longest.store(0, Relaxed);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keeps_the_last_and_the_longest() {
        let stages = Stages::new();
        for cycles in [5, 9, 3] {
            stages.note(Stage::Usb, cycles);
        }
        assert_eq!(stages.read()[Stage::Usb as usize], StageTime { last: 3, longest: 9 });
        assert_eq!(stages.read()[Stage::Tick as usize], StageTime::default());
        stages.forget_longest();
        stages.note(Stage::Usb, 4);
        assert_eq!(stages.read()[Stage::Usb as usize], StageTime { last: 4, longest: 4 });
    }
}
