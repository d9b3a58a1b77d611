//! The PC's side of a conversation with a device. It has no clock or cable of its own: the caller
//! passes it the time and the bytes.
//!
//! On a new connection it says hello, stops the device, configures it, and starts it only where a
//! person asks: no set value of an earlier connection is ever played again. Commands are repeated
//! until they are answered; a heartbeat says every 50 ms that the PC lives.

use crate::needle::LineSender;
use control_core::compensation::Gains;
use control_core::event::Fault;
use control_core::excitation::Excitation;
use control_core::{Device, Patient};
use link::codec::{self, MAX_FRAME};
use link::frames::{Ack, Command, CommandRefusal, DeviceFrame, EventKind, GuardRefusal, PROTOCOL_VERSION};
use link::host::{Commands, Counts, Reception};
use std::collections::VecDeque;
use std::time::Duration;

/// Time between heartbeats; the device waits for four of them.
pub(crate) const HEARTBEAT: Duration = Duration::from_millis(50);
/// An unanswered command is repeated after this.
pub(crate) const REPEAT: Duration = Duration::from_millis(100);
/// A command that gives torque is not repeated to a device that has sent no samples for this long;
/// it sends a block every 3.2 ms.
const DOUBT: Duration = Duration::from_millis(50);
/// A device that sends no samples for this long has started anew or is gone: hello again.
pub const SILENCE: Duration = Duration::from_secs(1);

/// The PC's side of a conversation.
pub struct Driver {
    patient: Patient,
    /// Sent too, where it is not the one that the device has.
    device: Option<Command>,
    reception: Reception,
    commands: Commands,
    open: bool,
    /// The device has taken its configuration in this connection.
    ready: bool,
    has_started: bool,
    waiting: VecDeque<Command>,
    pending: Option<Pending>,
    last_samples: Duration,
    last_heartbeat: Option<Duration>,
    notice: Option<String>,
    refused: Option<String>,
    /// The fault that the device reports, until a person clears it.
    fault: Option<Fault>,
    /// The answer to the last request for another patient.
    changed: Option<Result<(), String>>,
    /// The answer to the last question for the supply's guard.
    guarded: Option<Result<(), GuardRefusal>>,
    out: Vec<u8>,
}

/// A command that has not been answered.
struct Pending {
    id: u32,
    command: Command,
    bytes: Vec<u8>,
    sent: Duration,
}

impl Pending {
    fn gives_torque(&self) -> bool {
        matches!(self.command, Command::Start | Command::Excite(_) | Command::Play { .. })
    }
}

impl Driver {
    /// Nothing is open yet.
    pub fn new(patient: Patient) -> Self {
        Self {
            patient,
            device: None,
            reception: Reception::default(),
            commands: Commands::default(),
            open: false,
            ready: false,
            has_started: false,
            waiting: VecDeque::new(),
            pending: None,
            last_samples: Duration::ZERO,
            last_heartbeat: None,
            notice: None,
            refused: None,
            fault: None,
            changed: None,
            guarded: None,
            out: Vec::new(),
        }
    }

    /// Gives the device its own part as well; without it, that stays as commissioning found it.
    /// `part` is the command that does it.
    pub fn with_device(self, part: Command) -> Self {
        Self { device: Some(part), ..self }
    }

    /// A connection is open: hello, torque off, configuration.
    pub fn connected(&mut self, now: Duration) {
        self.open = true;
        self.greet(now);
    }

    /// The connection is gone, and with it whatever was asked and not done.
    pub fn disconnected(&mut self) {
        self.open = false;
        self.ready = false;
        self.waiting.clear();
        self.pending = None;
    }

    /// Powers up, once the device is ready; refused while a fault is latched.
    pub fn start(&mut self) {
        self.waiting.push_back(Command::Start);
    }

    /// Takes the torque off. It overtakes everything but the configuration, and what it overtakes
    /// is forgotten.
    pub fn stop(&mut self) {
        self.waiting.retain(|c| {
            matches!(
                c,
                Command::Hello { .. }
                    | Command::ConfigureDevice(_)
                    | Command::RestoreDevice(_)
                    | Command::ConfigurePatient(_)
                    | Command::Stop
            )
        });
        self.waiting.push_front(Command::Stop);
        if self.pending.as_ref().is_some_and(|pending| {
            pending.gives_torque() || matches!(pending.command, Command::Zero | Command::Segment { .. })
        }) {
            self.pending = None;
        }
    }

    /// A person has seen the fault: stops the device and clears it.
    pub fn clear(&mut self) {
        self.stop();
        self.waiting.push_back(Command::Clear);
    }

    /// Sets depth 0 to where the needle is when the device carries this out.
    pub fn zero(&mut self) {
        self.waiting.push_back(Command::Zero);
    }

    /// Plays an excitation, with no hand on the needle.
    pub fn excite(&mut self, excitation: Excitation) {
        self.waiting.push_back(Command::Excite(excitation));
    }

    /// Plays excitations without a rest between them, with no hand on the needle: uploads them one
    /// by one, and the device checks that it has all of them.
    pub fn play(&mut self, segments: Vec<Excitation>) {
        let play = Command::Play { count: segments.len() as u8, checksum: codec::hash(&segments.as_slice()) };
        for (index, excitation) in (0_u8..).zip(segments) {
            self.waiting.push_back(Command::Segment { index, excitation });
        }
        self.waiting.push_back(play);
    }

    /// Gives the device another patient; torque goes off for it. [`Self::take_change`] returns the
    /// answer.
    pub fn configure_patient(&mut self, patient: Patient) {
        self.waiting.push_back(Command::ConfigurePatient(patient));
    }

    /// Gives the device another device's part.
    pub fn configure_device(&mut self, device: Device) {
        self.waiting.push_back(Command::ConfigureDevice(device));
    }

    /// Marks the device's configuration as found by commissioning.
    pub fn commission(&mut self) {
        self.waiting.push_back(Command::Commission);
    }

    /// Has the device check that a brown-out reset guards its supply, and set one that is off if
    /// `set` is true. [`Self::take_guard`] returns the answer.
    pub fn guard_supply(&mut self, set: bool) {
        self.waiting.push_back(Command::GuardSupply { set });
    }

    /// Returns once the answer to [`Self::guard_supply`].
    pub fn take_guard(&mut self) -> Option<Result<(), GuardRefusal>> {
        self.guarded.take()
    }

    /// Has the device report its part of the configuration in force.
    pub fn report_device(&mut self) {
        self.waiting.push_back(Command::ReportDevice);
    }

    /// Sets the gains of the compensation.
    pub fn compensate(&mut self, gains: Gains) {
        // A slider that is dragged asks faster than a device answers: only its last place counts.
        self.waiting.retain(|command| !matches!(command, Command::Compensate(_)));
        self.waiting.push_back(Command::Compensate(gains));
    }

    /// Tells the device at `now` where `needle` meets the layers, if it has turned in tissue. Only
    /// the latest line counts.
    pub fn follow(&mut self, now: Duration, needle: &mut LineSender) {
        if self.is_ready(now)
            && let Some(line) = needle.due(now)
        {
            self.waiting.retain(|command| !matches!(command, Command::Line(_)));
            self.waiting.push_back(Command::Line(line));
        }
    }

    /// Sets the counts past the zero at which the rotor's angle is zero.
    pub fn index(&mut self, count: i32) {
        self.waiting.push_back(Command::Index(Some(count)));
    }

    /// Takes bytes; gives every whole frame to `see`.
    pub fn receive(&mut self, now: Duration, mut bytes: &[u8], mut see: impl FnMut(&DeviceFrame)) {
        while let Some(frame) = self.reception.take(&mut bytes) {
            match &frame {
                DeviceFrame::Ack(ack) => self.answered(now, ack),
                DeviceFrame::Samples(_) => self.last_samples = now,
                DeviceFrame::Hello(hello) => self.fault = hello.fault,
                DeviceFrame::Event(event) => match event.kind {
                    EventKind::Fault { cause } => self.fault = Some(cause),
                    EventKind::Cleared => self.fault = None,
                    _ => {}
                },
                _ => {}
            }
            see(&frame);
        }
    }

    /// Returns the bytes to send now.
    pub fn transmit(&mut self, now: Duration) -> &[u8] {
        self.out.clear();
        if !self.open {
            return &self.out;
        }
        if now.saturating_sub(self.last_samples) > SILENCE {
            self.greet(now);
        }
        let is_silent = now.saturating_sub(self.last_samples) > DOUBT;
        match &mut self.pending {
            // It may have started anew and forgotten who asked.
            Some(pending) if is_silent && pending.gives_torque() => {}
            Some(pending) if now.saturating_sub(pending.sent) >= REPEAT => {
                pending.sent = now;
                self.out.extend(&pending.bytes);
            }
            Some(_) => {}
            None => self.next_command(now),
        }
        if self.ready && self.last_heartbeat.is_none_or(|last| now.saturating_sub(last) >= HEARTBEAT) {
            self.last_heartbeat = Some(now);
            self.encode(Command::Heartbeat);
        }
        &self.out
    }

    /// Returns the counts of frames that arrived and that did not.
    pub fn counts(&self) -> Counts {
        self.reception.counts()
    }

    /// True if the device has taken its configuration and sends samples.
    pub fn is_ready(&self, now: Duration) -> bool {
        self.ready && now.saturating_sub(self.last_samples) <= SILENCE
    }

    /// True if the device has ever accepted a start.
    pub fn has_started(&self) -> bool {
        self.has_started
    }

    /// True if a start is on its way.
    pub fn is_starting(&self) -> bool {
        let pending = self.pending.iter().map(|pending| &pending.command);
        self.waiting.iter().chain(pending).any(|command| matches!(command, Command::Start))
    }

    /// Returns a notice for a person: why the last request was refused.
    pub fn notice(&self) -> Option<&str> {
        self.notice.as_deref()
    }

    /// Returns the fault that the device reports, until a person clears it.
    pub fn fault(&self) -> Option<Fault> {
        self.fault
    }

    /// Returns the reason why this device can never run this configuration, if it gave one.
    pub fn refused(&self) -> Option<&str> {
        self.refused.as_deref()
    }

    /// Returns once the answer to [`Self::configure_patient`]: taken, or refused for a reason.
    pub fn take_change(&mut self) -> Option<Result<(), String>> {
        self.changed.take()
    }

    fn greet(&mut self, now: Duration) {
        self.ready = false;
        self.last_samples = now;
        self.pending = None;
        self.waiting.clear();
        self.waiting.push_back(Command::Hello { version: PROTOCOL_VERSION });
        self.waiting.push_back(Command::Stop);
        self.waiting.extend(self.device.clone());
        self.waiting.push_back(Command::ConfigurePatient(self.patient.clone()));
    }

    fn next_command(&mut self, now: Duration) {
        let Some(command) = self.waiting.pop_front() else { return };
        let from = self.out.len();
        if let Some(id) = self.encode(command.clone()) {
            let bytes = self.out[from..].to_vec();
            self.pending = Some(Pending { id, command, bytes, sent: now });
        }
    }

    fn encode(&mut self, command: Command) -> Option<u32> {
        let mut frame = [0; MAX_FRAME];
        // Every command fits MAX_FRAME: `link` tests the longest.
        let (id, length) = self.commands.encode(command, &mut frame).ok()?;
        self.out.extend(&frame[..length]);
        Some(id)
    }

    fn answered(&mut self, now: Duration, ack: &Ack) {
        if self.pending.as_ref().is_none_or(|pending| pending.id != ack.id) {
            return;
        }
        let Some(pending) = self.pending.take() else { return };
        match (ack.result, &pending.command) {
            // One that came later than the first: the first still counts where this is refused.
            (Ok(()), Command::ConfigurePatient(patient)) if self.ready => {
                self.patient = patient.clone();
                self.changed = Some(Ok(()));
            }
            (Err(why @ CommandRefusal::Config(_)), Command::ConfigurePatient(_)) if self.ready => {
                self.changed = Some(Err(format!("the device refused: {why}")));
            }
            (Ok(()), Command::ConfigurePatient(_)) => self.ready = true,
            (Ok(()), Command::GuardSupply { .. }) => self.guarded = Some(Ok(())),
            (Err(CommandRefusal::Guard(why)), _) => self.guarded = Some(Err(why)),
            (Ok(()), Command::Start) => {
                self.has_started = true;
                self.notice = None;
            }
            (
                Ok(()),
                Command::Stop | Command::Clear | Command::Zero | Command::Excite(_) | Command::Play { .. },
            ) => {
                self.notice = None;
            }
            // One for a patient that the device no longer has: the next will do.
            (Ok(()), _) | (Err(CommandRefusal::Config(_)), Command::Line(_)) => {}
            // The same bytes again, soon.
            (Err(CommandRefusal::Full), _) => self.pending = Some(Pending { sent: now, ..pending }),
            (
                Err(CommandRefusal::Powered),
                Command::ConfigureDevice(_) | Command::RestoreDevice(_) | Command::ConfigurePatient(_),
            ) => {
                self.waiting.push_front(pending.command);
                self.waiting.push_front(Command::Stop);
            }
            (
                Err(
                    why @ (CommandRefusal::Config(_)
                    | CommandRefusal::Sequence(_)
                    | CommandRefusal::Version
                    | CommandRefusal::Commissioned(_)
                    | CommandRefusal::NotShown),
                ),
                _,
            ) => {
                self.waiting.clear();
                self.refused = Some(format!("the device refused: {why}"));
                self.notice = self.refused.clone();
            }
            (Err(why), _) => self.notice = Some(format!("the device refused: {why}")),
        }
    }
}
