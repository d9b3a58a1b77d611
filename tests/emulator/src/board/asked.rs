//! The requests of a test: the board runs until something holds, instructions are counted,
//! something goes wrong.

use std::sync::mpsc::channel;

use super::probe::{Counted, Effect, HandlerRun, Upset};
use super::run::Order;
use super::watch::Watch;
use super::{Board, MILLISECOND, Nanos, Stopped, elf};

impl Board {
    /// Runs until `wanted` holds, looking every `every_us` microseconds, for `limit_ms`
    /// milliseconds at most. Answers whether it came to hold.
    pub fn run_while_not(
        &mut self,
        limit_ms: u64,
        every_us: u64,
        wanted: impl FnMut(&mut Stopped<'_>) -> bool + Send + Clone + 'static,
    ) -> bool {
        let mut look = wanted.clone();
        if self.at_stop(move |stopped| look(stopped)) {
            return true;
        }
        let end = self.now + limit_ms * MILLISECOND;
        self.run_until_seen(end, every_us * 1_000, wanted)
    }

    /// The same, with the first look after `every` nanoseconds and the last at the instant `end`.
    pub fn run_until_seen(
        &mut self,
        end: Nanos,
        every: Nanos,
        wanted: impl FnMut(&mut Stopped<'_>) -> bool + Send + 'static,
    ) -> bool {
        if self.now >= end {
            return false;
        }
        let (found, answered) = channel();
        let next = (self.now + every).min(end);
        self.order(Order::Watch(Watch { next, end, every, look: Box::new(wanted), found }));
        let (is_there, now) = answered.recv().expect("the order was carried out");
        self.now = now;
        is_there
    }

    /// Counts the instructions of each run of the interrupt handler called `name` from now on.
    ///
    /// # Panics
    ///
    /// When the image has no such handler.
    pub fn count_runs_of(&self, name: &str) {
        let bytes = std::fs::read(&self.image).expect("the image that runs");
        let handler = self.file.symbols.iter().find(|symbol| symbol.name == name);
        let entry = handler.unwrap_or_else(|| panic!("the image has no handler {name}")).address;
        let exits = elf::exits(&bytes, &self.file.symbols, entry);
        self.probe.tally().counted = Some(Counted { entry, exits });
    }

    /// The same, and counts the lines of its code that come from the flash, which takes an
    /// instruction at a time.
    ///
    /// # Panics
    ///
    /// When the image has no such handler.
    pub fn count_lines_of(&self, name: &str) {
        self.count_runs_of(name);
        self.probe.tally().count_lines = true;
    }

    /// Stops counting and returns the runs that have ended.
    #[must_use]
    pub fn counted_runs(&self) -> Vec<HandlerRun> {
        let mut tally = self.probe.tally();
        (tally.counted, tally.count_lines) = (None, false);
        std::mem::take(&mut tally.runs)
    }

    /// Something goes wrong inside the core, after so many instructions of its handler of
    /// `exception`.
    ///
    /// # Panics
    ///
    /// When the image has no such handler.
    pub fn upset(&self, exception: u32, after: u32, effect: Effect) {
        let bytes = std::fs::read(&self.image).expect("the image that runs");
        let entry = elf::handler(&bytes, exception).expect("a table of handlers");
        self.probe.tally().upset = Some(Upset { exception, entry, after, effect });
    }
}
