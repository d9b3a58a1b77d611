//! The two sectors at the end of flash that hold the configuration.
#![allow(unsafe_code, reason = "flash is programmed by writes to its address")]

use crate::SHARED;
use firmware::store::{CELL_WORDS, ConfigFlash, Slot, StoreError};
use firmware::supervision::Task;
use firmware::timing;
use stm32f4xx_hal::pac::{FLASH, IWDG, RCC};

/// Words of a sector: 128 KiB.
const SECTOR_WORDS: usize = 128 * 1024 / 4;
/// The configuration's first sector by its number (RM0090 3.3); the second one follows. Parts with two megabytes have the same twelve
/// sectors in their first bank (3.4); those of the second bank, which begin at 16 in `SNB` (3.9.8), are left alone.
const FIRST_SECTOR: u8 = 10;
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];

/// Sectors 10 and 11, `CONFIG` of a board's `memory.x`, or a pair before them.
pub(crate) struct Sectors {
    flash: FLASH,
    /// Sectors from the configuration's down to these.
    below: u8,
}

impl Sectors {
    /// The configuration's, with the controller that programs them.
    pub(crate) fn new(flash: FLASH) -> Self {
        Self { flash, below: 0 }
    }

    /// Sectors 8 and 9 instead, which hold nothing: an image ends far below. For the test of the board, which leaves the
    /// configuration alone.
    #[allow(dead_code, reason = "the tests of the board call it")]
    pub(crate) fn scratch(self) -> Self {
        Self { below: 2, ..self }
    }

    fn address(&self, slot: Slot, index: usize) -> *mut u32 {
        unsafe extern "C" {
            static mut _config_start: u32;
        }
        assert!(index < SECTOR_WORDS);
        let first = (&raw mut _config_start).wrapping_sub(usize::from(self.below) * SECTOR_WORDS);
        first.wrapping_add(slot as usize * SECTOR_WORDS + index)
    }

    /// Carries out one operation between unlocking and locking; `turns` bound the wait for its end.
    fn operate(&mut self, turns: u32, start: impl FnOnce(&FLASH)) -> Result<(), StoreError> {
        for key in KEYS {
            self.flash.keyr().write(|w| w.key().set(key));
        }
        // SAFETY: flags of old are cleared by writing ones; the others do not care.
        self.flash.sr().modify(|r, w| unsafe { w.bits(r.bits()) });
        start(&self.flash);
        let is_done = (0..turns).any(|_| self.flash.sr().read().bsy().bit_is_clear());
        let sr = self.flash.sr().read();
        let has_failed = sr.pgserr().bit()
            || sr.pgperr().bit()
            || sr.pgaerr().bit()
            || sr.wrperr().bit()
            || sr.operr().bit();
        self.flash.cr().write(|w| w.lock().set_bit());
        self.forget_cached();
        if is_done && !has_failed { Ok(()) } else { Err(StoreError::Flash) }
    }

    /// The data cache may still hold what was there before.
    fn forget_cached(&mut self) {
        self.flash.acr().modify(|_, w| w.dcen().clear_bit());
        self.flash.acr().modify(|_, w| w.dcrst().set_bit());
        self.flash.acr().modify(|_, w| w.dcrst().clear_bit());
        self.flash.acr().modify(|_, w| w.dcen().set_bit());
    }
}

/// A time of the independent watchdog: the code of its prescaler, the divider that it stands for, and ms.
type WatchdogTime = (u8, u32, u32);
/// While the flash is written word by word, and always else.
const ALERT: WatchdogTime = (0b000, 4, timing::WATCHDOG_MS);
/// While a sector is erased.
const PATIENT: WatchdogTime = (0b100, 64, timing::WATCHDOG_ERASE_MS);

/// Gives the independent watchdog another time and feeds it. Its registers cross into the domain of its slow clock, which
/// takes five cycles of it; until then they take no other value (RM0090 21.4.4).
fn watchdog((prescaler, divider, ms): WatchdogTime) {
    const OPEN: u16 = 0x5555;
    const FEED: u16 = 0xAAAA;
    const SLOW_CLOCK_KHZ: u32 = 32;
    // SAFETY: two reads, and writes to registers that the watchdog's owner, who only feeds it, leaves alone.
    let (iwdg, rcc) = unsafe { (&*IWDG::ptr(), &*RCC::ptr()) };
    // Before the watchdog is started there is nothing to change: its clock runs from then on (RM0090 7.2.9).
    if rcc.csr().read().lsirdy().bit_is_clear() {
        return;
    }
    let settle = || (0..timing::WATCHDOG_SETTLE_TURNS).any(|_| iwdg.sr().read().bits() == 0);
    settle();
    // A feed in between would close the registers again: four writes, less than a microsecond.
    cortex_m::interrupt::free(|_| {
        // SAFETY: the key and a prescaler of the manual.
        iwdg.kr().write(|w| unsafe { w.key().bits(OPEN) });
        iwdg.pr().write(|w| unsafe { w.pr().bits(prescaler) });
        iwdg.rlr().write(|w| w.rl().set((ms * SLOW_CLOCK_KHZ / divider - 1) as u16));
    });
    settle();
    // SAFETY: a key of the manual.
    iwdg.kr().write(|w| unsafe { w.key().bits(FEED) });
}

impl ConfigFlash for Sectors {
    const CELLS: usize = SECTOR_WORDS / CELL_WORDS;

    fn word(&self, slot: Slot, index: usize) -> u32 {
        // SAFETY: an aligned word of flash that no variable lies in.
        unsafe { self.address(slot, index).read_volatile() }
    }

    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
        let address = self.address(slot, index).cast::<u16>();
        let halves = [(address, word as u16), (address.wrapping_add(1), (word >> 16) as u16)];
        let done = halves.into_iter().try_for_each(|(address, half)| {
            self.operate(timing::FLASH_WORD_TURNS, |flash| {
                // A register written whole begins from its reset value, which locks. 16 bits at a time: 32 ask for 2.7 V, and
                // the rail may be lower (RM0090 3.6.2).
                flash.cr().write(|w| w.lock().clear_bit().psize().psize16().pg().set_bit());
                // SAFETY: an aligned half of a word of flash that no variable lies in, open for programming.
                unsafe { address.write_volatile(half) };
                cortex_m::asm::dsb();
            })
        });
        // Telemetry is at work, not hung: a configuration has a hundred words and more.
        SHARED.reports.alive(Task::Telemetry);
        done
    }

    fn erase(&mut self, slot: Slot) -> Result<(), StoreError> {
        defmt::info!("erasing a sector of the configuration's flash");
        let sector = FIRST_SECTOR - self.below + slot as u8;
        watchdog(PATIENT);
        let done = self.operate(timing::FLASH_ERASE_TURNS, |flash| {
            // A register written whole begins from its reset value, which locks it (RM0090 3.9.7): whatever came after
            // would be lost without a word.
            // SAFETY: both numbers are sectors of this microcontroller, and no code lies in them.
            flash.cr().write(|w| unsafe {
                w.lock().clear_bit().psize().psize16().ser().set_bit().snb().bits(sector)
            });
            flash.cr().modify(|_, w| w.lock().clear_bit().strt().set_bit());
        });
        watchdog(ALERT);
        for task in Task::ALL {
            SHARED.reports.alive(task);
        }
        done
    }
}
