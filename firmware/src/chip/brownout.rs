//! The brown-out reset, which a part from the factory has switched off. Below 2.66 V the torque
//! goes off; without this reset nothing would stop a core whose supply goes on falling.

use stm32f4xx_hal::pac::flash::RegisterBlock;

/// Values of `BOR_LEV` (RM0090 3.9.10): the smaller, the higher the threshold. The register crate
/// names them the other way round (its "level 2" is the manual's level 1), so they are given as
/// numbers here.
const LEVEL_3: u8 = 0b00;
const LEVEL_2: u8 = 0b01;
const KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];
/// Turns of a loop that reads a register: option bytes take as long as an erasure of the shortest
/// sector (data sheet: 0.8 s at most).
const TURNS: u32 = 100_000_000;

/// Returns true if the part resets itself before its supply is too low for what the firmware asks
/// of it: at level 2, 2.4 to 2.5 V on the way down (data sheet, BOR thresholds), or at level 3.
pub(super) fn is_on(flash: &RegisterBlock) -> bool {
    let level = flash.optcr().read().bor_lev().bits();
    level == LEVEL_2 || level == LEVEL_3
}

/// Sets level 2 if it is off (RM0090 3.7.2); the other option bytes stay. Level 3 would reset a
/// board whose rail is a diode below 3.3 V.
pub(super) fn set(flash: &RegisterBlock) {
    if is_on(flash) {
        return;
    }
    let is_ready = || (0..TURNS).any(|_| flash.sr().read().bsy().bit_is_clear());
    is_ready();
    for key in KEYS {
        flash.optkeyr().write(|w| w.optkeyr().set(key));
    }
    flash.optcr().modify(|_, w| w.bor_lev().set(LEVEL_2));
    flash.optcr().modify(|_, w| w.optstrt().set_bit());
    is_ready();
    flash.optcr().modify(|_, w| w.optlock().set_bit());
    defmt::info!("the brown-out reset was off and has been set to level 2");
}
