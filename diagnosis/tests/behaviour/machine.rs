//! The small simulator's machine: an axis with one effect beyond inertia, viscous and dry friction,
//! and what moves it.

use std::collections::VecDeque;
use std::f64::consts::TAU;

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

/// A supply, V, behind a winding of so many ohms, and its back-EMF, V·s/rad, at size 1.
const SUPPLY_V: f64 = 1.2;
const OHMS: f64 = 20.0;
const BACK_EMF: f64 = 0.015;

/// Square of the command under which a gain that falls with the copper loss settles at its full
/// change, A².
pub const WARM_SQUARE: f64 = 1e-3;

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

/// A triangle of changing height with a multisine on top.
pub(crate) struct Excitation {
    /// Frequency in Hz, phase in rad, amplitude.
    tones: Vec<(f64, f64, f64)>,
    /// Triangles a second.
    pace: f64,
}

impl Excitation {
    pub(crate) fn draw(random: &mut Random) -> Self {
        let tone = |i| (0.4 * 1.42f64.powi(i), random.between(0.0, TAU), random.between(0.6, 1.4));
        let tones = (0..14).map(tone).collect();
        Self { tones, pace: random.between(0.22, 0.3) }
    }

    fn wave(&self, t: f64) -> f64 {
        self.tones.iter().map(|(f, p, a)| a * (TAU * f * t + p).sin()).sum()
    }

    fn triangle(&self, t: f64) -> f64 {
        let x = (self.pace * t).fract();
        if x < 0.5 { 4.0 * x - 1.0 } else { 3.0 - 4.0 * x }
    }

    /// The place that a position loop follows, rad.
    pub(crate) fn reference(&self, t: f64) -> f64 {
        8.0 * self.triangle(t) * (1.0 + 0.5 * (0.31 * t).sin()) + 0.5 * (2.0 * t).sin() + 0.12 * self.wave(t)
    }

    /// The command without a loop, A.
    pub(crate) fn open_loop(&self, t: f64) -> f64 {
        0.024 * self.triangle(t) * 1.6 + 0.014 * self.wave(t)
    }
}

/// A time in s, the tilt in rad and the load in N·m at it.
pub(crate) struct Moment {
    pub(crate) t: f64,
    pub(crate) tilt: f64,
    pub(crate) load: f64,
}

impl Moment {
    pub(crate) fn at(t: f64) -> Self {
        Self { t, tilt: 0.6 * (0.7 * t).sin(), load: 8e-4 * (1.3 * t).sin() + 4e-4 * (4.1 * t).sin() }
    }
}

/// An axis: the angle and speed of its rotor, and the states of its effect.
pub(crate) struct Machine<'a> {
    setup: &'a Setup,
    part: u64,
    /// Steps of the integrator in a row of the recording.
    pub(crate) substeps: usize,
    dt: f64,
    /// The encoder's zero, rad.
    zero: f64,
    /// The angle at the start, by the encoder, rad.
    start: f64,
    q: f64,
    v: f64,
    /// The load's angle and speed, where a joint is between.
    ql: f64,
    vl: f64,
    /// A bristle's deflection or another memory of the motion.
    z: f64,
    elements: [f64; 9],
    queue: VecDeque<f64>,
    lagged: f64,
    lost: f64,
    heat: f64,
    slow: f64,
}

impl<'a> Machine<'a> {
    pub(crate) fn new(setup: &'a Setup, part: u64, zero: f64) -> Self {
        let substeps = (40_000.0 / setup.rate).round().max(1.0) as usize;
        Self {
            setup,
            part,
            substeps,
            dt: 1.0 / setup.rate / substeps as f64,
            zero,
            start: 0.0 + zero,
            q: 0.0,
            v: 0.0,
            ql: 0.0,
            vl: 0.0,
            z: 0.0,
            elements: [0.0; 9],
            queue: VecDeque::new(),
            lagged: 0.0,
            lost: 0.0,
            heat: 0.0,
            slow: 0.0,
        }
    }

    pub(crate) fn has(&self, effect: &str) -> bool {
        self.setup.effect == effect
    }

    /// The encoder's reading.
    pub(crate) fn counts(&mut self, random: &mut Random) -> f64 {
        let s = self.setup.size;
        let mut measured = self.q;
        if self.has("encoder_eccentricity") {
            measured += 0.03 * s * (self.q + self.zero).sin();
        }
        if self.has("missed_counts") {
            if self.v.abs() > 12.0 && random.unit() < 2.0 / self.setup.rate {
                self.lost += 10.0 * s * self.v.signum();
            }
            measured -= self.lost / COUNTS;
        }
        (measured * COUNTS + 0.3).floor()
    }

    /// A row's white noise, N·m; what disturbs slowly moves on.
    pub(crate) fn disturb(&mut self, now: &Moment, random: &mut Random) -> f64 {
        let Setup { size: s, rate, .. } = *self.setup;
        let noise = self.setup.disturbance * C * random.normal() * (rate / 1000.0).sqrt().max(1.0);
        if self.has("random_disturbance") {
            self.slow = self.slow * 0.999f64.powf(1000.0 / rate)
                + s * C * 0.045 * random.normal() * (1000.0 / rate).sqrt();
        }
        if self.has("hum") {
            self.slow = 2.5e-4 * s * (TAU * 13.7 * now.t).sin();
        }
        noise
    }

    /// One step of the integrator.
    pub(crate) fn advance(&mut self, now: &Moment, command: f64, noise: f64) {
        let u = self.effective(now, command);
        let dry = self.dry_friction(now, u);
        let plain = GAIN * u - B * self.v + noise + self.slow;
        let force = self.with_effect(now, plain);
        match self.setup.effect {
            "drive_compliance" | "backlash" => self.advance_joint(force, dry),
            "grip" | "grip_of_a_light_needle" => self.advance_grip(force, dry),
            "presliding_friction" | "bristles_without_damping" => self.advance_bristle(force, dry),
            "bristles_of_many_lengths" => self.advance_bristles(force, dry),
            _ => {
                let is_heavier = self.has("heavier_load") && now.t > 0.45 * self.setup.seconds;
                let j = if is_heavier { J * (1.0 + 0.5 * self.setup.size) } else { J };
                step(&mut self.v, force / j, dry / j, self.dt);
                self.q += self.v * self.dt;
            }
        }
    }

    /// The command as the drive passes it on.
    fn effective(&mut self, now: &Moment, u: f64) -> f64 {
        let (s, dt) = (self.setup.size, self.dt);
        match self.setup.effect {
            "command_deadband" if u.abs() < 0.012 * s => 0.0,
            "command_saturation" => {
                let limit = 0.06 / (0.5 + s);
                u.clamp(-limit, limit)
            }
            "supply_limit" => {
                // Volts: the supply less back-EMF, over the winding's resistance.
                let most = |sign: f64| (sign * SUPPLY_V - BACK_EMF * s * self.v) / OHMS;
                u.clamp(most(-1.0), most(1.0))
            }
            "command_delay" => {
                self.queue.push_back(u);
                let is_full = self.queue.len() as f64 * dt > 0.004 * s;
                if is_full { self.queue.pop_front().unwrap() } else { 0.0 }
            }
            "electrical_lag" => {
                self.lagged += (u - self.lagged) * dt / (0.004 * s);
                self.lagged
            }
            "gain_drift" => u * (1.0 - 0.3 * s * self.warmth(now)),
            "gain_drift_by_loss" => {
                self.heat += (u * u / WARM_SQUARE - self.heat) * dt / (0.2 * self.setup.seconds);
                u * (1.0 - 0.15 * s * self.heat)
            }
            "torque_ripple" => {
                let angle = self.q + self.zero;
                u * (1.0 + s * (0.2 * (3.0 * angle).sin() + 0.1 * (6.0 * angle + 1.0).sin()))
            }
            _ => u,
        }
    }

    /// From 0 at the start towards 1.
    fn warmth(&self, now: &Moment) -> f64 {
        1.0 - (-now.t / (0.3 * self.setup.seconds)).exp()
    }

    fn dry_friction(&self, now: &Moment, u: f64) -> f64 {
        let (s, q, v) = (self.setup.size, self.q, self.v);
        match self.setup.effect {
            "stribeck_friction" => C + 3e-4 * s * (-(v.abs() / 2.0).powf(1.4)).exp(),
            "asymmetric_friction" if v > 0.0 => C + 2e-4 * s,
            "friction_drift" => C * (1.0 - 0.5 * s * self.warmth(now)),
            "position_dependent_friction" => {
                C * (1.0 + 0.6 * s * (0.2 * q).sin() + 0.3 * s * (0.2 * q).cos())
            }
            "load_dependent_friction" => C + 0.5 * s * now.load.abs(),
            "gear_loss" => C + 0.25 * s * (GAIN * u).abs(),
            _ => C,
        }
    }

    /// A force on the rotor with what the effect adds.
    fn with_effect(&mut self, now: &Moment, force: f64) -> f64 {
        let (s, q, v, angle) = (self.setup.size, self.q, self.v, self.q + self.zero);
        match self.setup.effect {
            "asymmetric_friction" if v > 0.0 => force - 4e-6 * s * v,
            "load_dependent_friction" => force + now.load,
            "quadratic_drag" => force - 4e-7 * s * v * v.abs(),
            "position_dependent_damping" => force - 6e-6 * s * (1.0 + (0.15 * q).sin()) * v,
            "creeping_spring" => {
                self.z += (v - self.z / 0.8) * self.dt;
                force - 8e-5 * s * self.z
            }
            "sticky_place" => force - 3e-5 * s * (-0.5 * ((q - 4.0) / 1.3).powi(2)).exp() * v,
            "cogging" => force + s * (1.2e-4 * (4.0 * angle).sin() + 0.9e-4 * (12.0 * angle + 0.5).sin()),
            "mass_imbalance" => force + 2e-4 * s * angle.sin(),
            "tilt_gravity" => force + 5e-4 * s * now.tilt.sin(),
            "position_spring" => force - 4e-5 * s * (angle - self.start),
            "roller_slip" => {
                let ceiling = GAIN * 0.06 / (0.5 + s);
                if force.abs() > ceiling { force.signum() * 0.8 * ceiling } else { force }
            }
            "sine_of_speed" => force + 2e-4 * s * (0.7 * v).sin(),
            "bump_of_travel_times_speed" => {
                let x = (q - 2.0) * v / 40.0;
                force + 2e-4 * s * 2.0 * x / (1.0 + x * x)
            }
            "outside" => {
                // A hysteresis that follows the slow past of the speed: nothing in the library.
                self.z += (v - self.z) * self.dt / 0.08;
                force - 2.0e-4 * s * (self.z * 0.5).tanh() * (1.0 + 0.5 * (0.5 * self.z).cos())
            }
            _ => force,
        }
    }

    /// Rotor and load with a spring between them, and a gap where there is backlash.
    fn advance_joint(&mut self, force: f64, dry: f64) {
        let (s, dt) = (self.setup.size, self.dt);
        let jl = 0.45 * J;
        let jm = J - jl;
        let (gap, k) = if self.has("backlash") {
            (0.04 * s, jl * (TAU * 120.0).powi(2))
        } else {
            (0.0, jl * (TAU * 25.0 / s.sqrt()).powi(2))
        };
        let twist = self.q - self.ql;
        let wound = if twist > 0.5 * gap {
            twist - 0.5 * gap
        } else if twist < -0.5 * gap {
            twist + 0.5 * gap
        } else {
            0.0
        };
        let spring =
            if wound != 0.0 { k * wound + 2.0 * 0.05 * (k * jl).sqrt() * (self.v - self.vl) } else { 0.0 };
        let half = 0.5 * dry;
        let (a, al) = ((force + 0.5 * B * self.v - spring) / jm, (spring - 0.5 * B * self.vl) / jl);
        step(&mut self.v, a, half / jm, dt);
        step(&mut self.vl, al, half / jl, dt);
        self.q += self.v * dt;
        self.ql += self.vl * dt;
    }

    /// Rotor and load that a traction couples, which slips.
    fn advance_grip(&mut self, force: f64, dry: f64) {
        // Another standing force in each recording.
        let standing = C * if self.part.is_multiple_of(2) { 0.2 } else { -0.1 };
        let part = if self.has("grip") { 0.55 } else { 0.3 };
        let (jl, jm, half) = (part * J, (1.0 - part) * J, 0.5 * dry);
        let traction = GRIP / self.setup.size * ((self.v - self.vl) / 0.2).tanh();
        let (a, al) =
            ((force + 0.5 * B * self.v - traction) / jm, (traction - 0.5 * B * self.vl + standing) / jl);
        step(&mut self.v, a, half / jm, self.dt);
        step(&mut self.vl, al, half / jl, self.dt);
        self.q += self.v * self.dt;
    }

    /// Dry friction as a bristle that bends and slides.
    fn advance_bristle(&mut self, force: f64, dry: f64) {
        let stiffness = dry / (0.05 * self.setup.size);
        let rate = self.v - stiffness * self.v.abs() / dry * self.z;
        self.z += rate * self.dt;
        let damping = if self.has("presliding_friction") { 1e-6 } else { 0.0 };
        let bristle = stiffness * self.z + damping * rate;
        self.v += (force - bristle) / J * self.dt;
        self.q += self.v * self.dt;
    }

    /// Dry friction as bristles of nine lengths.
    fn advance_bristles(&mut self, force: f64, dry: f64) {
        let most = dry / self.elements.len() as f64;
        for (i, element) in self.elements.iter_mut().enumerate() {
            let length = 0.05 * self.setup.size * 10f64.powf(i as f64 / 8.0 - 0.5);
            *element = (*element + most / length * self.v * self.dt).clamp(-most, most);
        }
        self.v += (force - self.elements.iter().sum::<f64>()) / J * self.dt;
        self.q += self.v * self.dt;
    }
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
