//! The supply falls below 2.66 V: the last moment at which the core still surely runs.

use super::shared;
use control_core::event::Fault;
use stm32f4xx_hal::pac::EXTI;

/// Line of the voltage detector in the interrupt controller.
pub(crate) const PVD_LINE: u32 = 16;

/// The voltage detector's interrupt.
pub(crate) struct Supply(pub(crate) EXTI);

impl Supply {
    /// Takes torque away with the next tick.
    pub(crate) fn run(&mut self) {
        // Cleared by writing ones; the other lines are not used.
        self.0.pr().write(|w| w.pr16().clear_bit_by_one());
        shared::TRIPS.raise(Fault::Brownout);
    }
}
