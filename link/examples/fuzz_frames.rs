//! Throws damaged frames at both ends of the link for a while: `cargo run --release -p link --example fuzz_frames --
//! --seconds 60 [--seed N]`. Nothing may panic, and after any damage the next whole frame must be read.

use control_core::compensation::{Gain, Gains};
use control_core::config::Config;
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use control_core::{Controller, TickInput};
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
    let (mut rounds, mut tick, mut id) = (0_u64, 0_u64, 0_u32);
    while Instant::now() < end {
        for _ in 0..256 {
            let mut bytes = command(&mut random, id);
            id = id.wrapping_add(random.u32(0..3));
            damage(&mut random, &mut bytes);
            device.receive(&bytes);
            run(&mut random, &mut device, &mut controller, &mut reception, &mut tick);
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
        "fuzz_frames seed={seed} rounds={rounds} commands={} frames={} garbage={}",
        rounds * 256,
        counts.frames,
        counts.garbage
    );
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

fn command(random: &mut fastrand::Rng, id: u32) -> Vec<u8> {
    let command = match random.u8(0..15) {
        0 => Command::Hello { version: random.u16(0..3) },
        1 => Command::ConfigurePatient(config(random).patient),
        6 => Command::ConfigureDevice(config(random).device),
        7 => Command::ReportDevice,
        8 => Command::Compensate(Gains { angle: Gain(random.u8(..)), ..Gains::OFF }),
        9 => Command::Index(Some(random.i32(..))),
        10 => Command::RestoreDevice(Record::of(&config(random).device, [0; 12])),
        11 => Command::Commission,
        12 | 13 => Command::Excite(excitation(random)),
        2 => Command::Start,
        3 => Command::Stop,
        4 => Command::Zero,
        5 => Command::Heartbeat,
        _ => return (0..random.usize(0..1500)).map(|_| random.u8(..)).collect(),
    };
    encoded(&HostFrame { id, command })
}

/// A sound sequence, some of its values replaced by any other.
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

fn run(
    random: &mut fastrand::Rng,
    device: &mut Endpoint,
    controller: &mut Controller,
    reception: &mut Reception,
    tick: &mut u64,
) {
    let mut out = [0; MAX_FRAME];
    for _ in 0..random.u8(0..40) {
        while let Some(order) = device.next_order() {
            controller.order(order);
        }
        let count = control_core::units::Counts(random.i32(..) >> random.u32(0..32));
        let output = controller.tick(TickInput { count, ..TickInput::default() });
        device.record(*tick, &output);
        *tick += 1;
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
