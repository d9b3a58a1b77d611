//! The store's two slots on any flash with the traits of `embedded-storage`.

use super::{CELL_WORDS, ConfigFlash, Slot, StoreError};
use embedded_storage::nor_flash::NorFlash;

/// Any flash with the traits of `embedded-storage`: its first two sectors are the slots. It
/// programs four bytes at a time, and no less.
pub struct Nor<F>(pub F);

impl<F: NorFlash> Nor<F> {
    /// Bytes from the beginning of the flash.
    fn offset(slot: Slot, index: usize) -> u32 {
        const { assert!(F::WRITE_SIZE == 4 && F::READ_SIZE <= 4, "a store of words of 32 bits") };
        (slot as usize * F::ERASE_SIZE + 4 * index) as u32
    }
}

impl<F: NorFlash> ConfigFlash for Nor<F> {
    const CELLS: usize = F::ERASE_SIZE / (4 * CELL_WORDS);

    /// A word that cannot be read is no part of anything whole, and is not blank.
    fn word(&mut self, slot: Slot, index: usize) -> u32 {
        let mut bytes = [0; 4];
        self.0.read(Self::offset(slot, index), &mut bytes).map_or(0, |()| u32::from_le_bytes(bytes))
    }

    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
        self.0.write(Self::offset(slot, index), &word.to_le_bytes()).map_err(|_| StoreError::Flash)
    }

    fn erase(&mut self, slot: Slot) -> Result<(), StoreError> {
        let from = Self::offset(slot, 0);
        self.0.erase(from, from + F::ERASE_SIZE as u32).map_err(|_| StoreError::Flash)
    }
}
