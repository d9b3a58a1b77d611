//! The lines on which the amplifier and the emergency stop speak back, and the motor's current where it is measured.
#![allow(unsafe_code, reason = "the HAL waits for a conversion; here one runs all the time and is only read")]

use control_core::units::DacCode;
use firmware::monitor::Readings;
use firmware::port::ReadDrive;
use stm32f4xx_hal::gpio::{Analog, Input, PC2, PE4, PE5, PE6};
use stm32f4xx_hal::pac::{ADC_COMMON, ADC2, GPIOD};
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// PD7 in its port.
const ENABLE_LINE: u32 = 1 << 7;

/// All of them.
pub(crate) struct DriveLines {
    stop: PE4<Input>,
    ready: PE5<Input>,
    current: Option<ADC2>,
}

impl DriveLines {
    /// `fitted` is low where the current is measured. Pulled up: a wire that is off says stop, not ready, not fitted.
    pub(crate) fn new(
        (stop, ready, fitted): (PE4, PE5, PE6),
        (converter, _pin): (ADC2, PC2<Analog>),
        rcc: &mut Rcc,
    ) -> Self {
        let (stop, ready) = (stop.into_pull_up_input(), ready.into_pull_up_input());
        let fitted = fitted.into_pull_up_input();
        cortex_m::asm::delay(firmware::timing::PULL_SETTLE_CYCLES);
        let current = fitted.is_low().then(|| convert_for_ever(converter, rcc));
        Self { stop, ready, current }
    }
}

impl ReadDrive for DriveLines {
    fn read(&self) -> Readings {
        Readings {
            stop_open: self.stop.is_high(),
            ready: self.ready.is_low(),
            // SAFETY: a read without a side effect.
            enable_line: unsafe { &*GPIOD::ptr() }.idr().read().bits() & ENABLE_LINE != 0,
            current: self.current.as_ref().map(|adc| DacCode(adc.dr().read().data().bits())),
        }
    }
}

/// PC2 is channel 12. A conversion takes 96 cycles of 21 MHz, 5 µs, over and over (RM0090 13.3.5).
fn convert_for_ever(converter: ADC2, rcc: &mut Rcc) -> ADC2 {
    const CHANNEL: u8 = 12;
    ADC2::enable(rcc);
    // SAFETY: the prescaler that the HAL sets too; both converters run on it. 84 MHz by 4, for more than 36 MHz is too
    // fast (DS8626, ADC characteristics).
    unsafe { &*ADC_COMMON::ptr() }.ccr().modify(|_, w| w.adcpre().div4());
    converter.smpr1().modify(|_, w| w.smp12().cycles84());
    // SAFETY: a channel that there is.
    converter.sqr3().modify(|_, w| unsafe { w.sq1().bits(CHANNEL) });
    converter.cr2().modify(|_, w| w.cont().set_bit().adon().set_bit());
    // It takes 3 µs to wake.
    cortex_m::asm::delay(firmware::timing::PULL_SETTLE_CYCLES);
    converter.cr2().modify(|_, w| w.swstart().set_bit());
    converter
}
