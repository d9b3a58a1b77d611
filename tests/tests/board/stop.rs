//! A stop that is answered holds: random streams of commands at random phases on the flash image,
//! judged by what was sent, what was answered and when the enable line changed.

use super::line::line;
use control_core::compensation::Gains;
use control_core::event::Fault;
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, Stiffness};
use emulator::board::{MILLISECOND, Nanos, Wiring};
use fixed::types::{I8F24, I16F16};
use link::Command;
use link::frames::{Ack, CommandRefusal, PROTOCOL_VERSION};
use std::ops::Range;
use tests::laws;
use tests::pc::sequence;
use tests::rig::Rig;

/// Streams of the test; `STREAMS` in the environment is another number, and `FIRST` the first seed.
const STREAMS: u64 = 300;
/// A stop is answered within this time, and the amplifier is off this long after the answer.
const ANSWER: Nanos = 2 * MILLISECOND;
const OFF: Nanos = MILLISECOND;
/// The PC looks for answers this often.
const LOOK: Nanos = 100_000;
/// All configurations of a stream are saved within this time. The longest record takes 20 ms.
const SAVED: Nanos = 300 * MILLISECOND;

/// SplitMix64 (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }
}

/// The part of a command in the judgement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Stop,
    /// It turns the amplifier on.
    Start,
    Other,
}

/// A command on its way, with its answer and the time at which the PC read that.
#[derive(Debug)]
struct Sent {
    id: u32,
    kind: Kind,
    at: Nanos,
    answer: Option<(Nanos, Ack)>,
}

fn stroke() -> Excitation {
    let mm = |length: f64| Millimetres(I16F16::from_num(length));
    let speed = MillimetresPerSecond(I16F16::from_num(20));
    Excitation {
        signal: Signal::Triangle { stroke: mm(5.0), speed },
        duration_ms: 30,
        servo: Servo {
            stiffness: Stiffness(I16F16::from_num(0.1)),
            damping: Damping(I8F24::from_num(0.0005)),
        },
        travel: mm(100.0),
        compensated: false,
    }
}

fn kind(command: &Command) -> Kind {
    match command {
        Command::Stop => Kind::Stop,
        Command::Start | Command::Excite(_) | Command::Play { .. } => Kind::Start,
        _ => Kind::Other,
    }
}

/// A line for the default patient or for the phantom, sound or not.
fn needle_line(random: &mut Random) -> Command {
    let layers = [4, 6][random.below(2) as usize];
    line((0..layers).map(|layer| 5.0 * f64::from(layer) + random.below(7_000) as f64 / 1_000.0))
}

/// One or more commands that a PC sends without waiting.
fn commands(random: &mut Random, rig: &Rig) -> Vec<Command> {
    let mut phantom = laws::phantom();
    phantom.device.limits.fade_in_ms = 100 + random.below(400) as u16;
    vec![match random.below(22) {
        0..=4 => Command::Stop,
        5..=7 => Command::Start,
        8 => return vec![Command::Start, rig.pc.record_of(phantom.device)],
        9 => Command::Zero,
        10 => Command::Heartbeat,
        11 => Command::Clear,
        12 | 13 => rig.pc.record_of(phantom.device),
        14 => Command::ConfigurePatient(phantom.patient),
        15 => Command::Excite(stroke()),
        16 => return sequence(&[stroke(), stroke()]),
        17 => Command::Compensate(Gains::default()),
        18 => Command::Index(Some(random.below(4_000) as i32)),
        19 => needle_line(random),
        // More than are taken.
        20 => return (0..random.below(40)).map(|_| needle_line(random)).collect(),
        _ => [Command::ReportDevice, Command::Commission, Command::Hello { version: PROTOCOL_VERSION }]
            [random.below(3) as usize]
            .clone(),
    }]
}

/// A stream that is sent and has been answered.
struct Stream {
    rig: Rig,
    sent: Vec<Sent>,
    since: Nanos,
}

impl Stream {
    /// Sends up to 16 times something, up to 3 ms apart.
    fn of(seed: u64) -> Self {
        let mut random = Random(seed);
        let rig = if random.below(2) == 0 { Rig::pressed() } else { Rig::zeroed(Wiring::default()) };
        let since = rig.board.now();
        let mut stream = Self { rig, sent: Vec::new(), since };
        if random.below(4) == 0 {
            stream.stop_start_configure(&mut random);
        }
        for _ in 0..4 + random.below(13) {
            for command in commands(&mut random, &stream.rig) {
                stream.send(command);
            }
            // Half of them within two ticks of the one before.
            let longest = [200_000, 3 * MILLISECOND][random.below(2) as usize];
            let at = stream.rig.board.now() + random.below(longest);
            stream.run_to(at);
        }
        stream.run_to(stream.rig.board.now() + 2 * ANSWER);
        stream
    }

    /// A start and a configuration shortly after a stop, and another stop: what an image once held
    /// back for seconds.
    fn stop_start_configure(&mut self, random: &mut Random) {
        let mut device = laws::phantom().device;
        device.limits.fade_in_ms = 100 + random.below(400) as u16;
        let record = self.rig.pc.record_of(device);
        let gaps = [400_000, 1, 5 * MILLISECOND, MILLISECOND];
        for (command, gap) in [Command::Stop, Command::Start, record, Command::Stop].into_iter().zip(gaps) {
            self.send(command);
            let at = self.rig.board.now() + random.below(gap);
            self.run_to(at);
        }
    }

    fn send(&mut self, command: Command) -> usize {
        let (kind, at) = (kind(&command), self.rig.board.now());

        let id = self.rig.pc.send(&mut self.rig.board, command);
        self.sent.push(Sent { id, kind, at, answer: None });
        self.sent.len() - 1
    }

    fn run_to(&mut self, end: Nanos) {
        while self.rig.board.now() < end {
            self.rig.pc.attend(&mut self.rig.board);
            let at = (self.rig.board.now() / LOOK + 1) * LOOK;
            self.rig.board.run_until(at.min(end));
            self.rig.pc.listen(&mut self.rig.board);
            let now = self.rig.board.now();
            for sent in self.sent.iter_mut().filter(|sent| sent.answer.is_none()) {
                sent.answer = self.rig.pc.heard.acks.get(&sent.id).map(|ack| (now, *ack));
            }
        }
    }

    /// Sends a command until it is carried out or refused: a device that saves is busy.
    fn ask(&mut self, command: Command) -> Result<(), CommandRefusal> {
        let end = self.rig.board.now() + SAVED;
        loop {
            let place = self.send(command.clone());
            while self.sent[place].answer.is_none() {
                let resets = self.rig.board.at_stop(|stopped| stopped.resets().to_vec());
                assert!(resets.is_empty() && self.rig.board.now() < end, "{resets:?}: {:?}", self.sent);
                self.run_to(self.rig.board.now() + LOOK);
            }
            match self.sent[place].answer {
                Some((at, Ack { result: Err(CommandRefusal::Full), .. })) if at < end => {
                    self.run_to(at + MILLISECOND);
                }
                answer => return answer.map_or(Ok(()), |(_, ack)| ack.result),
            }
        }
    }

    /// Returns the times from which and to which the amplifier was on.
    fn on(&mut self) -> Vec<Range<Nanos>> {
        let mut on = Vec::new();
        let changes = self.rig.board.at_stop(|stopped| stopped.log().enable.clone());
        for (at, is_on) in changes {
            match (is_on, on.last_mut()) {
                (true, _) => on.push(at..Nanos::MAX),
                (false, Some(last)) => last.end = at,
                (false, None) => {}
            }
        }
        on
    }

    /// Returns what a stop of the stream has done wrong.
    fn fault(&mut self) -> Option<String> {
        let on = self.on();
        for stop in self.sent.iter().filter(|sent| sent.kind == Kind::Stop) {
            let Some((answered, ack)) = stop.answer else { return Some(format!("{stop:?} has no answer")) };
            if ack.result.is_err() || answered > stop.at + LOOK + ANSWER {
                return Some(format!("{stop:?} is answered late, or refused"));
            }
            let off = answered + OFF;
            let is_asked = |at: Nanos| {
                self.sent.iter().any(|sent| {
                    sent.kind == Kind::Start
                        && sent.id.wrapping_sub(stop.id).cast_signed() > 0
                        && sent.at <= at
                })
            };
            let ignored =
                on.iter().find(|on| on.end > off && (on.start <= stop.at || !is_asked(on.start.max(off))));
            if let Some(on) = ignored {
                return Some(format!("{stop:?}: the amplifier is on from {} to {}", on.start, on.end));
            }
        }
        None
    }

    /// Stops, clears, starts: true if there is torque, once the device has saved what it was given.
    fn gives_torque(&mut self) -> bool {
        for command in [Command::Hello { version: PROTOCOL_VERSION }, Command::Stop] {
            assert_eq!(self.ask(command), Ok(()));
        }
        self.run_to(self.rig.board.now() + MILLISECOND);
        for command in [Command::Clear, Command::Zero, Command::Start] {
            if let Err(refusal) = self.ask(command) {
                println!("no torque: {refusal:?}");
                return false;
            }
        }
        let end = self.rig.board.now() + SAVED;
        self.rig.board.run_until_seen(end, LOOK, |stopped| stopped.drive().enabled)
    }
}

fn number(variable: &str, otherwise: u64) -> u64 {
    std::env::var(variable).map_or(otherwise, |text| text.parse().expect("a number"))
}

#[test]
fn a_stop_that_is_answered_holds() {
    let (streams, first) = (number("STREAMS", STREAMS), number("FIRST", 1));
    let (mut faults, mut without_torque, mut stops) = (Vec::new(), Vec::new(), 0);
    for seed in first..first + streams {
        let mut stream = Stream::of(seed);
        stops += stream.sent.iter().filter(|sent| sent.kind == Kind::Stop).count();
        faults.extend(stream.fault().map(|fault| format!("seed {seed}, from {} ns: {fault}", stream.since)));
        if !stream.gives_torque() {
            without_torque.push(seed);
        }
    }
    println!(
        "{stops} stops in {streams} streams from seed {first}; without torque after a start: {without_torque:?}"
    );
    assert!(faults.is_empty(), "{} of {streams}:\n{}", faults.len(), faults.join("\n"));
    assert!(100 * without_torque.len() as u64 <= streams, "no torque after {without_torque:?}");
}

/// The stop comes behind as many lines as a stream holds: with the amplifier on, with it off, and
/// while the device plans and saves the largest patient.
#[test]
fn a_stop_behind_a_flood_of_lines_is_answered_in_time() {
    let mut random = Random(1);
    for (state, rig) in [("on", Rig::pressed()), ("off", Rig::zeroed(Wiring::default()))]
        .into_iter()
        .chain((0..8).map(|ms| (["planning", "saving"][usize::from(ms > 2)], configured(ms))))
    {
        let since = rig.board.now();
        let mut stream = Stream { rig, sent: Vec::new(), since };
        for _ in 0..40 {
            stream.send(needle_line(&mut random));
        }
        let stop = stream.send(Command::Stop);
        stream.run_to(since + 40 * MILLISECOND);
        let answered = stream.sent[stop].answer.expect("an answer").0;
        println!("| stop behind 40 lines, {state} | {:.1} ms |", (answered - since) as f64 / 1e6);
        assert_eq!(stream.fault(), None, "{state}");
    }
}

/// A device that was given another patient so many milliseconds ago.
fn configured(ms: u64) -> Rig {
    let mut rig = Rig::zeroed(Wiring::default());
    rig.pc.send(&mut rig.board, Command::ConfigurePatient(laws::phantom().patient));
    rig.pc.run_ms(&mut rig.board, ms);
    rig
}

/// Ten emergency stops, each released again, and a program that does nothing but send Start.
#[test]
fn a_program_that_only_starts_gets_no_torque_after_a_fault() {
    let mut rig = Rig::pressed();
    let since = rig.board.now();
    let refused = Err(CommandRefusal::Faulted(Fault::EmergencyStop));
    for _ in 0..10 {
        rig.board.at_stop(|stopped| stopped.set_emergency_stop(true));
        rig.pc.run_ms(&mut rig.board, 10);
        rig.board.at_stop(|stopped| stopped.set_emergency_stop(false));
        rig.pc.run_ms(&mut rig.board, 10);
        assert_eq!(rig.pc.command(&mut rig.board, Command::Start).result, refused);
    }
    assert_eq!(rig.pc.must_not(&mut rig.board, Command::Clear), CommandRefusal::NotStopped);
    assert!(rig.enabled_since(since).is_empty());
    rig.pc.must(&mut rig.board, Command::Start);
    rig.pc.run_ms(&mut rig.board, 5);
    assert_eq!(rig.enabled_since(since).len(), 1, "a person has cleared it");
}
