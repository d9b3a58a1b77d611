//! The configuration in flash: two records, what was found of the device and whom it was set for
//! last, each with versions of its own. Both live in two slots (sectors), each a row of cells, a
//! cell for each version ever saved. A cell is written once, its last word last; losing power at
//! any point leaves the record that was or the one that comes, never a mixture. A slot is erased at
//! start-up, before the tick and the watchdog run, and where no cell is left: an erasure stops the
//! processor for a second or two, and whoever saves sees to it that torque is off meanwhile.
//!
//! Below it, the flash has the traits of `embedded-storage` ([`Nor`]), so that another store, such
//! as `sequential-storage`, can take this one's place. This one is kept for three things: a bit
//! that flips in the record saved last is distinguished from a record that was never finished, so
//! that a device never quietly runs on an older one; it is read and written without waiting in
//! between, in a task that the watchdog looks after, and reports progress with every word; and its
//! tests cut the power at every single write.

mod nor;
mod writing;

pub use nor::Nor;

use control_core::{Device, Patient};
use crc::{CRC_32_ISO_HDLC, Crc, Table};
use serde::Serialize;
use serde::de::DeserializeOwned;
use writing::{Writing, checksum};

/// Raised whenever the bytes of a stored record mean something else. A field added at the end does
/// not raise it if zeros say that nothing is known of it: a shorter record is read so.
pub(crate) const LAYOUT_VERSION: u8 = 6;
/// Words of a cell: 1 KiB, room for the longest record.
pub const CELL_WORDS: usize = 256;
/// Erased flash.
const BLANK: u32 = u32::MAX;
const MAGIC: u32 = 0xC0F1 << 16;
/// The last word of a cell once the cell is whole.
const COMMITTED: u32 = 0x600D_600D;
const HEADER_WORDS: usize = 3;
const PAYLOAD_BYTES: usize = (CELL_WORDS - HEADER_WORDS - 1) * 4;
/// The bits of a header that hold the payload's length.
const LENGTH: u32 = 0x3FF;
/// With fewer blank cells left, start-up moves to the other slot.
const RESERVE_CELLS: usize = 2;

const CRC: Crc<u32, Table<1>> = Crc::<u32, Table<1>>::new(&CRC_32_ISO_HDLC);

/// Which record a cell holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Device = 0,
    Patient = 1,
}

impl Kind {
    const ALL: [Self; 2] = [Self::Device, Self::Patient];

    /// Its bits in a header. A single bit that flips makes neither of the other.
    fn bits(self) -> u32 {
        match self {
            Kind::Device => 0b01 << 10,
            Kind::Patient => 0b10 << 10,
        }
    }
}

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
    fn word(&mut self, slot: Slot, index: usize) -> u32;
    /// Programs a word that is blank.
    fn program(&mut self, slot: Slot, index: usize, word: u32) -> Result<(), StoreError>;
    /// Makes every word of `slot` blank.
    fn erase(&mut self, slot: Slot) -> Result<(), StoreError>;
}

/// Why a configuration was not saved. It is in force all the same, until the next reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreError {
    /// The flash did not do what was ordered.
    Flash,
    /// No blank cell is left until the device is restarted.
    Full,
    /// The configuration is longer than a cell.
    TooLong,
    /// The piece is written: called again with the same record, the save goes on.
    Unfinished,
}

/// The finding of start-up about a record.
#[derive(Clone, Debug, PartialEq)]
pub enum Stored<T> {
    /// The version saved last.
    Found(T),
    /// None was saved, or only by a firmware with another layout.
    None,
    /// The version saved last cannot be read: flash has lost a bit.
    Damaged,
}

impl<T> Stored<T> {
    /// Returns the record to use, `otherwise` if there is none, and true if a version was lost.
    pub fn or(self, otherwise: T) -> (T, bool) {
        match self {
            Stored::Found(record) => (record, false),
            Stored::None => (otherwise, false),
            Stored::Damaged => (otherwise, true),
        }
    }
}

/// The store on its flash.
pub struct Store<F> {
    flash: F,
    slot: Slot,
    /// The newest version of each record, by [`Kind`].
    newest: [Option<Version>; 2],
    next_cell: usize,
    next_sequence: u32,
    writing: Option<Writing>,
}

/// The place of a version of a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Version {
    slot: Slot,
    cell: usize,
    sequence: u32,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Cell {
    Blank,
    /// Begun and never committed: the power went.
    Torn,
    /// Committed and wrong, with the record that its header names, where it still names one.
    Damaged(Option<Kind>),
    /// Whole, with its record and its sequence number.
    Whole(Kind, u32),
    /// Whole, from a firmware with another layout.
    Foreign(u32),
}

impl Cell {
    fn sequence(self) -> Option<u32> {
        match self {
            Cell::Whole(_, sequence) | Cell::Foreign(sequence) => Some(sequence),
            Cell::Blank | Cell::Torn | Cell::Damaged(_) => None,
        }
    }
}

/// True if number `a` was given out after `b`.
fn is_later(a: u32, b: u32) -> bool {
    a.wrapping_sub(b).cast_signed() > 0
}

impl<F: ConfigFlash> Store<F> {
    /// Finds the versions saved last and makes room for the next ones. Erases, so that it may take
    /// seconds.
    pub fn open(flash: F) -> (Self, Stored<Device>, Stored<Patient>) {
        let mut store =
            Self { flash, slot: Slot::A, newest: [None; 2], next_cell: 0, next_sequence: 0, writing: None };
        let [device_damaged, patient_damaged] = store.find();
        let device = store.stored(Kind::Device, device_damaged);
        let patient = store.stored(Kind::Patient, patient_damaged);
        // Without room the device works as well; saving then says so.
        let _ = store.make_room(&mut || true);
        (store, device, patient)
    }

    /// Gives the flash back, for the test of the board.
    pub fn close(self) -> F {
        self.flash
    }

    /// Saves the device's part unless it is what was saved last. After each word it asks `goes_on`,
    /// and leaves the rest for the next call ([`StoreError::Unfinished`]); another record ends it.
    /// Where no cell is left, it takes as long as an erasure.
    pub fn save_device(&mut self, device: &Device, goes_on: impl FnMut() -> bool) -> Result<(), StoreError> {
        self.save(Kind::Device, device, goes_on)
    }

    /// Saves the patient's part unless it is what was saved last; as [`Self::save_device`].
    pub fn save_patient(
        &mut self,
        patient: &Patient,
        goes_on: impl FnMut() -> bool,
    ) -> Result<(), StoreError> {
        self.save(Kind::Patient, patient, goes_on)
    }

    fn save<T: Serialize>(
        &mut self,
        kind: Kind,
        record: &T,
        mut goes_on: impl FnMut() -> bool,
    ) -> Result<(), StoreError> {
        let mut bytes = [0; PAYLOAD_BYTES];
        let payload = &*postcard::to_slice(record, &mut bytes).map_err(|_| StoreError::TooLong)?;
        if self.is_saved(kind, payload) {
            return Ok(());
        }
        let has_cell = self.next_cell < F::CELLS && self.is_in_one_slot();
        if !has_cell && self.begun(kind, payload).is_none() {
            self.make_room(&mut goes_on)?;
        }
        self.append(kind, payload, &mut goes_on)
    }

    fn is_saved(&mut self, kind: Kind, payload: &[u8]) -> bool {
        let mut bytes = [0; PAYLOAD_BYTES];
        let newest = self.newest[kind as usize];
        newest.is_some_and(|newest| self.read(newest, &mut bytes) == Some(payload))
    }

    fn cell(&mut self, slot: Slot, cell: usize) -> Cell {
        let mut word = |index| self.flash.word(slot, cell * CELL_WORDS + index);
        if word(CELL_WORDS - 1) == BLANK {
            let blank = (0..CELL_WORDS).all(|index| word(index) == BLANK);
            return if blank { Cell::Blank } else { Cell::Torn };
        }
        let mut bytes = [0; PAYLOAD_BYTES];
        let (header, sequence, check) = (word(0), word(1), word(2));
        let is_ours = header >> 12 & 0xF == u32::from(LAYOUT_VERSION);
        // Another layout may have had its length where this one has the record's name.
        let length = header & if is_ours { LENGTH } else { 0xFFF };
        let kind = Kind::ALL.into_iter().find(|kind| kind.bits() == header & (0b11 << 10));
        let payload = self.read_payload(slot, cell, header, length, &mut bytes);
        match (payload, kind) {
            (Some(payload), _) if checksum(header, sequence, payload) != check => Cell::Damaged(kind),
            (Some(_), _) if !is_ours => Cell::Foreign(sequence),
            (Some(_), Some(kind)) => Cell::Whole(kind, sequence),
            _ => Cell::Damaged(kind),
        }
    }

    fn read_payload<'a>(
        &mut self,
        slot: Slot,
        cell: usize,
        header: u32,
        length: u32,
        bytes: &'a mut [u8],
    ) -> Option<&'a [u8]> {
        if header & 0xFFFF_0000 != MAGIC {
            return None;
        }
        let payload = bytes.get_mut(..length as usize)?;
        for (index, chunk) in payload.chunks_mut(4).enumerate() {
            let word = self.flash.word(slot, cell * CELL_WORDS + HEADER_WORDS + index).to_le_bytes();
            chunk.copy_from_slice(word.get(..chunk.len())?);
        }
        Some(payload)
    }

    /// The bytes of a whole version.
    fn read<'a>(&mut self, version: Version, bytes: &'a mut [u8]) -> Option<&'a [u8]> {
        let header = self.flash.word(version.slot, version.cell * CELL_WORDS);
        self.read_payload(version.slot, version.cell, header, header & LENGTH, bytes)
    }

    /// Returns the content of the newest version of a record.
    fn stored<T: DeserializeOwned>(&mut self, kind: Kind, is_damaged: bool) -> Stored<T> {
        let mut bytes = [0; PAYLOAD_BYTES];
        match self.newest[kind as usize] {
            _ if is_damaged => Stored::Damaged,
            None => Stored::None,
            Some(newest) => {
                let is_read = self.read(newest, &mut bytes).is_some();
                // With the zeros that follow it: a field that it does not have yet.
                let record = if is_read { postcard::from_bytes(&bytes).ok() } else { None };
                record.map_or(Stored::Damaged, Stored::Found)
            }
        }
    }

    /// Finds the newest versions, the slot to write to and the cell; whether each record has lost
    /// its last version.
    fn find(&mut self) -> [bool; 2] {
        let mut last: Option<(u32, Slot)> = None;
        for (slot, cell) in cells::<F>() {
            let found = self.cell(slot, cell);
            let Some(sequence) = found.sequence() else { continue };
            if last.is_none_or(|(last, _)| is_later(sequence, last)) {
                last = Some((sequence, slot));
            }
            if let Cell::Whole(kind, _) = found {
                let newest = &mut self.newest[kind as usize];
                if newest.is_none_or(|newest| is_later(sequence, newest.sequence)) {
                    *newest = Some(Version { slot, cell, sequence });
                }
            }
        }
        self.next_sequence = last.map_or(0, |(last, _)| last.wrapping_add(1));
        let mut damaged_in =
            |slot| (0..F::CELLS).any(|cell| matches!(self.cell(slot, cell), Cell::Damaged(_)));
        self.slot = match last {
            Some((_, slot)) => slot,
            None if damaged_in(Slot::B) && !damaged_in(Slot::A) => Slot::B,
            None => Slot::A,
        };
        let is_used = |cell: &usize| self.cell(self.slot, *cell) != Cell::Blank;
        self.next_cell = (0..F::CELLS).rev().find(is_used).map_or(0, |cell| cell + 1);
        Kind::ALL.map(|kind| self.is_damaged(kind))
    }

    /// True if a version of the record that was committed after its newest whole one cannot be
    /// read. The other slot does not count: it may be half erased.
    fn is_damaged(&mut self, kind: Kind) -> bool {
        let from = match self.newest[kind as usize] {
            Some(newest) if newest.slot == self.slot => newest.cell + 1,
            Some(_) => return false,
            None => 0,
        };
        (from..F::CELLS).any(|cell| match self.cell(self.slot, cell) {
            Cell::Damaged(damaged) => damaged.is_none_or(|damaged| damaged == kind),
            _ => false,
        })
    }

    /// True if the newest versions are in the slot that is written to.
    fn is_in_one_slot(&self) -> bool {
        self.newest.iter().flatten().all(|newest| newest.slot == self.slot)
    }

    /// Brings both records together in one slot with room for more, and leaves the other one blank.
    /// Called again where it was unfinished, it goes on.
    fn make_room(&mut self, goes_on: &mut impl FnMut() -> bool) -> Result<(), StoreError> {
        let is_full = self.next_cell + RESERVE_CELLS > F::CELLS;
        if is_full && self.is_in_one_slot() {
            let other = self.slot.other();
            self.blank(other)?;
            (self.slot, self.next_cell, self.writing) = (other, 0, None);
        }
        for kind in Kind::ALL {
            if let Some(newest) = self.newest[kind as usize]
                && newest.slot != self.slot
            {
                let mut bytes = [0; PAYLOAD_BYTES];
                let payload = self.read(newest, &mut bytes).ok_or(StoreError::Flash)?;
                self.append(kind, payload, goes_on)?;
            }
        }
        self.blank(self.slot.other())
    }

    /// Erases a slot that holds anything.
    fn blank(&mut self, slot: Slot) -> Result<(), StoreError> {
        let is_blank = (0..F::CELLS).all(|cell| self.cell(slot, cell) == Cell::Blank);
        if is_blank { Ok(()) } else { self.flash.erase(slot) }
    }
}

/// Every cell of both slots.
fn cells<F: ConfigFlash>() -> impl Iterator<Item = (Slot, usize)> {
    [Slot::A, Slot::B].into_iter().flat_map(|slot| (0..F::CELLS).map(move |cell| (slot, cell)))
}

#[cfg(test)]
mod tests;
