//! An order to run until something holds. The emulator's thread looks by itself: to ask the test
//! each time would take longer than to run the board from one look to the next.

use std::sync::mpsc::Sender;

use super::plant::Nanos;
use super::stopped::Stopped;

/// True once what a test waits for holds.
pub(super) type Look = Box<dyn FnMut(&mut Stopped<'_>) -> bool + Send>;

/// The order.
pub(super) struct Watch {
    /// The instant of the next look, and that of the last.
    pub(super) next: Nanos,
    pub(super) end: Nanos,
    pub(super) every: Nanos,
    pub(super) look: Look,
    /// Takes the answer: true if it holds, and the instant.
    pub(super) found: Sender<(bool, Nanos)>,
}

impl Watch {
    /// Looks at the stopped board. True if the order is carried out.
    pub(super) fn look(&mut self, stopped: &mut Stopped<'_>) -> bool {
        let is_there = (self.look)(stopped);
        if is_there || self.next >= self.end {
            let _ = self.found.send((is_there, self.next));
            return true;
        }
        self.next = (self.next + self.every).min(self.end);
        false
    }
}
