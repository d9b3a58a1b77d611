//! The independent watchdog, and what a debugger may stop.
#![allow(unsafe_code, reason = "the HAL does not say when the watchdog has taken its time")]

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
    pub(crate) fn start(timer: IWDG, debug: DBGMCU) -> Self {
        let mut watchdog = IndependentWatchdog::new(timer);
        watchdog.stop_on_debug(&debug, true);
        watchdog.start(timing::WATCHDOG_MS.millis());
        // Its time crosses into the domain of its slow clock, and counts from the next feed on;
        // until then it waits for half a second (RM0090 21.4.4).
        // SAFETY: a read without a side effect.
        let status = unsafe { &*IWDG::ptr() }.sr();
        (0..timing::WATCHDOG_SETTLE_TURNS).any(|_| status.read().bits() == 0);
        watchdog.feed();
        Self { watchdog, debug }
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
