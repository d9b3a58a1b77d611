//! The independent watchdog, and what a debugger may stop.

use firmware::{port, timing};
use stm32f4xx_hal::pac::{DBGMCU, IWDG};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// Both.
pub(crate) struct Watchdog {
    watchdog: IndependentWatchdog,
    debug: DBGMCU,
}

impl Watchdog {
    /// Runs from now on.
    pub(super) fn start(timer: IWDG, debug: DBGMCU) -> Self {
        let mut watchdog = IndependentWatchdog::new(timer);
        watchdog.stop_on_debug(&debug, true);
        watchdog.start(timing::WATCHDOG_MS.millis());
        watchdog.feed();
        Self { watchdog, debug }
    }

    /// [`port::Watchdog::feed`], for a test that has no supervisor.
    #[allow(dead_code, reason = "the tests of the board call it")]
    pub(crate) fn feed_for_test(&mut self) {
        self.watchdog.feed();
    }
}

impl port::Watchdog for Watchdog {
    fn feed(&mut self) {
        self.watchdog.feed();
    }

    fn stop_on_debug(&mut self, stop: bool) {
        self.watchdog.stop_on_debug(&self.debug, stop);
    }
}
