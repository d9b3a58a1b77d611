//! The configuration in flash: two slots (sectors), each a row of cells, a cell for each configuration ever saved. A cell
//! is written once, its last word last; losing power at any point leaves the configuration that was or the one that
//! comes, never a mixture. A slot is erased at start-up, before the tick and the watchdog run, and where no cell is left:
//! an erasure stops the processor for a second or two, and whoever saves sees to it that torque is off meanwhile.

use control_core::Config;
use crc::{CRC_32_ISO_HDLC, Crc, Table};

/// Raised whenever the bytes of a stored configuration mean something else.
pub const LAYOUT_VERSION: u8 = 1;
/// Words of a cell: 1 KiB, room for the longest configuration.
pub const CELL_WORDS: usize = 256;
/// Erased flash.
const BLANK: u32 = u32::MAX;
const MAGIC: u32 = 0xC0F1 << 16;
/// What the last word of a cell becomes when the cell is whole.
const COMMITTED: u32 = 0x600D_600D;
const HEADER_WORDS: usize = 3;
const PAYLOAD_BYTES: usize = (CELL_WORDS - HEADER_WORDS - 1) * 4;
/// With fewer blank cells left, start-up moves to the other slot.
const RESERVE_CELLS: usize = 2;

const CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Either slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it all")]
pub enum Slot {
    A,
    B,
}

impl Slot {
    fn other(self) -> Self {
        match self {
            Slot::A => Slot::B,
            Slot::B => Slot::A,
        }
    }
}

/// Two sectors of flash. A word can be programmed once after its sector was erased.
pub trait ConfigFlash {
    /// Cells that a slot holds.
    const CELLS: usize;
    /// Reads word `index` of `slot`.
    fn word(&self, slot: Slot, index: usize) -> u32;
    /// Programs a word that is blank.
    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError>;
    /// Makes every word of `slot` blank.
    fn erase(&mut self, slot: Slot) -> Result<(), StoreError>;
}

/// Why a configuration was not saved. It is in force all the same, until the next reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The flash did not do what it was told.
    Flash,
    /// No blank cell is left until the device is restarted.
    Full,
    /// The configuration is longer than a cell.
    TooLong,
}

/// What start-up finds.
#[derive(Clone, Debug, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "nothing allocates here, and there is one at start-up")]
pub enum Stored {
    /// The configuration saved last.
    Config(Config),
    /// None was saved, or only by a firmware with another layout.
    None,
    /// The configuration saved last cannot be read: flash has lost a bit.
    Damaged,
}

/// The store on its flash.
pub struct Store<F> {
    flash: F,
    slot: Slot,
    newest: Option<(usize, u32)>,
    next_cell: usize,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    Blank,
    /// Begun and never committed: the power went.
    Torn,
    /// Committed and wrong.
    Damaged,
    /// Whole, with its sequence number.
    Whole(u32),
}

impl<F: ConfigFlash> Store<F> {
    /// Finds the configuration saved last and makes room for the next ones. Erases, so that it may take seconds.
    pub fn open(flash: F) -> (Self, Stored) {
        let mut store = Self { flash, slot: Slot::A, newest: None, next_cell: 0 };
        let stored = store.find();
        // Without room the device works as well; saving then says so.
        let _ = store.make_room();
        (store, stored)
    }

    /// Saves `config` unless it is what was saved last. Takes as long as the flash takes for its words; where no cell is
    /// left, as long as an erasure.
    pub fn save(&mut self, config: &Config) -> Result<(), StoreError> {
        if let Some((cell, _)) = self.newest
            && self.payload(cell) == Some(Stored::Config(config.clone()))
        {
            return Ok(());
        }
        if self.next_cell >= F::CELLS {
            self.make_room()?;
        }
        if self.next_cell >= F::CELLS {
            return Err(StoreError::Full);
        }
        let mut bytes = [0; PAYLOAD_BYTES];
        let length = postcard::to_slice(config, &mut bytes).map_err(|_| StoreError::TooLong)?.len();
        let sequence = self.newest.map_or(0, |(_, sequence)| sequence.wrapping_add(1));
        let cell = self.next_cell;
        // Whatever becomes of it, this cell is used.
        self.next_cell += 1;
        self.write(self.slot, cell, sequence, bytes.get(..length).ok_or(StoreError::TooLong)?)?;
        if self.cell(self.slot, cell) != Cell::Whole(sequence) {
            return Err(StoreError::Flash);
        }
        self.newest = Some((cell, sequence));
        Ok(())
    }

    fn write(&mut self, slot: Slot, cell: usize, sequence: u32, payload: &[u8]) -> Result<(), StoreError> {
        let header = MAGIC | u32::from(LAYOUT_VERSION) << 12 | payload.len() as u32;
        let at = cell * CELL_WORDS;
        self.flash.program(slot, at, header)?;
        self.flash.program(slot, at + 1, sequence)?;
        self.flash.program(slot, at + 2, checksum(header, sequence, payload))?;
        for (index, chunk) in payload.chunks(4).enumerate() {
            let mut word = [0xFF; 4];
            word[..chunk.len()].copy_from_slice(chunk);
            self.flash.program(slot, at + HEADER_WORDS + index, u32::from_le_bytes(word))?;
        }
        self.flash.program(slot, at + CELL_WORDS - 1, COMMITTED)
    }

    fn cell(&self, slot: Slot, cell: usize) -> Cell {
        let word = |index| self.flash.word(slot, cell * CELL_WORDS + index);
        if word(CELL_WORDS - 1) == BLANK {
            let blank = (0..CELL_WORDS).all(|index| word(index) == BLANK);
            return if blank { Cell::Blank } else { Cell::Torn };
        }
        let mut bytes = [0; PAYLOAD_BYTES];
        let (header, sequence) = (word(0), word(1));
        match self.read_payload(slot, cell, header, &mut bytes) {
            Some(payload) if checksum(header, sequence, payload) == word(2) => Cell::Whole(sequence),
            _ => Cell::Damaged,
        }
    }

    fn read_payload<'a>(
        &self,
        slot: Slot,
        cell: usize,
        header: u32,
        bytes: &'a mut [u8],
    ) -> Option<&'a [u8]> {
        if header & 0xFFFF_0000 != MAGIC {
            return None;
        }
        let payload = bytes.get_mut(..(header & 0xFFF) as usize)?;
        for (index, chunk) in payload.chunks_mut(4).enumerate() {
            let word = self.flash.word(slot, cell * CELL_WORDS + HEADER_WORDS + index).to_le_bytes();
            chunk.copy_from_slice(word.get(..chunk.len())?);
        }
        Some(payload)
    }

    /// What the whole cell of the current slot says.
    fn payload(&self, cell: usize) -> Option<Stored> {
        let mut bytes = [0; PAYLOAD_BYTES];
        let header = self.flash.word(self.slot, cell * CELL_WORDS);
        let payload = self.read_payload(self.slot, cell, header, &mut bytes)?;
        if header >> 12 & 0xF != u32::from(LAYOUT_VERSION) {
            return Some(Stored::None);
        }
        Some(postcard::from_bytes(payload).map_or(Stored::Damaged, Stored::Config))
    }

    /// The last whole cell of `slot`, and whether a damaged one follows it.
    fn survey(&self, slot: Slot) -> (Option<(usize, u32)>, bool) {
        let mut newest = None;
        let mut damaged = false;
        for cell in 0..F::CELLS {
            match self.cell(slot, cell) {
                Cell::Whole(sequence) => (newest, damaged) = (Some((cell, sequence)), false),
                Cell::Damaged => damaged = true,
                Cell::Blank | Cell::Torn => {}
            }
        }
        (newest, damaged)
    }

    fn find(&mut self) -> Stored {
        let (a, a_damaged) = self.survey(Slot::A);
        let (b, b_damaged) = self.survey(Slot::B);
        // The slot with the later sequence number; a slot whose erasure was cut short holds earlier ones or none.
        let b_is_newer = match (a, b) {
            (Some((_, a)), Some((_, b))) => b.wrapping_sub(a).cast_signed() > 0,
            (a, b) => a.is_none() && (b.is_some() || b_damaged && !a_damaged),
        };
        let (slot, newest, damaged) =
            if b_is_newer { (Slot::B, b, b_damaged) } else { (Slot::A, a, a_damaged) };
        (self.slot, self.newest) = (slot, newest);
        let is_used = |cell: &usize| self.cell(slot, *cell) != Cell::Blank;
        self.next_cell = (0..F::CELLS).rev().find(is_used).map_or(0, |cell| cell + 1);
        match newest {
            _ if damaged => Stored::Damaged,
            Some((cell, _)) => self.payload(cell).unwrap_or(Stored::Damaged),
            None => Stored::None,
        }
    }

    /// Leaves the other slot blank and, where this one is nearly used up, goes over to it.
    fn make_room(&mut self) -> Result<(), StoreError> {
        let other = self.slot.other();
        if (0..F::CELLS).any(|cell| self.cell(other, cell) != Cell::Blank) {
            self.flash.erase(other)?;
        }
        if self.next_cell + RESERVE_CELLS <= F::CELLS {
            return Ok(());
        }
        let mut bytes = [0; PAYLOAD_BYTES];
        let moved = match self.newest {
            Some((cell, sequence)) => {
                let header = self.flash.word(self.slot, cell * CELL_WORDS);
                let payload =
                    self.read_payload(self.slot, cell, header, &mut bytes).ok_or(StoreError::Flash)?;
                let sequence = sequence.wrapping_add(1);
                self.write(other, 0, sequence, payload)?;
                if self.cell(other, 0) != Cell::Whole(sequence) {
                    return Err(StoreError::Flash);
                }
                Some((0, sequence))
            }
            None => None,
        };
        let old = self.slot;
        (self.slot, self.newest, self.next_cell) = (other, moved, usize::from(moved.is_some()));
        self.flash.erase(old)
    }
}

fn checksum(header: u32, sequence: u32, payload: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&header.to_le_bytes());
    digest.update(&sequence.to_le_bytes());
    digest.update(payload);
    digest.finalize()
}

#[cfg(test)]
mod tests;
