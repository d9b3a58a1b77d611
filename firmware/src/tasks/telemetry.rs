//! Telemetry: the device's end of the link between the USB queues and the tick's queues, and the
//! configuration's way into flash. It decides nothing about torque; it only passes orders on.

use super::queues::{Packet, Queued, TelemetryEnds};
use super::shared::{LINK_CONFIGURED, LINK_READY, Shared};
use crate::log;
use crate::port::{Board, Lamps};
use crate::reset::Crash;
use crate::store::{Store, StoreError};
use crate::supervision::Task;
use crate::timing;
use control_core::event::Fault;
use control_core::interlock::{Interlock, Interlocks};
use control_core::{AnyOrder, LargeOrder, Plan};
use core::sync::atomic::Ordering::{Acquire, Relaxed};
use link::codec::MAX_FRAME;
use link::device::{Ahead, Endpoint, Identity, Waiting};
use link::frames::{CommandRefusal, SaveError, Stage, Timing};

/// Packets that the longest frame may need: only with room for all of them is a frame begun.
const FRAME_PACKETS: usize = MAX_FRAME / super::queues::PACKET_BYTES + 1;

/// The byte at which every frame ends.
const FRAME_END: u8 = 0;

/// The flash has not taken all of the configuration yet.
struct Unfinished;

/// Telemetry's own state.
pub struct Telemetry<B: Board> {
    shared: &'static Shared,
    endpoint: Endpoint<&'static mut Waiting>,
    store: Store<B::Flash>,
    /// CRC-32 of the device's and of the patient's part that a reset would bring back.
    saved: (u32, u32),
    ends: TelemetryEnds,
    lamps: B::Lamps,
    /// An order that the tick had no room for.
    held: Option<AnyOrder>,
    /// The number of orders that give torque so far, modulo 2^32.
    starts_sent: u32,
    /// The number of stops before the last of them.
    stops_before_start: u32,
    next_tick: u64,
    filling: Packet,
    was_open: bool,
    was_ready: bool,
    in_session: bool,
    /// The millisecond in which it last wrote to the flash, or had a plan made for it.
    written_ms: u32,
    /// The millisecond in which it last took a line.
    line_ms: u32,
    /// The millisecond in which the last packet came.
    heard_ms: u32,
    /// CRC-32 of both parts of the configuration that is being saved.
    saving: Option<(u32, u32)>,
}

impl<B: Board> Telemetry<B> {
    /// `plan` is the one that the tick starts with, `reset_cause` the fault that ended the last
    /// run, `crash` the record that it left where it gave up, and `knows_heat` true if the motor's
    /// heat is known.
    pub fn new(
        shared: &'static Shared,
        (identity, plan, reset_cause, crash, knows_heat): (
            Identity,
            &Plan,
            Option<Fault>,
            Option<Crash>,
            bool,
        ),
        store: Store<B::Flash>,
        (ends, waiting): (TelemetryEnds, &'static mut Waiting),
        lamps: B::Lamps,
    ) -> Self {
        let mut endpoint = Endpoint::with(waiting, identity, plan, reset_cause).guarding_supply();
        endpoint.set_crash(crash);
        endpoint.set_knows_heat(knows_heat);
        Self {
            shared,
            endpoint,
            store,
            saved: (link::codec::hash(plan.device()), link::codec::hash(plan.patient())),
            ends,
            lamps,
            held: None,
            starts_sent: 0,
            stops_before_start: 0,
            next_tick: 0,
            filling: Packet::new(),
            was_open: false,
            was_ready: false,
            in_session: false,
            written_ms: 0,
            line_ms: 0,
            heard_ms: 0,
            saving: None,
        }
    }

    /// One turn: link state, commands, samples, frames.
    pub fn run(&mut self) {
        let entered = B::cycles();
        self.watch_link();
        self.endpoint.set_ahead(self.ahead());
        // Samples first: whether torque is on decides what a command may do.
        self.take_samples();
        self.take_commands(entered);
        self.send_frames();
        self.lamps.show(self.shared.is_powered(), self.endpoint.fault().is_some());
        self.shared.reports.alive(Task::Telemetry);
        self.shared.stages.note(Stage::Telemetry, B::cycles().wrapping_sub(entered));
    }

    /// The cable pulled, the bus suspended, or the port closed by the program that had it open.
    fn watch_link(&mut self) {
        let link = self.shared.link.load(Relaxed);
        let is_ready = link & LINK_READY != 0;
        let was_closed = self.was_ready && !is_ready;
        let is_open = link & LINK_CONFIGURED != 0;
        if (self.was_open && !is_open) || was_closed {
            log::info!("the PC is gone");
            // Nothing that it asked for outlives it: neither what has not been read yet, nor a
            // start that the tick has not seen yet.
            while self.ends.from_pc.dequeue().is_some() {}
            self.endpoint.disconnect();
            self.filling.clear();
            self.shared.discard.store(true, Relaxed);
            if self.shared.is_powered() {
                self.shared.trips.raise(Fault::LinkLost);
            }
            self.stop();
        }
        self.was_open = is_open;
        self.was_ready = is_ready;
    }

    /// Many commands end the turn: what comes after them has the next one, so that telemetry
    /// reports between them.
    fn take_commands(&mut self, entered: u32) {
        // A start that follows a configuration waits behind it.
        let saving = Interlocks::of(Interlock::Saving);
        self.endpoint.set_interlocks(Interlocks(self.shared.conditions.get().0 & !saving.0));
        self.endpoint.set_fitted(self.shared.fitted());
        // Its hashes for hello and flash take half a millisecond: it pauses as a save does.
        let takes_plan = !self.save_pauses() && self.ends.plans_made.ready();
        if takes_plan {
            self.take_plan();
        }
        while let Some(packet) = self.ends.from_pc.dequeue() {
            self.heard_ms = self.shared.supervised_ms.load(Relaxed);
            self.endpoint.receive_and_plan_later(&packet);
            if self.endpoint.take_stop() {
                self.stop();
                // Its answer waits for nothing that came after it.
                self.send_frames();
            }
            // It saves nothing: a stop may be in the next packet.
            self.forward_orders(false);
            self.endpoint.set_ahead(self.ahead());
            if B::cycles().wrapping_sub(entered) >= timing::COMMAND_CYCLES {
                B::wake_telemetry();
                break;
            }
        }
        // The check of a line and its answer take longer than to read ten: one in a millisecond.
        let ms = self.shared.supervised_ms.load(Relaxed);
        if ms != self.line_ms
            && let Some(line) = self.endpoint.take_line()
        {
            self.line_ms = ms;
            self.shared.line.set(&line);
        }
        B::allow_usb(true);
        self.forward_orders(!takes_plan);
        if self.ends.plans_asked.ready() && self.ask_for_plan() {
            self.written_ms = ms;
        }
        self.guard_supply();
        let in_session = self.endpoint.in_session();
        if in_session && !self.in_session {
            self.shared.stages.forget_longest();
            // Ends whatever half frame the USB core still held from before; nothing else is in hand
            // yet.
            let _ = self.filling.push(FRAME_END);
        }
        self.in_session = in_session;
    }

    /// Takes a plan that was made. On its own, because a plan takes much room on the stack.
    #[inline(never)]
    fn take_plan(&mut self) {
        if let Some(planned) = self.ends.plans_made.dequeue() {
            self.endpoint.take_plan(planned);
        }
    }

    /// Passes on what the planner is asked for, if there is anything; it has room.
    #[inline(never)]
    fn ask_for_plan(&mut self) -> bool {
        let Some(request) = self.endpoint.plan_asked() else { return false };
        self.ends.plans_asked.enqueue(request).is_ok()
    }

    /// A stop waits for nothing: what waits before it and gives torque is dropped.
    fn stop(&mut self) {
        self.shared.stop();
        self.held.take_if(|order| order.gives_torque());
    }

    /// Has the board check its brown-out reset, or set it, where the PC asks for it: not before the
    /// amplifier is off, as in [`Self::save`].
    fn guard_supply(&mut self) {
        let Some(set) = self.endpoint.guard_asked() else { return };
        self.shared.conditions.set(Interlock::Saving, true);
        let is_off = !self.shared.is_powered();
        let result = if is_off {
            B::guard_supply(set).map_err(CommandRefusal::Guard)
        } else {
            Err(CommandRefusal::Powered)
        };
        // A configuration may be half saved.
        self.shared.conditions.set(Interlock::Saving, self.saving.is_some());
        self.endpoint.answer_guard(result);
    }

    /// Passes orders on until there are no more, the tick has no room, or one is to be saved and
    /// may not.
    fn forward_orders(&mut self, may_save: bool) {
        let may_save = may_save && !(self.saving.is_some() && self.save_pauses());
        // It is large: taking it out and putting it back for each packet takes longer than a line.
        if !may_save && matches!(self.held, Some(AnyOrder::Large(LargeOrder::Configure(_)))) {
            return;
        }
        while let Some(order) = self.held.take().or_else(|| self.endpoint.next_order()) {
            let is_large = matches!(order, AnyOrder::Large(_));
            if !self.ends.orders.ready() || is_large && !self.ends.large_orders.ready() {
                self.held = Some(order);
                return;
            }
            let stops = self.shared.stops.load(Relaxed);
            if order.gives_torque() {
                self.starts_sent = self.starts_sent.wrapping_add(1);
                self.stops_before_start = stops;
            }
            let order = match order {
                AnyOrder::Small(order) => Some(order),
                AnyOrder::Large(large) => {
                    if let LargeOrder::Configure(plan) = &large
                        && (!may_save || self.save(plan).is_err())
                    {
                        self.held = Some(large.into());
                        return;
                    }
                    let _ = self.ends.large_orders.enqueue(large);
                    None
                }
            };
            // There is room in both: just seen.
            let _ = self.ends.orders.enqueue(Queued { stops, order });
        }
    }

    /// Returns what the tick has done beyond the samples that have come. It may run between the two
    /// reads, and says that the amplifier is on before it says that it has taken a start.
    fn ahead(&self) -> Ahead {
        let is_held = self.held.as_ref().is_some_and(AnyOrder::gives_torque);
        let is_valid = self.stops_before_start == self.shared.stops.load(Relaxed);
        let is_queued = is_valid && self.starts_sent != self.shared.starts_taken.load(Acquire);
        Ahead { start_waits: is_held || is_queued, is_on: self.shared.is_powered() }
    }

    /// Each part outlives a reset; one that has not changed costs no flash. The link takes no
    /// configuration while torque is on or a start is on its way, and while it is being saved the
    /// tick gives none: an erasure stops the processor. A millisecond has its share of
    /// time for it, however often telemetry runs.
    fn save(&mut self, plan: &Plan) -> Result<(), Unfinished> {
        debug_assert!(!self.shared.is_powered(), "the link refuses it");
        let hashes = *self
            .saving
            .get_or_insert_with(|| (link::codec::hash(plan.device()), link::codec::hash(plan.patient())));
        if hashes != self.saved && self.save_pauses() {
            return Err(Unfinished);
        }
        self.written_ms = self.shared.supervised_ms.load(Relaxed);
        self.shared.conditions.set(Interlock::Saving, true);
        let error = match self.save_parts(plan, hashes) {
            Err(StoreError::Unfinished) => return Err(Unfinished),
            Ok(()) => None,
            Err(StoreError::Full) => Some(SaveError::Full),
            Err(StoreError::Flash) => Some(SaveError::Flash),
            Err(StoreError::TooLong) => Some(SaveError::TooLong),
        };
        self.saving = None;
        self.shared.conditions.set(Interlock::Saving, false);
        if let Some(error) = error {
            log::warn!("the configuration was not saved: {}", error as u8);
            self.endpoint.not_saved(self.next_tick, error);
        }
        Ok(())
    }

    /// True if a save has had its share of time. The flash stops the processor while it is written,
    /// and where packets come a stop may be among them.
    fn save_pauses(&self) -> bool {
        let ms = self.shared.supervised_ms.load(Relaxed);
        let hears = ms.wrapping_sub(self.heard_ms) < timing::QUIET_MS;
        ms.wrapping_sub(self.written_ms) < if hears { timing::SAVE_APART_MS } else { 1 }
    }

    fn save_parts(&mut self, plan: &Plan, (device, patient): (u32, u32)) -> Result<(), StoreError> {
        let began = B::cycles();
        let goes_on = || B::cycles().wrapping_sub(began) < timing::SAVE_CYCLES;
        if device != self.saved.0 {
            self.store.save_device(plan.device(), goes_on)?;
            self.saved.0 = device;
        }
        if patient != self.saved.1 {
            self.store.save_patient(plan.patient(), goes_on)?;
            self.saved.1 = patient;
        }
        Ok(())
    }

    fn take_samples(&mut self) {
        while let Some(ticked) = self.ends.outputs.dequeue() {
            let dropped = ticked.tick.wrapping_sub(self.next_tick as u32);
            if dropped != 0 {
                self.endpoint.note_dropped(dropped);
            }
            let tick = self.next_tick + u64::from(dropped);
            self.next_tick = tick + 1;
            self.endpoint.record(tick, &ticked.output);
        }
        self.endpoint.set_timing(Timing {
            clock_hz: timing::CORE_HZ,
            stages: self.shared.stages.read(),
            missed_ticks: self.shared.missed_ticks.load(Relaxed),
            late_codes: self.shared.late_codes.load(Relaxed),
            ..Timing::default()
        });
    }

    fn send_frames(&mut self) {
        let mut frame = [0; MAX_FRAME];
        let mut has_sent = false;
        while self.ends.to_pc.capacity() - self.ends.to_pc.len() > FRAME_PACKETS {
            let length = self.endpoint.transmit(&mut frame);
            if length == 0 {
                break;
            }
            for &byte in &frame[..length] {
                if self.filling.push(byte).is_err() {
                    self.flush();
                    let _ = self.filling.push(byte);
                }
            }
            has_sent = true;
        }
        if !self.filling.is_empty() {
            self.flush();
        }
        if has_sent {
            B::wake_usb();
        }
    }

    /// There is room: no frame is begun without it.
    fn flush(&mut self) {
        let packet = core::mem::take(&mut self.filling);
        let _ = self.ends.to_pc.enqueue(packet);
    }
}
