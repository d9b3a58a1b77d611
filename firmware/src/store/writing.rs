//! A version on its way into the flash, word by word, in as many pieces as its writer likes.

use super::{
    CELL_WORDS, COMMITTED, CRC, Cell, ConfigFlash, Kind, LAYOUT_VERSION, MAGIC, Store, StoreError, Version,
};

/// A version that is written up to some word, to the cell before the next one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Writing {
    header: u32,
    sequence: u32,
    check: u32,
    /// Words of it that are in the flash.
    words: usize,
}

impl<F: ConfigFlash> Store<F> {
    /// Writes the next version of a record to the next cell, or goes on with it.
    pub(super) fn append(
        &mut self,
        kind: Kind,
        payload: &[u8],
        goes_on: &mut impl FnMut() -> bool,
    ) -> Result<(), StoreError> {
        let writing = match self.begun(kind, payload) {
            Some(writing) => writing,
            None if self.next_cell >= F::CELLS => return Err(StoreError::Full),
            None => {
                let (header, sequence) = (header(kind, payload), self.next_sequence);
                // Whatever becomes of it, this cell is used.
                self.next_cell += 1;
                self.next_sequence = sequence.wrapping_add(1);
                Writing { header, sequence, check: checksum(header, sequence, payload), words: 0 }
            }
        };
        self.writing = None;
        let (cell, sequence) = (self.next_cell - 1, writing.sequence);
        self.write(cell, writing, payload, goes_on)?;
        if self.cell(self.slot, cell) != Cell::Whole(kind, sequence) {
            return Err(StoreError::Flash);
        }
        self.newest[kind as usize] = Some(Version { slot: self.slot, cell, sequence });
        Ok(())
    }

    /// Returns the version that is being written, if it is one of this record.
    pub(super) fn begun(&self, kind: Kind, payload: &[u8]) -> Option<Writing> {
        let is_it = |writing: &Writing| {
            writing.header == header(kind, payload)
                && writing.check == checksum(writing.header, writing.sequence, payload)
        };
        self.writing.filter(is_it)
    }

    /// Writes the words of a version that are not yet in the flash, the one that commits it last.
    fn write(
        &mut self,
        cell: usize,
        mut writing: Writing,
        payload: &[u8],
        goes_on: &mut impl FnMut() -> bool,
    ) -> Result<(), StoreError> {
        let Writing { header, sequence, check, words: done } = writing;
        let content = payload.chunks(4).map(|chunk| {
            let mut word = [0xFF; 4];
            word.iter_mut().zip(chunk).for_each(|(place, &byte)| *place = byte);
            u32::from_le_bytes(word)
        });
        let words = (0..).zip([header, sequence, check].into_iter().chain(content));
        for (place, word) in words.chain([(CELL_WORDS - 1, COMMITTED)]).skip(done) {
            self.flash.program(self.slot, cell * CELL_WORDS + place, word)?;
            writing.words += 1;
            if place < CELL_WORDS - 1 && !goes_on() {
                self.writing = Some(writing);
                return Err(StoreError::Unfinished);
            }
        }
        Ok(())
    }
}

fn header(kind: Kind, payload: &[u8]) -> u32 {
    MAGIC | u32::from(LAYOUT_VERSION) << 12 | kind.bits() | payload.len() as u32
}

pub(super) fn checksum(header: u32, sequence: u32, payload: &[u8]) -> u32 {
    let mut digest = CRC.digest();
    digest.update(&header.to_le_bytes());
    digest.update(&sequence.to_le_bytes());
    digest.update(payload);
    digest.finalize()
}
