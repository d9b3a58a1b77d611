//! The clocks, from 8 MHz that the board brings, and why the microcontroller was reset.
#![allow(unsafe_code, reason = "the HAL sets the flash's wait states for a supply of 2.7 V and more")]

use firmware::reset::ResetFlags;
use firmware::timing;
use stm32f4xx_hal::pac::{DBGMCU, FLASH, RCC};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

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
/// 5.1.4). The HAL is told nothing of it, for it would raise the clock on too few wait states: it
/// takes every bus to run at [`timing::RESET_CLOCK_HZ`], and only the SPI asks it.
pub(super) fn start(rcc: RCC, source: Source) -> Rcc {
    wait_for(&rcc, source);
    wait_for_flash();
    multiply(&rcc);
    rcc.constrain()
}

/// The PLL makes the core's clock and the USB core's from the one from outside.
fn multiply(rcc: &RCC) {
    const DIVIDED: u32 = timing::EXTERNAL_CLOCK_HZ / timing::PLL_INPUT_HZ;
    const MULTIPLIED: u32 = 2 * timing::CORE_HZ / timing::PLL_INPUT_HZ;
    const USB: u32 = 2 * timing::CORE_HZ / timing::USB_HZ;
    // A bootloader may have left it on, and then it cannot be set (RM0090 7.3.2).
    rcc.cr().modify(|_, w| w.hsion().set_bit());
    rcc.cfgr().modify(|_, w| w.sw().hsi());
    while !rcc.cfgr().read().sws().is_hsi() {}
    rcc.cr().modify(|_, w| w.pllon().clear_bit());
    while rcc.cr().read().pllrdy().bit_is_set() {}
    // SAFETY: factors of the manual.
    rcc.pllcfgr().write(|w| unsafe {
        let w = w.pllm().bits(DIVIDED as u8).plln().bits(MULTIPLIED as u16).pllp().div2();
        w.pllq().bits(USB as u8).pllsrc().hse()
    });
    rcc.cr().modify(|_, w| w.pllon().set_bit());
    while rcc.cr().read().pllrdy().bit_is_clear() {}
    rcc.cfgr().modify(|_, w| w.hpre().div1().ppre1().div4().ppre2().div2());
    // They divide by it after 16 cycles at most (RM0090 7.3.3).
    cortex_m::asm::delay(16);
    rcc.cfgr().modify(|_, w| w.sw().pll());
    while !rcc.cfgr().read().sws().is_pll() {}
}

/// Has the flash wait for as long as the lowest supply needs that the brown-out reset lets the core
/// run on, 2.4 V: 6 wait states at 168 MHz, in force before the clock rises (RM0090 3.5.1). The
/// first revision of the STM32F40x does not prefetch (its errata sheet; ST's own start-up code asks
/// for the revision too).
fn wait_for_flash() {
    const FIRST_REVISION: u16 = 0x1000;
    // The first revision gives itself out as an STM32F2 (errata sheet, "MCU device ID is
    // incorrect").
    const DEVICE_OF_FIRST_REVISION: u16 = 0x411;
    // SAFETY: start-up has the part to itself, and the identity is only read.
    let (flash, identity) = unsafe { (&*FLASH::ptr(), (&*DBGMCU::ptr()).idcode().read()) };
    let is_first =
        identity.rev_id().bits() == FIRST_REVISION || identity.dev_id().bits() == DEVICE_OF_FIRST_REVISION;
    let access = flash.acr();
    access.modify(|_, w| w.latency().ws6().prften().bit(!is_first).icen().set_bit().dcen().set_bit());
    while !access.read().latency().is_ws6() {}
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
