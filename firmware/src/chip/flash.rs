//! The two sectors at the end of flash that hold the configuration.
#![allow(unsafe_code, reason = "flash is programmed by writes to its address")]

use crate::SHARED;
use embedded_storage::nor_flash::{
    ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash, check_erase, check_read, check_write,
};
use firmware::supervision::Task;
use firmware::timing;
use stm32f4xx_hal::pac::flash::RegisterBlock;
use stm32f4xx_hal::pac::{FLASH, IWDG, RCC};

/// Bytes of a sector.
const SECTOR_BYTES: usize = 128 * 1024;
/// The configuration's first sector by its number (RM0090 3.3); the second one follows. Parts with
/// two megabytes have the same twelve sectors in their first bank (3.4); those of the second bank,
/// which begin at 16 in `SNB` (3.9.8), are left alone.
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

    /// Sectors 8 and 9 instead, which hold nothing: an image ends far below. For the test of the
    /// board, which leaves the configuration alone.
    #[allow(dead_code, reason = "the tests of the board call it")]
    pub(crate) fn scratch(self) -> Self {
        Self { below: 2, ..self }
    }

    /// The address of a byte of the two sectors.
    fn address(&self, offset: u32) -> *mut u8 {
        unsafe extern "C" {
            static mut _config_start: u32;
        }
        let first =
            (&raw mut _config_start).cast::<u8>().wrapping_sub(usize::from(self.below) * SECTOR_BYTES);
        first.wrapping_add(offset as usize)
    }

    /// Carries out one operation between unlocking and locking; `turns` bound the wait for its end.
    fn operate(&mut self, turns: u32, start: impl FnOnce(&FLASH)) -> Result<(), NorFlashErrorKind> {
        for key in KEYS {
            self.flash.keyr().write(|w| w.key().set(key));
        }
        // SAFETY: flags of old are cleared by writing ones; the others do not care.
        self.flash.sr().modify(|r, w| unsafe { w.bits(r.bits()) });
        start(&self.flash);
        let is_done = (0..turns).any(|_| self.flash.sr().read().bsy().bit_is_clear());
        let has_failed = has_failed(&self.flash);
        self.flash.cr().write(|w| w.lock().set_bit());
        self.forget_cached();
        if is_done && !has_failed { Ok(()) } else { Err(NorFlashErrorKind::Other) }
    }

    /// Erases the first of the two sectors or the second.
    fn erase_sector(&mut self, sector: u8) -> Result<(), NorFlashErrorKind> {
        defmt::info!("erasing a sector of the configuration's flash");
        let sector = FIRST_SECTOR - self.below + sector;
        patiently(|| {
            self.operate(timing::FLASH_ERASE_TURNS, |flash| {
                // A register written whole begins from its reset value, which locks it (RM0090
                // 3.9.7): whatever came after would be lost without a word. SAFETY: both numbers
                // are sectors of this microcontroller, and no code is in them.
                flash.cr().write(|w| unsafe {
                    w.lock().clear_bit().psize().psize16().ser().set_bit().snb().bits(sector)
                });
                flash.cr().modify(|_, w| w.lock().clear_bit().strt().set_bit());
            })
        })
    }

    /// Empties both caches, each of which has to be off for that (FLASH_ACR, RM0090 3.9.1): the
    /// next code comes from the flash, as it does where other tasks have used the cache since.
    #[allow(dead_code, reason = "the tests of the board call it")]
    pub(crate) fn forget_code(&mut self) {
        self.flash.acr().modify(|_, w| w.icen().clear_bit());
        self.flash.acr().modify(|_, w| w.icrst().set_bit());
        self.flash.acr().modify(|_, w| w.icrst().clear_bit());
        self.flash.acr().modify(|_, w| w.icen().set_bit());
        self.forget_cached();
    }

    /// The data cache may still hold what was there before.
    fn forget_cached(&mut self) {
        self.flash.acr().modify(|_, w| w.dcen().clear_bit());
        self.flash.acr().modify(|_, w| w.dcrst().set_bit());
        self.flash.acr().modify(|_, w| w.dcrst().clear_bit());
        self.flash.acr().modify(|_, w| w.dcen().set_bit());
    }
}

/// True if the last operation has left an error flag.
pub(super) fn has_failed(flash: &RegisterBlock) -> bool {
    let sr = flash.sr().read();
    sr.pgserr().bit() || sr.pgperr().bit() || sr.pgaerr().bit() || sr.wrperr().bit() || sr.operr().bit()
}

/// Does what stops the processor, for longer than the watchdog waits and any task may be silent.
pub(super) fn patiently<T>(work: impl FnOnce() -> T) -> T {
    watchdog(PATIENT);
    let done = work();
    watchdog(ALERT);
    for task in Task::ALL {
        SHARED.reports.alive(task);
    }
    done
}

/// A time of the independent watchdog: the code of its prescaler, the divider that it stands for,
/// and ms.
type WatchdogTime = (u8, u32, u32);
/// While the flash is written word by word, and always else.
const ALERT: WatchdogTime = (0b000, 4, timing::WATCHDOG_MS);
/// While a sector is erased.
const PATIENT: WatchdogTime = (0b100, 64, timing::WATCHDOG_ERASE_MS);

/// Gives the independent watchdog another time and feeds it. Its registers cross into the domain of
/// its slow clock, which takes five cycles of it; until then they take no other value (RM0090
/// 21.4.4).
fn watchdog((prescaler, divider, ms): WatchdogTime) {
    const OPEN: u16 = 0x5555;
    const FEED: u16 = 0xAAAA;
    const SLOW_CLOCK_KHZ: u32 = 32;
    // SAFETY: two reads, and writes to registers that the watchdog's owner, who only feeds it,
    // leaves alone.
    let (iwdg, rcc) = unsafe { (&*IWDG::ptr(), &*RCC::ptr()) };
    // Before the watchdog is started there is nothing to change: its clock runs from then on
    // (RM0090 7.2.9).
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

impl ErrorType for Sectors {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for Sectors {
    const READ_SIZE: usize = 4;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        check_read(self, offset, bytes.len())?;
        for (at, place) in (offset..).step_by(4).zip(bytes.chunks_exact_mut(4)) {
            // SAFETY: an aligned word of flash, within the two sectors, which hold no variable.
            let word = unsafe { self.address(at).cast::<u32>().read_volatile() };
            place.copy_from_slice(&word.to_le_bytes());
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        2 * SECTOR_BYTES
    }
}

impl NorFlash for Sectors {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        check_write(self, offset, bytes.len())?;
        for (at, half) in (offset..).step_by(2).zip(bytes.chunks_exact(2)) {
            let address = self.address(at).cast::<u16>();
            let half = half.iter().rev().fold(0, |half, &byte| half << 8 | u16::from(byte));
            self.operate(timing::FLASH_WORD_TURNS, |flash| {
                // A register written whole begins from its reset value, which locks. 16 bits at a
                // time: 32 ask for 2.7 V, and the rail may be lower (RM0090 3.6.2).
                flash.cr().write(|w| w.lock().clear_bit().psize().psize16().pg().set_bit());
                // SAFETY: an aligned half of a word of flash, within the two sectors, which hold no
                // variable, open for programming.
                unsafe { address.write_volatile(half) };
                cortex_m::asm::dsb();
            })?;
        }
        Ok(())
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        check_erase(self, from, to)?;
        (from as usize / SECTOR_BYTES..to as usize / SECTOR_BYTES)
            .try_for_each(|sector| self.erase_sector(sector as u8))
    }
}
