//! The sectors of flash that a firmware writes to, which the emulator keeps read only.
//!
//! Words are programmed and sectors erased under the rules of RM0090 section 3.6: both keys in
//! their order, `PG` or `SER` set with as many bits at a time as the supply allows (3.6.2), and a
//! bit goes from one to zero only. `LOCK` is set out of reset and a write with it set locks
//! whatever else it says (3.9.7); `STRT` in a locked register does nothing and reports nothing.
//! While a sector is erased the core gets no instruction from the flash (3.6: "any attempt to read
//! … causes the bus to stall"): for its whole time nothing runs, the watchdog excepted. The same
//! holds for the time in which it takes a word. The interface's registers stay the emulator's; this
//! model watches what is written to them.

mod options;

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::snapshot::{Error, Reader, Store, Writer};
use serde::{Deserialize, Serialize};

use options::FLASH_OPTKEYR;
pub use options::{FACTORY_OPTIONS, GUARDED_OPTIONS, OptionFault};
pub(super) use options::{FLASH_OPTCR, FLASH_SR};

/// The flash interface's control register, its bits, and its key register.
const FLASH_CR: u64 = 0x4002_3C10;
const FLASH_KEYR: u64 = 0x4002_3C04;
const PG: u32 = 1;
const SER: u32 = 1 << 1;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
const KEY1: u32 = 0x4567_0123;
const KEY2: u32 = 0xCDEF_89AB;
/// Bytes at a time by `PSIZE`, and the supply in millivolts that they need at least (3.6.2; 8 at a
/// time asks for a supply of its own).
const PARALLEL: [(u32, u32); 3] = [(1, 1_800), (2, 2_100), (4, 2_700)];
/// Time in which a sector of 128 KiB is erased, by the bytes at a time (data sheet DS8626, flash
/// memory programming, typical; twice that at most).
const fn erase_nanos(parallel_bytes: u32) -> u64 {
    match parallel_bytes {
        1 => 2_000_000_000,
        2 => 1_300_000_000,
        _ => 1_000_000_000,
    }
}
/// The time in which the array takes a byte, half a word or a word: typical, and at most (DS8626,
/// flash memory programming, t_prog).
pub const PROGRAM_NANOS: [u64; 2] = [16_000, 100_000];
/// The first sector of 128 KiB and the number it has; smaller ones hold the program.
const FIRST_LARGE: u64 = 0x0802_0000;
const FIRST_LARGE_NUMBER: u64 = 5;
const LARGE: u64 = 0x2_0000;
/// A sector holds a slot of the configuration.
pub(super) const SLOT_BYTES: u64 = LARGE;
/// The sectors of the configuration: the last two of one megabyte.
pub const CONFIGURATION: std::ops::Range<u64> = 0x080C_0000..0x0810_0000;
/// The number of the first of them.
pub const FIRST_OF_CONFIGURATION: u64 = 10;
/// The sectors that a firmware may write: the configuration's and the two before them, which the
/// board's own test uses.
pub(super) const WRITABLE: std::ops::Range<u64> = 0x0808_0000..0x0810_0000;
const ERASED: u32 = u32::MAX;

/// The array's state.
#[derive(Debug, Serialize, Deserialize)]
pub struct Array {
    /// Every word that is not erased, by address.
    words: BTreeMap<u64, u32>,
    control: u32,
    /// The last word written to the key register, and to the option bytes'.
    key: u32,
    option_key: u32,
    /// The option bytes' control register, without its lock.
    option_control: u32,
    options_unlocked: bool,
    /// The option bytes: kept through a reset.
    pub options: u32,
    /// The number of times they were written.
    pub option_writes: u32,
    /// Their fault.
    pub option_fault: OptionFault,
    /// The flags of the status register that programming them has left.
    status: u32,
    /// The part's supply in millivolts.
    pub(super) supply: u32,
    /// Sectors erased since the board was switched on, each with the instant in nanoseconds.
    pub erased: Vec<(u64, u64)>,
    /// Words programmed and sectors erased since the board was switched on.
    pub operations: u64,
    /// The supply goes right before this operation, and the core is reset.
    pub cut_before: Option<u64>,
    pub(super) cut: bool,
    /// True if it no longer accepts what is programmed: an array at the end of its life.
    pub worn: bool,
    /// The time in which it takes what is programmed, one of [`PROGRAM_NANOS`].
    pub program_nanos: u64,
    /// The firmware's actions against the rules.
    pub violations: Vec<String>,
}

impl Default for Array {
    fn default() -> Self {
        Self {
            words: BTreeMap::new(),
            control: LOCK,
            key: 0,
            option_key: 0,
            option_control: GUARDED_OPTIONS,
            options_unlocked: false,
            options: GUARDED_OPTIONS,
            option_writes: 0,
            option_fault: OptionFault::None,
            status: 0,
            supply: 3_300,
            erased: Vec::new(),
            operations: 0,
            cut_before: None,
            cut: false,
            worn: false,
            program_nanos: PROGRAM_NANOS[0],
            violations: Vec::new(),
        }
    }
}

impl Array {
    /// The word at `address`.
    #[must_use]
    pub fn word(&self, address: u64) -> u32 {
        self.words.get(&(address & !3)).copied().unwrap_or(ERASED)
    }

    /// Sets the word at `address`, as a programmer does.
    pub(super) fn put(&mut self, address: u64, word: u32) {
        self.words.insert(address, word);
    }

    /// Flips bits of the word at `address`, as an upset does.
    pub fn flip(&mut self, address: u64, bits: u32) {
        let word = self.word(address) ^ bits;
        self.words.insert(address & !3, word);
    }

    /// The addresses of every word that is not erased.
    #[must_use]
    pub fn written(&self) -> Vec<u64> {
        self.words.keys().copied().collect()
    }

    /// The configuration's words that are not erased, with their addresses.
    #[must_use]
    pub fn configuration(&self) -> Vec<(u64, u32)> {
        self.words.range(CONFIGURATION).map(|(&address, &word)| (address, word)).collect()
    }

    /// True if the supply lasts for the next operation; the one for which it does not cuts the
    /// supply.
    fn powered(&mut self) -> bool {
        if self.cut_before == Some(self.operations) {
            self.cut_before = None;
            self.cut = true;
        }
        self.operations += 1;
        !self.cut
    }

    /// The core starts again, with the supply back.
    pub(super) fn restarted(&mut self) {
        (self.control, self.key, self.option_key) = (LOCK, 0, 0);
        (self.option_control, self.options_unlocked, self.status) = (self.options, false, 0);
        self.cut = false;
    }

    /// A store of the firmware to the array. Returns the time for which the core then stalls, in
    /// nanoseconds.
    pub(super) fn store(&mut self, address: u64, bytes: u32, value: u32) -> u64 {
        let is_open = self.control & (LOCK | PG) == PG && Some(bytes) == self.parallel();
        if !is_open || !address.is_multiple_of(bytes.into()) {
            self.violations
                .push(format!("a store of {bytes} bytes to {address:#010x} with CR {:#x}", self.control));
            return 0;
        }
        if !self.powered() || self.worn {
            return 0;
        }
        let before = self.word(address);
        let shift = 8 * (address & 3) as u32;
        let mask = (u32::MAX >> (32 - 8 * bytes)) << shift;
        let value = value << shift & mask;
        if before & value != value {
            self.violations.push(format!("{address:#010x}: {before:#x} can't become {value:#x}"));
        }
        self.words.insert(address & !3, before & (value | !mask));
        self.program_nanos
    }

    /// Bytes at a time, where the supply is enough for so many.
    fn parallel(&mut self) -> Option<u32> {
        let (bytes, least) = *PARALLEL.get((self.control >> 8 & 0b11) as usize)?;
        if self.supply < least {
            self.violations.push(format!("{bytes} bytes at a time on {} mV", self.supply));
            return None;
        }
        Some(bytes)
    }

    /// A write of the firmware to a register, which may be the interface's, at the instant `at`.
    /// Returns the time for which the core then stalls, in nanoseconds.
    pub(super) fn register_written(&mut self, address: u64, value: u32, at: u64) -> u64 {
        match address {
            FLASH_KEYR => {
                if value == KEY2 && self.key == KEY1 {
                    self.control &= !LOCK;
                }
                self.key = value;
                0
            }
            FLASH_OPTKEYR | FLASH_OPTCR | FLASH_SR => self.option_register_written(address, value),
            FLASH_CR if self.control & LOCK == 0 => {
                self.control = value;
                let starts = value & (LOCK | SER | STRT) == SER | STRT;
                if starts && self.powered() { self.erase(u64::from(value >> 3 & 0x1F), at) } else { 0 }
            }
            _ => 0,
        }
    }

    fn erase(&mut self, sector: u64, at: u64) -> u64 {
        let base = FIRST_LARGE + sector.saturating_sub(FIRST_LARGE_NUMBER) * LARGE;
        let parallel = self.parallel().filter(|_| WRITABLE.contains(&base) && sector >= FIRST_LARGE_NUMBER);
        let Some(parallel_bytes) = parallel else {
            self.violations.push(format!("sector {sector} erased with CR {:#x}", self.control));
            return 0;
        };
        self.words.retain(|address, _| !(base..base + LARGE).contains(address));
        self.erased.push((sector, at));
        erase_nanos(parallel_bytes)
    }
}

/// Shared between the test and the core.
#[derive(Debug, Clone, Default)]
pub struct Flash(Arc<Mutex<Array>>);

impl Store for Flash {
    fn store(&self, to: &mut Writer) -> Result<(), Error> {
        to.put(&*self.array())
    }

    fn load(&mut self, from: &mut Reader) -> Result<(), Error> {
        *self.array() = from.take()?;
        Ok(())
    }
}

impl Flash {
    /// The array, to look at or to change.
    pub fn array(&self) -> MutexGuard<'_, Array> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: u64 = 0x080C_0010;
    const WORDS: u32 = 0b10 << 8;

    fn unlocked() -> Array {
        let mut array = Array::default();
        array.register_written(FLASH_KEYR, KEY1, 0);
        array.register_written(FLASH_KEYR, KEY2, 0);
        array.register_written(FLASH_CR, PG | WORDS, 0);
        array
    }

    #[test]
    fn a_word_loses_bits_and_an_erased_sector_has_them_all() {
        let mut array = unlocked();
        array.store(CELL, 4, 0xFFFF_00FF);
        array.store(CELL, 4, 0x0F0F_00FF);
        assert_eq!(array.word(CELL), 0x0F0F_00FF);
        assert!(array.violations.is_empty(), "{:?}", array.violations);
        array.store(CELL, 4, 0xFFFF_FFFF);
        assert_eq!(array.violations.len(), 1);
        assert_eq!(array.register_written(FLASH_CR, WORDS | SER | STRT | 10 << 3, 7), erase_nanos(4));
        assert_eq!((array.word(CELL), &array.erased[..]), (ERASED, &[(10, 7)][..]));
    }

    #[test]
    fn the_supply_bounds_how_much_is_programmed_at_a_time() {
        let mut array = unlocked();
        array.supply = 2_650;
        array.store(CELL, 4, 0);
        assert_eq!((array.word(CELL), array.violations.len()), (ERASED, 2));
        array.register_written(FLASH_CR, PG | 0b01 << 8, 0);
        array.store(CELL + 2, 2, 0x1234);
        assert_eq!((array.word(CELL), array.violations.len()), (0x1234_FFFF, 2));
    }

    #[test]
    fn a_locked_array_keeps_its_words() {
        let mut array = unlocked();
        array.register_written(FLASH_CR, LOCK, 0);
        array.store(CELL, 4, 0);
        assert_eq!((array.word(CELL), array.violations.len()), (ERASED, 1));
    }

    #[test]
    fn a_write_that_locks_erases_nothing_and_says_nothing() {
        let mut array = unlocked();
        array.store(CELL, 4, 0);
        array.register_written(FLASH_CR, LOCK | WORDS | SER | 10 << 3, 0);
        assert_eq!(array.register_written(FLASH_CR, WORDS | SER | STRT | 10 << 3, 0), 0);
        assert_eq!((array.word(CELL), array.violations.len()), (0, 0));
        array.register_written(FLASH_KEYR, KEY2, 0);
        assert_eq!(
            array.register_written(FLASH_CR, WORDS | SER | STRT | 10 << 3, 0),
            0,
            "one key does not unlock"
        );
    }

    #[test]
    fn a_cut_supply_loses_the_operation_and_all_that_follow() {
        let mut array = unlocked();
        array.cut_before = Some(1);
        for cell in 0..3 {
            array.store(CELL + 4 * cell, 4, 0);
        }
        assert_eq!(array.written(), [CELL]);
        assert!(array.cut);
        array.restarted();
        array.store(CELL + 4, 4, 0);
        assert_eq!(array.written(), [CELL], "locked again");
    }
}
