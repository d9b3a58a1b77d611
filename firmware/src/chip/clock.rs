//! The clocks, from 8 MHz that the board brings, and why the microcontroller was reset.
#![allow(unsafe_code, reason = "the HAL chooses the flash's wait states for a supply of 2.7 V and more")]

use firmware::reset::ResetFlags;
use firmware::timing;
use stm32f4xx_hal::pac::{DBGMCU, FLASH, RCC};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::{Config, Rcc};

/// The source on the board's OSC_IN (RM0090 7.2.1).
#[derive(Clone, Copy, PartialEq, Eq)]
#[allow(dead_code, reason = "a board has one of them")]
pub(crate) enum Source {
    /// A crystal, which the oscillator makes swing.
    Crystal,
    /// A clock from elsewhere, past the oscillator.
    Bypass,
}

/// Waits for the clock from outside and runs on it, as fast as `timing` says: the 168 MHz that
/// every part of the family reaches without over-drive, at the regulator's scale 1 of reset (RM0090
/// 5.1.4).
pub(super) fn start(rcc: RCC, source: Source) -> Rcc {
    wait_for(&rcc, source);
    let config = Config::hse(timing::EXTERNAL_CLOCK_HZ.Hz())
        .sysclk(timing::CORE_HZ.Hz())
        .hclk(timing::CORE_HZ.Hz())
        .pclk1(timing::APB1_HZ.Hz())
        .pclk2(timing::APB2_HZ.Hz())
        .require_pll48clk();
    let rcc = rcc.freeze(match source {
        Source::Crystal => config,
        Source::Bypass => config.bypass_hse_oscillator(),
    });
    wait_for_flash();
    rcc
}

/// Has the flash wait for as long as the lowest supply needs that the brown-out reset lets the core
/// run on, 2.4 V: 6 wait states at 168 MHz (RM0090 3.5.1). The first revision of the STM32F40x does
/// not prefetch (its errata sheet; ST's own start-up code asks for the revision too).
fn wait_for_flash() {
    const FIRST_REVISION: u16 = 0x1000;
    // The first revision gives itself out as an STM32F2 (errata sheet, "MCU device ID is
    // incorrect").
    const DEVICE_OF_FIRST_REVISION: u16 = 0x411;
    // SAFETY: start-up has the part to itself; the HAL is done with the register, and the identity
    // is only read.
    let (flash, identity) = unsafe { (&*FLASH::ptr(), (&*DBGMCU::ptr()).idcode().read()) };
    let is_first =
        identity.rev_id().bits() == FIRST_REVISION || identity.dev_id().bits() == DEVICE_OF_FIRST_REVISION;
    flash.acr().modify(|_, w| w.latency().ws6().prften().bit(!is_first));
}

/// Has the clock security watch the clock from outside once it runs. One that never comes leaves
/// the device here, its pins inputs and the amplifier held off by its pull-down, until a person
/// looks: without it there is neither USB nor a tick.
fn wait_for(rcc: &RCC, source: Source) {
    // The bypass can be chosen only while the oscillator is off (RM0090 7.3.1).
    rcc.cr().modify(|_, w| w.hsebyp().bit(source == Source::Bypass));
    rcc.cr().modify(|_, w| w.hseon().set_bit());
    while rcc.cr().read().hserdy().bit_is_clear() {}
    rcc.cr().modify(|_, w| w.csson().set_bit());
}

/// Why the microcontroller was reset; forgets it.
pub(super) fn reset_flags(rcc: &RCC) -> ResetFlags {
    let csr = rcc.csr().read();
    rcc.csr().modify(|_, w| w.rmvf().set_bit());
    ResetFlags {
        watchdog: csr.wdgrstf().bit() || csr.wwdgrstf().bit(),
        software: csr.sftrstf().bit(),
        power_on: csr.porrstf().bit(),
        brownout: csr.borrstf().bit(),
    }
}
