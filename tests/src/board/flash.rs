//! The sectors of flash that a firmware writes to, which the emulator keeps read only.
//!
//! Words are programmed and sectors erased under the rules of RM0090 section 3.6: unlocked, `PG`
//! or `SER` set, and a bit goes from one to zero only. The interface's registers stay the
//! emulator's; this model watches what is written to them. Timing is the emulator's `BSY`.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The flash interface's control register, its bits, and its key register.
const FLASH_CR: u64 = 0x4002_3C10;
const FLASH_KEYR: u64 = 0x4002_3C04;
const PG: u32 = 1;
const SER: u32 = 1 << 1;
const STRT: u32 = 1 << 16;
const LOCK: u32 = 1 << 31;
const KEY2: u32 = 0xCDEF_89AB;
/// The first sector of 128 KiB and the number it has; smaller ones hold the program.
const FIRST_LARGE: u64 = 0x0802_0000;
const FIRST_LARGE_NUMBER: u64 = 5;
const LARGE: u64 = 0x2_0000;
/// The sectors the firmware may write: the last two of one megabyte.
pub(super) const WRITABLE: std::ops::Range<u64> = 0x080C_0000..0x0810_0000;
const ERASED: u32 = u32::MAX;

/// The array's state.
#[derive(Debug)]
pub struct Array {
    /// Every word that is not erased, by address.
    words: BTreeMap<u64, u32>,
    control: u32,
    /// Words programmed and sectors erased since the board was switched on.
    pub operations: u64,
    /// The supply goes right before this operation, and the core is reset.
    pub cut_before: Option<u64>,
    pub(super) cut: bool,
    /// What the firmware did against the rules.
    pub violations: Vec<String>,
}

impl Default for Array {
    fn default() -> Self {
        Self {
            words: BTreeMap::new(),
            control: LOCK,
            operations: 0,
            cut_before: None,
            cut: false,
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

    /// Whether the next operation still has supply; the one that hasn't cuts it.
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
        self.control = LOCK;
        self.cut = false;
    }

    /// A store of the firmware to the array.
    pub(super) fn store(&mut self, address: u64, bytes: u32, value: u32) {
        if bytes != 4 || !address.is_multiple_of(4) || self.control & (LOCK | PG) != PG {
            self.violations
                .push(format!("a store of {bytes} bytes to {address:#010x} with CR {:#x}", self.control));
            return;
        }
        if !self.powered() {
            return;
        }
        let before = self.word(address);
        if before & value != value {
            self.violations.push(format!("{address:#010x}: {before:#x} can't become {value:#x}"));
        }
        self.words.insert(address, before & value);
    }

    /// A write of the firmware to a register, which may be the interface's.
    pub(super) fn register_written(&mut self, address: u64, value: u32) {
        match address {
            FLASH_KEYR if value == KEY2 => self.control &= !LOCK,
            FLASH_CR if self.control & LOCK == 0 => {
                self.control = value;
                if value & (SER | STRT) == SER | STRT && self.powered() {
                    let sector = u64::from(value >> 3 & 0x1F);
                    let base = FIRST_LARGE + sector.saturating_sub(FIRST_LARGE_NUMBER) * LARGE;
                    if WRITABLE.contains(&base) && sector >= FIRST_LARGE_NUMBER {
                        self.words.retain(|address, _| !(base..base + LARGE).contains(address));
                    } else {
                        self.violations.push(format!("sector {sector} holds the program"));
                    }
                }
            }
            _ => {}
        }
    }
}

/// Shared between the test and the core.
#[derive(Debug, Clone, Default)]
pub struct Flash(Arc<Mutex<Array>>);

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

    fn unlocked() -> Array {
        let mut array = Array::default();
        array.register_written(FLASH_KEYR, KEY2);
        array.register_written(FLASH_CR, PG);
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
        array.register_written(FLASH_CR, SER | STRT | 10 << 3);
        assert_eq!(array.word(CELL), ERASED);
    }

    #[test]
    fn a_locked_array_keeps_its_words() {
        let mut array = unlocked();
        array.register_written(FLASH_CR, LOCK);
        array.store(CELL, 4, 0);
        assert_eq!((array.word(CELL), array.violations.len()), (ERASED, 1));
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
