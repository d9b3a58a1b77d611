//! The device's end: commands in, orders for the control law out; ticks in, frames out. The board
//! and the virtual device share it. It never waits: what the PC does not take in time is dropped,
//! oldest block first, and counted.

mod commands;
mod guard;
mod line;
mod plan_request;
mod planning;
mod upload;
mod waiting;

use crate::build::Build;
use crate::codec::{self, Decoder, MAX_FRAME};
use crate::commissioning::{Proof, Record};
use crate::crash::Crash;
use crate::frames::{
    Ack, BLOCK_SAMPLES, CommandRefusal, DeviceFrame, Event, EventKind, Hello, HostFrame, Numbered, POSE_HZ,
    PROTOCOL_VERSION, Pose, SampleBlock, SaveError, Timing,
};
use control_core::ceilings::Ceilings;
use control_core::config::{Sensors, Tissue};
use control_core::event::{Fault, Limits};
use control_core::interlock::Interlocks;
use control_core::{AnyOrder, NeedleLine, Order, Plan, TICK_HZ, TickOutput};
use core::borrow::BorrowMut;
use guard::Guard;
use heapless::HistoryBuf;
pub use plan_request::{PlanRequest, Planned};
use planning::Planning;
pub use upload::LATE_TICKS;
use upload::Upload;
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
    /// The commit that it was built from.
    pub build: Build,
    /// The ceilings that no command raises.
    pub ceilings: Ceilings,
}

impl Identity {
    /// The identity of every virtual device.
    pub const VIRTUAL: Self =
        Self { serial: [0; 12], firmware: [0, 1, 0], build: Build::CURRENT, ceilings: Ceilings::VIRTUAL };
}

/// The state of the control law beyond the samples that have arrived.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Ahead {
    /// The amplifier is on right now.
    pub is_on: bool,
    /// An order that gives torque has been passed on, is still valid and has not been carried out.
    pub start_waits: bool,
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
    /// See [`Endpoint::set_ahead`].
    ahead: Ahead,
    /// The id of the session's last stop.
    last_stop: Option<u32>,
    stop_due: bool,
    /// The latest line, with its id, until the control law takes it.
    line_due: Option<(u32, NeedleLine)>,
    /// Its answer: in no queue, so that a flood of lines pushes no other answer out.
    line_ack: Option<Ack>,
    /// True if a stop has come since the fault.
    stopped_since_fault: bool,
    /// The sequence that waits for [`crate::Command::Play`].
    upload: Upload,
    /// The latest tick.
    now: u64,
    /// Somebody has said where depth 0 is.
    zeroed: bool,
    proof: Proof,
    interlocks: Interlocks,
    /// The optional sensors that are there, where somebody looks.
    fitted: Option<Sensors>,
    guard: Guard,
    planning: Planning,
    limits: Limits,
    fault: Option<Fault>,
    crash: Option<Crash>,
    knows_heat: bool,
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
    /// `plan` is the one that the control law starts with; `reset_cause` is reported until a person
    /// clears it.
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
            ahead: Ahead::default(),
            last_stop: None,
            stop_due: false,
            line_due: None,
            line_ack: None,
            stopped_since_fault: false,
            upload: Upload::NOTHING,
            now: 0,
            zeroed: false,
            proof: Proof::None,
            interlocks: Interlocks::default(),
            fitted: None,
            guard: Guard::default(),
            planning: Planning::default(),
            limits: Limits::default(),
            fault: reset_cause,
            crash: None,
            knows_heat: true,
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
        for byte in bytes {
            self.receive_and_plan_later(core::slice::from_ref(byte));
            if let Some(request) = self.plan_asked() {
                self.take_plan(request.make());
            }
        }
    }

    /// Takes bytes from the PC for a board, which makes what [`Self::plan_asked`] asks for where it
    /// holds nothing up.
    pub fn receive_and_plan_later(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            let Some(body) = self.decoder.push_body(byte) else { continue };
            if let Ok(Some(line)) = body.map(line::read) {
                self.line_due = Some(line);
                continue;
            }
            match body.and_then(codec::read::<HostFrame>) {
                Ok(frame) => self.command(frame),
                Err(_) => self.timing.garbage_frames = self.timing.garbage_frames.saturating_add(1),
            }
        }
    }

    /// The next order for the control law, a stop before all others.
    pub fn next_order(&mut self) -> Option<AnyOrder> {
        if self.take_stop() {
            return Some(Order::Stop.into());
        }
        self.waiting.borrow_mut().orders.pop_front()
    }

    /// The PC is gone: nothing waits for it any longer, and what it asked for gives no torque any
    /// more.
    pub fn disconnect(&mut self) {
        self.in_session = false;
        self.waiting.borrow_mut().acks.clear();
        (self.line_due, self.line_ack) = (None, None);
        self.drop_starts();
        self.forget_plan();
        self.decoder = Decoder::default();
        self.forget_waiting();
    }

    /// True if a PC has said hello and is listening.
    pub fn in_session(&self) -> bool {
        self.in_session
    }

    /// The fault that has latched, or that ended the last run, until a person clears it.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Sets the conditions that keep the device from being started, from now on.
    pub fn set_interlocks(&mut self, interlocks: Interlocks) {
        self.interlocks = interlocks;
    }

    /// Sets the crash that ended the last run, to be sent after each hello until a person clears
    /// the fault.
    pub fn set_crash(&mut self, crash: Option<Crash>) {
        self.crash = crash;
    }

    /// Says what the control law has done beyond the samples that have arrived, from now on. Where
    /// there is no queue between the two there is nothing to say.
    pub fn set_ahead(&mut self, ahead: Ahead) {
        self.ahead = ahead;
    }

    /// Returns true once after each stop, for whoever has a faster way to the control law than
    /// [`Self::next_order`]: a stop overtakes every order, and those before it give no torque any
    /// more.
    pub fn take_stop(&mut self) -> bool {
        core::mem::take(&mut self.stop_due)
    }

    /// The configuration in force was not saved.
    pub fn not_saved(&mut self, tick: u64, cause: SaveError) {
        self.event(tick, EventKind::NotSaved { cause });
    }

    /// Takes what a tick gave. `tick` counts from power-on without a gap.
    pub fn record(&mut self, tick: u64, output: &TickOutput) {
        self.now = tick;
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
        // No frame is longer than MAX_FRAME (a test holds it); were one, its missing number would
        // be counted as lost.
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
        if let Some(ack) = self.line_ack.take() {
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

    /// Returns the answer to a hello: the device's identity and the scale in which it speaks under
    /// the configuration in force.
    pub fn hello(&self) -> Hello {
        let plan = &self.plan;
        let device = plan.device();
        Hello {
            version: PROTOCOL_VERSION,
            identity: self.identity.serial,
            firmware: self.identity.firmware,
            build: self.identity.build,
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

    fn order(&mut self, order: impl Into<AnyOrder>) -> Result<(), CommandRefusal> {
        self.waiting.borrow_mut().orders.push_back(order.into()).map_err(|_| CommandRefusal::Full)
    }

    fn note_events(&mut self, tick: u64, output: &TickOutput) {
        if !self.ahead.start_waits && self.waiting.borrow().orders.is_empty() {
            self.start_ordered = false;
        }
        if output.enable != self.powered {
            self.powered = output.enable;
            match (output.enable, output.tripped) {
                (true, _) => self.event(tick, EventKind::Started),
                (false, None) => self.event(tick, EventKind::Stopped),
                (false, Some(_)) => {}
            }
        }
        if let Some(cause) = output.tripped {
            self.fault = Some(cause);
            self.stopped_since_fault = false;
            self.upload.forget();
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
            // The missing number shows the PC that a frame was lost.
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

    /// Nothing that was to be streamed is sent. Answers are: a stop may stand right before a hello.
    fn forget_waiting(&mut self) {
        self.waiting.borrow_mut().events.clear();
        self.waiting.borrow_mut().blocks.clear();
        self.filling = SampleBlock::default();
        self.pose = None;
        self.timing_due = false;
        self.device_due = false;
    }
}
