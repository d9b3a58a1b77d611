//! The supply's detector: an interrupt when it falls, and its level.
#![allow(unsafe_code, reason = "registers of other owners are read")]

use super::brownout;
use firmware::port;
use stm32f4xx_hal::pac::{EXTI, Interrupt, NVIC, PWR};
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// An interrupt, from line 16, when the supply falls below 2.66 V. A board's rail may be a diode
/// below 3.3 V, 2.9 V where people have measured it on the Discovery: the thresholds above this one
/// would never see it healthy. An edge from before, and one that the detector makes as it is
/// switched on, is forgotten (RM0090 12.3.6: what is pending out of reset is undefined); a supply
/// that is low now is seen by its level.
pub(super) fn warning(pwr: PWR, exti: EXTI, rcc: &mut Rcc) -> (Supply, SupplyLevel) {
    const FALLING_2V66: u8 = 4;
    PWR::enable(rcc);
    exti.rtsr().modify(|_, w| w.tr16().set_bit());
    // Three bits: any value is one.
    pwr.cr().modify(|_, w| w.pls().set(FALLING_2V66).pvde().set_bit());
    // Its comparator settles.
    cortex_m::asm::delay(firmware::timing::PULL_SETTLE_CYCLES);
    let mut supply = Supply(exti);
    supply.clear();
    NVIC::unpend(Interrupt::PVD);
    supply.0.imr().modify(|_, w| w.mr16().set_bit());
    (supply, SupplyLevel(pwr))
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

/// True if the supply is below the detector's level.
pub(crate) fn is_falling() -> bool {
    // SAFETY: a read without a side effect.
    unsafe { &*PWR::ptr() }.csr().read().pvdo().bit()
}

impl port::SupplyLevel for SupplyLevel {
    fn is_low(&self) -> bool {
        self.0.csr().read().pvdo().bit() || !brownout::is_in_force()
    }
}
