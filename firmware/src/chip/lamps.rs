//! The board's lamps.

use firmware::port;
use stm32f4xx_hal::gpio::{self, AnyPin, Output, PinState};

/// A lamp for torque and one for a fault; a third, which the board lights by itself, says that the
/// image runs.
pub(crate) struct Lamps {
    powered: AnyPin<Output>,
    fault: AnyPin<Output>,
}

impl Lamps {
    /// Dark. Both shine while their pin is high.
    pub(crate) fn new<const P: char, const N: u8, const Q: char, const M: u8>(
        powered: gpio::Pin<P, N>,
        fault: gpio::Pin<Q, M>,
    ) -> Self {
        Self {
            powered: powered.into_push_pull_output_in_state(PinState::Low).erase(),
            fault: fault.into_push_pull_output_in_state(PinState::Low).erase(),
        }
    }
}

impl port::Lamps for Lamps {
    fn show(&mut self, powered: bool, fault: bool) {
        self.powered.set_state(PinState::from(powered));
        self.fault.set_state(PinState::from(fault));
    }
}
