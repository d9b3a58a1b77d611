//! From frames to bytes and back. A frame ends at a zero byte, whatever came before it.

use crc::{CRC_32_ISO_HDLC, Crc, Table};
use serde::{Serialize, de::DeserializeOwned};

/// Bytes of the longest frame, its delimiter included.
pub const MAX_FRAME: usize = 1024;
/// CRC-32 as in Ethernet.
static CRC: Crc<u32, Table<TABLES>> = Crc::<u32, Table<TABLES>>::new(&CRC_32_ISO_HDLC);
/// Tables of 1 KiB each: on the board one byte at a time, on a PC sixteen.
const TABLES: usize = if cfg!(target_os = "none") { 1 } else { 16 };
const CRC_BYTES: usize = 4;
/// COBS adds a byte, and one more for every 254; the delimiter is one.
const OVERHEAD: usize = 2 + MAX_FRAME / 254;

/// A frame that does not fit [`MAX_FRAME`] or the room given.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TooLong;

/// Writes `frame` to the beginning of `out`; the number of bytes. Nothing longer than [`MAX_FRAME`]
/// is written.
pub fn encode<F: Serialize>(frame: &F, out: &mut [u8]) -> Result<usize, TooLong> {
    let mut plain = [0; MAX_FRAME - OVERHEAD];
    let room = plain.get_mut(..MAX_FRAME - OVERHEAD - CRC_BYTES).ok_or(TooLong)?;
    let length = postcard::to_slice(frame, room).map_err(|_| TooLong)?.len();
    let check = CRC.checksum(plain.get(..length).ok_or(TooLong)?);
    plain.get_mut(length..length + CRC_BYTES).ok_or(TooLong)?.copy_from_slice(&check.to_le_bytes());
    let plain = plain.get(..length + CRC_BYTES).ok_or(TooLong)?;
    let room = out.len().checked_sub(1).ok_or(TooLong)?;
    let coded = cobs::try_encode(plain, out.get_mut(..room).ok_or(TooLong)?).map_err(|_| TooLong)?;
    *out.get_mut(coded).ok_or(TooLong)? = 0;
    Ok(coded + 1)
}

/// CRC-32 of these bytes, one part after the other.
pub(crate) fn check(parts: [&[u8]; 2]) -> u32 {
    let mut digest = CRC.digest();
    parts.into_iter().for_each(|part| digest.update(part));
    digest.finalize()
}

/// CRC-32 of anything that can be a frame: names a configuration.
pub fn hash<F: Serialize>(value: &F) -> u32 {
    let mut plain = [0; MAX_FRAME];
    postcard::to_slice(value, &mut plain).map_or(0, |bytes| CRC.checksum(bytes))
}

/// The bytes between two zero bytes that are not a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Garbage;

/// Collects bytes until a frame is whole.
#[derive(Clone, Debug)]
pub struct Decoder {
    buffer: [u8; MAX_FRAME],
    filled: usize,
    overflown: bool,
}

impl Default for Decoder {
    fn default() -> Self {
        Self { buffer: [0; MAX_FRAME], filled: 0, overflown: false }
    }
}

impl Decoder {
    /// Takes a byte; at the end of a frame, the frame or the word that it was none. Empty frames
    /// are passed over.
    pub fn push<F: DeserializeOwned>(&mut self, byte: u8) -> Option<Result<F, Garbage>> {
        Some(self.push_body(byte)?.and_then(read))
    }

    /// [`Self::push`] without a look into the frame.
    pub(crate) fn push_body(&mut self, byte: u8) -> Option<Result<&[u8], Garbage>> {
        if byte != 0 {
            match self.buffer.get_mut(self.filled) {
                Some(place) => {
                    *place = byte;
                    self.filled += 1;
                }
                None => self.overflown = true,
            }
            return None;
        }
        let filled = core::mem::take(&mut self.filled);
        if core::mem::take(&mut self.overflown) {
            return Some(Err(Garbage));
        }
        let coded = self.buffer.get_mut(..filled).filter(|coded| !coded.is_empty())?;
        Some(body(coded))
    }

    /// Takes bytes from the front of `bytes` up to the end of a frame, as [`Self::push`] does one
    /// by one: `None` where they end before that. On a PC that is faster than a call for each byte.
    pub fn take<F: DeserializeOwned>(&mut self, bytes: &mut &[u8]) -> Option<Result<F, Garbage>> {
        while let Some((piece, rest)) = bytes
            .iter()
            .position(|byte| *byte == 0)
            .and_then(|end| Some((bytes.get(..end)?, bytes.get(end + 1..)?)))
        {
            self.fill(piece);
            *bytes = rest;
            let frame = self.push(0);
            if frame.is_some() {
                return frame;
            }
        }
        self.fill(bytes);
        *bytes = &[];
        None
    }

    fn fill(&mut self, piece: &[u8]) {
        let end = self.filled.saturating_add(piece.len());
        match self.buffer.get_mut(self.filled..end) {
            Some(place) => {
                place.copy_from_slice(piece);
                self.filled = end;
            }
            None => self.overflown = true,
        }
    }
}

/// Returns the bytes of a frame that is sound.
fn body(coded: &mut [u8]) -> Result<&[u8], Garbage> {
    let length = cobs::decode_in_place(coded).map_err(|_| Garbage)?;
    let plain = coded.get(..length).ok_or(Garbage)?;
    let (body, check) = plain.split_last_chunk::<CRC_BYTES>().ok_or(Garbage)?;
    if CRC.checksum(body) == u32::from_le_bytes(*check) { Ok(body) } else { Err(Garbage) }
}

/// Reads a frame, which is all of `body`.
pub(crate) fn read<F: DeserializeOwned>(body: &[u8]) -> Result<F, Garbage> {
    match postcard::take_from_bytes(body) {
        Ok((frame, [])) => Ok(frame),
        _ => Err(Garbage),
    }
}
