//! The supply's detector: an interrupt when it falls, and its level.

#![allow(unsafe_code, reason = "the flash's registers are another owner's; here one is read")]

use super::brownout;
use firmware::port;
use stm32f4xx_hal::pac::{EXTI, FLASH, PWR};
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// An interrupt, from line 16, when the supply falls below 2.66 V. A board's rail may be a diode
/// below 3.3 V, 2.9 V where people have measured it on the Discovery: the thresholds above this one
/// would never see it healthy.
pub(super) fn warning(pwr: PWR, exti: EXTI, rcc: &mut Rcc) -> (Supply, SupplyLevel) {
    const FALLING_2V66: u8 = 4;
    PWR::enable(rcc);
    exti.rtsr().modify(|_, w| w.tr16().set_bit());
    exti.imr().modify(|_, w| w.mr16().set_bit());
    // Three bits: any value is one.
    pwr.cr().modify(|_, w| w.pls().set(FALLING_2V66).pvde().set_bit());
    // Its comparator settles.
    cortex_m::asm::delay(firmware::timing::PULL_SETTLE_CYCLES);
    (Supply(exti), SupplyLevel(pwr))
}

/// The voltage detector's interrupt.
pub(crate) struct Supply(EXTI);

impl Supply {
    /// Has been served.
    pub(crate) fn clear(&mut self) {
        // Cleared by writing ones; the other lines are not used.
        self.0.pr().write(|w| w.pr16().clear_bit_by_one());
    }
}

/// The voltage detector's level.
pub(crate) struct SupplyLevel(PWR);

impl SupplyLevel {
    /// True if the supply is below the detector's level.
    pub(super) fn is_falling(&self) -> bool {
        self.0.csr().read().pvdo().bit()
    }
}

impl port::SupplyLevel for SupplyLevel {
    fn is_low(&self) -> bool {
        // SAFETY: a read without a side effect.
        self.is_falling() || !brownout::is_on(unsafe { &*FLASH::ptr() })
    }
}
