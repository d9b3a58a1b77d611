//! The board's lamps.

use firmware::port;
use stm32f4xx_hal::gpio::{self, AnyPin, Output, PinState};

/// A lamp that says that the tasks run, one for torque and one for a fault.
pub(crate) struct Lamps {
    running: AnyPin<Output>,
    powered: AnyPin<Output>,
    fault: AnyPin<Output>,
}

impl Lamps {
    /// All dark. Each shines while its pin is high.
    pub(crate) fn new<const P: char, const N: u8, const Q: char, const M: u8, const R: char, const L: u8>(
        running: gpio::Pin<P, N>,
        powered: gpio::Pin<Q, M>,
        fault: gpio::Pin<R, L>,
    ) -> Self {
        Self {
            running: running.into_push_pull_output_in_state(PinState::Low).erase(),
            powered: powered.into_push_pull_output_in_state(PinState::Low).erase(),
            fault: fault.into_push_pull_output_in_state(PinState::Low).erase(),
        }
    }
}

impl port::Lamps for Lamps {
    fn show(&mut self, powered: bool, fault: bool) {
        self.running.set_high();
        self.powered.set_state(PinState::from(powered));
        self.fault.set_state(PinState::from(fault));
    }
}
