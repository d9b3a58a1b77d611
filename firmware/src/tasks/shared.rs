//! The single words that tasks share. Each has one writer, or is a set of bits.

use control_core::config::DacWidth;
use control_core::units::DacCode;
use core::sync::atomic::{AtomicBool, AtomicI32, AtomicU8, AtomicU16, AtomicU32, Ordering::Relaxed};
use firmware::reset::LastWords;
use firmware::stages::Stages;
use firmware::supervision::{Conditions, Reports, Trips};

/// Who is alive. Written by every task, taken by the supervisor.
pub(crate) static REPORTS: Reports = Reports::new();

/// Faults on their way to the tick.
pub(crate) static TRIPS: Trips = Trips::new();

/// What keeps the device from being started.
pub(crate) static CONDITIONS: Conditions = Conditions::new();

/// Which session's orders the tick carries out: those of a PC that went are none of the next one's. Written by telemetry.
pub(crate) static SESSION: AtomicU8 = AtomicU8::new(0);

/// Times of the stages.
pub(crate) static STAGES: Stages = Stages::new();

/// Milliseconds that the supervisor has run; the tick watches it.
pub(crate) static SUPERVISED_MS: AtomicU32 = AtomicU32::new(0);

/// Whether the amplifier is on. Written by the tick.
pub(crate) static POWERED: AtomicBool = AtomicBool::new(false);

/// The code that was given out last, of 12 bits. Written by the tick.
static GIVEN: AtomicU16 = AtomicU16::new(DacWidth::Bits12.mid_scale());

/// Gives the supervisor the code that a converter of this width was given.
pub(crate) fn set_given(width: DacWidth, code: DacCode) {
    let code = match width {
        DacWidth::Bits12 => code.0,
        DacWidth::Bits8 => code.0 << 4,
    };
    GIVEN.store(code, Relaxed);
}

/// The code that was given out last, of 12 bits.
pub(crate) fn given() -> DacCode {
    DacCode(GIVEN.load(Relaxed))
}

/// Ticks that came late or not at all. Written by the tick.
pub(crate) static MISSED_TICKS: AtomicU32 = AtomicU32::new(0);

/// What the USB host has done to us: [`LINK_CONFIGURED`], [`LINK_READY`]. Written by the USB task.
pub(crate) static LINK: AtomicU8 = AtomicU8::new(0);
/// Enumerated, configured and not suspended.
pub(crate) const LINK_CONFIGURED: u8 = 1;
/// A program has the port open (DTR).
pub(crate) const LINK_READY: u8 = 2;

/// Asks the USB task to throw away what waits for a PC that is gone. Set by telemetry.
pub(crate) static DISCARD: AtomicBool = AtomicBool::new(false);

/// Smoothed inclination in mrad. Written by the tilt task.
static TILT_MRAD: AtomicI32 = AtomicI32::new(0);

/// What survives a reset: start-up code leaves this section alone.
#[allow(unsafe_code, reason = "any bits are valid in it, and it says itself which mean something")]
#[unsafe(link_section = ".uninit.last_words")]
pub(crate) static LAST_WORDS: LastWords = LastWords::new();

/// Gives the tick a new inclination.
pub(crate) fn set_tilt(tilt: control_core::units::Milliradians) {
    TILT_MRAD.store(tilt.0.into(), Relaxed);
}

/// The latest inclination.
pub(crate) fn tilt() -> control_core::units::Milliradians {
    control_core::units::Milliradians(TILT_MRAD.load(Relaxed) as i16)
}
