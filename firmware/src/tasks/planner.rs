//! The planner: makes the plans that commands ask for, below every other task. A plan takes more
//! than a millisecond, and no stop may wait for it.

use super::queues::PlannerEnds;
use crate::port::Board;
use core::marker::PhantomData;

/// The planner's own state.
pub struct Planner<B: Board> {
    ends: PlannerEnds,
    board: PhantomData<fn(B)>,
}

impl<B: Board> Planner<B> {
    /// Nothing is asked for yet.
    pub fn new(ends: PlannerEnds) -> Self {
        Self { ends, board: PhantomData }
    }

    /// Makes a plan, if one is asked for and the one before has been taken.
    pub fn run(&mut self) {
        if self.ends.made.ready()
            && let Some(request) = self.ends.asked.dequeue()
        {
            // There is room: just seen.
            let _ = self.ends.made.enqueue(request.make());
            B::wake_telemetry();
        }
    }
}
