//! The control law as a whole: its core, and the segments that play while it excites.

use super::{AnyOrder, Core, LargeOrder, TickInput, TickOutput};
use crate::excitation::Segments;
use crate::plan::Plan;
use crate::units::Millimetres;
use core::borrow::BorrowMut;

/// The control law with its memory.
#[derive(Clone, Debug)]
pub struct Controller<S = Segments> {
    core: Core,
    /// Nothing plays them but an excitation, and each begins with segments of its own: those that a
    /// fault leaves behind are never played.
    segments: S,
}

impl Controller {
    /// Torque off, waiting to be started.
    pub fn new(plan: Plan) -> Self {
        Self::warm(plan, 0)
    }

    /// The same, with a motor that has the heat which [`Self::heat`] gave before a reset.
    pub fn warm(plan: Plan, heat: u32) -> Self {
        Self::with(Segments::new(), plan, Some(heat))
    }
}

impl<S: BorrowMut<Segments>> Controller<S> {
    /// [`Controller::warm`] with a place for what plays. A motor whose heat is not known gives no
    /// more than its continuous torque until its winding's time constant has passed.
    pub fn with(segments: S, plan: Plan, heat: Option<u32>) -> Self {
        Self { core: Core::warm(plan, heat), segments }
    }

    /// The plan in force.
    pub fn plan(&self) -> &Plan {
        self.core.plan()
    }

    /// True if the amplifier is on from the next tick on, unless that trips.
    pub fn is_powered(&self) -> bool {
        self.core.is_powered()
    }

    /// The winding's heat in (mN·m)², in Q16: what must not be forgotten in a reset.
    pub fn heat(&self) -> u32 {
        self.core.heat()
    }

    /// Takes an order. What does not fit the mode is ignored: the link has refused it before.
    #[inline]
    pub fn order(&mut self, order: impl Into<AnyOrder>) {
        match order.into() {
            AnyOrder::Small(order) => self.core.order(self.segments.borrow_mut(), order),
            AnyOrder::Large(order) => self.large_order(order),
        }
    }

    /// The same for a large one, which is moved no further on its way.
    #[inline]
    pub fn large_order(&mut self, order: LargeOrder) {
        self.core.large_order(self.segments.borrow_mut(), order);
    }

    /// [`super::Order::Heartbeat`], the one that comes while the needle moves.
    pub fn heartbeat(&mut self) {
        self.core.heartbeat();
    }

    /// Says that the tissue's surface is displaced by so much along the needle: the law of Paper
    /// 000 counts depth from there. At most 3 mm count, they change by at most 20 mm/s, and they go
    /// back to 0 if they are not said again within 50 ms. The firmware never says it.
    pub fn displace(&mut self, displacement: Millimetres) {
        self.core.displace(displacement);
    }

    /// Takes [`crate::NeedleLine::depths`] of a needle that has turned in tissue, in the place of
    /// those before; they have passed [`Plan::check_line`]. It holds until the next, or until the
    /// needle is taken for one that has never been in this tissue: at a zero, an excitation,
    /// another plan.
    #[inline]
    pub fn take_line(&mut self, depths: &[Millimetres]) {
        self.core.take_line(depths);
    }

    /// Says, until it is said again, whether both of the encoder's lines are at one level, as they
    /// also are without its supply or its ground. An encoder without lines, such as a simulated
    /// one, leaves it at `false`.
    #[inline]
    pub fn set_lines_agree(&mut self, agree: bool) {
        self.core.set_lines_agree(agree);
    }

    /// One tick, 100 µs after the one before.
    pub fn tick(&mut self, input: TickInput) -> TickOutput {
        self.core.tick(&mut self.segments, input)
    }
}
