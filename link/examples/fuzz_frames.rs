//! Throws damaged frames at both ends of the link for a while: `cargo run --release -p link
//! --example fuzz_frames -- --seconds 60 [--seed N]`. Nothing may panic, and after any damage the
//! next whole frame must be read.

use control_core::compensation::{Gain, Gains};
use control_core::config::{Config, MAX_LAYERS};
use control_core::excitation::{Excitation, MAX_SEGMENTS, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use control_core::{AnyOrder, Controller, LargeOrder, NeedleLine, TickInput};
use link::codec::{self, MAX_FRAME};
use link::commissioning::Record;
use link::device::{Endpoint, Identity};
use link::frames::{Command, HostFrame, PROTOCOL_VERSION};
use link::host::Reception;
use std::time::{Duration, Instant};

fn main() {
    let seconds = argument("--seconds").unwrap_or(60);
    let seed = argument("--seed").unwrap_or(1);
    let mut random = fastrand::Rng::with_seed(seed);
    let end = Instant::now() + Duration::from_secs(seconds);
    let plan = Config::commissioned_virtual().plan().expect("the default is sound");
    let mut device = Endpoint::new(Identity::VIRTUAL, &plan, None).knowing_depth();
    let mut controller = Controller::new(plan);
    let mut reception = Reception::default();
    let (mut rounds, mut ticks, mut id) = (0_u64, Ticks::default(), 0_u32);
    let mut sent = Vec::new();
    while Instant::now() < end {
        for _ in 0..256 {
            let mut bytes = command(&mut random, id, &mut sent);
            id = id.wrapping_add(random.u32(0..3));
            damage(&mut random, &mut bytes);
            device.receive(&bytes);
            run(&mut random, &mut device, &mut controller, &mut reception, &mut ticks);
        }
        // Whatever went before, a hello behind a zero byte opens a session.
        device.receive(&[0]);
        device.receive(&encoded(&HostFrame {
            id: u32::MAX,
            command: Command::Hello { version: PROTOCOL_VERSION },
        }));
        assert!(device.in_session(), "seed {seed}, round {rounds}: the endpoint did not resynchronise");
        rounds += 1;
    }
    let counts = reception.counts();
    println!(
        "fuzz_frames seed={seed} rounds={rounds} commands={} frames={} garbage={} sequences={}",
        rounds * 256,
        counts.frames,
        counts.garbage,
        ticks.sequences
    );
    assert!(seconds < 10 || ticks.sequences > 0, "seed {seed}: no sequence was ever played");
}

fn argument(name: &str) -> Option<u64> {
    let mut arguments = std::env::args().skip_while(|a| a != name);
    arguments
        .nth(1)
        .map(|value| value.parse().unwrap_or_else(|_| panic!("{name} takes a whole number, not {value}")))
}

fn encoded(frame: &HostFrame) -> Vec<u8> {
    let mut out = [0; MAX_FRAME];
    let length = codec::encode(frame, &mut out).expect("it fits");
    out[..length].to_vec()
}

/// `sent` are the segments that a device has which has taken each of them.
fn command(random: &mut fastrand::Rng, id: u32, sent: &mut Vec<Excitation>) -> Vec<u8> {
    let command = match random.u8(0..25) {
        0 => Command::Hello { version: random.u16(0..3) },
        1 => Command::ConfigurePatient(config(random).patient),
        6 => Command::ConfigureDevice(config(random).device),
        7 => Command::ReportDevice,
        8 => Command::Compensate(Gains { angle: Gain(random.u8(..)), ..Gains::OFF }),
        9 => Command::Index(Some(random.i32(..))),
        10 => Command::RestoreDevice(Record::of(&config(random).device, [0; 12])),
        11 => Command::Commission,
        12 | 13 => Command::Excite(excitation(random)),
        14..=17 => segment(random, sent),
        18 | 19 => Command::Play {
            count: sent.len() as u8 ^ u8::from(random.u8(0..8) == 0),
            checksum: codec::hash(&sent.as_slice()) ^ u32::from(random.u8(0..8) == 0),
        },
        2 => Command::Start,
        3 => Command::Stop,
        4 => Command::Zero,
        5 => Command::Heartbeat,
        20 => Command::GuardSupply { set: random.bool() },
        21 => Command::Clear,
        22 => Command::Line(line(random)),
        _ => return (0..random.usize(0..1500)).map(|_| random.u8(..)).collect(),
    };
    encoded(&HostFrame { id, command })
}

/// The default patient's layers, some of them anywhere.
fn line(random: &mut fastrand::Rng) -> NeedleLine {
    let any = |random: &mut fastrand::Rng| random.i32(..) >> random.u32(0..32);
    let patient = config(random).patient;
    let depths = patient.layers.iter().map(|layer| layer.depth);
    let mut depths: heapless::Vec<Millimetres, MAX_LAYERS> = depths.collect();
    if random.u8(0..4) == 0 {
        let _ = depths.push(Millimetres(fixed::types::I16F16::from_bits(any(random))));
    }
    NeedleLine { depths }
}

/// The next segment of a sequence, the first of another one, or any at any place.
fn segment(random: &mut fastrand::Rng, sent: &mut Vec<Excitation>) -> Command {
    let mut segment = excitation(random);
    if random.bool() {
        segment.signal = Signal::Hold;
        segment.duration_ms = random.u32(10..100);
        segment.servo.stiffness = Stiffness::default();
        (segment.travel.0, segment.compensated) = (fixed::types::I16F16::from_num(100), false);
    }
    let index = match random.u8(0..8) {
        0 => random.u8(..),
        1 | 2 => 0,
        _ => sent.len() as u8,
    };
    sent.truncate(usize::from(index));
    if sent.len() < MAX_SEGMENTS {
        sent.push(segment.clone());
    }
    Command::Segment { index, excitation: segment }
}

/// A sound excitation, some of its values replaced by any other.
fn excitation(random: &mut fastrand::Rng) -> Excitation {
    let any =
        |random: &mut fastrand::Rng| fixed::types::I16F16::from_bits(random.i32(..) >> random.u32(0..32));
    let small = |random: &mut fastrand::Rng| match random.bool() {
        true => fixed::types::I16F16::from_num(random.u8(1..20)),
        false => any(random),
    };
    let speed = MillimetresPerSecond(small(random));
    let signal = match random.u8(0..6) {
        0 => Signal::Triangle { stroke: Millimetres(small(random)), speed },
        1 => Signal::SpeedStaircase {
            slowest: speed,
            ratio: small(random),
            steps: random.u8(..),
            dwell_ms: random.u16(..),
        },
        2 => Signal::ReversalLadder {
            smallest: Millimetres(small(random)),
            ratio: small(random),
            steps: random.u8(..),
            speed,
        },
        3 => Signal::Multisine {
            torque: MillinewtonMetres(small(random)),
            frequencies: (0..random.usize(0..12)).map(|_| random.u16(..)).collect(),
        },
        4 => Signal::BreakawayRamps { torque: MillinewtonMetres(small(random)), ramp_ms: random.u16(..) },
        _ => Signal::Hold,
    };
    Excitation {
        signal,
        duration_ms: random.u32(..) >> random.u32(0..32),
        servo: Servo { stiffness: Stiffness(any(random)), damping: Damping::default() },
        travel: Millimetres(small(random)),
        compensated: random.bool(),
    }
}

/// A sound configuration, some of its values replaced by any other.
fn config(random: &mut fastrand::Rng) -> Config {
    let mut config = Config::commissioned_virtual();
    let any =
        |random: &mut fastrand::Rng| fixed::types::I16F16::from_bits(random.i32(..) >> random.u32(0..32));
    for layer in &mut config.patient.layers {
        if random.u8(0..4) == 0 {
            layer.depth.0 = any(random);
        }
        if let Some(wall) = &mut layer.wall
            && random.bool()
        {
            wall.elastic.compliance.0 = any(random);
            wall.puncture_travel.0 = any(random);
            wall.relief.vertex.0 = any(random);
        }
    }
    if random.u8(0..4) == 0 {
        config.device.counts_per_turn = random.u16(..);
        config.device.limits.fade_in_ms = random.u16(..);
        config.device.limits.max_counts_per_tick = random.u16(..);
    }
    config
}

fn damage(random: &mut fastrand::Rng, bytes: &mut Vec<u8>) {
    for _ in 0..random.u8(0..3) {
        if bytes.is_empty() {
            return;
        }
        let at = random.usize(0..bytes.len());
        match random.u8(0..4) {
            0 => bytes[at] = random.u8(..),
            1 => bytes.truncate(at),
            2 => bytes.insert(at, random.u8(..)),
            _ => {
                bytes.remove(at);
            }
        }
    }
}

/// Ticks so far, and the sequences that began in them.
#[derive(Default)]
struct Ticks {
    tick: u64,
    sequences: u64,
}

fn run(
    random: &mut fastrand::Rng,
    device: &mut Endpoint,
    controller: &mut Controller,
    reception: &mut Reception,
    ticks: &mut Ticks,
) {
    let mut out = [0; MAX_FRAME];
    for _ in 0..random.u8(0..40) {
        if let Some(line) = device.take_line() {
            controller.take_line(&line.depths);
        }
        while let Some(order) = device.next_order() {
            if matches!(order, AnyOrder::Large(LargeOrder::Play(_))) {
                assert!(device.in_session(), "a sequence outlived its session");
                ticks.sequences += 1;
            }
            controller.order(order);
        }
        let count = control_core::units::Counts(random.i32(..) >> random.u32(0..32));
        let output = controller.tick(TickInput { count, ..TickInput::default() });
        device.record(ticks.tick, &output);
        ticks.tick += 1;
    }
    for _ in 0..random.u8(0..8) {
        let length = device.transmit(&mut out);
        if random.u8(0..8) == 0 && length > 0 {
            out[random.usize(0..length)] = random.u8(..);
        }
        for byte in &out[..length] {
            reception.push(*byte);
        }
    }
}
