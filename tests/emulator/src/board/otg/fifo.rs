//! The packet memory of the USB core: 320 words cut by the firmware into one receive FIFO and one
//! transmit FIFO for each IN endpoint, RM0090 section 34.11.

use std::collections::VecDeque;

use serde::{Deserialize, Serialize};

use super::registers::{PKTSTS_OUT_COMPLETE, PKTSTS_OUT_DATA, PKTSTS_SETUP_COMPLETE, PKTSTS_SETUP_DATA};

/// The words of packet memory the core has.
pub const PACKET_WORDS: u32 = 320;

/// A word of the receive FIFO: the status in front of a packet, or four of its bytes.
#[derive(Debug, Clone, Copy, Serialize, Deserialize)]
enum Word {
    Status(u32),
    Data(u32),
}

/// The announcement of a status word once the firmware has taken it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Announced {
    /// Data follows, or nothing of interest.
    Packet,
    /// The OUT transfer of this endpoint is complete.
    OutComplete(usize),
    /// The SETUP stage of this endpoint is over.
    SetupComplete(usize),
}

/// The receive FIFO, shared by every OUT endpoint.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct ReceiveFifo {
    words: VecDeque<Word>,
    /// Its depth in words, as `GRXFSIZ` sets it.
    pub(super) depth: u32,
}

fn status(endpoint: usize, bytes: usize, toggle: bool, packet_status: u32) -> u32 {
    let pid = if toggle { 0b10 } else { 0b00 };
    endpoint as u32 | (bytes as u32) << 4 | pid << 15 | packet_status << 17
}

fn words_of(bytes: &[u8]) -> impl Iterator<Item = u32> + '_ {
    bytes.chunks(4).map(|chunk| {
        let mut word = [0; 4];
        word[..chunk.len()].copy_from_slice(chunk);
        u32::from_le_bytes(word)
    })
}

impl ReceiveFifo {
    pub(super) fn of(depth: u32) -> Self {
        Self { words: VecDeque::new(), depth }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    pub(super) fn flush(&mut self) {
        self.words.clear();
    }

    fn room(&self) -> usize {
        (self.depth as usize).saturating_sub(self.words.len())
    }

    /// True if a packet of `bytes` fits, its status word and the one that ends a transfer included.
    pub(super) fn fits(&self, bytes: usize) -> bool {
        self.room() >= bytes.div_ceil(4) + 2
    }

    pub(super) fn push_setup(&mut self, endpoint: usize, bytes: [u8; 8]) {
        self.words.push_back(Word::Status(status(endpoint, 8, false, PKTSTS_SETUP_DATA)));
        self.words.extend(words_of(&bytes).map(Word::Data));
    }

    pub(super) fn push_setup_complete(&mut self, endpoint: usize) {
        self.words.push_back(Word::Status(status(endpoint, 0, false, PKTSTS_SETUP_COMPLETE)));
    }

    pub(super) fn push_out(&mut self, endpoint: usize, bytes: &[u8], toggle: bool) {
        let word = status(endpoint, bytes.len(), toggle, PKTSTS_OUT_DATA);
        self.words.push_back(Word::Status(word));
        self.words.extend(words_of(bytes).map(Word::Data));
    }

    pub(super) fn push_out_complete(&mut self, endpoint: usize) {
        self.words.push_back(Word::Status(status(endpoint, 0, false, PKTSTS_OUT_COMPLETE)));
    }

    /// The word on top, which is what the core shows even where the firmware lost its place.
    pub(super) fn look(&self) -> u32 {
        match self.words.front() {
            Some(Word::Status(word) | Word::Data(word)) => *word,
            None => 0,
        }
    }

    /// Takes the word on top.
    pub(super) fn take(&mut self) -> (u32, Announced) {
        let (word, is_status) = match self.words.pop_front() {
            Some(Word::Status(word)) => (word, true),
            Some(Word::Data(word)) => (word, false),
            None => (0, false),
        };
        let endpoint = (word & 0xF) as usize;
        let announced = match (is_status, word >> 17 & 0xF) {
            (true, PKTSTS_OUT_COMPLETE) => Announced::OutComplete(endpoint),
            (true, PKTSTS_SETUP_COMPLETE) => Announced::SetupComplete(endpoint),
            _ => Announced::Packet,
        };
        (word, announced)
    }
}

/// One transmit FIFO.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct TransmitFifo {
    words: VecDeque<u32>,
    /// Its depth in words, as `DIEPTXFx` sets it.
    pub(super) depth: u32,
    /// Words the firmware wrote past the end, which the core loses.
    pub(super) overruns: u64,
}

impl TransmitFifo {
    pub(super) fn of(depth: u32) -> Self {
        Self { words: VecDeque::new(), depth, overruns: 0 }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    pub(super) fn flush(&mut self) {
        self.words.clear();
    }

    /// The free words, which `DTXFSTS` reads.
    pub(super) fn room(&self) -> u32 {
        self.depth.saturating_sub(self.words.len() as u32)
    }

    pub(super) fn push(&mut self, word: u32) {
        if self.room() == 0 {
            self.overruns += 1;
        } else {
            self.words.push_back(word);
        }
    }

    /// The next packet of `bytes`, or `None` while the firmware hasn't written all of it.
    pub(super) fn packet(&mut self, bytes: usize) -> Option<Vec<u8>> {
        let words = bytes.div_ceil(4);
        if self.words.len() < words {
            return None;
        }
        let mut packet: Vec<u8> = self.words.drain(..words).flat_map(u32::to_le_bytes).collect();
        packet.truncate(bytes);
        Some(packet)
    }
}
