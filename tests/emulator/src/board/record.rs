//! The record in flash of a board that was commissioned, written as the firmware writes it.

use control_core::Device;
use firmware::store::{CELL_WORDS, ConfigFlash, Slot, Store, StoreError};

use super::flash::{Array, CONFIGURATION, SLOT_BYTES};

/// The array as the store sees it, without the rules of its registers: what a programmer does
/// before the board is switched on.
struct Cells<'a>(&'a mut Array);

fn address(slot: Slot, index: usize) -> u64 {
    let slot = match slot {
        Slot::A => 0,
        Slot::B => 1,
    };
    CONFIGURATION.start + slot * SLOT_BYTES + 4 * index as u64
}

impl ConfigFlash for Cells<'_> {
    const CELLS: usize = SLOT_BYTES as usize / 4 / CELL_WORDS;

    fn word(&mut self, slot: Slot, index: usize) -> u32 {
        self.0.word(address(slot, index))
    }

    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError> {
        self.0.put(address(slot, index), word);
        Ok(())
    }

    /// A new array is blank.
    fn erase(&mut self, _: Slot) -> Result<(), StoreError> {
        Err(StoreError::Flash)
    }
}

/// Saves a device's record in a blank array.
///
/// # Panics
///
/// When it is not blank.
pub fn save(array: &mut Array, device: &Device) {
    let (mut store, ..) = Store::open(Cells(array));
    store.save_device(device, || true).expect("a blank array has room");
}
