//! The lines on which the amplifier and the emergency stop speak back, and the motor's current
//! where it is measured.
#![allow(unsafe_code, reason = "the HAL waits for a conversion; here one runs all the time and is only read")]

use super::pin::Pin;
use control_core::units::DacCode;
use firmware::monitor::Readings;
use firmware::port::ReadDrive;
use stm32f4xx_hal::gpio::{self, AnyPin, Input};
use stm32f4xx_hal::hal_02::adc::Channel;
use stm32f4xx_hal::pac::{ADC_COMMON, ADC1, ADC2};
use stm32f4xx_hal::rcc::{Enable, Rcc};

/// A line that a contact outside connects to the board's supply, pulled down: a wire that is off or
/// shorted to ground reads low.
pub(crate) struct Line(AnyPin<Input>);

impl Line {
    /// On `pin`.
    pub(crate) fn new<const P: char, const N: u8>(pin: gpio::Pin<P, N>) -> Self {
        Self(pin.into_pull_down_input().erase())
    }

    /// True if the contact is closed.
    pub(crate) fn is_closed(&self) -> bool {
        self.0.is_high()
    }
}

/// All of them.
pub(crate) struct DriveLines {
    stop: Line,
    ready: Line,
    enable: Pin,
    current: Option<ADC2>,
}

impl DriveLines {
    /// `fitted` is closed where the current is measured, on `channel`. A wire that is off says
    /// stop, not ready, not fitted. The `enable` line is read back.
    pub(crate) fn new(
        [stop, ready, fitted]: [Line; 3],
        enable: Pin,
        (converter, channel): (ADC2, impl Channel<ADC2, ID = u8>),
        rcc: &mut Rcc,
    ) -> Self {
        cortex_m::asm::delay(firmware::timing::PULL_SETTLE_CYCLES);
        let current = fitted.is_closed().then(|| convert_for_ever(converter, channel, rcc));
        Self { stop, ready, enable, current }
    }
}

impl ReadDrive for DriveLines {
    fn read(&self) -> Readings {
        Readings {
            stop_open: !self.stop.is_closed(),
            ready: self.ready.is_closed(),
            enable_line: self.enable.is_high(),
            current: self.current.as_ref().map(|adc| DacCode(adc.dr().read().data().bits())),
        }
    }
}

/// A conversion takes 96 cycles of 21 MHz, 5 µs, over and over (RM0090 13.3.5).
fn convert_for_ever<C: Channel<ADC2, ID = u8>>(converter: ADC2, _channel: C, rcc: &mut Rcc) -> ADC2 {
    /// 84 cycles of sampling.
    const SAMPLING: u8 = 0b100;
    let channel = C::channel();
    ADC2::enable(rcc);
    // The manual does not say on whose clock the common registers are: on that of the first one, by
    // its address.
    ADC1::enable(rcc);
    // SAFETY: the prescaler that the HAL sets too; both converters run on it. 84 MHz by 4, for more
    // than 36 MHz is too fast (data sheet, ADC characteristics).
    unsafe { &*ADC_COMMON::ptr() }.ccr().modify(|_, w| w.adcpre().div4());
    // SAFETY: a time of the manual, for a channel that there is.
    match channel {
        0..10 => converter.smpr2().modify(|_, w| unsafe { w.smp(channel).bits(SAMPLING) }),
        10.. => converter.smpr1().modify(|_, w| unsafe { w.smp(channel - 10).bits(SAMPLING) }),
    };
    // SAFETY: a channel that there is.
    converter.sqr3().modify(|_, w| unsafe { w.sq1().bits(channel) });
    converter.cr2().modify(|_, w| w.cont().set_bit().adon().set_bit());
    // It takes 3 µs to wake.
    cortex_m::asm::delay(firmware::timing::PULL_SETTLE_CYCLES);
    converter.cr2().modify(|_, w| w.swstart().set_bit());
    converter
}
