//! The independent watchdog, the pin that shows outside that it is fed, and what a debugger may
//! stop.
#![allow(unsafe_code, reason = "the HAL does not say when the watchdog has taken its time")]

use super::pin::Pin;
use firmware::{port, timing};
use stm32f4xx_hal::pac::{DBGMCU, IWDG};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::watchdog::IndependentWatchdog;

/// All of it.
pub(crate) struct Watchdog {
    watchdog: IndependentWatchdog,
    debug: DBGMCU,
    alive: Pin,
}

impl Watchdog {
    /// Runs from now on; `alive`, an output, changes its level each time that it is fed.
    pub(crate) fn start(timer: IWDG, debug: DBGMCU, alive: Pin) -> Self {
        let mut watchdog = IndependentWatchdog::new(timer);
        watchdog.stop_on_debug(&debug, true);
        watchdog.start(timing::WATCHDOG_MS.millis());
        // Its time crosses into the domain of its slow clock, and counts from the next feed on;
        // until then it waits for half a second (RM0090 21.4.4).
        // SAFETY: a read without a side effect.
        let status = unsafe { &*IWDG::ptr() }.sr();
        (0..timing::WATCHDOG_SETTLE_TURNS).any(|_| status.read().bits() == 0);
        watchdog.feed();
        Self { watchdog, debug, alive }
    }
}

impl port::Watchdog for Watchdog {
    fn feed(&mut self) {
        self.watchdog.feed();
        // A monostable outside holds the amplifier's enable path only while edges come.
        self.alive.toggle();
    }

    fn stop_on_debug(&mut self, stop: bool) {
        self.watchdog.stop_on_debug(&self.debug, stop);
    }
}
