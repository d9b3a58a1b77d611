//! Channel 1 of the digital-to-analogue converter, RM0090 chapter 14: a code in, a pin out.
//!
//! What the part does not promise, it does not do here: the trigger's selection stays as it was
//! while the channel is enabled (14.3.6), a code that waits goes out with its trigger and no other
//! way (14.3.4), and the output buffer, which is on out of reset (14.3.2), does not come nearer to
//! either rail than 0.2 V (data sheet DS8626, DAC characteristics).
//!
//! Left out: DMA, wave generation, channel 2's pin, and the three or so APB clocks from a write or
//! a trigger to the output. A trigger from a timer is the board's to bring: [`Dac::trigger`].

use rigless::chip::parallel::Peer;
use rigless::device::DeviceContext;
use rigless::soc::Width;
use serde::{Deserialize, Serialize};

const CR: u64 = 0x00;
const SWTRIGR: u64 = 0x04;
const DHR12R1: u64 = 0x08;
const DHR12L1: u64 = 0x0C;
const DHR8R1: u64 = 0x10;
const DHR12RD: u64 = 0x20;
const DHR12LD: u64 = 0x24;
const DHR8RD: u64 = 0x28;
const DOR1: u64 = 0x2C;
/// `CR.EN1`: the pin is driven.
const EN1: u32 = 1;
/// `CR.BOFF1`: the output buffer is off.
const BOFF1: u32 = 1 << 1;
/// `CR.TEN1`: a held code waits for its trigger.
const TEN1: u32 = 1 << 2;
/// `CR.TSEL1`: which trigger.
const TSEL1: u32 = 0b111 << 3;
/// `CR.TSEL1` that selects software.
const SOFTWARE: u32 = 0b111;

/// The codes that the output buffer reaches: 0.2 V from either rail of 3.0 V.
const BUFFERED: std::ops::RangeInclusive<u16> = 273..=4_095 - 273;

/// Returns the trigger that releases a held code, `CR.TSEL1`.
fn selected(control: u32) -> u32 {
    control >> 3 & 0b111
}

/// The converter.
#[derive(Debug, Default, Serialize, Deserialize)]
pub(super) struct Dac {
    control: u32,
    held: u16,
    output: u16,
    violations: Vec<String>,
}

impl Dac {
    /// The code that the voltage at the pin stands for, or `None` while the pin is not driven.
    #[must_use]
    pub(super) fn code(&self) -> Option<u16> {
        let is_buffered = self.control & BOFF1 == 0;
        let reached =
            if is_buffered { self.output.clamp(*BUFFERED.start(), *BUFFERED.end()) } else { self.output };
        (self.control & EN1 != 0).then_some(reached)
    }

    /// Returns the firmware's actions that the manual does not describe.
    #[must_use]
    pub(super) fn violations(&self) -> &[String] {
        &self.violations
    }

    /// A write to `CR`.
    fn configure(&mut self, wanted: u32) {
        let was = self.control;
        let mut control = wanted;
        if was & wanted & EN1 != 0 && (was ^ wanted) & TSEL1 != 0 {
            self.violations
                .push(format!("CR {was:#x} to {wanted:#x}: TSEL1 changed while EN1 is set (14.3.6)"));
            control = control & !TSEL1 | was & TSEL1;
        }
        if was & wanted & EN1 != 0 && was & TEN1 != 0 && wanted & TEN1 == 0 && self.held != self.output {
            self.violations.push(format!(
                "CR {was:#x} to {wanted:#x}: TEN1 cleared while a code waits: what becomes of it is not documented (14.3.4)"
            ));
        }
        self.control = control;
    }

    /// The trigger that the held code waits for, as `TSEL1` numbers it; `None` where it waits for
    /// none, or for software.
    pub(super) fn waits_for(&self) -> Option<u32> {
        let trigger = selected(self.control);
        let waits = self.control & (EN1 | TEN1) == EN1 | TEN1 && trigger != SOFTWARE;
        (waits && self.held != self.output).then_some(trigger)
    }

    fn hold(&mut self, code: u16) {
        self.held = code;
        if self.control & TEN1 == 0 {
            self.output = code;
        }
    }

    /// The trigger came.
    pub(super) fn trigger(&mut self) {
        self.output = self.held;
    }
}

rigless::store!(Dac);

impl Peer for Dac {
    fn read(&mut self, offset: u64, _width: Width, _context: &mut DeviceContext<'_>) -> u64 {
        match offset {
            CR => self.control.into(),
            DHR12R1 | DHR12RD => self.held.into(),
            DHR12L1 | DHR12LD => u64::from(self.held) << 4,
            DHR8R1 | DHR8RD => u64::from(self.held) >> 4,
            DOR1 => self.output.into(),
            _ => 0,
        }
    }

    fn write(&mut self, offset: u64, _width: Width, value: u64, _context: &mut DeviceContext<'_>) {
        match offset {
            CR => self.configure(value as u32),
            SWTRIGR if value & 1 != 0 && selected(self.control) == SOFTWARE => self.trigger(),
            DHR12R1 | DHR12RD => self.hold((value & 0xFFF) as u16),
            DHR12L1 | DHR12LD => self.hold((value >> 4 & 0xFFF) as u16),
            DHR8R1 | DHR8RD => self.hold(((value & 0xFF) << 4) as u16),
            _ => {}
        }
    }

    fn reset(&mut self) {
        *self = Self { violations: std::mem::take(&mut self.violations), ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIM4: u32 = 0b101 << 3;

    fn with_code(control: u32, code: u16) -> Dac {
        let mut dac = Dac::default();
        dac.configure(control);
        dac.hold(code);
        dac
    }

    #[test]
    fn the_trigger_is_chosen_before_the_channel_is_enabled_or_never() {
        let mut dac = Dac::default();
        dac.configure(EN1);
        dac.configure(EN1 | TEN1 | TIM4);
        dac.hold(3_000);
        assert_eq!(dac.waits_for(), Some(0), "the trigger of reset, TIM6");
        assert_eq!(dac.violations().len(), 1);
        let dac = with_code(EN1 | TEN1 | TIM4, 3_000);
        assert_eq!((dac.waits_for(), dac.violations().len()), (Some(0b101), 0));
    }

    #[test]
    fn a_code_that_waits_goes_out_with_its_trigger_only() {
        let mut dac = with_code(EN1 | BOFF1 | TEN1 | TIM4, 3_000);
        dac.configure(EN1 | BOFF1 | TIM4);
        assert_eq!((dac.code(), dac.violations().len()), (Some(0), 1));
        dac.hold(2_000);
        assert_eq!(dac.code(), Some(2_000), "without a trigger a code goes straight out");
    }

    #[test]
    fn the_buffer_keeps_away_from_both_rails() {
        for (code, buffered) in [(1, 273), (2_048, 2_048), (4_095, 3_822)] {
            assert_eq!(with_code(EN1, code).code(), Some(buffered));
            assert_eq!(with_code(EN1 | BOFF1, code).code(), Some(code));
        }
    }
}
