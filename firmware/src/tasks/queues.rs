//! The queues between tasks: one writer and one reader each, no lock.

use control_core::excitation::Segments;
use control_core::{LargeOrder, Order, TickOutput};
use heapless::Vec;
use heapless::spsc::{Consumer, Producer, Queue};
use link::device::{PlanRequest, Planned, Waiting};

/// A bulk packet of USB at full speed.
pub const PACKET_BYTES: usize = 64;

/// Bytes on their way to or from the PC.
pub type Packet = Vec<u8, PACKET_BYTES>;

/// An order on its way to the tick in a few bytes, which a tick moves without noticing.
#[derive(Clone, Copy)]
pub struct Queued {
    /// The number of stops that had come before it: after a later one it gives no torque.
    pub stops: u32,
    /// The order; `None`: the large one that waits, which is rare and only for a device whose
    /// torque is off.
    pub order: Option<Order>,
}

/// The outputs of a tick, with its number.
pub struct Ticked {
    /// Counts from power-on, the lower half of the number; a gap is what the queue had no room for.
    pub tick: u32,
    /// Its outputs.
    pub output: TickOutput,
}

/// Memory of all queues, and what is too large for the tasks' own.
pub struct Queues {
    orders: Queue<Queued, 16>,
    large_orders: Queue<LargeOrder, 2>,
    // 25 ms of samples: as long as telemetry may hang before it is found out.
    outputs: Queue<Ticked, 256>,
    plans_asked: Queue<PlanRequest, 2>,
    plans_made: Queue<Planned, 2>,
    // 1 KiB: more than any command; while it is full, USB makes the PC wait.
    from_pc: Queue<Packet, 16>,
    // 4 KiB: what a full-speed host takes in 4 ms at worst, 40 ms of stream.
    to_pc: Queue<Packet, 64>,
    waiting: Waiting,
    segments: Segments,
}

/// The tick's ends.
pub struct TickEnds {
    /// From telemetry.
    pub orders: Consumer<'static, Queued>,
    /// The large orders.
    pub large_orders: Consumer<'static, LargeOrder>,
    /// To telemetry.
    pub outputs: Producer<'static, Ticked>,
}

/// The USB task's ends.
pub struct UsbEnds {
    /// To telemetry.
    pub from_pc: Producer<'static, Packet>,
    /// From telemetry.
    pub to_pc: Consumer<'static, Packet>,
}

/// The planner's ends.
pub struct PlannerEnds {
    /// From telemetry.
    pub asked: Consumer<'static, PlanRequest>,
    /// To telemetry.
    pub made: Producer<'static, Planned>,
}

/// Telemetry's ends.
pub struct TelemetryEnds {
    /// To the tick.
    pub orders: Producer<'static, Queued>,
    /// The large orders.
    pub large_orders: Producer<'static, LargeOrder>,
    /// From the tick.
    pub outputs: Consumer<'static, Ticked>,
    /// To the planner.
    pub plans_asked: Producer<'static, PlanRequest>,
    /// From the planner.
    pub plans_made: Consumer<'static, Planned>,
    /// From the USB task.
    pub from_pc: Consumer<'static, Packet>,
    /// To the USB task.
    pub to_pc: Producer<'static, Packet>,
}

/// All ends.
pub struct Ends {
    /// The tick's, and its room for the excitations that play: out of the way of what every tick
    /// uses.
    pub tick: (TickEnds, &'static mut Segments),
    /// The USB task's.
    pub usb: UsbEnds,
    /// The planner's.
    pub planner: PlannerEnds,
    /// Telemetry's, and its memory for what waits.
    pub telemetry: (TelemetryEnds, &'static mut Waiting),
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}

impl Queues {
    /// All empty.
    pub const fn new() -> Self {
        Self {
            orders: Queue::new(),
            large_orders: Queue::new(),
            outputs: Queue::new(),
            plans_asked: Queue::new(),
            plans_made: Queue::new(),
            from_pc: Queue::new(),
            to_pc: Queue::new(),
            waiting: Waiting::new(),
            segments: Segments::new(),
        }
    }

    /// The ends, for the tasks.
    pub fn split(&'static mut self) -> Ends {
        let (orders_in, orders) = self.orders.split();
        let (large_in, large_orders) = self.large_orders.split();
        let (outputs, outputs_out) = self.outputs.split();
        let (asked_in, asked) = self.plans_asked.split();
        let (made, made_out) = self.plans_made.split();
        let (from_pc, from_pc_out) = self.from_pc.split();
        let (to_pc_in, to_pc) = self.to_pc.split();
        Ends {
            tick: (TickEnds { orders, large_orders, outputs }, &mut self.segments),
            usb: UsbEnds { from_pc, to_pc },
            planner: PlannerEnds { asked, made },
            telemetry: (
                TelemetryEnds {
                    orders: orders_in,
                    large_orders: large_in,
                    outputs: outputs_out,
                    plans_asked: asked_in,
                    plans_made: made_out,
                    from_pc: from_pc_out,
                    to_pc: to_pc_in,
                },
                &mut self.waiting,
            ),
        }
    }
}
