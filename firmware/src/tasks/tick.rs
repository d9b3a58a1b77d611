//! The control tick: count in, code out, then everything that can wait for the code to be out.

use super::queues::{Queued, TickEnds, Ticked};
use super::shared::Shared;
use crate::drive::Drive;
use crate::port::{Board, Encoder, TickTimer};
use crate::supervision::Task;
use crate::timing;
use control_core::config::DacWidth;
use control_core::controller::TickInput;
use control_core::event::Fault;
use control_core::excitation::Segments;
use control_core::interlock::Interlock;
use control_core::{AnyOrder, Controller, LargeOrder, Order, Plan};
use core::sync::atomic::Ordering::{Relaxed, Release};
use link::frames::Stage;

/// Ticks from one note of the motor's heat, or one line of the needle, to the next.
const HEAT_TICKS: u32 = 8;

/// The tick's own state.
// In this order: the nearer a field is to the beginning, the fewer instructions it takes to reach
// it.
#[repr(C)]
pub struct Tick<B: Board> {
    shared: &'static Shared,
    timer: B::Timer,
    encoder: B::Encoder,
    drive: BoardDrive<B>,
    width: DacWidth,
    ends: TickEnds,
    tick: u32,
    has_ticked: bool,
    entered: u32,
    supervised_ms: u32,
    unsupervised_ticks: u32,
    /// The number of the line that was taken last.
    line: u32,
    controller: Controller<&'static mut Segments>,
}

/// Converters and amplifier enable of a board.
pub type BoardDrive<B> = Drive<<B as Board>::Converters, <B as Board>::Enable>;

impl<B: Board> Tick<B> {
    /// Torque off, under `plan`, with a motor as warm as `heat`, if it is known.
    pub fn new(
        shared: &'static Shared,
        (timer, encoder, drive): (B::Timer, B::Encoder, BoardDrive<B>),
        plan: &Plan,
        heat: Option<u32>,
        (ends, segments): (TickEnds, &'static mut Segments),
    ) -> Self {
        Self {
            shared,
            timer,
            encoder,
            drive,
            controller: Controller::with(segments, plan.clone(), heat),
            width: plan.device().dac,
            ends,
            tick: 0,
            has_ticked: false,
            entered: 0,
            supervised_ms: 0,
            unsupervised_ticks: 0,
            line: 0,
        }
    }

    /// The converter of the plan in force.
    #[cfg(test)]
    pub(super) fn width(&self) -> DacWidth {
        self.width
    }

    /// As after so many ticks.
    #[cfg(test)]
    pub(super) fn set_number(&mut self, tick: u32) {
        self.tick = tick;
    }

    /// One tick.
    pub fn run(&mut self) {
        let entered = B::cycles();
        self.timer.acknowledge();
        let input = TickInput { count: self.encoder.count(), tilt: self.shared.tilt() };
        if !self.shared.trips.is_empty() {
            self.take_torque_away();
        }
        let output = self.controller.tick(input);
        self.drive.apply(self.width, &output);
        let to_dac = self.timer.cycles_since_edge();

        // The code is out; what follows may take its time, up to the deadline.
        self.shared.set_given(self.width, output.dac);
        self.shared.set_count(output.sample.count);
        if self.ends.outputs.enqueue(Ticked { tick: self.tick, output }).is_err() {
            // Telemetry sees the gap in the numbers and counts it.
        }
        self.tick = self.tick.wrapping_add(1);
        self.note_power(output.enable);
        if self.tick.is_multiple_of(HEAT_TICKS) {
            if self.line == self.shared.line.number() {
                self.shared.last_words.heat(self.controller.heat());
            } else if output.transitions.is_empty() {
                // A tick in which a layer is touched or gives way is long enough.
                self.take_line();
            }
        }
        self.watch_supervisor();
        self.take_order();
        self.shared.stages.note(Stage::TickToDac, to_dac);
        self.shared.reports.alive(Task::Tick);
        self.watch_time(entered);
        if to_dac >= timing::OUTPUT_CYCLES {
            self.late_code();
        }
    }

    /// A stop before a fault: the fault is to stay latched.
    #[cold]
    #[inline(never)]
    fn take_torque_away(&mut self) {
        if self.shared.trips.take_stop() {
            self.controller.order(Order::Stop);
        }
        if let Some(fault) = self.shared.trips.take() {
            self.controller.order(Order::Trip(fault));
        }
    }

    /// Out of the way: most ticks bring none.
    #[cold]
    #[inline(never)]
    fn take_line(&mut self) {
        if let Some((number, depths, layers)) = self.shared.line.read() {
            self.line = number;
            self.controller.take_line(depths.get(..layers).unwrap_or_default());
        }
    }

    /// At most one order a tick, so that a storm of them costs no more than one.
    fn take_order(&mut self) {
        let Some(Queued { stops, order }) = self.ends.orders.dequeue() else { return };
        match order {
            Some(Order::Start) => self.power_up(stops, Order::Start),
            Some(Order::Heartbeat) => self.controller.heartbeat(),
            Some(order) => self.controller.order(order),
            None => self.take_large_order(stops),
        }
    }

    /// On its own, because it is rare and an order takes much room.
    #[cold]
    #[inline(never)]
    fn take_large_order(&mut self, stops: u32) {
        let Some(order) = self.ends.large_orders.dequeue() else { return };
        if matches!(order, LargeOrder::Excite(_) | LargeOrder::Play(_)) {
            return self.power_up(stops, order);
        }
        self.controller.large_order(order);
        // A plan that came while torque was on has not been taken.
        self.width = self.controller.plan().config().device.dac;
    }

    /// Torque on by `order`, if no stop has come after it and under no interlock; telemetry has
    /// refused it before where it could know.
    #[cold]
    #[inline(never)]
    fn power_up(&mut self, stops: u32, order: impl Into<AnyOrder>) {
        if stops == self.shared.stops.load(Relaxed) {
            match self.shared.conditions.get().first() {
                None => self.controller.order(order),
                Some(interlock) => self.controller.order(Order::Trip(interlock.fault())),
            }
            self.note_power(self.controller.is_powered());
        }
        let taken = self.shared.starts_taken.load(Relaxed).wrapping_add(1);
        self.shared.starts_taken.store(taken, Release);
    }

    fn note_power(&self, powered: bool) {
        if self.shared.is_powered() != powered {
            self.shared.powered.store(powered, Relaxed);
            self.shared.last_words.torque(powered);
        }
    }

    /// The supervisor watches everybody; somebody has to watch the supervisor.
    fn watch_supervisor(&mut self) {
        let supervised_ms = self.shared.supervised_ms.load(Relaxed);
        if supervised_ms != self.supervised_ms {
            self.supervised_ms = supervised_ms;
            self.unsupervised_ticks = 0;
            // What the supervisor has found in that millisecond.
            self.controller.set_lines_agree(self.shared.lines_agree.load(Relaxed));
            return;
        }
        self.unsupervised_ticks = self.unsupervised_ticks.saturating_add(1);
        if self.unsupervised_ticks >= timing::SUPERVISOR_SILENCE_TICKS {
            self.shared.trips.raise(Fault::Watchdog);
        }
    }

    /// Counts ticks that never came and takes torque away when this one was too long.
    fn watch_time(&mut self, entered: u32) {
        let apart = entered.wrapping_sub(core::mem::replace(&mut self.entered, entered));
        if apart > timing::TICK_MISSED_CYCLES && self.has_ticked {
            self.missed((apart + timing::TICK_CYCLES / 2) / timing::TICK_CYCLES - 1);
        }
        // The first tick has none before it.
        self.has_ticked = true;
        if self.timer.edge_waits() {
            self.missed(1);
        }
        self.shared.stages.note(Stage::Tick, B::cycles().wrapping_sub(entered));
    }

    /// Counts a code that came after the converter's instant. One by itself is a delay of a tick;
    /// many make a wall softer than it is calculated to be, so they are counted, sent to the PC and
    /// shown. A converter without such an instant gives the code out late, and `delay_us` counts on
    /// these 20 µs with every converter.
    #[cold]
    #[inline(never)]
    fn late_code(&self) {
        if self.is_saving() {
            return;
        }
        self.shared.late_codes.store(self.shared.late_codes.load(Relaxed).saturating_add(1), Relaxed);
    }

    /// Returns true while the flash is being written: an erasure stops the processor, and torque is
    /// off.
    fn is_saving(&self) -> bool {
        self.shared.conditions.get().contains(Interlock::Saving)
    }

    #[cold]
    fn missed(&self, ticks: u32) {
        if self.is_saving() {
            return;
        }
        self.shared.missed_ticks.store(self.shared.missed_ticks.load(Relaxed).saturating_add(ticks), Relaxed);
        if self.shared.is_powered() {
            self.shared.trips.raise(Fault::Overrun);
        }
    }
}
