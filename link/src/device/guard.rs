//! The supply's brown-out reset, which a board looks after: [`Command::GuardSupply`] waits for the
//! board's answer. A virtual device has no supply.
//!
//! [`Command::GuardSupply`]: crate::Command::GuardSupply

use super::{Endpoint, Waiting};
use crate::frames::CommandRefusal;
use core::borrow::BorrowMut;

/// The command's state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Guard {
    /// There is no supply to guard.
    #[default]
    Needless,
    /// The board is asked when the command comes.
    Idle,
    /// The board has been asked by the command of this number, and if it is to set what is off.
    Asked(u32, bool),
}

impl<W: BorrowMut<Waiting>> Endpoint<W> {
    /// Returns the device of a board, which answers by [`Self::answer_guard`].
    pub fn guarding_supply(self) -> Self {
        Self { guard: Guard::Idle, ..self }
    }

    /// True if the board answers the command later.
    pub(super) fn defer_guard(&mut self, id: u32, set: bool) -> bool {
        let defers = self.guard != Guard::Needless && !self.has_torque();
        if defers {
            self.guard = Guard::Asked(id, set);
        }
        defers
    }

    /// Returns true or false where the board is to check its brown-out reset: true if it is to set
    /// one that is off.
    pub fn guard_asked(&self) -> Option<bool> {
        if let Guard::Asked(_, set) = self.guard { Some(set) } else { None }
    }

    /// Takes the board's answer.
    pub fn answer_guard(&mut self, result: Result<(), CommandRefusal>) {
        if let Guard::Asked(id, _) = self.guard {
            self.guard = Guard::Idle;
            self.answer(id, result);
        }
    }
}
