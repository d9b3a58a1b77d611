//! The device's end by itself: what it says when, what it keeps, and what it forgets.

use control_core::config::{self, Config};
use control_core::controller::Sample;
use control_core::event::Limits;
use control_core::excitation::{Excitation, GENTLE_TORQUE, Servo, Signal};
use control_core::interlock::Interlock;
use control_core::units::{Counts, Damping, Millimetres, MillinewtonMetres, Milliradians, Stiffness};
use control_core::{AnyOrder, Controller, Order, Patient, Plan, Refusal, TickInput};
use fixed::types::{I8F24, I16F16};
use link::codec::{self, MAX_FRAME, TooLong};
use link::commissioning::Record;
use link::device::{Endpoint, Identity};
use link::frames::{
    Command, CommandRefusal, DeviceFrame, Event, EventKind, Numbered, PROTOCOL_VERSION, SampleBlock, Timing,
};
use link::host::{Commands, Reception};

struct Device {
    endpoint: Endpoint,
    controller: Controller,
    commands: Commands,
    reception: Reception,
    tick: u64,
}

impl Device {
    fn new() -> Self {
        let plan = Config::commissioned_virtual().plan().expect("the default is sound");
        Self {
            endpoint: Endpoint::new(Identity::VIRTUAL, &plan, None).knowing_depth(),
            controller: Controller::new(plan),
            commands: Commands::default(),
            reception: Reception::default(),
            tick: 0,
        }
    }

    fn in_session() -> Self {
        let mut device = Self::new();
        device.say(Command::Hello { version: PROTOCOL_VERSION });
        device.heard();
        device
    }

    fn bytes(&mut self, command: Command) -> Vec<u8> {
        let mut out = [0; MAX_FRAME];
        let (_, length) = self.commands.encode(command, &mut out).expect("it fits");
        out[..length].to_vec()
    }

    fn say(&mut self, command: Command) {
        let bytes = self.bytes(command);
        self.endpoint.receive(&bytes);
    }

    fn answer(&mut self, command: Command) -> Result<(), CommandRefusal> {
        self.say(command);
        let mut acks = self.heard().into_iter().filter_map(|frame| match frame {
            DeviceFrame::Ack(ack) => Some(ack.result),
            _ => None,
        });
        acks.next_back().expect("every command is answered")
    }

    fn run(&mut self, ticks: u64) -> Vec<DeviceFrame> {
        let mut frames = vec![];
        for _ in 0..ticks {
            let output = self.controller.tick(TickInput { count: Counts(0), ..TickInput::default() });
            self.endpoint.record(self.tick, &output);
            self.tick += 1;
            frames.extend(self.heard());
        }
        frames
    }

    fn heard(&mut self) -> Vec<DeviceFrame> {
        let (mut out, mut frames) = ([0; MAX_FRAME], vec![]);
        loop {
            let length = self.endpoint.transmit(&mut out);
            if length == 0 {
                return frames;
            }
            frames.extend(out[..length].iter().filter_map(|byte| self.reception.push(*byte)));
        }
    }

    fn timing(&mut self) -> Timing {
        let frames = self.run(10_000);
        let timing = frames.into_iter().find_map(|frame| match frame {
            DeviceFrame::Timing(timing) => Some(timing),
            _ => None,
        });
        timing.expect("timing once a second")
    }
}

#[test]
fn another_version_is_turned_away() {
    let mut device = Device::new();
    device.say(Command::Hello { version: PROTOCOL_VERSION + 1 });
    let frames = device.heard();
    assert!(
        matches!(frames[..], [DeviceFrame::Ack(ack)] if ack.result == Err(CommandRefusal::Version)),
        "{frames:?}"
    );
    assert!(!device.endpoint.in_session());
}

/// The bytes of commit 8dc88938: its program's hello, and its device's answer to that of another
/// version. Each reads what the other says, so that both say it in a sentence.
#[test]
fn a_hello_of_protocol_9_is_turned_away_in_its_words() {
    const HELLO: [u8; 9] = [0x02, 0x01, 0x06, 0x09, 0x81, 0x0b, 0x5f, 0x87, 0x00];
    const ANSWER: [u8; 11] = [0x01, 0x09, 0x05, 0x01, 0x01, 0x02, 0x75, 0x3d, 0x2b, 0x07, 0x00];
    let mut device = Device::new();
    device.endpoint.receive(&HELLO);
    let mut out = [0; MAX_FRAME];
    let length = device.endpoint.transmit(&mut out);
    assert_eq!(&out[..length], &ANSWER, "an old program with this device");
    let heard: Vec<DeviceFrame> = ANSWER.into_iter().filter_map(|byte| device.reception.push(byte)).collect();
    assert!(
        matches!(heard[..], [DeviceFrame::Ack(ack)] if ack.result == Err(CommandRefusal::Version)),
        "this program with an old device: {heard:?}"
    );
}

#[test]
fn a_hello_says_how_long_the_heat_is_unknown() {
    let mut limited = config::Device::commissioned_virtual();
    limited.limits.continuous_torque.0 /= 2;
    let plan = Plan::new(&limited, &Patient::nobody()).expect("sound");
    for (knows_heat, ticks, wanted) in
        [(true, 0, None), (false, 0, Some(12)), (false, 45_000, Some(8)), (false, 120_001, None)]
    {
        let mut device = Device::new();
        device.endpoint = Endpoint::new(Identity::VIRTUAL, &plan, None);
        device.endpoint.set_knows_heat(knows_heat);
        device.run(ticks);
        device.say(Command::Hello { version: PROTOCOL_VERSION });
        let told = device.heard().into_iter().find_map(|frame| match frame {
            DeviceFrame::Event(Event { kind: EventKind::HeatUnknown { seconds }, .. }) => Some(seconds),
            _ => None,
        });
        assert_eq!(told, wanted, "{knows_heat}, {ticks} ticks after power-up");
    }
}

#[test]
fn a_device_starts_once_it_is_commissioned_and_knows_its_depth() {
    let mut device = Device::in_session();
    let plan = Plan::new(&config::Device::default(), &Patient::default()).expect("as sound as the default");
    device.endpoint = Endpoint::new(Identity::VIRTUAL, &plan, None);
    assert_eq!(device.answer(Command::Hello { version: PROTOCOL_VERSION }), Ok(()));
    let interlocked = |interlock| Err(CommandRefusal::Interlocked(interlock));
    assert_eq!(device.answer(Command::Start), interlocked(Interlock::NotCommissioned));
    let excitation = |signal, damping: f64| {
        let servo = Servo { stiffness: Stiffness::default(), damping: Damping(I8F24::from_num(damping)) };
        Command::Excite(Excitation {
            signal,
            duration_ms: 100,
            servo,
            travel: Millimetres(I16F16::from_num(100)),
            compensated: false,
        })
    };
    let ramps = |torque| Signal::BreakawayRamps { torque: MillinewtonMetres(torque), ramp_ms: 50 };
    let sines = |torque| Signal::Multisine {
        torque: MillinewtonMetres(torque),
        frequencies: [10, 20].into_iter().collect(),
    };
    let most = GENTLE_TORQUE.0;
    for (command, is_taken) in [
        (excitation(ramps(most + I16F16::DELTA), 0.0), false),
        (excitation(ramps(most), 0.001), false),
        (excitation(sines(most / 2 + I16F16::DELTA), 0.0), false),
        (excitation(sines(most / 2), 0.0), true),
    ] {
        let refused = interlocked(Interlock::NotCommissioned);
        assert_eq!(device.answer(command), if is_taken { Ok(()) } else { refused });
    }
    device.answer(Command::Stop).expect("a stop is always taken");
    let record = Record::of(&config::Device::commissioned_virtual(), [0; 12]);
    assert_eq!(device.answer(Command::RestoreDevice(record)), Ok(()));
    while device.endpoint.next_order().is_some() {}
    assert_eq!(device.answer(Command::Start), interlocked(Interlock::NotZeroed));
    assert_eq!(device.answer(Command::Zero), Ok(()));
    assert_eq!(
        device.answer(Command::ConfigureDevice(config::Device::commissioned_virtual())),
        Ok(()),
        "the same one"
    );
    assert_eq!(device.answer(Command::Start), Ok(()));
}

#[test]
fn a_session_lasts_from_the_hello_until_the_pc_is_gone() {
    let mut device = Device::new();
    assert!(!device.endpoint.in_session());
    device.say(Command::Hello { version: PROTOCOL_VERSION });
    assert!(device.endpoint.in_session());
    device.run(100);
    // Half a command is forgotten with the PC that sent it.
    let start = device.bytes(Command::Start);
    device.endpoint.receive(&start[..start.len() / 2]);
    device.endpoint.disconnect();
    assert!(!device.endpoint.in_session());
    assert!(device.run(100).is_empty(), "nobody is there to hear it");
    device.say(Command::Hello { version: PROTOCOL_VERSION });
    assert!(matches!(device.heard().first(), Some(DeviceFrame::Hello(_))), "the first command is whole");
    assert_eq!(device.timing().garbage_frames, 0);
    let orders: Vec<AnyOrder> = std::iter::from_fn(|| device.endpoint.next_order()).collect();
    assert!(orders.iter().all(|order| matches!(order, AnyOrder::Small(Order::Heartbeat))), "{orders:?}");
}

#[test]
fn a_pose_comes_a_thousand_times_a_second_and_timing_once() {
    let mut device = Device::in_session();
    let frames = device.run(20_000);
    let poses: Vec<u64> = frames
        .iter()
        .filter_map(|frame| match frame {
            DeviceFrame::Pose(pose) => Some(pose.tick),
            _ => None,
        })
        .collect();
    assert_eq!(poses.len(), 2_000);
    assert!(poses.iter().all(|tick| tick.is_multiple_of(10)));
    assert_eq!(frames.iter().filter(|frame| matches!(frame, DeviceFrame::Timing(_))).count(), 2);
}

#[test]
fn a_gap_ends_the_block_in_hand_and_is_counted() {
    let mut device = Device::in_session();
    assert!(device.run(5).iter().all(|frame| !matches!(frame, DeviceFrame::Samples(_))));
    device.endpoint.note_dropped(7);
    device.tick += 7;
    let frames = device.heard();
    let [DeviceFrame::Samples(block)] = &frames[..] else { panic!("{frames:?}") };
    assert_eq!((block.first_tick, block.samples.len()), (0, 5));
    // With nothing in hand there is nothing to end.
    device.endpoint.note_dropped(1);
    assert!(device.heard().is_empty());
    assert_eq!(device.timing().dropped_samples, 8);
}

#[test]
fn times_are_passed_on_and_its_own_counts_are_kept() {
    let mut device = Device::in_session();
    device.endpoint.receive(&[1, 2, 3, 0]);
    device.endpoint.note_dropped(4);
    device.endpoint.set_timing(Timing { clock_hz: 168, missed_ticks: 3, ..Timing::default() });
    let timing = device.timing();
    assert_eq!((timing.clock_hz, timing.missed_ticks), (168, 3));
    assert_eq!((timing.garbage_frames, timing.dropped_samples), (1, 4));
}

#[test]
fn a_configuration_is_known_by_its_hash() {
    let default = Config::commissioned_virtual();
    let mut other = default.clone();
    other.device.limits.fade_in_ms += 1;
    assert_eq!(codec::hash(&default), codec::hash(&default.clone()));
    assert_ne!(codec::hash(&default), codec::hash(&other));
}

#[test]
fn the_longest_frame_is_encoded_and_a_longer_one_is_not() {
    let bytes = |length: usize| heapless::Vec::<u8, MAX_FRAME>::from_iter((0..length).map(|_| 1));
    // 1,024 bytes: the delimiter, five of COBS, four of CRC, and two that say how many follow.
    let mut out = [0; MAX_FRAME];
    assert_eq!(codec::encode(&bytes(MAX_FRAME - 12), &mut out), Ok(MAX_FRAME));
    assert_eq!(codec::encode(&bytes(MAX_FRAME - 11), &mut out), Err(TooLong));
}

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

/// Returns the events while the needle went to `counts` one after the other, one a tick.
fn events(device: &mut Device, counts: &[i32]) -> Vec<EventKind> {
    let mut at = 0;
    let mut kinds = vec![];
    for &target in counts {
        while at != target {
            at += (target - at).signum();
            device.controller.order(Order::Heartbeat);
            let output = device.controller.tick(TickInput { count: Counts(at), tilt: STRAIGHT });
            device.endpoint.record(device.tick, &output);
            device.tick += 1;
            kinds.extend(device.heard().into_iter().filter_map(|frame| match frame {
                DeviceFrame::Event(event) => Some(event.kind),
                _ => None,
            }));
        }
    }
    kinds
}

#[test]
fn a_needle_in_and_out_is_reported_layer_by_layer() {
    let mut device = Device::in_session();
    // 7 mm in, and out again.
    let seen = events(&mut device, &[450, -50]);
    let wanted = [
        EventKind::Contact { layer: 0 },
        EventKind::Puncture { layer: 0 },
        EventKind::Contact { layer: 1 },
        EventKind::Contact { layer: 2 },
        EventKind::Puncture { layer: 2 },
        EventKind::Vessel { layer: 2 },
        EventKind::Flashback { layer: 2 },
        EventKind::Exit { layer: 2 },
        EventKind::Exit { layer: 1 },
        EventKind::Exit { layer: 0 },
    ];
    assert_eq!(seen, wanted);
}

#[test]
fn limit_changes_are_reported_except_the_slew_limit() {
    let mut device = Device::in_session();
    device.controller.order(Order::Start);
    // A puncture at 157 mm/s changes force faster than torque may change; 0.3 s later torque has
    // faded in.
    let mut seen = events(&mut device, &[-3_000, 700, -50]);
    seen.retain(|kind| matches!(kind, EventKind::Started | EventKind::Limits { .. }));
    let limits = |in_force| EventKind::Limits { in_force };
    let wanted = [EventKind::Started, limits(Limits::FADE_IN), limits(Limits::default())];
    assert_eq!(seen[..3], wanted, "{seen:?}");
    let told = seen.iter().filter_map(|kind| match kind {
        EventKind::Limits { in_force } => Some(*in_force),
        _ => None,
    });
    assert!(told.clone().all(|in_force| !in_force.contains(Limits::SLEW)), "{seen:?}");
}

#[test]
fn waiting_messages_are_forgotten_when_the_pc_leaves() {
    let mut device = Device::in_session();
    let output = device.controller.tick(TickInput::default());
    (0..200).for_each(|tick| device.endpoint.record(tick, &output));
    device.endpoint.disconnect();
    device.say(Command::Hello { version: PROTOCOL_VERSION });
    let frames = device.heard();
    assert!(matches!(frames[..], [DeviceFrame::Hello(_), DeviceFrame::Ack(_)]), "{frames:?}");
}

#[test]
fn each_refusal_has_words_of_its_own() {
    let texts = [
        CommandRefusal::Version,
        CommandRefusal::Powered,
        CommandRefusal::Full,
        CommandRefusal::Config(Refusal::Empty),
    ]
    .map(|refusal| refusal.to_string());
    assert!(texts.iter().all(|text| text.len() > 5), "{texts:?}");
    assert_eq!(texts.iter().collect::<std::collections::BTreeSet<_>>().len(), texts.len());
}

fn push(reception: &mut Reception, sequence: u32, frame: DeviceFrame) {
    let mut out = [0; MAX_FRAME];
    let length = codec::encode(&Numbered { sequence, frame }, &mut out).expect("it fits");
    let whole = out[..length].iter().filter_map(|byte| reception.push(*byte)).count();
    assert_eq!(whole, 1);
}

fn samples(first_tick: u64, number: usize) -> DeviceFrame {
    let samples = (0..number).map(|_| Sample::default()).collect();
    DeviceFrame::Samples(SampleBlock { first_tick, samples })
}

#[test]
fn the_pc_counts_what_is_missing_from_one_hello_to_the_next() {
    let hello = || {
        let mut device = Device::new();
        device.say(Command::Hello { version: PROTOCOL_VERSION });
        device.heard().remove(0)
    };
    let mut reception = Reception::default();
    push(&mut reception, 0, hello());
    push(&mut reception, 1, samples(100, 4));
    assert_eq!((reception.counts().lost_frames, reception.counts().lost_samples), (0, 0));
    // Two frames and six samples are missing.
    push(&mut reception, 4, samples(110, 4));
    assert_eq!((reception.counts().lost_frames, reception.counts().lost_samples), (2, 6));
    // A hello that answers a new configuration begins nothing anew.
    push(&mut reception, 6, hello());
    push(&mut reception, 7, samples(115, 4));
    assert_eq!((reception.counts().lost_frames, reception.counts().lost_samples), (3, 7));
    // A number from before is a device that started anew; its own count goes on from there.
    push(&mut reception, 2, samples(119, 1));
    assert_eq!(reception.counts().lost_frames, 3);
    push(&mut reception, 4, samples(120, 1));
    assert_eq!(reception.counts().lost_frames, 4);
    // The first hello of a session begins anew, whatever came before.
    push(&mut reception, 0, hello());
    push(&mut reception, 1, samples(5_000, 1));
    let counts = reception.counts();
    assert_eq!((counts.lost_frames, counts.lost_samples), (4, 7));
    assert_eq!((counts.frames, counts.samples), (9, 15));
    [1, 2, 3, 0, 4, 5, 0].iter().for_each(|byte| assert!(reception.push(*byte).is_none()));
    assert_eq!(reception.counts().garbage, 2);
}
