//! The board at work on the emulator's thread, by the orders of a test.

use std::sync::mpsc::{Receiver, Sender};

use rigless::emulator::{Driver, Host, Settled, Stop};
use rigless::session::Session;
use rigless::snapshot::{self, Taken};
use rigless::time::VirtualNanos;

use super::machine::Machine;
use super::plant::Nanos;
use super::stopped::Stopped;
use super::warm_core::ImageKey;
use super::watch::Watch;
use super::world::World;

/// A visit of the test to the stopped board.
pub(super) type Visit = Box<dyn FnOnce(&mut Stopped<'_>) + Send>;

/// The answer to an order to take a snapshot.
pub(super) type Answer = Sender<Result<Taken, snapshot::Error>>;

/// The order from a test to the emulator's thread.
pub(super) enum Order {
    Until(Nanos),
    Visit(Visit),
    Watch(Watch),
    Save(Answer),
    End,
}

/// The answer of the emulator's thread once the order is done.
pub(super) struct Done;

/// A board that takes orders.
pub(super) struct Run {
    world: World,
    image: ImageKey,
    orders: Receiver<Order>,
    done: Sender<Done>,
    /// True while an order to run is carried out.
    is_busy: bool,
    watch: Option<Watch>,
    /// True until a board that starts from a snapshot is back at the stop in which it was taken.
    is_resuming: bool,
    has_ended: bool,
}

impl Run {
    pub(super) fn new(
        world: World,
        image: ImageKey,
        is_resuming: bool,
        (orders, done): (Receiver<Order>, Sender<Done>),
    ) -> Self {
        Self { world, image, orders, done, is_busy: false, watch: None, is_resuming, has_ended: false }
    }

    /// Carries out the orders of the test until one is to run on, and returns the time of the next
    /// stop; `None` at the end.
    fn take_orders(
        &mut self,
        session: &mut Session<Machine>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        let (at, instruction) = (stop.at.0, stop.instruction_count);
        while at >= self.world.target {
            if let Some(mut watch) = self.watch.take() {
                let mut stopped = Stopped { at, instruction, world: &mut self.world, session, host };
                if !watch.look(&mut stopped) {
                    self.world.target = watch.next;
                    self.watch = Some(watch);
                    continue;
                }
            }
            if std::mem::take(&mut self.is_busy) && self.done.send(Done).is_err() {
                return None;
            }
            match self.orders.recv() {
                Ok(Order::Until(target)) => {
                    self.world.target = target;
                    self.is_busy = true;
                    continue;
                }
                Ok(Order::Watch(watch)) => {
                    self.world.target = watch.next;
                    (self.watch, self.is_busy) = (Some(watch), true);
                    continue;
                }
                Ok(Order::Visit(visit)) => {
                    visit(&mut Stopped { at, instruction, world: &mut self.world, session, host });
                }
                Ok(Order::Save(answer)) => {
                    let taken = snapshot::take(session, host, stop, &self.image.digest(), &self.world);
                    let _ = answer.send(taken);
                }
                Ok(Order::End) | Err(_) => return None,
            }
            if self.done.send(Done).is_err() {
                return None;
            }
        }
        Some(VirtualNanos(self.world.due()))
    }
}

impl Driver<Machine> for Run {
    fn on_settled(&mut self, session: &mut Session<Machine>, host: &mut dyn Host, settled: Settled) {
        if let Settled::Stop(stop) = settled
            && std::mem::take(&mut self.is_resuming)
        {
            // The snapshot was taken between two orders of this stop, after all else that happens
            // in it.
            let until = self.take_orders(session, stop, host);
            self.has_ended = until.is_none();
            session.run_until(until.unwrap_or(stop.at));
            return;
        }
        self.world.settle(session, host, settled);
    }

    fn on_stop(
        &mut self,
        session: &mut Session<Machine>,
        stop: Stop,
        host: &mut dyn Host,
    ) -> Option<VirtualNanos> {
        if self.has_ended {
            return None;
        }
        self.world.step(session, host, stop.at.0);
        self.take_orders(session, stop, host)
    }
}
