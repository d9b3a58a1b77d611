//! Frames survive the journey; garbage, truncation and floods cost no more than they must and are
//! counted.

use control_core::config::{Config, MAX_LAYERS};
use control_core::controller::Sample;
use control_core::event::Fault;
use control_core::{AnyOrder, Controller, Device, Order, Patient, TickInput};
use link::codec::{self, Decoder, Garbage, MAX_FRAME};
use link::commissioning::Record;
use link::device::{Endpoint, Identity};
use link::frames::{
    BLOCK_SAMPLES, Command, CommandRefusal, DeviceFrame, EventKind, HostFrame, Numbered, PROTOCOL_VERSION,
    SampleBlock,
};
use link::host::{Commands, Reception};
use proptest::prelude::*;

fn encoded<F: serde::Serialize>(frame: &F) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = codec::encode(frame, &mut out).expect("it fits");
    out[..length].to_vec()
}

fn block(first_tick: u64, samples: &[Sample]) -> DeviceFrame {
    DeviceFrame::Samples(SampleBlock { first_tick, samples: samples.iter().copied().collect() })
}

fn decode_all(bytes: &[u8]) -> (Vec<Numbered>, usize) {
    let mut decoder = Decoder::default();
    let (mut frames, mut garbage) = (Vec::new(), 0);
    for &byte in bytes {
        match decoder.push::<Numbered>(byte) {
            Some(Ok(frame)) => frames.push(frame),
            Some(Err(Garbage)) => garbage += 1,
            None => {}
        }
    }
    (frames, garbage)
}

fn samples() -> impl Strategy<Value = Vec<Sample>> {
    let sample = (any::<i32>(), any::<u16>(), any::<u8>(), any::<i16>());
    let sample = sample.prop_map(|(count, dac, state, tilt_mrad)| Sample { count, dac, state, tilt_mrad });
    prop::collection::vec(sample, 0..=BLOCK_SAMPLES)
}

proptest! {
    #[test]
    fn a_frame_arrives_as_it_was_sent(sequence: u32, tick: u64, samples in samples()) {
        let sent = Numbered { sequence, frame: block(tick, &samples) };
        let bytes = encoded(&sent);
        prop_assert_eq!(bytes.iter().filter(|b| **b == 0).count(), 1);
        prop_assert_eq!(decode_all(&bytes), (vec![sent], 0));
    }

    #[test]
    fn after_garbage_the_next_frame_is_read(garbage: Vec<u8>, samples in samples()) {
        let sent = Numbered { sequence: 1, frame: block(7, &samples) };
        let mut bytes = garbage;
        bytes.push(0);
        bytes.extend(encoded(&sent));
        let (frames, _) = decode_all(&bytes);
        prop_assert_eq!(frames.last(), Some(&sent));
    }

    #[test]
    fn bytes_in_pieces_are_read_as_one_by_one(garbage: Vec<u8>, samples in samples(), long in 0..3 * MAX_FRAME, piece in 1..200_usize) {
        let mut bytes = garbage;
        for (sequence, filler) in [0, long, 1].into_iter().enumerate() {
            bytes.extend(vec![1; filler]);
            bytes.push(0);
            bytes.extend(encoded(&Numbered { sequence: sequence as u32, frame: block(9, &samples) }));
        }
        let (mut decoder, mut frames, mut garbage) = (Decoder::default(), Vec::new(), 0);
        for mut piece in bytes.chunks(piece) {
            while let Some(read) = decoder.take::<Numbered>(&mut piece) {
                match read {
                    Ok(frame) => frames.push(frame),
                    Err(Garbage) => garbage += 1,
                }
            }
            prop_assert!(piece.is_empty());
        }
        prop_assert_eq!((frames, garbage), decode_all(&bytes));
    }

    #[test]
    fn a_frame_cut_short_costs_itself_alone(samples in samples(), cut in 0.0..1.0_f64) {
        let first = encoded(&Numbered { sequence: 0, frame: block(0, &samples) });
        let second = Numbered { sequence: 1, frame: block(32, &samples) };
        let keep = 1 + (cut * (first.len() - 2) as f64) as usize;
        let mut bytes = first[..keep.min(first.len() - 1)].to_vec();
        bytes.push(0);
        bytes.extend(encoded(&second));
        let (frames, garbage) = decode_all(&bytes);
        prop_assert!(garbage == 1 || keep == first.len() - 1, "{} bytes of {}", keep, first.len());
        prop_assert_eq!(frames.last(), Some(&second));
    }

    #[test]
    fn a_changed_byte_never_passes(samples in samples(), at: prop::sample::Index, flip in 1_u8..) {
        let sent = Numbered { sequence: 3, frame: block(9, &samples) };
        let mut bytes = encoded(&sent);
        let at = at.index(bytes.len() - 1);
        bytes[at] ^= flip;
        let (frames, _) = decode_all(&bytes);
        prop_assert!(frames.iter().all(|f| *f == sent), "a damaged frame was taken for another");
    }
}

#[test]
fn the_largest_frames_fit() {
    let sample = Sample { count: i32::MIN, dac: u16::MAX, state: u8::MAX, tilt_mrad: i16::MIN };
    encoded(&Numbered { sequence: u32::MAX, frame: block(u64::MAX, &[sample; BLOCK_SAMPLES]) });
    let mut config = Config::commissioned_virtual();
    let mut layer = config.patient.layers[0];
    let wall = layer.wall.as_mut().expect("skin has a wall");
    let most = fixed::types::I16F16::MIN;
    for parabola in [&mut wall.elastic, &mut wall.relief] {
        (parabola.vertex.0, parabola.compliance.0, parabola.base.0) = (most, most, most);
    }
    (wall.puncture_travel.0, wall.unload.0) = (most, most);
    (layer.depth.0, layer.friction.0) = (most, most);
    config.patient.layers = [layer; MAX_LAYERS].into_iter().collect();
    encoded(&HostFrame { id: u32::MAX, command: Command::ConfigurePatient(config.patient) });
}

/// A device with its control law, and the PC's end.
struct LinkedDevice {
    controller: Controller,
    device: Endpoint,
    commands: Commands,
    reception: Reception,
    tick: u64,
}

impl LinkedDevice {
    fn new() -> Self {
        let plan = Config::commissioned_virtual().plan().expect("the default is sound");
        Self {
            device: Endpoint::new(Identity::VIRTUAL, &plan, None).knowing_depth(),
            controller: Controller::new(plan),
            commands: Commands::default(),
            reception: Reception::default(),
            tick: 0,
        }
    }

    fn bytes(&mut self, command: Command) -> Vec<u8> {
        let mut out = [0; MAX_FRAME];
        let (_, length) = self.commands.encode(command, &mut out).expect("it fits");
        out[..length].to_vec()
    }

    fn send(&mut self, command: Command) -> Result<(), CommandRefusal> {
        let bytes = self.bytes(command);
        self.device.receive(&bytes);
        let mut acks = self.drain().into_iter().filter_map(|f| match f {
            DeviceFrame::Ack(ack) => Some(ack.result),
            _ => None,
        });
        acks.next_back().expect("every command is answered")
    }

    /// Returns the number of ticks with torque.
    fn run(&mut self, ticks: u64, mut count: impl FnMut(u64) -> i32) -> u64 {
        let mut powered = 0;
        for _ in 0..ticks {
            while let Some(order) = self.device.next_order() {
                self.controller.order(order);
            }
            let input =
                TickInput { count: control_core::units::Counts(count(self.tick)), ..TickInput::default() };
            let output = self.controller.tick(input);
            self.device.record(self.tick, &output);
            self.tick += 1;
            powered += u64::from(output.enable);
        }
        powered
    }

    fn drain(&mut self) -> Vec<DeviceFrame> {
        let (mut out, mut frames) = ([0; MAX_FRAME], Vec::new());
        loop {
            let length = self.device.transmit(&mut out);
            if length == 0 {
                return frames;
            }
            frames.extend(out[..length].iter().filter_map(|b| self.reception.push(*b)));
        }
    }
}

#[test]
fn a_session_begins_with_a_hello_and_loses_nothing() {
    let mut bench = LinkedDevice::new();
    bench.run(100, |_| 0);
    assert!(bench.drain().is_empty(), "nothing is said before the hello");
    let bytes = bench.bytes(Command::Hello { version: PROTOCOL_VERSION });
    bench.device.receive(&bytes);
    assert!(matches!(bench.drain().first(), Some(DeviceFrame::Hello(_))));
    assert_eq!(bench.send(Command::Start), Ok(()));
    let mut events = Vec::new();
    for _ in 0..100 {
        assert_eq!(bench.send(Command::Heartbeat), Ok(()));
        bench.run(320, |_| 0);
        events.extend(bench.drain().into_iter().filter_map(|f| match f {
            DeviceFrame::Event(event) => Some(event.kind),
            _ => None,
        }));
    }
    let counts = bench.reception.counts();
    assert_eq!((counts.samples, counts.lost_samples, counts.lost_frames, counts.garbage), (32_000, 0, 0, 0));
    assert!(events.contains(&EventKind::Started), "{events:?}");
}

#[test]
fn frames_that_the_pc_misses_are_counted() {
    let mut bench = LinkedDevice::new();
    let _ = bench.send(Command::Hello { version: PROTOCOL_VERSION });
    bench.run(3_200, |_| 0);
    bench.drain();
    bench.run(3_200, |_| 0);
    bench.drain();
    let counts = bench.reception.counts();
    assert_eq!(
        counts.samples + counts.lost_samples,
        6_400 - 2_432,
        "the first block that arrived is not the first tick"
    );
    assert_eq!(counts.lost_samples, 3_200 - 768);
}

#[test]
fn a_repeated_command_is_answered_again_and_carried_out_once() {
    let mut bench = LinkedDevice::new();
    let _ = bench.send(Command::Hello { version: PROTOCOL_VERSION });
    let start = bench.bytes(Command::Start);
    for _ in 0..3 {
        bench.device.receive(&start);
    }
    let acks = bench.drain().iter().filter(|f| matches!(f, DeviceFrame::Ack(_))).count();
    assert_eq!(acks, 3);
    let orders = std::iter::from_fn(|| bench.device.next_order())
        .filter(|o| matches!(o, AnyOrder::Small(Order::Start)))
        .count();
    assert_eq!(orders, 1);
}

#[test]
fn torque_and_configuration_exclude_each_other() {
    let mut bench = LinkedDevice::new();
    let _ = bench.send(Command::Hello { version: PROTOCOL_VERSION });
    assert_eq!(bench.send(Command::ConfigurePatient(Patient::default())), Ok(()));
    assert_eq!(bench.send(Command::Start), Ok(()));
    assert_eq!(bench.send(Command::ConfigurePatient(Patient::default())), Err(CommandRefusal::Powered));
    bench.run(10, |_| 0);
    assert_eq!(bench.send(Command::Zero), Err(CommandRefusal::Powered));
    assert_eq!(bench.send(Command::Stop), Ok(()));
    bench.run(10, |_| 0);
    assert_eq!(bench.send(Command::Zero), Ok(()));
    let empty = Patient { layers: heapless::Vec::new(), ..Patient::default() };
    assert!(matches!(bench.send(Command::ConfigurePatient(empty)), Err(CommandRefusal::Config(_))));
}

#[test]
fn a_patient_never_changes_the_device_but_may_be_dismissed() {
    let mut bench = LinkedDevice::new();
    let _ = bench.send(Command::Hello { version: PROTOCOL_VERSION });
    let ask = |bench: &mut LinkedDevice, command: Command| {
        let bytes = bench.bytes(command);
        bench.device.receive(&bytes);
        bench.drain()
    };
    let hello = |frames: &[DeviceFrame]| {
        let hello =
            frames.iter().find_map(|f| if let DeviceFrame::Hello(h) = f { Some(h.clone()) } else { None });
        hello.expect("a new configuration is told")
    };
    let hash = |device: Device, patient: Patient| codec::hash(&Config { device, patient });
    let mut device = Device { motor_reversed: true, dac_zero: 3, ..Device::commissioned_virtual() };
    let told = hello(&ask(&mut bench, Command::RestoreDevice(Record::of(&device, [0; 12]))));
    assert_eq!(told.config_hash, hash(device, Patient::default()), "the patient stays");
    assert_eq!(told.device_hash, codec::hash(&device));

    let mut patient = Patient::default();
    patient.layers[0].friction.0 /= 2;
    let told = hello(&ask(&mut bench, Command::ConfigurePatient(patient.clone())));
    assert_eq!(told.config_hash, hash(device, patient.clone()), "the device stays");
    let reported = ask(&mut bench, Command::ReportDevice);
    assert!(reported.contains(&DeviceFrame::Device(Record::of(&device, [0; 12]))), "{reported:?}");

    // Refused whole: neither part changes.
    let refused = Device { counts_per_turn: 3, commissioned: false, ..device };
    assert!(matches!(bench.send(Command::ConfigureDevice(refused)), Err(CommandRefusal::Config(_))));
    assert_eq!(bench.device.hello().config_hash, hash(device, patient));
    // A ceiling of 0.2 N bears no adult.
    device.limits.torque.0 = fixed::types::I16F16::from_num(2);
    let told = hello(&ask(&mut bench, Command::ConfigureDevice(device)));
    assert_eq!(told.config_hash, hash(device, Patient::nobody()));
    bench.run(1, |_| 0);
    assert!(matches!(
        bench.send(Command::ConfigurePatient(Patient::default())),
        Err(CommandRefusal::Config(_))
    ));
}

#[test]
fn a_fault_is_reported_and_again_after_a_reconnection() {
    let mut bench = LinkedDevice::new();
    let _ = bench.send(Command::Hello { version: PROTOCOL_VERSION });
    assert_eq!(bench.send(Command::Start), Ok(()));
    bench.run(10, |tick| if tick > 5 { 5_000 } else { 0 });
    let jump = EventKind::Fault { cause: Fault::EncoderJump };
    assert!(bench.drain().iter().any(|f| matches!(f, DeviceFrame::Event(e) if e.kind == jump)));
    bench.device.disconnect();
    let hello = bench.bytes(Command::Hello { version: PROTOCOL_VERSION });
    bench.device.receive(&hello);
    let frames = bench.drain();
    assert!(matches!(&frames[0], DeviceFrame::Hello(h) if h.fault == Some(Fault::EncoderJump)), "{frames:?}");
}

#[test]
fn a_fault_is_cleared_only_by_clear_after_a_stop() {
    let mut bench = LinkedDevice::new();
    let _ = bench.send(Command::Hello { version: PROTOCOL_VERSION });
    assert_eq!(bench.send(Command::Clear), Ok(()), "there is none");
    let _ = bench.send(Command::Stop);
    assert_eq!(bench.send(Command::Start), Ok(()));
    bench.run(10, |tick| if tick > 5 { 5_000 } else { 0 });
    let refused = Err(CommandRefusal::Faulted(Fault::EncoderJump));
    assert_eq!(bench.send(Command::Start), refused);
    assert_eq!(bench.send(Command::Clear), Err(CommandRefusal::NotStopped), "the stop was before it");
    let _ = bench.send(Command::Stop);
    assert_eq!(bench.send(Command::Start), refused, "a stop alone clears nothing");
    let clear = bench.bytes(Command::Clear);
    bench.device.receive(&clear);
    let is_cleared = |f: &DeviceFrame| matches!(f, DeviceFrame::Event(e) if e.kind == EventKind::Cleared);
    assert!(bench.drain().iter().any(is_cleared));
    bench.run(2, |_| 0);
    assert_eq!(bench.send(Command::Start), Ok(()));
    assert_eq!(bench.run(10, |_| 0), 10, "torque");
}

#[test]
fn a_start_that_a_stop_has_overtaken_gives_no_torque() {
    let mut bench = LinkedDevice::new();
    let _ = bench.send(Command::Hello { version: PROTOCOL_VERSION });
    let late = bench.bytes(Command::Start);
    assert_eq!(bench.send(Command::Stop), Ok(()));
    bench.device.receive(&late);
    let is_refused =
        |f: &DeviceFrame| matches!(f, DeviceFrame::Ack(ack) if ack.result == Err(CommandRefusal::Overtaken));
    assert!(bench.drain().iter().any(is_refused));
    assert_eq!(bench.run(10, |_| 0), 0);
    assert_eq!(bench.send(Command::Start), Ok(()));
}
