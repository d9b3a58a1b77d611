//! The queues between tasks: one writer and one reader each, no lock.

use control_core::{Order, TickOutput};
use heapless::Vec;
use heapless::spsc::{Consumer, Producer, Queue};

/// A bulk packet of USB at full speed.
pub(crate) const PACKET_BYTES: usize = 64;

/// Bytes on their way to or from the PC.
pub(crate) type Packet = Vec<u8, PACKET_BYTES>;

/// An order in a byte: what a tick moves without noticing.
#[derive(Clone, Copy)]
pub(crate) enum SmallOrder {
    /// In the session of this number.
    Start(u8),
    Stop,
    Zero,
    Heartbeat,
    /// Take the large one that waits: a plan or an excitation, which are rare and only for a device whose torque is off;
    /// in the session of this number.
    Large(u8),
}

/// What a tick gave, with its number.
pub(crate) struct Ticked {
    /// Counts from power-on, the lower half of the number; a gap is what the queue had no room for.
    pub(crate) tick: u32,
    pub(crate) output: TickOutput,
}

/// Memory of all queues.
pub(crate) struct Queues {
    orders: Queue<SmallOrder, 16>,
    large_orders: Queue<Order, 2>,
    // 25 ms of samples: as long as telemetry may hang before it is found out.
    outputs: Queue<Ticked, 256>,
    // 1 KiB: more than any command; where it is full, USB tells the PC to wait.
    from_pc: Queue<Packet, 16>,
    // 4 KiB: what a full-speed host takes in 4 ms at worst, 40 ms of stream.
    to_pc: Queue<Packet, 64>,
}

/// The tick's ends.
pub(crate) struct TickEnds {
    pub(crate) orders: Consumer<'static, SmallOrder>,
    pub(crate) large_orders: Consumer<'static, Order>,
    pub(crate) outputs: Producer<'static, Ticked>,
}

/// The USB task's ends.
pub(crate) struct UsbEnds {
    pub(crate) from_pc: Producer<'static, Packet>,
    pub(crate) to_pc: Consumer<'static, Packet>,
}

/// Telemetry's ends.
pub(crate) struct TelemetryEnds {
    pub(crate) orders: Producer<'static, SmallOrder>,
    pub(crate) large_orders: Producer<'static, Order>,
    pub(crate) outputs: Consumer<'static, Ticked>,
    pub(crate) from_pc: Consumer<'static, Packet>,
    pub(crate) to_pc: Producer<'static, Packet>,
}

/// All ends.
pub(crate) struct Ends {
    pub(crate) tick: TickEnds,
    pub(crate) usb: UsbEnds,
    pub(crate) telemetry: TelemetryEnds,
}

impl Queues {
    /// All empty.
    pub(crate) const fn new() -> Self {
        Self {
            orders: Queue::new(),
            large_orders: Queue::new(),
            outputs: Queue::new(),
            from_pc: Queue::new(),
            to_pc: Queue::new(),
        }
    }

    /// The ends, for the tasks.
    pub(crate) fn split(&'static mut self) -> Ends {
        let (orders_in, orders) = self.orders.split();
        let (large_in, large_orders) = self.large_orders.split();
        let (outputs, outputs_out) = self.outputs.split();
        let (from_pc, from_pc_out) = self.from_pc.split();
        let (to_pc_in, to_pc) = self.to_pc.split();
        Ends {
            tick: TickEnds { orders, large_orders, outputs },
            usb: UsbEnds { from_pc, to_pc },
            telemetry: TelemetryEnds {
                orders: orders_in,
                large_orders: large_in,
                outputs: outputs_out,
                from_pc: from_pc_out,
                to_pc: to_pc_in,
            },
        }
    }
}
