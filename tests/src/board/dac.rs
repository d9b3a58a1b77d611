//! Channel 1 of the digital-to-analogue converter, RM0090 chapter 14: a code in, a pin out.
//!
//! Left out: DMA, wave generation, channel 2's pin, and the three or so APB clocks from a write or a
//! trigger to the output. A trigger from a timer is the board's to bring: [`Dac::trigger`].

use rigless::chip::parallel::Peer;
use rigless::device::DeviceContext;
use rigless::snapshot::Store;
use rigless::soc::Width;

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
/// `CR.TEN1`: a held code waits for its trigger.
const TEN1: u32 = 1 << 2;
/// `CR.TSEL1` that selects software.
const SOFTWARE: u32 = 0b111;

/// Which trigger lets a held code out, `CR.TSEL1`.
fn selected(control: u32) -> u32 {
    control >> 3 & 0b111
}

/// The converter.
#[derive(Debug, Default)]
pub(super) struct Dac {
    control: u32,
    held: u16,
    output: u16,
}

impl Dac {
    /// The code at the output, or `None` while the pin is not driven.
    #[must_use]
    pub(super) fn code(&self) -> Option<u16> {
        (self.control & EN1 != 0).then_some(self.output)
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

impl Store for Dac {}

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
            CR => self.control = value as u32,
            SWTRIGR if value & 1 != 0 && selected(self.control) == SOFTWARE => self.trigger(),
            DHR12R1 | DHR12RD => self.hold((value & 0xFFF) as u16),
            DHR12L1 | DHR12LD => self.hold((value >> 4 & 0xFFF) as u16),
            DHR8R1 | DHR8RD => self.hold(((value & 0xFF) << 4) as u16),
            _ => {}
        }
    }

    fn reset(&mut self) {
        *self = Self::default();
    }
}
