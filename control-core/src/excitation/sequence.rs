//! Excitations that a PC uploads one by one and that play one after the other without a rest
//! between them. An upload starts nothing: the whole is checked once more when it is to play,
//! against the ceilings that are in force then.

use super::Excitation;
use super::player::{MAX_SEGMENTS, Prepared, ticks};
use super::reference::Reach;
use crate::plan::Plan;
use crate::refusal::{Field, Refusal, within};
use core::fmt;
use fixed::types::I16F16;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The longest sequence, all segments together: two minutes.
pub const MAX_SEQUENCE_MS: u32 = 120_000;

/// Segments in the order in which they play.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sequence {
    segments: Vec<Excitation, MAX_SEGMENTS>,
}

/// The reason why a segment or a sequence was not taken. `index` counts from 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SequenceRefusal {
    /// This segment may not play, by itself or after those before it.
    Segment {
        /// The segment.
        index: u8,
        /// The reason.
        refusal: Refusal,
    },
    /// With this segment it lasts longer than [`MAX_SEQUENCE_MS`].
    TooLong {
        /// The segment.
        index: u8,
    },
    /// There are more than [`MAX_SEGMENTS`].
    TooMany,
    /// This segment does not follow the one before it.
    OutOfOrder {
        /// The segment.
        index: u8,
        /// The one that is due.
        due: u8,
    },
    /// This segment asks for compensation and the first does not, or the other way round.
    Mixed {
        /// The segment.
        index: u8,
    },
    /// No sequence waits.
    Nothing,
    /// Another number of segments waits than is to play.
    Count {
        /// The number that waits.
        found: u8,
        /// The number to play.
        wanted: u8,
    },
    /// The sequence that waits is not the one that was sent.
    Damaged,
    /// The upload began too long ago.
    Late,
}

impl fmt::Display for SequenceRefusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let number = |index: &u8| u16::from(*index) + 1;
        match self {
            Self::Segment { index, refusal } => write!(f, "segment {} of the sequence: {refusal}", number(index)),
            Self::TooLong { index } => write!(
                f,
                "with segment {} the sequence lasts longer than {} s; shorten it or play it in parts",
                number(index),
                MAX_SEQUENCE_MS / 1000
            ),
            Self::TooMany => write!(
                f,
                "the sequence has more segments than the {MAX_SEGMENTS} that the device holds; play it in parts"
            ),
            Self::OutOfOrder { index, due } => write!(
                f,
                "segment {} of the sequence came where segment {} is due; upload it again from the first",
                number(index),
                number(due)
            ),
            Self::Mixed { index } => write!(
                f,
                "segment {} of the sequence differs from the first in its compensation; choose the same for all",
                number(index)
            ),
            Self::Nothing => f.write_str(
                "no sequence waits in the device: it was played, or forgotten at a stop, a fault, another start, a new configuration or a new session; upload it again",
            ),
            Self::Count { found, wanted } => write!(
                f,
                "{found} segments of the sequence wait in the device, and {wanted} are to be played; upload it again"
            ),
            Self::Damaged => {
                f.write_str("the sequence in the device is not the one that was sent; upload it again")
            }
            Self::Late => {
                f.write_str("the sequence was uploaded too long ago and is forgotten; upload it again and play it at once")
            }
        }
    }
}

impl Sequence {
    /// No segments.
    pub const fn new() -> Self {
        Self { segments: Vec::new() }
    }

    /// The segments so far.
    pub fn segments(&self) -> &[Excitation] {
        &self.segments
    }

    /// Takes a segment; the first begins another sequence. One that is refused takes all those
    /// before it along.
    ///
    /// # Errors
    /// The reason if it is not the next one, if there is no room, or if the device may not play it
    /// after those before it under `plan`.
    pub fn upload(&mut self, index: u8, segment: Excitation, plan: &Plan) -> Result<(), SequenceRefusal> {
        if index == 0 {
            self.forget();
        }
        let result = self.append(index, segment).and_then(|()| self.check(plan));
        if result.is_err() {
            self.forget();
        }
        result
    }

    fn append(&mut self, index: u8, segment: Excitation) -> Result<(), SequenceRefusal> {
        if usize::from(index) >= MAX_SEGMENTS {
            return Err(SequenceRefusal::TooMany);
        }
        if usize::from(index) != self.segments.len() {
            return Err(SequenceRefusal::OutOfOrder { index, due: self.segments.len() as u8 });
        }
        self.segments.push(segment).map_err(|_| SequenceRefusal::TooMany)
    }

    /// Forgets all segments.
    pub fn forget(&mut self) {
        self.segments.clear();
    }

    /// Checks all of it against the ceilings of `plan`: each segment as an excitation by itself,
    /// the length of all, and the way of the reference, which goes on from segment to segment and
    /// must stay within each segment's travel from where the first began.
    ///
    /// # Errors
    /// The first reason that is found.
    pub fn check(&self, plan: &Plan) -> Result<(), SequenceRefusal> {
        let (mut length_ms, mut begin) = (0_u32, I16F16::ZERO);
        for (index, segment) in (0_u8..).zip(&self.segments) {
            let refused = |refusal| SequenceRefusal::Segment { index, refusal };
            segment.check(plan).map_err(refused)?;
            length_ms = length_ms.saturating_add(segment.duration_ms);
            if length_ms > MAX_SEQUENCE_MS {
                return Err(SequenceRefusal::TooLong { index });
            }
            if self.segments.first().is_some_and(|first| first.compensated != segment.compensated) {
                return Err(SequenceRefusal::Mixed { index });
            }
            let reach = Reach::after(&segment.signal, ticks(segment));
            let furthest = begin.saturating_add(reach.furthest.0);
            within(Field::Travel, furthest, I16F16::ZERO, segment.travel.0).map_err(refused)?;
            // Without a servo the motor goes where it goes: the travel is watched while it plays.
            if segment.servo.stiffness.0 != I16F16::ZERO {
                begin = begin.saturating_add(reach.end.0);
            }
        }
        Ok(())
    }

    /// Returns it ready to be played, or why it may not play under `plan`.
    ///
    /// # Errors
    /// See [`Self::check`]; one without segments is refused too.
    pub fn prepared(&self, plan: &Plan) -> Result<Prepared, SequenceRefusal> {
        if self.segments.is_empty() {
            return Err(SequenceRefusal::Nothing);
        }
        self.check(plan)?;
        Ok(Prepared::new(&self.segments))
    }
}
