//! A small simulated axis, rotary or linear, for faults that recordings of real machines showed.
#![allow(dead_code, unreachable_pub, missing_docs)]

use diagnosis::laws::EffectName as N;
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use diagnosis::{Outcome, diagnose_recordings};
use std::f64::consts::TAU;

/// A machine: inertia, viscous and dry friction, the latter's part against backward motion,
/// gravity, a constant force, delay and lag of its drive, the first-order filter behind which its
/// position is read, the command at which the drive is limited, dry friction that comes and goes
/// along the travel where the axis is slow, cogging of twelve a turn, a push that follows the time
/// since the start, the frequency of the belt behind which half of it is (none where zero), the
/// part of its dry friction that comes on top while it is cold, for some 3 s, and the part of its
/// drive's force that is lost after that time.
#[derive(Clone, Copy)]
pub struct Machine {
    pub inertia: f64,
    pub viscous: f64,
    pub forward: f64,
    pub backward: f64,
    pub gravity: f64,
    pub offset: f64,
    pub delay_s: f64,
    pub lag_s: f64,
    pub filter_s: f64,
    pub limit: f64,
    /// Power with which the drive approaches its limit; none where it clips at once.
    pub soft_power: Option<f64>,
    pub slow_grip: f64,
    pub cogging: f64,
    pub push: f64,
    pub belt_hz: f64,
    pub cold: f64,
    pub fades: f64,
    /// White disturbance, as a part of the forward dry friction.
    pub disturbance: f64,
}

pub const AXIS: Machine = Machine {
    inertia: 2.0,
    viscous: 8.0,
    forward: 3.0,
    backward: 3.0,
    gravity: 0.0,
    offset: 0.0,
    delay_s: 0.0,
    lag_s: 0.0,
    filter_s: 0.0,
    limit: f64::INFINITY,
    soft_power: None,
    slow_grip: 0.0,
    cogging: 0.0,
    push: 0.0,
    belt_hz: 0.0,
    cold: 0.0,
    fades: 0.0,
    disturbance: 0.05,
};

/// The recording: rows per second, seconds, the state it starts in, and counts per unit of travel.
#[derive(Clone, Copy)]
pub struct Taken {
    pub rate: f64,
    pub seconds: f64,
    pub start: (f64, f64),
    pub counts: f64,
}

pub const BENCH: Taken = Taken { rate: 500.0, seconds: 8.0, start: (0.0, 0.0), counts: 2e5 };

/// Returns a generator of numbers from -0.5 to 0.5, the same for each seed.
fn white(seed: u64) -> impl FnMut() -> f64 {
    let mut random = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        random ^= random >> 12;
        random ^= random << 25;
        random ^= random >> 27;
        (random.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64 - 0.5
    }
}

/// Runs the machine under a command over time; `seed` draws a white disturbance of 1 % of its dry
/// friction.
pub fn record(machine: Machine, taken: Taken, seed: u64, command: impl Fn(f64) -> f64) -> Recording {
    let steps = 40;
    let h = 1.0 / taken.rate / f64::from(steps);
    let (mut q, mut v) = taken.start;
    let (mut q_load, mut v_load) = taken.start;
    let (mut driven, mut behind) = (command(0.0), 0.0);
    let follow = |by: f64| if by > 0.0 { 1.0 - (-h / by).exp() } else { 1.0 };
    let mut noise = white(seed);
    let mut out = Recording { file: format!("{seed}.csv"), ..Recording::default() };
    for row in 0..(taken.rate * taken.seconds) as u32 {
        let t = f64::from(row) / taken.rate;
        out.time_s.push(t);
        out.command.push(command(t));
        out.position_counts.push(((q - behind) * taken.counts).floor());
        let disturbance = machine.disturbance * machine.forward.max(0.02 * machine.gravity) * noise();
        for i in 0..steps {
            // In rows, and a little on, so that rounding does not make the row before of it.
            let rows = f64::from(row) + f64::from(i) / f64::from(steps) - machine.delay_s * taken.rate;
            let u = command((rows + 1e-9).floor() / taken.rate);
            let passed = match machine.soft_power {
                Some(p) => u / (1.0 + (u / machine.limit).abs().powf(p)).powf(1.0 / p),
                None => u.clamp(-machine.limit, machine.limit),
            };
            driven += (passed - driven) * follow(machine.lag_s);
            let warm = 1.0 - (-t / 3.0).exp();
            let free = driven * (1.0 - machine.fades * warm) + machine.offset + disturbance
                - machine.gravity * q.sin()
                + machine.cogging * (12.0 * q).sin()
                + machine.push * (TAU * (3.0 * t + 0.6 * t * t)).sin();
            let at = q;
            let grip = machine.slow_grip * (4.0 * q).sin().abs() * (-(v / 0.3).abs()).exp();
            let slides = if v > 0.0 || (v == 0.0 && free > 0.0) { machine.forward } else { machine.backward };
            let dry = grip + slides * (1.0 + machine.cold * (-t / 3.0).exp());
            let before = v;
            if machine.belt_hz > 0.0 {
                let (half, rate) = (0.5 * machine.inertia, TAU * machine.belt_hz);
                let belt = half * (rate * rate * (q - q_load) + 0.06 * rate * (v - v_load));
                let before_load = v_load;
                v = slid(v, h, (free - belt) / half, 0.5 * machine.viscous / half, 0.5 * dry / half);
                v_load = slid(v_load, h, belt / half, 0.5 * machine.viscous / half, 0.5 * dry / half);
                q_load += 0.5 * h * (before_load + v_load);
            } else {
                v = slid(
                    v,
                    h,
                    free / machine.inertia,
                    machine.viscous / machine.inertia,
                    dry / machine.inertia,
                );
            }
            q += 0.5 * h * (before + v);
            // The filter's lag under the mean speed of the step.
            let speed = (q - at) / h;
            behind = (behind - machine.filter_s * speed) * (1.0 - follow(machine.filter_s))
                + machine.filter_s * speed;
        }
    }
    out
}

/// Speed after a step of `h` s under a force, viscous friction per speed, and dry friction that
/// holds, all over the mass.
fn slid(v: f64, h: f64, force: f64, viscous: f64, dry: f64) -> f64 {
    if v == 0.0 && force.abs() <= dry {
        return 0.0;
    }
    let way = if v == 0.0 { force.signum() } else { v.signum() };
    let next = v + h * (force - viscous * v - dry * way);
    if next * v < 0.0 { 0.0 } else { next }
}

/// Several frequencies, drawn by a phase.
pub fn mixed(size: f64, phase: f64) -> impl Fn(f64) -> f64 {
    move |t| {
        let tone = |hz: f64, part: f64| part * (TAU * hz * t + phase * hz).sin();
        size * (tone(0.31, 1.0) + tone(0.83, 0.7) + tone(2.3, 0.5) + tone(5.1, 0.3))
    }
}

pub fn rig(model: &str, encoder: &str, actuator: &str, counts: f64) -> Rig {
    let text = format!(
        "format = 1\nkind = \"rotary\"\n[model]\n{model}\n[uncertainty]\ninertia = 0.1\nviscous = 0.3\ncoulomb = 0.3\ngain = 0.05\n\
         [actuator]\ngain = 1.0\ncommand_unit = \"N·m\"\n{actuator}\n[encoder]\ncounts_per_unit = {counts}\n{encoder}\n"
    );
    Rig::parse(&text, "a test").expect("the rig is right")
}

pub fn diagnosed(rig: &Rig, fit: &[Recording], holdout: &[Recording]) -> Outcome {
    let outcome = diagnose_recordings(rig, fit, holdout, &|_, _| ()).expect("the recordings are usable");
    println!("{}\n{}", outcome.summary(), outcome.hypotheses_csv());
    outcome
}

pub fn names(outcome: &Outcome) -> Vec<N> {
    outcome.report.effects.iter().map(|e| e.name).collect()
}

pub const WHOLE: &str = "inertia = 2.0\nviscous = 8.0\ncoulomb = 3.0";
