//! The encoder on TIM2, which counts 32 bits, and its two lines, whose pins the board chooses.
#![allow(unsafe_code, reason = "the HAL does not set the filters of an encoder's inputs")]

use super::monitors::Line;
use super::pin::{Pin, Placed};
use control_core::units::Counts;
use firmware::timing;
use firmware::wire_check::{Pull, PulledLines};
use stm32f4xx_hal::gpio::{self, PushPull, alt};
use stm32f4xx_hal::pac::TIM2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::qei::Qei;
use stm32f4xx_hal::rcc::Rcc;

/// TIM2 in encoder mode.
pub(crate) struct Encoder(Qei<TIM2>);

/// Counts on both edges of both lines (RM0090 18.3.12), each filtered and pulled up: `a` and `b`
/// are inputs, pulled up. `supply` is high while the encoder's supply is there, where it is wired.
pub(crate) fn init<A, B, const P: char, const N: u8>(
    timer: TIM2,
    (a, b): (A, B),
    supply: gpio::Pin<P, N>,
    rcc: &mut Rcc,
) -> (Encoder, EncoderLines)
where
    A: Placed + Into<alt::tim2::Ch1<PushPull>>,
    B: Placed + Into<alt::tim2::Ch2<PushPull>>,
{
    let encoder = timer.qei((a, b), rcc);
    // SAFETY: the timer is `encoder`'s, and nobody reads its count yet.
    let inputs = unsafe { &*TIM2::ptr() }.ccmr1_input();
    // SAFETY: four bits each, of which any value is a filter.
    inputs
        .modify(|_, w| unsafe { w.ic1f().bits(timing::ENCODER_FILTER).ic2f().bits(timing::ENCODER_FILTER) });
    let mut lines = EncoderLines { tracks: [A::PIN, B::PIN], supply: Line::new(supply) };
    lines.pull(Pull::Up);
    (Encoder(encoder), lines)
}

impl firmware::port::Encoder for Encoder {
    #[inline]
    fn count(&self) -> Counts {
        Counts(self.0.count().cast_signed())
    }
}

/// The pins of A and B, whose pulls act while the timer listens (RM0090 8.3.11), and the supply's.
pub(crate) struct EncoderLines {
    tracks: [Pin; 2],
    supply: Line,
}

impl PulledLines for EncoderLines {
    const ALL: u8 = 0b11;

    fn has_supply(&self) -> bool {
        self.supply.is_closed()
    }

    fn high(&mut self) -> u8 {
        let [a, b] = self.tracks.map(Pin::is_high);
        u8::from(a) | u8::from(b) << 1
    }

    fn pull(&mut self, pull: Pull) {
        self.tracks.iter().for_each(|pin| pin.pull(pull));
    }

    fn settle(&mut self) {
        cortex_m::asm::delay(timing::PULL_SETTLE_CYCLES);
    }
}
