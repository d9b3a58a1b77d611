//! A pin by its registers, for what the HAL leaves out and for a crash, which may trust nobody who
//! owns a pin.
#![allow(unsafe_code, reason = "pins are reached past their owners")]

use firmware::wire_check::Pull;
use stm32f4xx_hal::gpio;
use stm32f4xx_hal::pac::{GPIOA, gpioa::RegisterBlock};

/// A pin.
#[derive(Clone, Copy)]
pub(crate) struct Pin {
    port: char,
    number: u8,
}

/// The HAL's types of pins, which say in themselves which one they are.
pub(crate) trait Placed {
    /// Which.
    const PIN: Pin;
}

impl<const P: char, const N: u8, MODE> Placed for gpio::Pin<P, N, MODE> {
    const PIN: Pin = Pin { port: P, number: N };
}

/// From one port's registers to the next one's (RM0090 2.3).
const PORT_BYTES: usize = 0x400;

impl Pin {
    /// Its port. All have the same registers (RM0090 8.4).
    fn registers(self) -> *const RegisterBlock {
        GPIOA::ptr().wrapping_byte_add((self.port as usize - 'A' as usize) * PORT_BYTES)
    }

    /// Its level, whoever drives it.
    pub(crate) fn is_high(self) -> bool {
        // SAFETY: a read without a side effect.
        unsafe { &*self.registers() }.idr().read().bits() >> self.number & 1 != 0
    }

    /// Pulls it, whatever else it does (RM0090 8.3.11). Nobody else changes the pulls of its port
    /// meanwhile.
    pub(crate) fn pull(self, pull: Pull) {
        let (place, pull) = (
            2 * self.number,
            match pull {
                Pull::Up => 0b01,
                Pull::Down => 0b10,
            },
        );
        // SAFETY: two bits, of which these are values of the manual (RM0090 8.4.4); the others
        // stay.
        unsafe { &*self.registers() }
            .pupdr()
            .modify(|r, w| unsafe { w.bits(r.bits() & !(0b11 << place) | pull << place) });
    }

    /// Changes the level of an output. Nobody else drives this pin; the write changes no other.
    pub(crate) fn toggle(self) {
        // SAFETY: a read without a side effect, and a bit that sets or clears this pin (RM0090
        // 8.4.6, 8.4.7).
        unsafe {
            let is_high = (*self.registers()).odr().read().bits() >> self.number & 1 != 0;
            let bit = 1 << (self.number + if is_high { 16 } else { 0 });
            (*self.registers()).bsrr().write(|w| w.bits(bit));
        }
    }

    /// Drives it low, where it is an output; else it does nothing. A write that changes no other
    /// pin.
    pub(crate) fn set_low(self) {
        // SAFETY: a bit that clears this pin (RM0090 8.4.7).
        unsafe { &*self.registers() }.bsrr().write(|w| unsafe { w.bits(1 << (self.number + 16)) });
    }
}
