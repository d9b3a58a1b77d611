//! A small simulator for calibrating thresholds: written from the physics, apart from the crate's
//! own effect models.
#![allow(dead_code, unused_imports, unreachable_pub, missing_docs)]

use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use std::f64::consts::TAU;

// Examples include this file by its path.
#[path = "machine.rs"]
mod machine;

pub use machine::{B, C, COUNTS, GAIN, GRIP, J, Random, Setup, WARM_SQUARE};
use machine::{Excitation, Machine, Moment};

/// The nominal rig, with values off by the given relative errors of inertia, viscous, coulomb and
/// gain.
pub fn rig(off: [f64; 4], extra: &str) -> Rig {
    let text = format!(
        "format = 1\nname = \"simulated\"\nkind = \"rotary\"\n[model]\ninertia = {}\nviscous = {}\ncoulomb = {}\n{extra}\n\
         [uncertainty]\ninertia = 0.15\nviscous = 0.5\ncoulomb = 0.5\ngain = 0.1\n[actuator]\ngain = {}\ncommand_unit = \"A\"\n\
         [encoder]\ncounts_per_unit = {COUNTS}\nstart_spread = 0.1\n",
        J * (1.0 + off[0]),
        B * (1.0 + off[1]),
        C * (1.0 + off[2]),
        GAIN * (1.0 + off[3])
    );
    Rig::parse(&text, "simulated").expect("the rig is right")
}

/// Runs the plant and records it.
pub fn record(setup: &Setup, part: u64) -> Recording {
    let mut random = Random::new(setup.seed * 1000 + part * 17 + 3);
    let rows = (setup.seconds * setup.rate) as usize;
    let mut machine = Machine::new(setup, part, random.between(0.0, TAU));
    let excitation = Excitation::draw(&mut random);
    let mut out = empty(setup, part);
    let mut integral = 0.0;
    for row in 0..rows {
        let now = Moment::at(row as f64 / setup.rate);
        let jitter = random.normal() * 2e-6;
        let counts = machine.counts(&mut random);
        let reference = excitation.reference(now.t);
        let command = if setup.closed {
            let error = reference - counts / COUNTS;
            integral = (integral + error * 0.4 / setup.rate).clamp(-0.1, 0.1);
            (0.06 * error + integral - 0.003 * slope(&out, setup.rate, counts)).clamp(-0.4, 0.4)
        } else {
            excitation.open_loop(now.t)
        };
        // Hard work and rest by turns.
        let works = !machine.has("gain_drift_by_loss") || (4.0 * now.t / setup.seconds).fract() < 0.5;
        let command = if works { command } else { 0.4 * command };
        out.time_s.push(now.t + jitter);
        out.command.push(command);
        out.position_counts.push(counts);
        let push = |column: &mut Option<Vec<f64>>, value| column.as_mut().map_or((), |it| it.push(value));
        push(&mut out.tilt_rad, now.tilt);
        push(&mut out.reference_counts, (reference * COUNTS).round());
        push(&mut out.force, now.load);
        let noise = machine.disturb(&now, &mut random);
        for _ in 0..machine.substeps {
            machine.advance(&now, command, noise);
        }
    }
    out
}

fn empty(setup: &Setup, part: u64) -> Recording {
    Recording {
        file: format!("{}-{part}.csv", setup.effect),
        time_s: Vec::new(),
        command: Vec::new(),
        position_counts: Vec::new(),
        tilt_rad: (setup.effect == "tilt_gravity").then(Vec::new),
        reference_counts: setup.closed.then(Vec::new),
        force: (setup.effect == "load_dependent_friction").then(Vec::new),
    }
}

/// Speed over the last 4 ms, rad/s.
fn slope(so_far: &Recording, rate: f64, counts: f64) -> f64 {
    let before = so_far.position_counts.len().checked_sub((0.004 * rate) as usize + 1);
    before.map_or(0.0, |i| (counts - so_far.position_counts[i]) / COUNTS / 0.004)
}
