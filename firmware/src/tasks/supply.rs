//! The supply below 2.66 V: the last moment at which the core still surely runs. Its fall takes torque away with the next
//! tick, by interrupt; its level keeps the device from being started, whether anybody saw it fall or not.

use super::shared;
use control_core::event::Fault;
use control_core::interlock::Interlock;
use stm32f4xx_hal::pac::{EXTI, PWR};

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

/// The voltage detector's level.
pub(crate) struct SupplyLevel(pub(crate) PWR);

impl SupplyLevel {
    /// Looks at it.
    pub(crate) fn look(&self) {
        shared::CONDITIONS.set(Interlock::Supply, self.0.csr().read().pvdo().bit());
    }
}
