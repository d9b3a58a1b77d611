//! A sequence on its way: uploaded segment by segment, played as a whole or refused as a whole, and
//! forgotten with its session.

use control_core::config::Config;
use control_core::event::Fault;
use control_core::excitation::{
    Excitation, MAX_LINES, MAX_SEGMENTS, MAX_SEQUENCE_MS, SequenceRefusal, Servo, Signal,
};
use control_core::interlock::{Interlock, Interlocks};
use control_core::units::{Counts, Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use control_core::{Controller, Device, Order, TickInput};
use fixed::types::{I8F24, I16F16};
use link::codec::{self, MAX_FRAME};
use link::device::{Endpoint, Identity, LATE_TICKS};
use link::frames::{Command, CommandRefusal, DeviceFrame, HostFrame, PROTOCOL_VERSION};
use link::host::Reception;

/// A device with its control law, a motor that is held, and the PC's end.
struct HeldDevice {
    controller: Controller,
    endpoint: Endpoint,
    reception: Reception,
    tick: u64,
    id: u32,
    /// Ticks with power so far.
    powered: u64,
}

impl HeldDevice {
    fn new(device: &Device) -> Self {
        let mut config = Config::commissioned_virtual();
        config.device = *device;
        let plan = config.plan().expect("sound");
        let mut bench = Self {
            endpoint: Endpoint::new(Identity::VIRTUAL, &plan, None).knowing_depth(),
            controller: Controller::new(plan),
            reception: Reception::default(),
            tick: 0,
            id: 0,
            powered: 0,
        };
        bench.must(Command::Hello { version: PROTOCOL_VERSION });
        bench
    }

    fn commissioned() -> Self {
        Self::new(&Device::commissioned_virtual())
    }

    fn ask_as(&mut self, id: u32, command: Command) -> Result<(), CommandRefusal> {
        let mut out = [0; MAX_FRAME];
        let length = codec::encode(&HostFrame { id, command }, &mut out).expect("it fits");
        self.endpoint.receive(&out[..length]);
        let mut answer = None;
        loop {
            let length = self.endpoint.transmit(&mut out);
            if length == 0 {
                return answer.expect("every command is answered");
            }
            for frame in out[..length].iter().filter_map(|byte| self.reception.push(*byte)) {
                if let DeviceFrame::Ack(ack) = frame {
                    assert_eq!(ack.id, id);
                    answer = Some(ack.result);
                }
            }
        }
    }

    fn ask(&mut self, command: Command) -> Result<(), CommandRefusal> {
        self.id += 1;
        self.ask_as(self.id, command)
    }

    fn must(&mut self, command: Command) {
        assert_eq!(self.ask(command), Ok(()));
    }

    fn run(&mut self, ticks: u64) {
        for _ in 0..ticks {
            while let Some(order) = self.endpoint.next_order() {
                self.controller.order(order);
            }
            self.controller.order(Order::Heartbeat);
            let count = Counts((self.tick / 100 % 2) as i32);
            let output = self.controller.tick(TickInput { count, ..TickInput::default() });
            self.endpoint.record(self.tick, &output);
            self.tick += 1;
            self.powered += u64::from(output.enable);
        }
    }

    fn upload(&mut self, segments: &[Excitation]) -> Result<(), CommandRefusal> {
        (0_u8..).zip(segments).try_for_each(|(index, segment)| {
            self.ask(Command::Segment { index, excitation: segment.clone() })
        })
    }

    fn play(&mut self, segments: &[Excitation]) -> Result<(), CommandRefusal> {
        self.ask(play(segments))
    }
}

fn play(segments: &[Excitation]) -> Command {
    Command::Play { count: segments.len() as u8, checksum: codec::hash(&segments) }
}

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn ramps(torque: f64, duration_ms: u32) -> Excitation {
    Excitation {
        signal: Signal::BreakawayRamps { torque: MillinewtonMetres(q(torque)), ramp_ms: 50 },
        duration_ms,
        servo: Servo { stiffness: Stiffness(q(0.1)), damping: Damping(I8F24::from_num(0.0005)) },
        travel: Millimetres(q(100.0)),
        compensated: false,
    }
}

fn sound() -> Vec<Excitation> {
    vec![ramps(1.0, 60), ramps(2.0, 40)]
}

const fn refused(refusal: SequenceRefusal) -> Result<(), CommandRefusal> {
    Err(CommandRefusal::Sequence(refusal))
}

const NOTHING: Result<(), CommandRefusal> = refused(SequenceRefusal::Nothing);

#[test]
fn an_upload_gives_no_torque_and_a_play_command_does() {
    let mut bench = HeldDevice::commissioned();
    assert_eq!(bench.upload(&sound()), Ok(()));
    bench.run(5_000);
    assert_eq!(bench.powered, 0, "an upload starts nothing");
    assert_eq!(bench.play(&sound()), Ok(()));
    bench.run(5_000);
    assert_eq!(bench.powered, 1_000, "100 ms, without a rest");
    assert_eq!(bench.play(&sound()), NOTHING, "it plays once");
    bench.run(1_000);
    assert_eq!(bench.powered, 1_000);
}

#[test]
fn a_sequence_that_is_not_what_was_sent_is_refused_whole() {
    let other = vec![ramps(1.0, 60), ramps(2.0, 41)];
    let count_is = |found, wanted| refused(SequenceRefusal::Count { found, wanted });
    let cases = [
        ("another number", play(&[ramps(1.0, 60)]), count_is(2, 1)),
        ("more than there are", play(&[sound(), sound()].concat()), count_is(2, 4)),
        ("other values", play(&other), refused(SequenceRefusal::Damaged)),
        ("no checksum", Command::Play { count: 2, checksum: 0 }, refused(SequenceRefusal::Damaged)),
        ("none", Command::Play { count: 0, checksum: 0 }, count_is(2, 0)),
    ];
    for (what, command, answer) in cases {
        let mut bench = HeldDevice::commissioned();
        assert_eq!(bench.upload(&sound()), Ok(()));
        assert_eq!(bench.ask(command), answer, "{what}");
        assert_eq!(bench.play(&sound()), NOTHING, "{what}: it is forgotten");
        bench.run(1_000);
        assert_eq!(bench.powered, 0, "{what}");
    }
    let nothing = Command::Play { count: 0, checksum: codec::hash(&[(); 0]) };
    assert_eq!(HeldDevice::commissioned().ask(nothing), NOTHING);
}

#[test]
fn a_segment_that_is_refused_takes_the_sequence_along() {
    let long = |ms| Excitation { duration_ms: ms, ..ramps(1.0, 60) };
    let fast = MillimetresPerSecond(q(2_001.0));
    let fast = Signal::Triangle { stroke: Millimetres(q(10.0)), speed: fast };
    for (what, index, bad) in [
        ("too strong", 1, ramps(29.0, 60)),
        ("too fast", 1, Excitation { signal: fast, ..ramps(1.0, 60) }),
        ("too far", 1, Excitation { travel: Millimetres(q(1_001.0)), ..ramps(1.0, 60) }),
        ("too long together", 1, long(MAX_SEQUENCE_MS)),
        ("not the next", 2, ramps(1.0, 60)),
        ("no place for it", MAX_SEGMENTS as u8, ramps(1.0, 60)),
    ] {
        let mut bench = HeldDevice::commissioned();
        bench.must(Command::Segment { index: 0, excitation: ramps(1.0, 60) });
        let answer = bench.ask(Command::Segment { index, excitation: bad });
        let Err(CommandRefusal::Sequence(refusal)) = answer else { panic!("{what}: {answer:?}") };
        let sentence = refusal.to_string();
        assert!(sentence.contains("sequence") && sentence.contains(';'), "what, and what to do: {sentence}");
        assert_eq!(bench.play(&[ramps(1.0, 60)]), NOTHING, "{what}");
        bench.run(1_000);
        assert_eq!(bench.powered, 0, "{what}");
    }
}

#[test]
fn a_sequence_is_forgotten_at_all_that_comes_between() {
    type Between = fn(&mut HeldDevice);
    let hello = |bench: &mut HeldDevice| bench.must(Command::Hello { version: PROTOCOL_VERSION });
    let betweens: [(&str, Between); 8] = [
        ("a stop", |bench| bench.must(Command::Stop)),
        ("the end of the session", |bench| {
            bench.endpoint.disconnect();
            bench.must(Command::Hello { version: PROTOCOL_VERSION });
        }),
        ("another session", hello),
        ("a fault", |bench| {
            bench.controller.order(Order::Trip(Fault::Tilt));
            bench.run(1);
            bench.must(Command::Stop);
            bench.must(Command::Clear);
        }),
        ("another configuration", |bench| {
            bench.must(Command::ConfigureDevice(Device::commissioned_virtual()));
            bench.run(1);
        }),
        ("another patient", |bench| {
            bench.must(Command::ConfigurePatient(Config::commissioned_virtual().patient));
            bench.run(1);
        }),
        ("a start", |bench| {
            bench.must(Command::Start);
            bench.run(10);
            bench.must(Command::Stop);
            bench.run(10);
        }),
        ("an excitation", |bench| {
            bench.must(Command::Excite(ramps(1.0, 20)));
            bench.run(400);
        }),
    ];
    for (what, between) in betweens {
        let mut bench = HeldDevice::commissioned();
        assert_eq!(bench.upload(&sound()), Ok(()));
        between(&mut bench);
        let powered = bench.powered;
        assert_eq!(bench.play(&sound()), NOTHING, "{what}");
        bench.run(1_000);
        assert_eq!(bench.powered, powered, "{what}");
        // Uploaded again it plays.
        assert_eq!(bench.upload(&sound()), Ok(()), "{what}");
        assert_eq!(bench.play(&sound()), Ok(()), "{what}");
    }
}

#[test]
fn a_sequence_that_waits_too_long_is_refused() {
    for (ticks, answer) in [(LATE_TICKS, Ok(())), (LATE_TICKS + 1, refused(SequenceRefusal::Late))] {
        let mut bench = HeldDevice::commissioned();
        bench.run(1);
        assert_eq!(bench.upload(&sound()), Ok(()));
        bench.run(ticks);
        assert_eq!(bench.play(&sound()), answer, "{ticks} ticks");
    }
    let mut bench = HeldDevice::commissioned();
    bench.run(1);
    bench.must(Command::Segment { index: 0, excitation: ramps(1.0, 60) });
    bench.run(LATE_TICKS + 1);
    let late = bench.ask(Command::Segment { index: 1, excitation: ramps(1.0, 60) });
    assert_eq!(late, refused(SequenceRefusal::Late), "a segment that comes late");
}

#[test]
fn nothing_is_uploaded_or_played_while_torque_is_on() {
    let mut bench = HeldDevice::commissioned();
    assert_eq!(bench.upload(&sound()), Ok(()));
    assert_eq!(bench.play(&sound()), Ok(()));
    for _ in 0..2 {
        // On its way to the tick, and then playing.
        assert_eq!(bench.upload(&sound()), Err(CommandRefusal::Powered));
        assert_eq!(bench.play(&sound()), Err(CommandRefusal::Powered));
        bench.run(100);
    }
    bench.must(Command::Stop);
    bench.run(2_000);
    assert_eq!(bench.powered, 200, "no tick after the stop");
}

#[test]
fn a_sequence_plays_in_a_session_without_interlocks_only() {
    let mut bench = HeldDevice::commissioned();
    bench.endpoint.disconnect();
    assert_eq!(bench.upload(&sound()), Err(CommandRefusal::NoSession));
    assert_eq!(bench.play(&sound()), Err(CommandRefusal::NoSession));

    let mut bench = HeldDevice::commissioned();
    assert_eq!(bench.upload(&sound()), Ok(()));
    bench.endpoint.set_interlocks(Interlocks::of(Interlock::EmergencyStop));
    assert_eq!(bench.play(&sound()), Err(CommandRefusal::Interlocked(Interlock::EmergencyStop)));

    let mut unknown = HeldDevice::new(&Device::default());
    let gentle = [Excitation {
        servo: Servo { stiffness: Stiffness::default(), damping: Damping::default() },
        ..ramps(1.0, 60)
    }];
    assert_eq!(unknown.upload(&gentle), Ok(()));
    let not_commissioned = Err(CommandRefusal::Interlocked(Interlock::NotCommissioned));
    assert_eq!(unknown.play(&gentle), not_commissioned, "its own pulses come one by one");
    unknown.run(1_000);
    assert_eq!(unknown.powered + bench.powered, 0);
}

#[test]
fn a_repeated_command_is_answered_again_and_plays_once() {
    let mut bench = HeldDevice::commissioned();
    let [first, second] =
        [0, 1].map(|index| Command::Segment { index, excitation: sound()[index as usize].clone() });
    for (id, command) in [(1_000, first), (1_001, second)] {
        assert_eq!(bench.ask_as(id, command.clone()), Ok(()));
        assert_eq!(bench.ask_as(id, command), Ok(()), "again");
    }
    for _ in 0..2 {
        assert_eq!(bench.ask_as(1_002, play(&sound())), Ok(()));
        bench.run(2_000);
    }
    assert_eq!(bench.powered, 1_000, "played once");
}

/// Otherwise the checksum of two different ones would be the same.
#[test]
fn the_largest_sequence_fits_its_checksum() {
    let most = I16F16::MIN;
    let frequencies = || [u16::MAX; MAX_LINES].into_iter().collect();
    let largest = Excitation {
        signal: Signal::Multisine { torque: MillinewtonMetres(most), frequencies: frequencies() },
        duration_ms: u32::MAX,
        servo: Servo { stiffness: Stiffness(most), damping: Damping(I8F24::MIN) },
        travel: Millimetres(most),
        compensated: true,
    };
    let mut segments = vec![largest; MAX_SEGMENTS];
    let before = codec::hash(&segments.as_slice());
    segments[MAX_SEGMENTS - 1].compensated = false;
    let after = codec::hash(&segments.as_slice());
    assert!(before != 0 && after != 0 && before != after, "{before} {after}");
}
