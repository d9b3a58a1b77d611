//! The encoder on TIM2 and its two lines on port A.
#![allow(
    unsafe_code,
    reason = "the HAL sets neither the filters of an encoder's inputs nor the pulls of a timer's pins"
)]

use control_core::units::Counts;
use firmware::lines::{Pull, PulledLines};
use firmware::timing;
use stm32f4xx_hal::gpio::{Alternate, PA1, PA15, alt};
use stm32f4xx_hal::pac::{GPIOA, TIM2};
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::qei::Qei;
use stm32f4xx_hal::rcc::Rcc;

/// TIM2 in encoder mode.
pub(crate) struct Encoder(Qei<TIM2>);

/// Counts on both edges of both lines (RM0090 18.3.12), each filtered and pulled up. PA15 is the debugger's JTDI out of
/// reset (8.3.2); from here on it is the timer's.
pub(crate) fn init(timer: TIM2, a: PA15<Alternate<0>>, b: PA1, rcc: &mut Rcc) -> (Encoder, EncoderLines) {
    let a: alt::tim2::Ch1<_> = a.into_pull_up_input().into();
    let b: alt::tim2::Ch2<_> = b.into_pull_up_input().into();
    let encoder = timer.qei((a, b), rcc);
    // SAFETY: the timer is `encoder`'s, and nobody reads its count yet.
    let inputs = unsafe { &*TIM2::ptr() }.ccmr1_input();
    // SAFETY: four bits each, of which any value is a filter.
    inputs
        .modify(|_, w| unsafe { w.ic1f().bits(timing::ENCODER_FILTER).ic2f().bits(timing::ENCODER_FILTER) });
    let mut lines = EncoderLines(());
    lines.pull(Pull::Up);
    (Encoder(encoder), lines)
}

impl firmware::port::Encoder for Encoder {
    fn count(&self) -> Counts {
        Counts(self.0.count().cast_signed())
    }
}

/// PA15 and PA1, whose pulls act while the timer listens (RM0090 8.3.11).
pub(crate) struct EncoderLines(());

impl EncoderLines {
    const A: u32 = 15;
    const B: u32 = 1;
}

impl PulledLines for EncoderLines {
    fn high(&mut self) -> u8 {
        // SAFETY: a read without a side effect.
        let levels = unsafe { &*GPIOA::ptr() }.idr().read().bits();
        (levels >> Self::A & 1 | (levels >> Self::B & 1) << 1) as u8
    }

    fn pull(&mut self, pull: Pull) {
        const BOTH: u32 = 0b11 << (2 * EncoderLines::A) | 0b11 << (2 * EncoderLines::B);
        let pulls = match pull {
            Pull::Up => 0b01 << (2 * Self::A) | 0b01 << (2 * Self::B),
            Pull::Down => 0b10 << (2 * Self::A) | 0b10 << (2 * Self::B),
        };
        // SAFETY: the pulls of these two lines, which are ours; nobody changes those of port A's other pins any more.
        unsafe { &*GPIOA::ptr() }.pupdr().modify(|r, w| unsafe { w.bits(r.bits() & !BOTH | pulls) });
    }

    fn settle(&mut self) {
        cortex_m::asm::delay(timing::PULL_SETTLE_CYCLES);
    }
}
