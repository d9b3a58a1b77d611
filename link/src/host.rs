//! The PC's end: bytes in, frames out, and the count of what is missing.

use crate::codec::{self, Decoder, Garbage, MAX_FRAME, TooLong};
use crate::frames::{Command, DeviceFrame, HostFrame, Numbered};

/// The counts of frames that arrived and that did not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Frames that arrived whole.
    pub frames: u64,
    /// Frames whose number is missing.
    pub lost_frames: u64,
    /// Pieces between zero bytes that were no frame.
    pub garbage: u64,
    /// Samples that arrived.
    pub samples: u64,
    /// Ticks between the first and the last sample of the session that did not.
    pub lost_samples: u64,
}

/// Reads what the device sends.
#[derive(Clone, Debug, Default)]
pub struct Reception {
    decoder: Decoder,
    counts: Counts,
    next_sequence: Option<u32>,
    next_tick: Option<u64>,
}

impl Reception {
    /// Takes a byte; a frame where one is whole.
    pub fn push(&mut self, byte: u8) -> Option<DeviceFrame> {
        let read = self.decoder.push(byte)?;
        self.counted(read)
    }

    /// Takes bytes from the front of `bytes` until a frame is whole, and returns it; `None` where
    /// they end before that.
    pub fn take(&mut self, bytes: &mut &[u8]) -> Option<DeviceFrame> {
        while let Some(read) = self.decoder.take(bytes) {
            let frame = self.counted(read);
            if frame.is_some() {
                return frame;
            }
        }
        None
    }

    fn counted(&mut self, read: Result<Numbered, Garbage>) -> Option<DeviceFrame> {
        match read {
            Ok(numbered) => {
                self.count(&numbered);
                Some(numbered.frame)
            }
            Err(Garbage) => {
                self.counts.garbage += 1;
                None
            }
        }
    }

    /// Returns the counts of frames that arrived and that did not, so far.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    fn count(&mut self, numbered: &Numbered) {
        self.counts.frames += 1;
        let restarted = matches!(numbered.frame, DeviceFrame::Hello(_)) && numbered.sequence == 0;
        if !restarted && let Some(expected) = self.next_sequence {
            // A number from before the expected one is a device that started anew, not four
            // thousand million lost frames.
            let gap = numbered.sequence.wrapping_sub(expected);
            if gap < u32::MAX / 2 {
                self.counts.lost_frames += u64::from(gap);
            }
        }
        self.next_sequence = Some(numbered.sequence.wrapping_add(1));
        match &numbered.frame {
            DeviceFrame::Hello(_) if restarted => self.next_tick = None,
            DeviceFrame::Samples(block) => {
                if let Some(expected) = self.next_tick {
                    self.counts.lost_samples += block.first_tick.saturating_sub(expected);
                }
                self.counts.samples += block.samples.len() as u64;
                self.next_tick = Some(block.first_tick.saturating_add(block.samples.len() as u64));
            }
            _ => {}
        }
    }
}

/// Numbers and encodes commands.
#[derive(Clone, Debug, Default)]
pub struct Commands {
    last_id: u32,
}

impl Commands {
    /// Writes `command` to `out` under a new id; the id and the number of bytes. To repeat it, send
    /// the same bytes.
    pub fn encode(&mut self, command: Command, out: &mut [u8; MAX_FRAME]) -> Result<(u32, usize), TooLong> {
        self.last_id = self.last_id.wrapping_add(1);
        let frame = HostFrame { id: self.last_id, command };
        codec::encode(&frame, out).map(|length| (self.last_id, length))
    }
}
