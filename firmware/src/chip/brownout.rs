//! The brown-out reset, which a part from the factory has switched off. Below 2.66 V the torque
//! goes off; without this reset nothing would stop a core whose supply goes on falling.
//!
//! The register of the option bytes shows what was written to it, taken or not. So what counts is
//! what the last reset loaded into it, and option bytes that were set count after the next one.
#![allow(unsafe_code, reason = "option bytes are written whole, past the owner of the flash")]

use super::flash;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use firmware::timing;
use link::frames::GuardRefusal;
use stm32f4xx_hal::pac::FLASH;
use stm32f4xx_hal::pac::flash::RegisterBlock;

/// Values of `BOR_LEV` (RM0090 3.9.10): the smaller, the higher the threshold. The register crate
/// names them the other way round (its "level 2" is the manual's level 1), so they are given as
/// numbers here.
const LEVELS: u32 = 0b11 << 2;
const LEVEL_3: u32 = 0;
const LEVEL_2: u32 = 0b01 << 2;
const KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];
/// Lock and start, which are no option bytes.
const ACTIONS: u32 = 0b11;
/// Bits that a board for this firmware has in one way only: the flash is not protected from being
/// read or written, and what is reserved is clear.
const FIXED: u32 = 0xFFFF_FF10;
const UNPROTECTED: u32 = 0x0FFF_AA00;

/// The register as the last reset loaded it; 0, which no board has, before it was looked at.
static LOADED: AtomicU32 = AtomicU32::new(0);

/// Notes what the last reset has loaded, before anybody writes to the register.
pub(super) fn note_loaded(flash: &RegisterBlock) {
    LOADED.store(flash.optcr().read().bits(), Relaxed);
}

/// True if the part resets itself before its supply is too low for what the firmware asks of it: at
/// level 2, 2.4 to 2.5 V on the way down (data sheet, BOR thresholds), or at level 3.
fn is_on(options: u32) -> bool {
    is_plausible(options) && [LEVEL_2, LEVEL_3].contains(&(options & LEVELS))
}

/// Option bytes that are something else were read wrong, and are never written back: a read
/// protection would stay, or take the whole flash with it when it goes (RM0090 3.7.3).
fn is_plausible(options: u32) -> bool {
    options & FIXED == UNPROTECTED
}

/// True if it is in force.
pub(super) fn is_in_force() -> bool {
    is_on(LOADED.load(Relaxed))
}

/// Checks that it is in force; where it is off, sets level 2 if `set` asks for it (RM0090 3.7.2).
/// The other option bytes stay. Level 3 would reset a board whose rail is a diode below 3.3 V.
/// Stops the processor for up to a second.
pub(super) fn guard(set: bool) -> Result<(), GuardRefusal> {
    // SAFETY: telemetry asks, which has the flash's controller and does nothing else meanwhile.
    let flash = unsafe { &*FLASH::ptr() };
    let (loaded, shown) = (LOADED.load(Relaxed), flash.optcr().read().bits());
    if let Some(implausible) = [loaded, shown].into_iter().find(|&options| !is_plausible(options)) {
        return Err(GuardRefusal::Implausible(implausible));
    }
    if is_on(loaded) {
        return Ok(());
    }
    if is_on(shown) {
        return Err(GuardRefusal::Restart);
    }
    if !set {
        return Err(GuardRefusal::Off);
    }
    let wanted = loaded & !(LEVELS | ACTIONS) | LEVEL_2;
    flash::patiently(|| program(flash, wanted))?;
    defmt::info!("the brown-out reset was off and has been set to level 2");
    Err(GuardRefusal::Restart)
}

/// Programs the option bytes, and sees that nothing says that they were not taken.
fn program(flash: &RegisterBlock, options: u32) -> Result<(), GuardRefusal> {
    const OPTSTRT: u32 = 0b10;
    let is_ready = || (0..timing::OPTION_TURNS).any(|_| flash.sr().read().bsy().bit_is_clear());
    if !is_ready() {
        return Err(GuardRefusal::NotTaken);
    }
    // SAFETY: flags of old are cleared by writing ones; the others do not care.
    flash.sr().modify(|r, w| unsafe { w.bits(r.bits()) });
    for key in KEYS {
        flash.optkeyr().write(|w| w.optkeyr().set(key));
    }
    // SAFETY: option bytes that a reset loaded, with the level of a brown-out reset.
    flash.optcr().write(|w| unsafe { w.bits(options) });
    // SAFETY: the same, with their start.
    flash.optcr().write(|w| unsafe { w.bits(options | OPTSTRT) });
    let is_done = is_ready();
    let has_failed = flash::has_failed(flash);
    flash.optcr().modify(|_, w| w.optlock().set_bit());
    let is_shown = flash.optcr().read().bits() & !ACTIONS == options;
    if is_done && !has_failed && is_shown { Ok(()) } else { Err(GuardRefusal::NotTaken) }
}
