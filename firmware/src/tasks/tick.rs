//! The control tick: count in, code out, then everything that can wait for the code to be out.

use super::queues::{SmallOrder, TickEnds, Ticked};
use super::shared;
use crate::board::{BoardDrive, Encoder, TickTimer};
use control_core::config::DacWidth;
use control_core::controller::TickInput;
use control_core::event::Fault;
use control_core::interlock::Interlock;
use control_core::{Controller, Order, Plan};
use core::sync::atomic::Ordering::Relaxed;
use cortex_m::peripheral::DWT;
use firmware::supervision::Task;
use firmware::timing;
use link::frames::Stage;

/// Ticks from one note of the motor's heat to the next.
const HEAT_TICKS: u32 = 8;

/// The tick's own state.
pub(crate) struct Tick {
    timer: TickTimer,
    encoder: Encoder,
    drive: BoardDrive,
    controller: Controller,
    width: DacWidth,
    ends: TickEnds,
    tick: u32,
    has_ticked: bool,
    entered: u32,
    supervised_ms: u32,
    unsupervised_ticks: u32,
}

impl Tick {
    /// Torque off, under `plan`, with a motor as warm as `heat`.
    pub(crate) fn new(
        timer: TickTimer,
        encoder: Encoder,
        drive: BoardDrive,
        plan: &Plan,
        heat: u32,
        ends: TickEnds,
    ) -> Self {
        Self {
            timer,
            encoder,
            drive,
            controller: Controller::warm(plan.clone(), heat),
            width: plan.device().dac,
            ends,
            tick: 0,
            has_ticked: false,
            entered: 0,
            supervised_ms: 0,
            unsupervised_ticks: 0,
        }
    }

    /// One tick.
    pub(crate) fn run(&mut self) {
        let entered = DWT::cycle_count();
        self.timer.acknowledge();
        let input = TickInput { count: self.encoder.count(), tilt: shared::tilt() };
        if !shared::TRIPS.is_empty()
            && let Some(fault) = shared::TRIPS.take()
        {
            self.controller.order(Order::Trip(fault));
        }
        let output = self.controller.tick(input);
        self.drive.apply(self.width, &output);
        let to_dac = self.timer.cycles_since_edge();

        // The code is out; what follows may take its time, up to the deadline.
        shared::set_given(self.width, output.dac);
        let powered = output.enable;
        if self.ends.outputs.enqueue(Ticked { tick: self.tick, output }).is_err() {
            // Telemetry sees the gap in the numbers and counts it.
        }
        self.tick = self.tick.wrapping_add(1);
        if shared::POWERED.load(Relaxed) != powered {
            shared::POWERED.store(powered, Relaxed);
            shared::LAST_WORDS.torque(powered);
        }
        if self.tick.is_multiple_of(HEAT_TICKS) {
            shared::LAST_WORDS.heat(self.controller.heat());
        }
        self.watch_supervisor();
        self.take_order();
        shared::STAGES.note(Stage::TickToDac, to_dac);
        shared::REPORTS.alive(Task::Tick);
        self.watch_time(entered);
    }

    /// At most one order a tick, so that a storm of them costs no more than one.
    fn take_order(&mut self) {
        let Some(order) = self.ends.orders.dequeue() else { return };
        match order {
            SmallOrder::Start(session) => self.power_up(session, Order::Start),
            SmallOrder::Stop => self.controller.order(Order::Stop),
            SmallOrder::Zero => self.controller.order(Order::Zero),
            SmallOrder::Heartbeat => self.controller.heartbeat(),
            SmallOrder::Large(session) => match self.ends.large_orders.dequeue() {
                Some(excite @ Order::Excite(_)) => self.power_up(session, excite),
                Some(order) => {
                    self.controller.order(order);
                    // A plan that came while torque was on has not been taken.
                    self.width = self.controller.plan().config().device.dac;
                }
                None => {}
            },
        }
    }

    /// Torque on, for the PC that is there and under no interlock; telemetry has refused it before where it could know.
    fn power_up(&mut self, session: u8, order: Order) {
        if session != shared::SESSION.load(Relaxed) {
            return;
        }
        match shared::CONDITIONS.get().first() {
            None => self.controller.order(order),
            Some(interlock) => self.controller.order(Order::Trip(interlock.fault())),
        }
    }

    /// The supervisor watches everybody; somebody has to watch the supervisor.
    fn watch_supervisor(&mut self) {
        let supervised_ms = shared::SUPERVISED_MS.load(Relaxed);
        if supervised_ms != self.supervised_ms {
            self.supervised_ms = supervised_ms;
            self.unsupervised_ticks = 0;
            return;
        }
        self.unsupervised_ticks = self.unsupervised_ticks.saturating_add(1);
        if self.unsupervised_ticks >= timing::SUPERVISOR_SILENCE_TICKS {
            shared::TRIPS.raise(Fault::Watchdog);
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
        shared::STAGES.note(Stage::Tick, DWT::cycle_count().wrapping_sub(entered));
    }

    #[cold]
    fn missed(&self, ticks: u32) {
        if shared::CONDITIONS.get().contains(Interlock::Saving) {
            // An erasure stops the processor, and torque is off.
            return;
        }
        shared::MISSED_TICKS.store(shared::MISSED_TICKS.load(Relaxed).saturating_add(ticks), Relaxed);
        if shared::POWERED.load(Relaxed) {
            shared::TRIPS.raise(Fault::Overrun);
        }
    }
}
