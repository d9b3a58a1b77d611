//! The two sectors at the end of flash that hold the configuration.
#![allow(unsafe_code, reason = "flash is programmed by writes to its address")]

use crate::tasks::shared::REPORTS;
use firmware::store::{CELL_WORDS, ConfigFlash, Slot, StoreError};
use firmware::supervision::Task;
use firmware::timing;
use stm32f4xx_hal::pac::FLASH;

/// Words of a sector: 128 KiB.
const SECTOR_WORDS: usize = 128 * 1024 / 4;
/// Both sectors by their number.
const SECTORS: [u8; 2] = [10, 11];
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Sectors 10 and 11, `CONFIG` of `memory.x`.
pub(crate) struct Sectors(FLASH);

impl Sectors {
    /// With the controller that programs them.
    pub(crate) fn new(flash: FLASH) -> Self {
        Self(flash)
    }

    fn address(slot: Slot, index: usize) -> *mut u32 {
        unsafe extern "C" {
            static mut _config_start: u32;
        }
        assert!(index < SECTOR_WORDS);
        (&raw mut _config_start).wrapping_add(slot as usize * SECTOR_WORDS + index)
    }

    /// Carries out one operation between unlocking and locking; `turns` bound the wait for its end.
    fn operate(&mut self, turns: u32, start: impl FnOnce(&FLASH)) -> Result<(), StoreError> {
        for key in KEYS {
            self.0.keyr().write(|w| w.key().set(key));
        }
        // SAFETY: flags of old are cleared by writing ones; the others do not care.
        self.0.sr().modify(|r, w| unsafe { w.bits(r.bits()) });
        start(&self.0);
        let is_done = (0..turns).any(|_| self.0.sr().read().bsy().bit_is_clear());
        let sr = self.0.sr().read();
        let has_failed = sr.pgserr().bit()
            || sr.pgperr().bit()
            || sr.pgaerr().bit()
            || sr.wrperr().bit()
            || sr.operr().bit();
        self.0.cr().write(|w| w.lock().set_bit());
        self.forget_cached();
        if is_done && !has_failed { Ok(()) } else { Err(StoreError::Flash) }
    }

    /// The data cache may still hold what was there before.
    fn forget_cached(&mut self) {
        self.0.acr().modify(|_, w| w.dcen().clear_bit());
        self.0.acr().modify(|_, w| w.dcrst().set_bit());
        self.0.acr().modify(|_, w| w.dcrst().clear_bit());
        self.0.acr().modify(|_, w| w.dcen().set_bit());
    }
}

impl ConfigFlash for Sectors {
    const CELLS: usize = SECTOR_WORDS / CELL_WORDS;

    fn word(&self, slot: Slot, index: usize) -> u32 {
        // SAFETY: an aligned word of flash that no variable lies in.
        unsafe { Self::address(slot, index).read_volatile() }
    }

    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
        let done = self.operate(timing::FLASH_WORD_TURNS, |flash| {
            // A register written whole begins from its reset value, which locks.
            flash.cr().write(|w| w.lock().clear_bit().psize().psize32().pg().set_bit());
            // SAFETY: an aligned word of flash that no variable lies in, open for programming.
            unsafe { Self::address(slot, index).write_volatile(word) };
            cortex_m::asm::dsb();
        });
        // Telemetry is at work, not hung: a configuration has a hundred words and more.
        REPORTS.alive(Task::Telemetry);
        done
    }

    fn erase(&mut self, slot: Slot) -> Result<(), StoreError> {
        defmt::info!("erasing a sector of the configuration's flash");
        self.operate(timing::FLASH_ERASE_TURNS, |flash| {
            // SAFETY: both numbers are sectors of this microcontroller, and no code lies in them.
            flash
                .cr()
                .write(|w| unsafe { w.psize().psize32().ser().set_bit().snb().bits(SECTORS[slot as usize]) });
            flash.cr().modify(|_, w| w.strt().set_bit());
        })
    }
}
