//! The external interrupt controller, RM0090 chapter 12, as far as the supply's voltage detector
//! needs it: line 16, its edges and its interrupt.

use rigless::chip::parallel::Peer;
use rigless::device::{DeviceContext, Level};
use rigless::soc::Width;
use serde::{Deserialize, Serialize};

const IMR: u64 = 0x00;
const RTSR: u64 = 0x08;
const FTSR: u64 = 0x0C;
const SWIER: u64 = 0x10;
const PR: u64 = 0x14;
/// Line 16 is the voltage detector's output.
const DETECTOR: u32 = 1 << 16;

/// The one interrupt of the window: `PVD`, line 1.
pub(super) const INTERRUPTS: [u16; 1] = [1];

/// The controller.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Exti {
    mask: u32,
    rising: u32,
    falling: u32,
    pending: u32,
    /// The detector's output: the supply is below its threshold.
    detector: bool,
    /// The detector's new state that the controller has not seen yet.
    arriving: Option<bool>,
    line: bool,
}

impl Default for Exti {
    /// Out of reset. What is pending then is undefined (12.3.6): the worst is that all is.
    fn default() -> Self {
        Self {
            mask: 0,
            rising: 0,
            falling: 0,
            pending: DETECTOR,
            detector: false,
            arriving: None,
            line: false,
        }
    }
}

impl Exti {
    /// The detector's output from the next stop on.
    pub(super) fn drive_detector(&mut self, low_supply: bool) {
        self.arriving = Some(low_supply);
    }

    fn settle(&mut self, context: &mut DeviceContext<'_>) {
        let line = self.pending & self.mask & DETECTOR != 0;
        if line != self.line {
            self.line = line;
            context.interrupt(0, Level::from(line));
        }
    }
}

rigless::store!(Exti);

impl Peer for Exti {
    fn read(&mut self, offset: u64, _width: Width, _context: &mut DeviceContext<'_>) -> u64 {
        match offset {
            IMR => self.mask.into(),
            RTSR => self.rising.into(),
            FTSR => self.falling.into(),
            PR => self.pending.into(),
            _ => 0,
        }
    }

    fn write(&mut self, offset: u64, _width: Width, value: u64, context: &mut DeviceContext<'_>) {
        let value = value as u32;
        match offset {
            IMR => self.mask = value,
            RTSR => self.rising = value,
            FTSR => self.falling = value,
            SWIER => self.pending |= value,
            PR => self.pending &= !value,
            _ => {}
        }
        self.settle(context);
    }

    fn poll(&mut self, context: &mut DeviceContext<'_>) {
        let Some(detector) = self.arriving.take() else { return };
        let edges = if detector { self.rising } else { self.falling };
        if detector != self.detector {
            self.pending |= edges & DETECTOR;
        }
        self.detector = detector;
        self.settle(context);
    }

    /// The detector's output stays: the supply is what it is.
    fn reset(&mut self) {
        *self = Self { detector: self.detector, arriving: self.arriving, ..Self::default() };
    }
}
