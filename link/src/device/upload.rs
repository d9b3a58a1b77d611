//! The sequence that a PC uploads before it plays it. It belongs to the session, and nothing starts
//! by it.

use super::{Endpoint, Waiting};
use crate::codec;
use crate::commissioning::Proof;
use crate::frames::CommandRefusal;
use control_core::excitation::{Excitation, Prepared, Sequence, SequenceRefusal};
use control_core::{LargeOrder, Plan, TICK_HZ};
use core::borrow::BorrowMut;

/// A sequence is played at once or not at all: this many ticks after its first segment it is
/// forgotten.
pub const LATE_TICKS: u64 = 10 * TICK_HZ as u64;

/// A sequence and the tick at which its first segment came.
#[derive(Debug, Default)]
pub(super) struct Upload {
    sequence: Sequence,
    since: u64,
}

impl Upload {
    pub(super) const NOTHING: Self = Self { sequence: Sequence::new(), since: 0 };

    pub(super) fn forget(&mut self) {
        self.sequence.forget();
    }

    fn take(&mut self, now: u64, index: u8, segment: Excitation, plan: &Plan) -> Result<(), SequenceRefusal> {
        if index == 0 {
            self.since = now;
        }
        self.is_in_time(now)?;
        self.sequence.upload(index, segment, plan)
    }

    fn is_in_time(&mut self, now: u64) -> Result<(), SequenceRefusal> {
        if self.sequence.segments().is_empty() || now.saturating_sub(self.since) <= LATE_TICKS {
            return Ok(());
        }
        self.forget();
        Err(SequenceRefusal::Late)
    }

    /// Ready to be played if it is whole and what was sent.
    fn prepared(
        &mut self,
        now: u64,
        wanted: u8,
        checksum: u32,
        plan: &Plan,
    ) -> Result<Prepared, SequenceRefusal> {
        self.is_in_time(now)?;
        let segments = self.sequence.segments();
        let found = segments.len() as u8;
        if found != wanted && found != 0 {
            return Err(SequenceRefusal::Count { found, wanted });
        }
        if found != 0 && codec::hash(&segments) != checksum {
            return Err(SequenceRefusal::Damaged);
        }
        self.sequence.prepared(plan)
    }
}

impl<W: BorrowMut<Waiting>> Endpoint<W> {
    pub(super) fn upload(&mut self, index: u8, segment: Excitation) -> Result<(), CommandRefusal> {
        if !self.in_session {
            return Err(CommandRefusal::NoSession);
        }
        self.upload.take(self.now, index, segment, &self.plan).map_err(CommandRefusal::Sequence)
    }

    pub(super) fn play(&mut self, count: u8, checksum: u32) -> Result<(), CommandRefusal> {
        self.may_give_torque()?;
        self.is_commissioned()?;
        match self.upload.prepared(self.now, count, checksum, &self.plan) {
            Ok(prepared) => self.order(LargeOrder::Play(prepared))?,
            Err(refusal) => {
                self.upload.forget();
                return Err(CommandRefusal::Sequence(refusal));
            }
        }
        self.proof = Proof::None;
        self.will_power_up();
        Ok(())
    }
}
