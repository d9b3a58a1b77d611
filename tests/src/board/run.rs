//! The board at work on the emulator's thread, by the orders of a test.

use std::sync::mpsc::{Receiver, Sender};

use rigless::emulator::{Driver, Host, Settled, Stop};
use rigless::session::Session;
use rigless::time::VirtualNanos;

use super::machine::Machine;
use super::plant::Nanos;
use super::stopped::Stopped;
use super::world::World;

/// A visit of the test to the stopped board.
pub(super) type Visit = Box<dyn FnOnce(&mut Stopped<'_>) + Send>;

/// The order from a test to the emulator's thread.
pub(super) enum Order {
    Until(Nanos),
    Visit(Visit),
    End,
}

/// The answer of the emulator's thread once the order is done.
pub(super) struct Done;

/// A board that takes orders.
pub(super) struct Run {
    world: World,
    orders: Receiver<Order>,
    done: Sender<Done>,
    /// True while an order to run is carried out.
    is_busy: bool,
}

impl Run {
    pub(super) fn new(world: World, orders: Receiver<Order>, done: Sender<Done>) -> Self {
        Self { world, orders, done, is_busy: false }
    }
}

impl Driver<Machine> for Run {
    fn on_settled(&mut self, session: &mut Session<Machine>, host: &mut dyn Host, settled: Settled) {
        self.world.settle(session, host, settled);
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Machine>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let at = stop.at.0;
        self.world.step(session, host, at);
        while at >= self.world.target {
            if std::mem::take(&mut self.is_busy) && self.done.send(Done).is_err() {
                return None;
            }
            match self.orders.recv() {
                Ok(Order::Until(target)) => {
                    self.world.target = target;
                    self.is_busy = true;
                }
                Ok(Order::Visit(visit)) => {
                    let instruction = stop.instruction_count;
                    visit(&mut Stopped { at, instruction, world: &mut self.world, session, host });
                    if self.done.send(Done).is_err() {
                        return None;
                    }
                }
                Ok(Order::End) | Err(_) => return None,
            }
        }
        Some(VirtualNanos(self.world.due()))
    }
}
