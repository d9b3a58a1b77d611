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
use control_core::interlock::Interlock;
use control_core::{AnyOrder, LargeOrder, Order, Plan};
use core::sync::atomic::Ordering::Relaxed;
use link::codec::MAX_FRAME;
use link::device::{Endpoint, Identity, Waiting};
use link::frames::{CommandRefusal, SaveError, Stage, Timing};

/// Packets that the longest frame may need: only with room for all of them is a frame begun.
const FRAME_PACKETS: usize = MAX_FRAME / super::queues::PACKET_BYTES + 1;

/// The byte at which every frame ends.
const FRAME_END: u8 = 0;

/// The configuration is saved later.
struct TorqueIsOn;

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
    next_tick: u64,
    filling: Packet,
    was_open: bool,
    was_ready: bool,
    in_session: bool,
}

impl<B: Board> Telemetry<B> {
    /// `plan` is the one that the tick starts with, `reset_cause` the fault that ended the last
    /// run, and `crash` the record that it left where it gave up.
    pub fn new(
        shared: &'static Shared,
        (identity, plan, reset_cause, crash): (Identity, &Plan, Option<Fault>, Option<Crash>),
        store: Store<B::Flash>,
        (ends, waiting): (TelemetryEnds, &'static mut Waiting),
        lamps: B::Lamps,
    ) -> Self {
        let mut endpoint = Endpoint::with(waiting, identity, plan, reset_cause).guarding_supply();
        endpoint.set_crash(crash);
        Self {
            shared,
            endpoint,
            store,
            saved: (link::codec::hash(plan.device()), link::codec::hash(plan.patient())),
            ends,
            lamps,
            held: None,
            next_tick: 0,
            filling: Packet::new(),
            was_open: false,
            was_ready: false,
            in_session: false,
        }
    }

    /// One turn: link state, commands, samples, frames.
    pub fn run(&mut self) {
        let entered = B::cycles();
        self.watch_link();
        // Samples first: whether torque is on decides what a command may do.
        self.take_samples();
        self.take_commands();
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
            self.shared.session.store(self.session().wrapping_add(1), Relaxed);
            self.held = Some(Order::Stop.into());
            self.forward_orders();
            if self.shared.is_powered() {
                self.shared.trips.raise(Fault::LinkLost);
            }
        }
        self.was_open = is_open;
        self.was_ready = is_ready;
    }

    /// The number of the session.
    fn session(&self) -> u8 {
        self.shared.session.load(Relaxed)
    }

    fn take_commands(&mut self) {
        self.endpoint.set_interlocks(self.shared.conditions.get());
        while let Some(packet) = self.ends.from_pc.dequeue() {
            self.endpoint.receive(&packet);
            self.forward_orders();
        }
        B::allow_usb(true);
        self.forward_orders();
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
        self.shared.conditions.set(Interlock::Saving, false);
        self.endpoint.answer_guard(result);
    }

    /// Passes orders on until there are no more or the tick has no room.
    fn forward_orders(&mut self) {
        while let Some(order) = self.held.take().or_else(|| self.endpoint.next_order()) {
            let order = match order {
                AnyOrder::Small(Order::Trip(fault)) => {
                    self.shared.trips.raise(fault);
                    continue;
                }
                AnyOrder::Small(order) => Some(order),
                AnyOrder::Large(large) => {
                    if !self.ends.orders.ready() || !self.ends.large_orders.ready() {
                        self.held = Some(AnyOrder::Large(large));
                        return;
                    }
                    if let LargeOrder::Configure(plan) = &large
                        && self.save(plan).is_err()
                    {
                        self.held = Some(AnyOrder::Large(large));
                        return;
                    }
                    // There is room: just seen.
                    let _ = self.ends.large_orders.enqueue(large);
                    None
                }
            };
            let queued = Queued { session: self.session(), order };
            if self.ends.orders.enqueue(queued).is_err() {
                // The room of a large one was seen above.
                self.held = order.map(AnyOrder::Small);
                return;
            }
        }
    }

    /// Each part outlives a reset; one that has not changed costs no flash. The link takes none
    /// while torque is on; a start and a stop may still be on their way to the tick, though, and an
    /// erasure would stop the processor with the amplifier on: not before it is off.
    fn save(&mut self, plan: &Plan) -> Result<(), TorqueIsOn> {
        self.shared.conditions.set(Interlock::Saving, true);
        let is_off = !self.shared.is_powered();
        let saved = if is_off { self.save_parts(plan) } else { Ok(()) };
        self.shared.conditions.set(Interlock::Saving, false);
        let error = match saved {
            Ok(()) => return if is_off { Ok(()) } else { Err(TorqueIsOn) },
            Err(StoreError::Full) => SaveError::Full,
            Err(StoreError::Flash) => SaveError::Flash,
            Err(StoreError::TooLong) => SaveError::TooLong,
        };
        log::warn!("the configuration was not saved: {}", error as u8);
        self.endpoint.not_saved(self.next_tick, error);
        Ok(())
    }

    fn save_parts(&mut self, plan: &Plan) -> Result<(), StoreError> {
        let (device, patient) = (link::codec::hash(plan.device()), link::codec::hash(plan.patient()));
        if device != self.saved.0 {
            self.store.save_device(plan.device())?;
            self.saved.0 = device;
        }
        if patient != self.saved.1 {
            self.store.save_patient(plan.patient())?;
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
