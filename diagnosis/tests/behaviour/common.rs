//! A small simulator for calibrating thresholds: written from the physics, apart from the crate's own effect models.
#![allow(dead_code, unreachable_pub, missing_docs)]

use diagnosis::recording::Recording;
use diagnosis::rig::Rig;

/// Deterministic noise.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1)
    }
    pub fn unit(&mut self) -> f64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        (self.0.wrapping_mul(0x2545_F491_4F6C_DD1D) >> 11) as f64 / (1u64 << 53) as f64
    }
    pub fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.unit()).sum::<f64>() - 6.0
    }
    pub fn between(&mut self, a: f64, b: f64) -> f64 {
        a + (b - a) * self.unit()
    }
}

pub const J: f64 = 2.4e-6;
pub const B: f64 = 4.0e-6;
pub const C: f64 = 4.0e-4;
pub const GAIN: f64 = 0.0234;
pub const COUNTS: f64 = 636.619_772_4;

/// Force at which a grip of size 1 lets go, N·m.
pub const GRIP: f64 = 7e-4;

/// Square of the command under which a gain that falls with the copper loss settles at its full change, A².
pub const WARM_SQUARE: f64 = 1e-3;

/// The nominal rig, with values off by the given relative errors of inertia, viscous, coulomb and gain.
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

/// The plant's physics beyond the nominal model.
#[derive(Clone, Copy, Debug)]
pub struct Setup {
    pub effect: &'static str,
    /// Size of the effect, relative to what is strong.
    pub size: f64,
    pub closed: bool,
    pub rate: f64,
    pub seconds: f64,
    /// White torque noise per 1 ms, relative to the dry friction.
    pub disturbance: f64,
    pub seed: u64,
}

/// Runs the plant and records it.
pub fn record(setup: &Setup, part: u64) -> Recording {
    let mut random = Random::new(setup.seed * 1000 + part * 17 + 3);
    let s = setup.size;
    let is = |name: &str| setup.effect == name;
    let substeps = (40_000.0 / setup.rate).round().max(1.0) as usize;
    let dt = 1.0 / setup.rate / substeps as f64;
    let rows = (setup.seconds * setup.rate) as usize;
    let zero = random.between(0.0, std::f64::consts::TAU);
    let (mut q, mut v) = (0.0f64, 0.0f64);
    let start = q + zero;
    let mut out = Recording {
        file: format!("{}-{part}.csv", setup.effect),
        time_s: Vec::new(),
        command: Vec::new(),
        position_counts: Vec::new(),
        tilt_rad: is("tilt_gravity").then(Vec::new),
        reference_counts: setup.closed.then(Vec::new),
        force: is("load_dependent_friction").then(Vec::new),
    };
    // Excitation: a triangle of changing height with a multisine on top.
    let tones: Vec<(f64, f64, f64)> = (0..14)
        .map(|i| {
            (0.4 * 1.42f64.powi(i), random.between(0.0, std::f64::consts::TAU), random.between(0.6, 1.4))
        })
        .collect();
    let pace = random.between(0.22, 0.3);
    let mut slow = 0.0;
    let mut z = 0.0f64;
    let mut elements = [0.0f64; 9];
    let mut queue = std::collections::VecDeque::new();
    let mut lagged = 0.0;
    let (mut ql, mut vl) = (0.0f64, 0.0f64);
    let mut lost = 0.0;
    let mut heat = 0.0;
    let mut integral = 0.0;
    for row in 0..rows {
        let t = row as f64 / setup.rate;
        let jitter = random.normal() * 2e-6;
        let tilt = 0.6 * (0.7 * t).sin();
        let load = 8e-4 * (1.3 * t).sin() + 4e-4 * (4.1 * t).sin();
        let wave: f64 = tones.iter().map(|(f, p, a)| a * (std::f64::consts::TAU * f * t + p).sin()).sum();
        let triangle = {
            let x = (pace * t).fract();
            if x < 0.5 { 4.0 * x - 1.0 } else { 3.0 - 4.0 * x }
        };
        let mut measured = q;
        if is("encoder_eccentricity") {
            measured += 0.03 * s * (q + zero).sin();
        }
        if is("missed_counts") {
            if v.abs() > 12.0 && random.unit() < 2.0 / setup.rate {
                lost += 10.0 * s * v.signum();
            }
            measured -= lost / COUNTS;
        }
        let counts = (measured * COUNTS + 0.3).floor();
        let reference = 8.0 * triangle * (1.0 + 0.5 * (0.31 * t).sin()) + 0.5 * (2.0 * t).sin() + 0.12 * wave;
        let command = if setup.closed {
            let error = reference - counts / COUNTS;
            integral = (integral + error * 0.4 / setup.rate).clamp(-0.1, 0.1);
            let slope = {
                let before = out.position_counts.len().checked_sub((0.004 * setup.rate) as usize + 1);
                before.map_or(0.0, |i| (counts - out.position_counts[i]) / COUNTS / 0.004)
            };
            (0.06 * error + integral - 0.003 * slope).clamp(-0.4, 0.4)
        } else {
            0.024 * triangle * 1.6 + 0.014 * wave
        };
        // Hard work and rest by turns.
        let works = !is("gain_drift_by_loss") || (4.0 * t / setup.seconds).fract() < 0.5;
        let command = if works { command } else { 0.4 * command };
        out.time_s.push(t + jitter);
        out.command.push(command);
        out.position_counts.push(counts);
        if let Some(column) = &mut out.tilt_rad {
            column.push(tilt);
        }
        if let Some(column) = &mut out.reference_counts {
            column.push((reference * COUNTS).round());
        }
        if let Some(column) = &mut out.force {
            column.push(load);
        }
        if row % ((setup.rate / 1000.0).ceil() as usize) == 0 {
            slow += 0.0;
        }
        let noise = setup.disturbance * C * random.normal() * (setup.rate / 1000.0).sqrt().max(1.0);
        if is("random_disturbance") {
            slow = slow * 0.999f64.powf(1000.0 / setup.rate)
                + s * C * 0.045 * random.normal() * (1000.0 / setup.rate).sqrt();
        }
        if is("hum") {
            slow = 2.5e-4 * s * (std::f64::consts::TAU * 13.7 * t).sin();
        }
        for _ in 0..substeps {
            let mut u = command;
            if is("command_deadband") && u.abs() < 0.012 * s {
                u = 0.0;
            }
            if is("command_saturation") {
                let limit = 0.06 / (0.5 + s);
                u = u.clamp(-limit, limit);
            }
            if is("command_delay") {
                queue.push_back(u);
                u = if queue.len() as f64 * dt > 0.004 * s { queue.pop_front().unwrap() } else { 0.0 };
            }
            if is("electrical_lag") {
                lagged += (u - lagged) * dt / (0.004 * s);
                u = lagged;
            }
            if is("gain_drift") {
                u *= 1.0 - 0.3 * s * (1.0 - (-t / (0.3 * setup.seconds)).exp());
            }
            if is("gain_drift_by_loss") {
                heat += (u * u / WARM_SQUARE - heat) * dt / (0.2 * setup.seconds);
                u *= 1.0 - 0.15 * s * heat;
            }
            if is("torque_ripple") {
                u *= 1.0 + s * (0.2 * (3.0 * (q + zero)).sin() + 0.1 * (6.0 * (q + zero) + 1.0).sin());
            }
            let mut j = J;
            let mut dry = C;
            let mut force = GAIN * u - B * v + noise + slow;
            if is("stribeck_friction") {
                dry += 3e-4 * s * (-(v.abs() / 2.0).powf(1.4)).exp();
            }
            if is("asymmetric_friction") && v > 0.0 {
                dry += 2e-4 * s;
                force -= 4e-6 * s * v;
            }
            if is("friction_drift") {
                dry *= 1.0 - 0.5 * s * (1.0 - (-t / (0.3 * setup.seconds)).exp());
            }
            if is("position_dependent_friction") {
                dry *= 1.0 + 0.6 * s * (0.2 * q).sin() + 0.3 * s * (0.2 * q).cos();
            }
            if is("load_dependent_friction") {
                dry += 0.5 * s * load.abs();
                force += load;
            }
            if is("gear_loss") {
                dry += 0.25 * s * (GAIN * u).abs();
            }
            if is("quadratic_drag") {
                force -= 4e-7 * s * v * v.abs();
            }
            if is("position_dependent_damping") {
                force -= 6e-6 * s * (1.0 + (0.15 * q).sin()) * v;
            }
            if is("creeping_spring") {
                z += (v - z / 0.8) * dt;
                force -= 8e-5 * s * z;
            }
            if is("heavier_load") && t > 0.45 * setup.seconds {
                j *= 1.0 + 0.5 * s;
            }
            if is("sticky_place") {
                force -= 3e-5 * s * (-0.5 * ((q - 4.0) / 1.3).powi(2)).exp() * v;
            }
            if is("cogging") {
                force += s * (1.2e-4 * (4.0 * (q + zero)).sin() + 0.9e-4 * (12.0 * (q + zero) + 0.5).sin());
            }
            if is("mass_imbalance") {
                force += 2e-4 * s * (q + zero).sin();
            }
            if is("tilt_gravity") {
                force += 5e-4 * s * tilt.sin();
            }
            if is("position_spring") {
                force -= 4e-5 * s * (q + zero - start);
            }
            if is("roller_slip") {
                let ceiling = GAIN * 0.06 / (0.5 + s);
                let through = force;
                if through.abs() > ceiling {
                    force = through.signum() * 0.8 * ceiling;
                }
            }
            if is("sine_of_speed") {
                force += 2e-4 * s * (0.7 * v).sin();
            }
            if is("bump_of_travel_times_speed") {
                let x = (q - 2.0) * v / 40.0;
                force += 2e-4 * s * 2.0 * x / (1.0 + x * x);
            }
            if is("outside") {
                // A hysteresis that follows the slow past of the speed: nothing in the library.
                z += (v - z) * dt / 0.08;
                force -= 2.0e-4 * s * (z * 0.5).tanh() * (1.0 + 0.5 * (0.5 * z).cos());
            }
            if is("drive_compliance") || is("backlash") {
                let jl = 0.45 * J;
                let jm = J - jl;
                let gap = if is("backlash") { 0.04 * s } else { 0.0 };
                let k = if is("backlash") {
                    jl * (std::f64::consts::TAU * 120.0).powi(2)
                } else {
                    jl * (std::f64::consts::TAU * 25.0 / s.sqrt()).powi(2)
                };
                let twist = q - ql;
                let wound = if twist > 0.5 * gap {
                    twist - 0.5 * gap
                } else if twist < -0.5 * gap {
                    twist + 0.5 * gap
                } else {
                    0.0
                };
                let spring =
                    if wound != 0.0 { k * wound + 2.0 * 0.05 * (k * jl).sqrt() * (v - vl) } else { 0.0 };
                let half = 0.5 * dry;
                let (a, al) = ((force + 0.5 * B * v - spring) / jm, (spring - 0.5 * B * vl) / jl);
                step(&mut v, a, half / jm, dt);
                step(&mut vl, al, half / jl, dt);
                q += v * dt;
                ql += vl * dt;
                continue;
            }
            if is("grip") || is("grip_of_a_light_needle") {
                // Another standing force in each recording.
                let standing = C * if part.is_multiple_of(2) { 0.2 } else { -0.1 };
                let part = if is("grip") { 0.55 } else { 0.3 };
                let (jl, jm, half) = (part * J, (1.0 - part) * J, 0.5 * dry);
                let traction = GRIP / s * ((v - vl) / 0.2).tanh();
                let (a, al) =
                    ((force + 0.5 * B * v - traction) / jm, (traction - 0.5 * B * vl + standing) / jl);
                step(&mut v, a, half / jm, dt);
                step(&mut vl, al, half / jl, dt);
                q += v * dt;
                continue;
            }
            if is("presliding_friction") || is("bristles_without_damping") {
                let g = dry;
                let stiffness = dry / (0.05 * s);
                let rate = v - stiffness * v.abs() / g * z;
                z += rate * dt;
                let damping = if is("presliding_friction") { 1e-6 } else { 0.0 };
                let bristle = stiffness * z + damping * rate;
                v += (force - bristle) / J * dt;
                q += v * dt;
                continue;
            }
            if is("bristles_of_many_lengths") {
                let most = dry / elements.len() as f64;
                for (i, element) in elements.iter_mut().enumerate() {
                    let length = 0.05 * s * 10f64.powf(i as f64 / 8.0 - 0.5);
                    *element = (*element + most / length * v * dt).clamp(-most, most);
                }
                v += (force - elements.iter().sum::<f64>()) / J * dt;
                q += v * dt;
                continue;
            }
            step(&mut v, force / j, dry / j, dt);
            q += v * dt;
        }
    }
    out
}

/// One step of a mass under a force and a dry friction that sticks (both divided by the mass).
fn step(v: &mut f64, a: f64, dry: f64, dt: f64) {
    if *v == 0.0 {
        if a.abs() > dry {
            *v = (a - a.signum() * dry) * dt;
        }
        return;
    }
    let next = *v + (a - v.signum() * dry) * dt;
    *v = if next * *v < 0.0 && a.abs() <= dry { 0.0 } else { next };
}
