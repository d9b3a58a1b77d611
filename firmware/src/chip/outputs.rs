//! The converters, as the traits that the hardware-free parts know.
#![allow(unsafe_code, reason = "the HAL leaves the converter's trigger to its user")]

use control_core::config::DacWidth;
use control_core::units::DacCode;
use firmware::drive::{ByteBus, MotorDac};
use firmware::tilt::ReadCode;
use stm32f4xx_hal::adc::Adc;
use stm32f4xx_hal::adc::config::{AdcConfig, Clock, SampleTime};
use stm32f4xx_hal::dac::{C1, DacOut};
use stm32f4xx_hal::gpio::outport::OutPort8;
use stm32f4xx_hal::gpio::{self, Output, PE8, PE9, PE10, PE11, PE12, PE13, PE14, PE15};
use stm32f4xx_hal::hal_02::adc::Channel;
use stm32f4xx_hal::pac::{ADC1, DAC, GPIOE};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::rcc::Rcc;

/// The microcontroller's own converter, channel 1. It takes a code at the instant that the tick's
/// timer sets (TRGO), so that the motor is driven at equal distances, however long the tick took to
/// compute.
pub(crate) struct OnChipDac(C1);

impl OnChipDac {
    /// At zero torque from the first moment that it is on. The buffer is off: it would end 0.2 V
    /// from either rail (DS8626, DAC characteristics), where full torque is; a follower is outside
    /// (`docs/guide/hardware.md`).
    pub(crate) fn new(mut channel: C1) -> Self {
        // SAFETY: `C1` stands for channel 1, whose bits alone are changed; channel 2 is not used.
        let control = unsafe { &*DAC::ptr() }.cr();
        // RM0090 14.3.6: which trigger cannot be changed while the channel is enabled.
        control.modify(|_, w| w.boff1().set_bit().tsel1().tim4trgo().ten1().clear_bit().en1().clear_bit());
        let mid_scale = DacWidth::BITS_12.mid_scale();
        channel.set_value(mid_scale);
        control.modify(|_, w| w.en1().set_bit());
        // 14.3.4: without a trigger the code is at the pin one bus clock later; from then on codes
        // wait for the timer.
        channel.set_value(mid_scale);
        control.modify(|_, w| w.ten1().set_bit());
        Self(channel)
    }
}

impl MotorDac for OnChipDac {
    const WIDTH: DacWidth = DacWidth::BITS_12;

    fn put(&mut self, code: DacCode) {
        self.0.set_value(code.0);
    }
}

type LinePins = (PE8, PE9, PE10, PE11, PE12, PE13, PE14, PE15);

/// Eight lines of port E, set in one write: the same on every board, for both have this half of a
/// port free on one header.
pub(crate) struct Lines(OutPort8<'E', 8, 9, 10, 11, 12, 13, 14, 15>);

impl Lines {
    /// As outputs.
    pub(crate) fn new(pins: LinePins) -> Self {
        let (p0, p1, p2, p3, p4, p5, p6, p7) = pins;
        let outputs = (
            p0.into_push_pull_output(),
            p1.into_push_pull_output(),
            p2.into_push_pull_output(),
            p3.into_push_pull_output(),
            p4.into_push_pull_output(),
            p5.into_push_pull_output(),
            p6.into_push_pull_output(),
            p7.into_push_pull_output(),
        );
        Self(outputs.outport())
    }
}

/// The amplifier's enable line as an output that is low. The board calls this before it sets up any
/// other pin.
pub(crate) fn amplifier_off<const P: char, const N: u8>(pin: gpio::Pin<P, N>) -> gpio::Pin<P, N, Output> {
    let mut enable = pin.into_push_pull_output();
    enable.set_low();
    enable
}

/// Both converters at zero torque, from the peripherals and the ports that have their pins: PA4
/// leaves no choice, and PE8–PE15 are the same on every board.
macro_rules! converters {
    ($device:ident, $gpioa:ident, $gpioe:ident, $rcc:ident) => {{
        let lines = $crate::chip::Lines::new((
            $gpioe.pe8,
            $gpioe.pe9,
            $gpioe.pe10,
            $gpioe.pe11,
            $gpioe.pe12,
            $gpioe.pe13,
            $gpioe.pe14,
            $gpioe.pe15,
        ));
        let wide = $crate::chip::OnChipDac::new($device.DAC.constrain($gpioa.pa4.into_analog(), $rcc));
        firmware::drive::Two { wide, narrow: firmware::drive::ParallelDac(lines) }
    }};
}
pub(crate) use converters;

/// Mid-scale on them, after a crash: the highest bit set, the others cleared.
pub(super) fn lines_to_zero_torque() {
    const ZERO_TORQUE: u32 = 1 << 15 | 0x7F << (8 + 16);
    // SAFETY: as in `put`; whoever owned the lines never runs again.
    unsafe { &*GPIOE::ptr() }.bsrr().write(|w| unsafe { w.bits(ZERO_TORQUE) });
}

/// Mid-scale at the microcontroller's own converter, after a crash, whatever it waited for.
pub(super) fn dac_to_zero_torque() {
    let mid_scale = DacWidth::BITS_12.mid_scale().into();
    // SAFETY: valid codes and bits; whoever owned the converter never runs again.
    unsafe {
        // Off and on again, now without its trigger (RM0090 14.3.6): a code then goes straight out
        // (14.3.4).
        (*DAC::ptr()).cr().write(|w| w.boff1().set_bit());
        (*DAC::ptr()).dhr12r1().write(|w| w.bits(mid_scale));
        (*DAC::ptr()).cr().write(|w| w.boff1().set_bit().en1().set_bit());
        (*DAC::ptr()).dhr12r1().write(|w| w.bits(mid_scale));
    }
}

impl ByteBus for Lines {
    fn put(&mut self, byte: u8) {
        // Of port E's upper half: what is to rise in the lower word, what is to fall in the upper
        // one.
        let word = u32::from(byte) << 8 | u32::from(!byte) << 24;
        // SAFETY: writes to this register change the lines named in it and no other, and those
        // eight belong to `self`. The HAL puts the same word together line by line, in fifty
        // instructions of the tick.
        unsafe { &*GPIOE::ptr() }.bsrr().write(|w| unsafe { w.bits(word) });
    }
}

/// The analogue inclinometer, on the pin that the board chooses for it.
pub(crate) struct InclinometerPin<P> {
    converter: Adc<ADC1>,
    pin: P,
}

impl<P: Channel<ADC1, ID = u8>> InclinometerPin<P> {
    /// On ADC 1.
    pub(crate) fn new(adc: ADC1, pin: P, rcc: &mut Rcc) -> Self {
        // 84 MHz by 4: by 2, as the HAL would have it, is more than the converter's 36 MHz (data
        // sheet, ADC characteristics).
        let config = AdcConfig::default().clock(Clock::Pclk2_div_4);
        Self { converter: Adc::new(adc, true, config, rcc), pin }
    }
}

impl<P: Channel<ADC1, ID = u8>> ReadCode for InclinometerPin<P> {
    fn read_code(&mut self) -> u16 {
        // The longest sampling: 20 µs, for a source of tens of kΩ.
        self.converter.convert(&self.pin, SampleTime::Cycles_480)
    }
}
