//! The queues at the device's end of the link.

use super::plan_request::PlanRequest;
use crate::frames::{Ack, Event, SampleBlock};
use control_core::AnyOrder;
use heapless::Deque;

/// Blocks that wait for the PC: 77 ms of samples.
const WAITING_BLOCKS: usize = 24;
const WAITING_EVENTS: usize = 32;
const WAITING_ACKS: usize = 16;
const WAITING_ORDERS: usize = 4;

/// The messages that wait for the PC or for the control law, and what is to be planned. It is
/// large, may be built in its final place, and takes no flash: all of it begins as zeros.
pub struct Waiting {
    pub(super) acks: Deque<Ack, WAITING_ACKS>,
    pub(super) events: Deque<Event, WAITING_EVENTS>,
    pub(super) blocks: Deque<SampleBlock, WAITING_BLOCKS>,
    pub(super) orders: Deque<AnyOrder, WAITING_ORDERS>,
    pub(super) plan: Deque<PlanRequest, 1>,
}

impl Default for Waiting {
    fn default() -> Self {
        Self::new()
    }
}

impl Waiting {
    /// Nothing waits.
    pub const fn new() -> Self {
        Self {
            acks: Deque::new(),
            events: Deque::new(),
            blocks: Deque::new(),
            orders: Deque::new(),
            plan: Deque::new(),
        }
    }
}
