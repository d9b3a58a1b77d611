//! The hot paths whose instructions `cargo xtask counts` counts under callgrind: `hot_paths PATH`,
//! or `hot_paths filter whole` for a diagnosis to its end. Each is a function that is never
//! inlined, by whose name counting is turned on, and does the same work at every run.

use control_core::controller::{Order, Sample, TickInput};
use control_core::units::Counts;
use control_core::{Config, Controller};
use device_sim::device::virtual_device::VirtualDevice;
use device_sim::procedure::Procedure;
use device_sim::profile::Profile;
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use link::codec::{self, MAX_FRAME};
use link::frames::{BLOCK_SAMPLES, DeviceFrame, Numbered, SampleBlock};
use link::host::Reception;
use std::hint::black_box;
use tissue::{Configuration, Needle, Tissue};

/// Times that each is done; printed, for `cargo xtask counts` divides by them.
const TICKS: i32 = 20_000;
const FRAMES: usize = 200;
const STEPS: usize = 20;
/// The part of a diagnosis that is done when the nominal model is being refitted.
const REFITTED: f64 = 0.1;

fn main() {
    let wanted = std::env::args().nth(1).unwrap_or_default();
    match wanted.as_str() {
        "tick" => {
            let plan = Config::commissioned_virtual().plan().expect("the default is sound");
            let mut controller = Controller::new(plan);
            controller.order(Order::Start);
            counted_ticks(&mut controller);
            println!("times={TICKS}");
        }
        "plant" => {
            let profile = Profile::find("adult").expect("it is built in");
            let procedure = Procedure::find("venepuncture", &profile).expect("it is built in");
            let mut device = VirtualDevice::new(&profile, procedure);
            device.start_alone();
            counted_plant(&mut device);
            println!("times={TICKS}");
        }
        "frame" => {
            counted_frames(&block());
            println!("times={FRAMES}");
        }
        // By the calls of the filter: how often it is called is not what is counted.
        "filter" => {
            let (rig, fit, held) = (rig(), recording(0.0), recording(1.0));
            // The refit of the nominal model calls it often enough: what follows would take a
            // minute under callgrind.
            let until_refitted = |_: &str, done: f64| {
                if done > REFITTED && std::env::args().len() == 2 {
                    std::process::exit(0);
                }
            };
            let outcome = diagnosis::diagnose_recordings(&rig, &[fit], &[held], &until_refitted);
            assert!(outcome.is_ok(), "the recording can be diagnosed");
        }
        "tissue" => {
            let mut tissue = Tissue::new(&Configuration::default()).expect("the default limb can be built");
            counted_tissue(&mut tissue);
            println!("times={STEPS}");
        }
        other => {
            eprintln!("`{other}` is not a path: tick, plant, frame, filter or tissue");
            std::process::exit(2);
        }
    }
}

/// An insertion and a withdrawal, 11 mm.
#[inline(never)]
fn counted_ticks(controller: &mut Controller) {
    for tick in 0..TICKS {
        let way = 1_400 * tick / TICKS;
        if tick % 1_000 == 0 {
            controller.heartbeat();
        }
        let input = TickInput { count: Counts(way.min(1_400 - way)), ..TickInput::default() };
        assert!(black_box(controller.tick(black_box(input))).enable, "the law ran with torque on");
    }
}

/// The plant and the control law.
#[inline(never)]
fn counted_plant(device: &mut VirtualDevice) {
    (0..TICKS).for_each(|_| device.tick_alone());
}

fn block() -> SampleBlock {
    let sample = |index: usize| {
        let count = 40_000 + index as i32 / 4;
        Sample { count, dac: 1_900 - index as u16 / 8, state: 3, tilt_mrad: 520 }
    };
    SampleBlock { first_tick: 1_000_000, samples: (0..BLOCK_SAMPLES).map(sample).collect() }
}

/// Full blocks of samples as frames, there and back.
#[inline(never)]
fn counted_frames(block: &SampleBlock) {
    let mut reception = Reception::default();
    let mut bytes = [0; MAX_FRAME];
    for sequence in 0..FRAMES as u32 {
        let frame = Numbered { sequence, frame: DeviceFrame::Samples(block.clone()) };
        let length = codec::encode(black_box(&frame), &mut bytes).expect("a block fits a frame");
        let mut bytes = black_box(&bytes[..length]);
        while let Some(frame) = reception.take(&mut bytes) {
            black_box(&frame);
        }
    }
    assert_eq!(reception.counts().samples, (FRAMES * BLOCK_SAMPLES) as u64, "every sample arrives");
}

#[inline(never)]
fn counted_tissue(tissue: &mut Tissue) {
    for step in 0..STEPS {
        tissue.step(&Needle::entering(0.5 * step as f32, 30_f32.to_radians(), 0.0), 1.0 / 60.0);
    }
}

fn rig() -> Rig {
    let text = "format = 1\nname = \"simulated\"\nkind = \"rotary\"\n[model]\ninertia = 2.4e-6\nviscous = 4e-6\ncoulomb = 4e-4\n\
                [uncertainty]\ninertia = 0.15\nviscous = 0.5\ncoulomb = 0.5\n[actuator]\ngain = 0.0234\ncommand_unit = \"A\"\n\
                [encoder]\ncounts_per_unit = 636.6197724\n";
    Rig::parse(text, "simulated").expect("the rig is right")
}

/// Four seconds at 500 Hz of an axis with inertia, viscous and dry friction, under two waves.
fn recording(phase: f64) -> Recording {
    let (mut out, mut position, mut speed) = (Recording::default(), 0.0_f64, 0.0_f64);
    out.file = "simulated.csv".into();
    for row in 0..2_000 {
        let time = f64::from(row) * 2e-3;
        let command = 0.04 * (4.0 * time + phase).sin() + 0.02 * (23.0 * time).sin();
        out.time_s.push(time);
        out.command.push(command);
        out.position_counts.push((636.619_772_4 * position).floor());
        for _ in 0..20 {
            let force = 0.0234 * command - 4e-6 * speed;
            let dry = if speed == 0.0 { force.clamp(-4e-4, 4e-4) } else { 4e-4 * speed.signum() };
            let next = speed + (force - dry) / 2.4e-6 * 1e-4;
            speed = if next * speed < 0.0 { 0.0 } else { next };
            position += 1e-4 * speed;
        }
    }
    out
}
