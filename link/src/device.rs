//! The device's end: commands in, orders for the control law out; ticks in, frames out. The board and the virtual device
//! share it. It never waits: what the PC does not take in time is dropped, oldest block first, and counted.

mod waiting;

use crate::build::Build;
use crate::codec::{self, Decoder, MAX_FRAME};
use crate::commissioning::{Proof, Record, may_become};
use crate::crash::Crash;
use crate::frames::{
    Ack, BLOCK_SAMPLES, Command, DeviceFrame, Event, EventKind, Hello, HostFrame, Numbered, POSE_HZ,
    PROTOCOL_VERSION, Pose, Rejection, SampleBlock, SaveFailure, Timing,
};
use control_core::ceilings::Ceilings;
use control_core::compensation::check::check;
use control_core::config::{Device, Tissue};
use control_core::event::{Fault, Limits};
use control_core::interlock::{Interlock, Interlocks};
use control_core::units::Counts;
use control_core::{Order, Patient, Plan, TICK_HZ, TickOutput};
use core::borrow::BorrowMut;
use heapless::HistoryBuf;
pub use waiting::Waiting;

/// Commands whose answer is remembered.
const REMEMBERED: usize = 16;
/// Ticks from one pose to the next.
const POSE_TICKS: u64 = (TICK_HZ / POSE_HZ as u32) as u64;
/// Ticks from one timing frame to the next.
const TIMING_TICKS: u64 = TICK_HZ as u64;

/// The device's number, firmware and ceilings.
#[derive(Clone, Copy, Debug)]
pub struct Identity {
    /// The microcontroller's unique number.
    pub serial: [u8; 12],
    /// Version of the firmware.
    pub firmware: [u8; 3],
    /// The ceilings that no command raises.
    pub ceilings: Ceilings,
}

impl Identity {
    /// The identity of every virtual device.
    pub const VIRTUAL: Self = Self { serial: [0; 12], firmware: [0, 1, 0], ceilings: Ceilings::VIRTUAL };
}

/// The device's end of the link.
pub struct Endpoint<W = Waiting> {
    waiting: W,
    identity: Identity,
    plan: Plan,
    decoder: Decoder,
    answered: HistoryBuf<Ack, REMEMBERED>,
    in_session: bool,
    powered: bool,
    start_ordered: bool,
    /// Somebody has said where depth 0 is.
    zeroed: bool,
    proof: Proof,
    interlocks: Interlocks,
    limits: Limits,
    fault: Option<Fault>,
    crash: Option<Crash>,
    sequence: u32,
    hello_due: bool,
    crash_due: bool,
    device_due: bool,
    filling: SampleBlock,
    pose: Option<Pose>,
    timing: Timing,
    timing_due: bool,
}

impl Endpoint {
    /// `plan` is the one that the control law starts with; `reset_cause` is reported until a person starts again.
    pub fn new(identity: Identity, plan: &Plan, reset_cause: Option<Fault>) -> Self {
        Self::with(Waiting::new(), identity, plan, reset_cause)
    }
}

impl<W: BorrowMut<Waiting>> Endpoint<W> {
    /// [`Endpoint::new`] with a place for what waits, in which nothing waits yet.
    pub fn with(waiting: W, identity: Identity, plan: &Plan, reset_cause: Option<Fault>) -> Self {
        Self {
            waiting,
            identity,
            plan: plan.clone(),
            decoder: Decoder::default(),
            answered: HistoryBuf::new(),
            in_session: false,
            powered: false,
            start_ordered: false,
            zeroed: false,
            proof: Proof::None,
            interlocks: Interlocks::default(),
            limits: Limits::default(),
            fault: reset_cause,
            crash: None,
            sequence: 0,
            hello_due: false,
            crash_due: false,
            device_due: false,
            filling: SampleBlock::default(),
            pose: None,
            timing: Timing::default(),
            timing_due: false,
        }
    }

    /// Returns the device with its depth known from the start, as a virtual one's is.
    pub fn knowing_depth(self) -> Self {
        Self { zeroed: true, ..self }
    }

    /// Takes bytes from the PC, in pieces of any size.
    pub fn receive(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            match self.decoder.push::<HostFrame>(byte) {
                Some(Ok(frame)) => self.command(frame),
                Some(Err(_)) => self.timing.garbage_frames = self.timing.garbage_frames.saturating_add(1),
                None => {}
            }
        }
    }

    /// The next order for the control law.
    pub fn next_order(&mut self) -> Option<Order> {
        self.waiting.borrow_mut().orders.pop_front()
    }

    /// The PC is gone: nothing waits for it any longer, and what it asked for and was not yet done is forgotten.
    pub fn disconnect(&mut self) {
        self.in_session = false;
        self.start_ordered = false;
        self.proof.interrupt();
        self.waiting.borrow_mut().orders.clear();
        self.decoder = Decoder::default();
        self.forget_waiting();
    }

    /// True if a PC has said hello and is listening.
    pub fn in_session(&self) -> bool {
        self.in_session
    }

    /// The fault that has latched, or that ended the last run, until a person starts the device.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Sets the conditions that keep the device from being started, from now on.
    pub fn set_interlocks(&mut self, interlocks: Interlocks) {
        self.interlocks = interlocks;
    }

    /// Sets the crash that ended the last run, to be sent after each hello until a person starts the device.
    pub fn set_crash(&mut self, crash: Option<Crash>) {
        self.crash = crash;
    }

    /// The configuration in force was not saved.
    pub fn not_saved(&mut self, tick: u64, cause: SaveFailure) {
        self.event(tick, EventKind::NotSaved { cause });
    }

    /// Takes what a tick gave. `tick` counts from power-on without a gap.
    pub fn record(&mut self, tick: u64, output: &TickOutput) {
        self.note_events(tick, output);
        self.proof.see(&output.sample, self.plan.device().dac.mid_scale(), output.tripped.is_some());
        if !self.in_session {
            return;
        }
        if self.filling.samples.is_empty() {
            self.filling.first_tick = tick;
        }
        let _ = self.filling.samples.push(output.sample);
        if self.filling.samples.len() == BLOCK_SAMPLES {
            self.queue_block();
        }
        if tick.is_multiple_of(POSE_TICKS) {
            self.pose = Some(Pose {
                tick,
                depth: output.depth,
                speed: output.speed,
                force: output.force,
                tilt: control_core::units::Milliradians(output.sample.tilt_mrad),
                state: output.sample.state,
                limits: output.limits,
                angle: output.angle,
                vessel: output.vessel as u8,
                lateral: output.lateral,
            });
        }
        self.timing_due |= tick.is_multiple_of(TIMING_TICKS);
    }

    /// Ticks that never reached [`Self::record`], because the queue between was full.
    pub fn note_dropped(&mut self, samples: u32) {
        self.timing.dropped_samples = self.timing.dropped_samples.saturating_add(samples);
        // The block in hand must not span the gap.
        if !self.filling.samples.is_empty() {
            self.queue_block();
        }
    }

    /// Times and counts that the next timing frame reports; the endpoint's own counts are kept.
    pub fn set_timing(&mut self, timing: Timing) {
        self.timing = Timing {
            dropped_samples: self.timing.dropped_samples,
            garbage_frames: self.timing.garbage_frames,
            ..timing
        };
    }

    /// Writes the next frame to `out`, which has room for [`MAX_FRAME`]; 0 where nothing waits.
    pub fn transmit(&mut self, out: &mut [u8; MAX_FRAME]) -> usize {
        let Some(frame) = self.next_frame() else { return 0 };
        let numbered = Numbered { sequence: self.sequence, frame };
        self.sequence = self.sequence.wrapping_add(1);
        // No frame is longer than MAX_FRAME (a test holds it); were one, its missing number would be counted as lost.
        codec::encode(&numbered, out).unwrap_or(0)
    }

    fn next_frame(&mut self) -> Option<DeviceFrame> {
        if core::mem::take(&mut self.hello_due) {
            return Some(DeviceFrame::Hello(self.hello()));
        }
        if core::mem::take(&mut self.crash_due)
            && let Some(crash) = &self.crash
        {
            return Some(DeviceFrame::Crash(crash.clone()));
        }
        if let Some(ack) = self.waiting.borrow_mut().acks.pop_front() {
            return Some(DeviceFrame::Ack(ack));
        }
        if !self.in_session {
            return None;
        }
        if core::mem::take(&mut self.device_due) {
            let record = Record::of(self.plan.device(), self.identity.serial);
            return Some(DeviceFrame::Device(record));
        }
        if let Some(event) = self.waiting.borrow_mut().events.pop_front() {
            return Some(DeviceFrame::Event(event));
        }
        if let Some(pose) = self.pose.take() {
            return Some(DeviceFrame::Pose(pose));
        }
        if let Some(block) = self.waiting.borrow_mut().blocks.pop_front() {
            return Some(DeviceFrame::Samples(block));
        }
        core::mem::take(&mut self.timing_due).then_some(DeviceFrame::Timing(self.timing))
    }

    /// Returns the answer to a hello: the device's identity and the scale in which it speaks under the configuration in force.
    pub fn hello(&self) -> Hello {
        let plan = &self.plan;
        let device = plan.device();
        Hello {
            version: PROTOCOL_VERSION,
            identity: self.identity.serial,
            firmware: self.identity.firmware,
            build: Build::CURRENT,
            config_hash: codec::hash(plan.config()),
            device_hash: codec::hash(device),
            tick_hz: TICK_HZ,
            pose_hz: POSE_HZ,
            mm_per_count: plan.mm_per_count(),
            roller_radius: device.roller_radius,
            full_scale_torque: device.full_scale_torque,
            dac: device.dac,
            fault: self.fault,
        }
    }

    fn command(&mut self, frame: HostFrame) {
        if matches!(frame.command, Command::Hello { .. }) {
            // A PC that starts anew may use old ids again.
            self.answered.clear();
        } else if let Some(ack) = self.answered.oldest_ordered().find(|ack| ack.id == frame.id) {
            let _ = self.waiting.borrow_mut().acks.push_back(*ack);
            return;
        }
        let result = self.carry_out(frame.command);
        let ack = Ack { id: frame.id, result };
        if result != Err(Rejection::Full) {
            self.answered.write(ack);
        }
        // Where the PC floods faster than it reads, an ack is lost: it asks again and is answered again.
        let _ = self.waiting.borrow_mut().acks.push_back(ack);
    }

    fn carry_out(&mut self, command: Command) -> Result<(), Rejection> {
        let powered = self.powered || self.start_ordered;
        match command {
            Command::Hello { version } if version != PROTOCOL_VERSION => Err(Rejection::Version),
            Command::Hello { .. } => {
                self.forget_waiting();
                self.in_session = true;
                self.hello_due = true;
                self.crash_due = true;
                self.sequence = 0;
                self.order(Order::Heartbeat)
            }
            Command::Heartbeat => self.order(Order::Heartbeat),
            Command::Stop => {
                self.start_ordered = false;
                self.proof.interrupt();
                // A stop must not wait behind other orders.
                self.waiting.borrow_mut().orders.clear();
                self.order(Order::Stop)
            }
            Command::Start => {
                self.may_give_torque()?;
                self.is_commissioned()?;
                if !self.zeroed {
                    return Err(Rejection::Interlocked(Interlock::NotZeroed));
                }
                self.order(Order::Start)?;
                self.start_ordered = true;
                self.forget_fault();
                Ok(())
            }
            Command::ConfigurePatient(_)
            | Command::ConfigureDevice(_)
            | Command::RestoreDevice(_)
            | Command::Commission
            | Command::Zero
            | Command::Excite(_)
            | Command::Index(_)
                if powered =>
            {
                Err(Rejection::Powered)
            }
            Command::Zero => {
                self.order(Order::Zero)?;
                self.zeroed = true;
                Ok(())
            }
            Command::Excite(excitation) => {
                excitation.check(&self.plan).map_err(Rejection::Config)?;
                self.may_give_torque()?;
                let is_gentle = excitation.is_gentle();
                if !is_gentle {
                    self.is_commissioned()?;
                }
                self.order(Order::Excite(excitation))?;
                self.proof = if is_gentle { Proof::Ordered } else { Proof::None };
                self.start_ordered = true;
                self.forget_fault();
                Ok(())
            }
            Command::ConfigurePatient(patient) => {
                self.configure(Plan::new(self.plan.device(), &patient).map_err(Rejection::Config)?)
            }
            Command::ConfigureDevice(device) => {
                may_become(self.plan.device(), &device)?;
                self.configure_device(&device)
            }
            Command::RestoreDevice(record) => {
                if !record.is_of(self.identity.serial) {
                    may_become(self.plan.device(), &record.device)?;
                }
                self.configure_device(&record.device)
            }
            Command::Commission => {
                let device = Device { commissioned: true, ..*self.plan.device() };
                if !self.proof.is_shown() {
                    may_become(self.plan.device(), &device)?;
                }
                self.configure_device(&device)
            }
            Command::ReportDevice => {
                self.device_due = true;
                Ok(())
            }
            Command::Compensate(gains) => {
                check(self.plan.device(), gains).map_err(Rejection::Config)?;
                self.order(Order::Compensate(gains))
            }
            Command::Index(index) => self.order(Order::Index(index.map(Counts))),
        }
    }

    /// A person has started the device, and has been told what ended its last run.
    fn forget_fault(&mut self) {
        self.fault = None;
        self.crash = None;
    }

    fn is_commissioned(&self) -> Result<(), Rejection> {
        let is = self.plan.device().commissioned;
        if is { Ok(()) } else { Err(Rejection::Interlocked(Interlock::NotCommissioned)) }
    }

    /// Torque is given to a PC that listens, and under no interlock.
    fn may_give_torque(&self) -> Result<(), Rejection> {
        if !self.in_session {
            return Err(Rejection::NoSession);
        }
        self.interlocks.first().map_or(Ok(()), |interlock| Err(Rejection::Interlocked(interlock)))
    }

    /// A patient for another device leaves; what is wrong with the device itself is wrong without a patient too.
    fn configure_device(&mut self, device: &Device) -> Result<(), Rejection> {
        self.identity.ceilings.check(device).map_err(Rejection::Config)?;
        let plan = Plan::new(device, self.plan.patient())
            .or_else(|_| Plan::new(device, &Patient::nobody()))
            .map_err(Rejection::Config)?;
        let before = *self.plan.device();
        self.configure(plan)?;
        self.proof.keep(&before, device);
        let counts =
            |device: &Device| (device.encoder_reversed, device.counts_per_turn, device.roller_radius);
        // Otherwise the same counts are another depth.
        self.zeroed &= counts(&before) == counts(device);
        Ok(())
    }

    fn configure(&mut self, plan: Plan) -> Result<(), Rejection> {
        self.order(Order::Configure(plan.clone()))?;
        self.plan = plan;
        self.hello_due = true;
        Ok(())
    }

    fn order(&mut self, order: Order) -> Result<(), Rejection> {
        self.waiting.borrow_mut().orders.push_back(order).map_err(|_| Rejection::Full)
    }

    fn note_events(&mut self, tick: u64, output: &TickOutput) {
        if output.enable != self.powered {
            self.powered = output.enable;
            self.start_ordered = false;
            match (output.enable, output.tripped) {
                (true, _) => self.event(tick, EventKind::Started),
                (false, None) => self.event(tick, EventKind::Stopped),
                (false, Some(_)) => {}
            }
        }
        if let Some(cause) = output.tripped {
            self.fault = Some(cause);
            self.start_ordered = false;
            self.event(tick, EventKind::Fault { cause });
        }
        // A slew limit of a tick or two at each puncture is no news; the pose shows it.
        let in_force = Limits(output.limits.0 & !Limits::SLEW.0);
        if in_force != self.limits {
            self.limits = in_force;
            self.event(tick, EventKind::Limits { in_force });
        }
        if !output.transitions.is_empty() {
            self.tissue_events(tick, output);
        }
    }

    fn tissue_events(&mut self, tick: u64, output: &TickOutput) {
        for layer in 0..8_u8 {
            let has = |mask: u8| mask & (1 << layer) != 0;
            if has(output.transitions.contact) {
                self.event(tick, EventKind::Contact { layer });
            }
            if has(output.transitions.in_track) {
                self.event(tick, EventKind::InTrack { layer });
            }
            if has(output.transitions.puncture) {
                self.event(tick, EventKind::Puncture { layer });
                match self.plan.tissue(layer) {
                    Some(Tissue::Vessel) => self.event(tick, EventKind::Vessel { layer }),
                    Some(Tissue::FarWall) => self.event(tick, EventKind::FarWall { layer }),
                    _ => {}
                }
            }
            if has(output.transitions.exit) {
                self.event(tick, EventKind::Exit { layer });
            }
        }
        if output.transitions.barrier {
            self.event(tick, EventKind::Barrier);
        }
        if output.transitions.flashback
            && let Some(layer) = (0..8).find(|&layer| self.plan.tissue(layer) == Some(Tissue::Vessel))
        {
            self.event(tick, EventKind::Flashback { layer });
        }
    }

    fn event(&mut self, tick: u64, kind: EventKind) {
        if self.waiting.borrow_mut().events.is_full() {
            // The missing number tells the PC that a frame was lost.
            self.waiting.borrow_mut().events.pop_front();
            self.sequence = self.sequence.wrapping_add(1);
        }
        let _ = self.waiting.borrow_mut().events.push_back(Event { tick, kind });
    }

    fn queue_block(&mut self) {
        let block = core::mem::take(&mut self.filling);
        if self.waiting.borrow_mut().blocks.is_full()
            && let Some(oldest) = self.waiting.borrow_mut().blocks.pop_front()
        {
            let dropped = oldest.samples.len() as u32;
            self.timing.dropped_samples = self.timing.dropped_samples.saturating_add(dropped);
        }
        let _ = self.waiting.borrow_mut().blocks.push_back(block);
    }

    fn forget_waiting(&mut self) {
        self.waiting.borrow_mut().acks.clear();
        self.waiting.borrow_mut().events.clear();
        self.waiting.borrow_mut().blocks.clear();
        self.filling = SampleBlock::default();
        self.pose = None;
        self.timing_due = false;
        self.device_due = false;
    }
}
