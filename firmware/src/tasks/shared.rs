//! The single words that tasks share. Each has one writer, or is a set of bits.

use super::latest_line::LatestLine;
use crate::reset::LastWords;
use crate::stage_timing::Stages;
use crate::supervision::{Conditions, Reports, Trips};
use control_core::config::{DacWidth, Sensors};
use control_core::units::{Counts, DacCode, Milliradians};
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU8, AtomicU16, AtomicU32, Ordering::Relaxed};

/// Enumerated, configured and not suspended: a bit of [`Shared::link`].
pub(crate) const LINK_CONFIGURED: u8 = 1;
/// A program has the port open (DTR): a bit of [`Shared::link`].
pub(crate) const LINK_READY: u8 = 2;

/// All of them; there is one on a device.
pub struct Shared {
    /// Who is alive. Written by every task, taken by the supervisor.
    pub reports: Reports,
    /// Faults on their way to the tick.
    pub trips: Trips,
    /// The causes that keep the device from being started.
    pub conditions: Conditions,
    /// The number of stops so far; the end of a session is one. No order from before the last of
    /// them gives torque. Written by telemetry, before it raises the stop in `trips`.
    pub stops: AtomicU32,
    /// The latest line of the needle. Written by telemetry.
    pub line: LatestLine,
    /// The number of orders that give torque which the tick has taken from the queue, modulo 2^32.
    /// Written by the tick, after what `powered` says of them.
    pub starts_taken: AtomicU32,
    /// Times of the stages.
    pub stages: Stages,
    /// Milliseconds that the supervisor has run; the tick watches it.
    pub supervised_ms: AtomicU32,
    /// True if the amplifier is on. Written by the tick.
    pub powered: AtomicBool,
    /// True if the encoder's lines are at one level. Written by the supervisor.
    pub lines_agree: AtomicBool,
    /// Ticks that came late or not at all. Written by the tick.
    pub missed_ticks: AtomicU32,
    /// Codes that were written after the converter's instant. Written by the tick.
    pub late_codes: AtomicU32,
    /// The state that the USB host has set: `LINK_CONFIGURED`, `LINK_READY`. Written by the USB
    /// task.
    pub link: AtomicU8,
    /// Asks the USB task to throw away what waits for a PC that is gone. Set by telemetry.
    pub discard: AtomicBool,
    /// The words that survive a reset.
    pub last_words: &'static LastWords,
    given: AtomicU16,
    count: AtomicI32,
    tilt_mrad: AtomicI32,
    /// The optional sensors that are there: `ENCODER_SUPPLY`, `CURRENT`.
    fitted: AtomicU8,
}

const ENCODER_SUPPLY: u8 = 1;
const CURRENT: u8 = 2;

impl Shared {
    /// As at start-up.
    pub const fn new(last_words: &'static LastWords) -> Self {
        Self {
            reports: Reports::new(),
            trips: Trips::new(),
            conditions: Conditions::new(),
            stops: AtomicU32::new(0),
            line: LatestLine::new(),
            starts_taken: AtomicU32::new(0),
            stages: Stages::new(),
            supervised_ms: AtomicU32::new(0),
            powered: AtomicBool::new(false),
            lines_agree: AtomicBool::new(false),
            missed_ticks: AtomicU32::new(0),
            late_codes: AtomicU32::new(0),
            link: AtomicU8::new(0),
            discard: AtomicBool::new(false),
            last_words,
            given: AtomicU16::new(DacWidth::BITS_16.mid_scale()),
            count: AtomicI32::new(0),
            tilt_mrad: AtomicI32::new(0),
            fitted: AtomicU8::new(0),
        }
    }

    /// True if torque is on.
    pub fn is_powered(&self) -> bool {
        self.powered.load(Relaxed)
    }

    /// Takes torque away at the next tick, whatever waits in the queues: what waits there gives
    /// none.
    pub(crate) fn stop(&self) {
        self.stops.store(self.stops.load(Relaxed).wrapping_add(1), Relaxed);
        self.trips.raise_stop();
    }

    /// Gives the supervisor the code that a converter of this width was given.
    pub(crate) fn set_given(&self, width: DacWidth, code: DacCode) {
        // As 16 bits: the highest of any width are in one place.
        self.given.store(code.0 << (16 - width.bits()), Relaxed);
    }

    /// The code that was given out last, of 12 bits.
    pub fn given(&self) -> DacCode {
        DacCode(self.given.load(Relaxed) >> 4)
    }

    /// Gives the supervisor the encoder's count.
    pub(crate) fn set_count(&self, count: i32) {
        self.count.store(count, Relaxed);
    }

    /// The encoder's count in the latest tick.
    pub fn count(&self) -> Counts {
        Counts(self.count.load(Relaxed))
    }

    /// Gives the tick a new inclination.
    pub fn set_tilt(&self, tilt: Milliradians) {
        self.tilt_mrad.store(tilt.0.into(), Relaxed);
    }

    /// Sets the optional sensors that are there.
    pub(crate) fn set_fitted(&self, sensors: Sensors) {
        let bit = |is_there, bit| if is_there { bit } else { 0 };
        let fitted = bit(sensors.encoder_supply, ENCODER_SUPPLY) | bit(sensors.current, CURRENT);
        self.fitted.store(fitted, Relaxed);
    }

    /// Those that are there.
    pub(crate) fn fitted(&self) -> Sensors {
        let fitted = self.fitted.load(Relaxed);
        Sensors { encoder_supply: fitted & ENCODER_SUPPLY != 0, current: fitted & CURRENT != 0 }
    }

    /// The latest inclination.
    pub fn tilt(&self) -> Milliradians {
        Milliradians(self.tilt_mrad.load(Relaxed) as i16)
    }
}
