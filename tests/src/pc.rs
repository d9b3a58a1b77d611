//! A PC with the device's driver: it plugs the cable in, opens the port, speaks `link`, keeps the
//! heartbeat going and keeps everything the device says.
//!
//! It looks at the cable once a millisecond of virtual time, as a program on a PC does.

use std::collections::BTreeMap;

use control_core::Config;
use control_core::config::Device;
use control_core::controller::Sample;
use control_core::excitation::Excitation;
use control_core::interlock::Interlock;
use link::codec::{self, MAX_FRAME};
use link::commissioning::Record;
use link::crash::Crash;
use link::frames::{Ack, CommandRefusal, Event, EventKind, Hello, PROTOCOL_VERSION, Pose, Timing};
use link::host::{Commands, Counts, Reception};
use link::{Command, DeviceFrame};

use emulator::board::Board;
use emulator::usb_host::Port;

/// The period of the PC's heartbeats: a quarter of the shortest default timeout.
const HEARTBEAT_MS: u64 = 50;
/// The longest wait of the PC for a port, and for an answer.
const PORT_MS: u64 = 3_000;
const ANSWER_MS: u64 = 200;
/// The number of hellos in that time.
const HELLOS: u64 = 2;

/// The messages of the device.
#[derive(Debug, Clone, Default)]
pub struct Heard {
    /// The latest hello.
    pub hello: Option<Hello>,
    /// The crash that ended the device's last run, with how many times it was sent.
    pub crash: (Option<Crash>, u32),
    /// The device's part of the configuration, where it was asked for.
    pub record: Option<Record>,
    /// Every sample, with its tick.
    pub samples: Vec<(u64, Sample)>,
    /// Every event.
    pub events: Vec<Event>,
    /// The latest pose.
    pub pose: Option<Pose>,
    /// The latest timing.
    pub timing: Option<Timing>,
    /// Every answer, by the command's number.
    pub acks: BTreeMap<u32, Ack>,
}

/// The PC.
#[derive(Debug, Clone, Default)]
pub struct Pc {
    reception: Reception,
    commands: Commands,
    silent: bool,
    keep_samples: bool,
    last_beat_ms: u64,
    /// The messages of the device since [`Pc::connect`].
    pub heard: Heard,
}

impl Pc {
    /// A PC that keeps every sample.
    #[must_use]
    pub fn new() -> Self {
        Self { keep_samples: true, ..Self::default() }
    }

    /// A PC that counts samples and forgets them.
    #[must_use]
    pub fn counting() -> Self {
        Self::default()
    }

    /// Plugs the cable in, waits for the port, opens it and says hello.
    ///
    /// # Panics
    ///
    /// When the port does not come, or nobody answers.
    pub fn connect(&mut self, board: &mut Board) {
        open_port(board);
        self.hello(board);
    }

    /// Says hello on an open port and waits for the answer.
    ///
    /// # Panics
    ///
    /// When nobody answers.
    pub fn hello(&mut self, board: &mut Board) {
        self.reception = Reception::default();
        self.heard = Heard::default();
        // What waited on the cable may swallow the first answer: a PC asks again.
        for _ in 0..HELLOS {
            self.send(board, Command::Hello { version: PROTOCOL_VERSION });
            for _ in 0..ANSWER_MS / HELLOS {
                self.run_ms(board, 1);
                if self.heard.hello.is_some() {
                    return;
                }
            }
        }
        panic!("no answer to a hello within {ANSWER_MS} ms");
    }

    /// Stops or resumes the heartbeat.
    pub fn set_silent(&mut self, silent: bool) {
        self.silent = silent;
    }

    /// Sends a command; its number.
    pub fn send(&mut self, board: &mut Board, command: Command) -> u32 {
        let mut bytes = [0; MAX_FRAME];
        let (id, length) = self.commands.encode(command, &mut bytes).expect("a command fits a frame");
        self.send_bytes(board, &bytes[..length]);
        id
    }

    /// Sends bytes that need not be a frame.
    pub fn send_bytes(&mut self, board: &mut Board, bytes: &[u8]) {
        let bytes = bytes.to_vec();
        board.at_stop(move |stopped| stopped.usb().host.write(&bytes));
    }

    /// Sends a command and waits for its answer.
    ///
    /// # Panics
    ///
    /// When there is none.
    pub fn command(&mut self, board: &mut Board, command: Command) -> Ack {
        let id = self.send(board, command);
        for _ in 0..ANSWER_MS {
            self.run_ms(board, 1);
            if let Some(ack) = self.heard.acks.get(&id) {
                return *ack;
            }
        }
        panic!("no answer to command {id} within {ANSWER_MS} ms");
    }

    /// Sends a command that the device refuses; why.
    ///
    /// # Panics
    ///
    /// When it does not refuse or does not answer.
    pub fn must_not(&mut self, board: &mut Board, command: Command) -> CommandRefusal {
        self.command(board, command).result.expect_err("the device refuses")
    }

    /// Sends a command that the device has to carry out. Where a fault is latched, or the device
    /// does not know its depth when it is to start, a person who is told so clears the fault, and
    /// says that the tip is on the skin now.
    ///
    /// # Panics
    ///
    /// When it refuses or does not answer.
    pub fn must(&mut self, board: &mut Board, command: Command) {
        let mut ack = self.command(board, command.clone());
        if let Err(CommandRefusal::Faulted(_)) = ack.result {
            for clear in [Command::Stop, Command::Clear] {
                assert_eq!(self.command(board, clear).result, Ok(()), "the fault is cleared");
            }
            ack = self.command(board, command.clone());
        }
        if ack.result == Err(CommandRefusal::Interlocked(Interlock::NotZeroed)) {
            assert_eq!(self.command(board, Command::Zero).result, Ok(()), "the device refuses a zero");
            ack = self.command(board, command);
        }
        assert_eq!(ack.result, Ok(()), "the device refuses");
    }

    /// Configures the device, both parts.
    ///
    /// # Panics
    ///
    /// When it refuses or does not answer.
    pub fn configure(&mut self, board: &mut Board, config: &Config) {
        self.must(board, self.record_of(config.device));
        self.must(board, Command::ConfigurePatient(config.patient.clone()));
    }

    /// The command that gives the device at the other end its own record back, were it one of
    /// `device`.
    ///
    /// # Panics
    ///
    /// Before the hello.
    #[must_use]
    pub fn record_of(&self, device: Device) -> Command {
        let hello = self.heard.hello.as_ref().expect("the device has said hello");
        Command::RestoreDevice(Record::of(&device, hello.identity))
    }

    /// Lets `milliseconds` pass, with the heartbeat going.
    pub fn run_ms(&mut self, board: &mut Board, milliseconds: u64) {
        for _ in 0..milliseconds {
            self.attend(board);
            board.run_ms(1);
            self.listen(board);
        }
    }

    /// Sends the heartbeat, if it is due.
    pub fn attend(&mut self, board: &mut Board) {
        let now_ms = board.now() / 1_000_000;
        if !self.silent && now_ms >= self.last_beat_ms + HEARTBEAT_MS && self.heard.hello.is_some() {
            self.last_beat_ms = now_ms;
            self.send(board, Command::Heartbeat);
        }
    }

    /// Takes what has arrived.
    pub fn listen(&mut self, board: &mut Board) {
        let bytes = board.at_stop(|stopped| stopped.usb().host.read());
        for byte in bytes {
            if let Some(frame) = self.reception.push(byte) {
                self.take(frame);
            }
        }
    }

    fn take(&mut self, frame: DeviceFrame) {
        let heard = &mut self.heard;
        match frame {
            DeviceFrame::Hello(hello) => heard.hello = Some(hello),
            DeviceFrame::Device(record) => heard.record = Some(record),
            DeviceFrame::Crash(crash) => heard.crash = (Some(crash), heard.crash.1 + 1),
            DeviceFrame::Samples(block) => {
                if self.keep_samples {
                    heard.samples.extend((block.first_tick..).zip(block.samples));
                }
            }
            DeviceFrame::Pose(pose) => heard.pose = Some(pose),
            DeviceFrame::Event(event) => heard.events.push(event),
            DeviceFrame::Timing(timing) => heard.timing = Some(timing),
            DeviceFrame::Ack(ack) => {
                heard.acks.insert(ack.id, ack);
            }
        }
    }

    /// Returns the counts of frames that arrived and that did not.
    #[must_use]
    pub fn counts(&self) -> Counts {
        self.reception.counts()
    }

    /// True if the device has reported an event that `wanted` accepts.
    #[must_use]
    pub fn heard_event(&self, wanted: impl Fn(&EventKind) -> bool) -> bool {
        self.heard.events.iter().any(|event| wanted(&event.kind))
    }
}

/// The commands that upload a sequence and play it.
#[must_use]
pub fn sequence(segments: &[Excitation]) -> Vec<Command> {
    let play = Command::Play { count: segments.len() as u8, checksum: codec::hash(&segments) };
    let upload = (0_u8..).zip(segments);
    upload
        .map(|(index, excitation)| Command::Segment { index, excitation: excitation.clone() })
        .chain([play])
        .collect()
}

/// Plugs the cable in, waits for the port and opens it.
///
/// # Panics
///
/// When the port does not come.
pub fn open_port(board: &mut Board) {
    board.at_stop(|stopped| stopped.usb().host.plug());
    let settled = |port: Port| matches!(port, Port::Configured | Port::Failed(_));
    board.run_while_not(PORT_MS, 1_000, move |stopped| settled(stopped.usb().host.port()));
    let port = board.at_stop(|stopped| {
        stopped.usb().host.open();
        stopped.usb().host.port()
    });
    assert_eq!(port, Port::Configured, "the serial port");
}
