//! Excitations: what is played on a machine. Each kind is what an engineer would play to show some
//! effects and not others.

use super::drive::{Drive, Loop, Profile, Segment, Tones};
use super::machine::Machine;
use crate::rng::Rng;

/// Kinds of excitation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// Constant speeds over two decades, both ways, under a loop.
    Staircase,
    /// Slow back and forth over much of the travel, at a few speeds.
    Triangle,
    /// Reversals of growing amplitude.
    Ladder,
    /// Point-to-point moves at random.
    Trapezoids,
    /// Point-to-point moves that ask the drive for much.
    Hard,
    /// Open loop: slow waves and a multisine up to the residual bandwidth (linear machines: under a
    /// loop).
    Multisine,
    /// Moves under a loop with a multisine injected into the command.
    Injected,
    /// Open-loop command levels (linear machines: [`Kind::Staircase`]).
    Levels,
    /// Holds with breakaway ramps, open loop (linear machines: [`Kind::Ladder`]).
    HoldRamp,
    /// One slow sine only: poor on purpose.
    OneSine,
    /// One speed, one direction only: poor on purpose.
    OneSpeed,
    /// A multisine below 2 Hz only: poor on purpose.
    SlowMultisine,
    /// Triangles at one single speed: poor on purpose.
    OneTriangle,
}

/// The excitations that an engineer may play on any machine, whatever is wrong with it.
pub(crate) const RICH: [Kind; 9] = [
    Kind::Staircase,
    Kind::Triangle,
    Kind::Ladder,
    Kind::Trapezoids,
    Kind::Hard,
    Kind::Multisine,
    Kind::Injected,
    Kind::Levels,
    Kind::HoldRamp,
];

/// Plays `kinds` one after another over the recording's duration, in shares by chance.
pub(crate) fn programme(kinds: &[Kind], m: &Machine, rng: &mut Rng) -> Vec<Segment> {
    let shares: Vec<f64> = kinds.iter().map(|_| rng.range(0.7, 1.3)).collect();
    let total: f64 = shares.iter().sum();
    let mut from = 0.0;
    kinds
        .iter()
        .zip(shares)
        .map(|(kind, share)| {
            let part = Machine { duration: m.duration * share / total, ..m.clone() };
            let (drive, control) = build(*kind, &part, rng);
            let segment = Segment { from, length: part.duration, drive, control };
            from += part.duration;
            segment
        })
        .collect()
}

/// Builds an excitation of the kind for the machine, over the machine's duration.
pub(crate) fn build(kind: Kind, m: &Machine, rng: &mut Rng) -> (Drive, Option<Loop>) {
    let kind = match kind {
        Kind::Multisine if !m.rotary => Kind::Injected,
        Kind::SlowMultisine if !m.rotary => Kind::OneSine,
        Kind::Levels if !m.rotary => Kind::Staircase,
        Kind::HoldRamp if !m.rotary => Kind::Ladder,
        other => other,
    };
    let bench = ExcitedMachine::new(m, rng);
    let drive = match kind {
        Kind::Staircase => bench.staircase(rng),
        Kind::Triangle => {
            let passes = 2 + rng.below(2) as i32;
            bench.triangles(passes, rng)
        }
        Kind::OneTriangle => bench.triangles(1, rng),
        Kind::Ladder => bench.ladder(),
        Kind::Trapezoids => bench.moves(false, rng),
        Kind::Hard => bench.moves(true, rng),
        Kind::Injected => bench.injected_moves(rng),
        Kind::Multisine => bench.multisine(rng),
        Kind::Levels => bench.levels(rng),
        Kind::HoldRamp => bench.hold_ramps(rng),
        Kind::OneSine => bench.one_sine(rng),
        Kind::OneSpeed => bench.one_speed(rng),
        Kind::SlowMultisine => bench.slow_multisine(rng),
    };
    let control = drive.profile.is_some().then(|| bench.control(rng));
    (drive, control)
}

/// The machine with the numbers that its excitations share.
struct ExcitedMachine<'a> {
    m: &'a Machine,
    /// Level of the dry friction, as a force.
    coulomb: f64,
    /// Command for one unit of force.
    per_force: f64,
    /// The largest acceleration that the drive is asked for, u/s².
    strongest: f64,
    /// Acceleration at the changes of speed, u/s².
    acceleration: f64,
    /// The residual bandwidth, Hz.
    top_hz: f64,
}

impl<'a> ExcitedMachine<'a> {
    fn new(m: &'a Machine, rng: &mut Rng) -> Self {
        let strongest = 0.45 * m.limit * m.plant.gain / m.plant.inertia;
        Self {
            m,
            coulomb: m.plant.dry.coulomb,
            per_force: 1.0 / m.plant.gain,
            strongest,
            acceleration: (m.friction_acceleration() * rng.range(2.0, 5.0)).min(strongest),
            top_hz: m.residual_bandwidth(),
        }
    }

    /// Returns a drive that follows (speed, duration) one after another.
    fn speeds(&self, segments: &[(f64, f64)], acceleration: f64) -> Drive {
        let profile = Profile::from_speeds(segments, acceleration, self.m.duration);
        Drive { profile: Some(profile), ..Drive::default() }
    }

    fn staircase(&self, rng: &mut Rng) -> Drive {
        let steps = 6 + rng.below(2);
        let dwell = self.m.duration / (2 * steps) as f64;
        let mut speeds: Vec<f64> = (0..steps)
            .map(|i| self.m.top_speed * 10_f64.powf(-2.0 * i as f64 / (steps - 1) as f64))
            .collect();
        if rng.chance(0.5) {
            speeds.reverse();
        }
        let mut segments = Vec::new();
        for speed in speeds {
            let legs = (speed * dwell / self.m.travel).ceil().max(1.0);
            push_legs(&mut segments, speed, legs, dwell / legs);
        }
        self.speeds(&segments, self.acceleration)
    }

    /// Triangles at `passes` speeds, each 2.2 times the one before.
    fn triangles(&self, passes: i32, rng: &mut Rng) -> Drive {
        let first = rng.range(0.08, 0.2);
        let mut segments = Vec::new();
        for i in 0..passes {
            let speed = self.m.top_speed * first * 2.2_f64.powi(i);
            let slice = self.m.duration / f64::from(passes);
            let legs = (speed * slice / (2.0 * self.m.travel)).ceil().max(1.0);
            push_legs(&mut segments, speed, legs, 0.5 * slice / legs);
        }
        self.speeds(&segments, self.acceleration)
    }

    fn ladder(&self) -> Drive {
        let (v, travel) = (self.m.top_speed, self.m.travel);
        let count = 24;
        let each = self.m.duration / f64::from(count);
        let (small, large) = (0.004 * v * each, 0.5 * (v * each).min(travel));
        let segments: Vec<(f64, f64)> = (0..count)
            .map(|i| {
                let stage = f64::from(i / 2) / f64::from(count / 2 - 1);
                let amplitude = small.max(1e-12) * (large / small).powf(stage);
                (amplitude / each * if i % 2 == 0 { 1.0 } else { -1.0 }, each)
            })
            .collect();
        self.speeds(&segments, self.acceleration)
    }

    /// Point-to-point moves with pauses; `hard`: fast, with hardly a pause.
    fn moves(&self, hard: bool, rng: &mut Rng) -> Drive {
        let (v, travel, duration) = (self.m.top_speed, self.m.travel, self.m.duration);
        let ac = self.m.friction_acceleration();
        let acceleration = if hard { 0.8 * self.strongest.min(ac * 9.0) } else { self.acceleration };
        let mut segments = vec![(0.0, 0.1)];
        let (mut place, mut elapsed) = (0.0, 0.1);
        while elapsed < duration {
            let speed = if hard { v * rng.range(0.6, 1.2) } else { v * rng.log_range(0.08, 1.0) };
            let mut target = travel * rng.range(0.0, 1.0);
            // Moves of a length that the time allows.
            let longest = speed * duration / 6.0;
            target = place + (target - place).clamp(-longest, longest);
            let time = ((target - place) / speed).abs().max(0.02);
            segments.push(((target - place) / time, time));
            let pause = if hard { 0.02 } else { rng.range(0.02, 0.25) };
            segments.push((0.0, pause));
            elapsed += time + pause;
            place = target;
        }
        self.speeds(&segments, acceleration)
    }

    fn injected_moves(&self, rng: &mut Rng) -> Drive {
        let mut drive = self.moves(false, rng);
        let rms = self.coulomb * rng.range(0.8, 1.6) * self.per_force;
        drive.tones = Tones::multisine(rng, rms, 1.0_f64.min(0.1 * self.top_hz), 1.1 * self.top_hz, 24);
        drive
    }

    /// Returns the dry friction and a share of the viscous friction at top speed, as a force.
    fn friction(&self) -> f64 {
        self.coulomb + 0.6 * self.m.plant.viscous * self.m.top_speed
    }

    fn multisine(&self, rng: &mut Rng) -> Drive {
        let slow = self.friction() * rng.range(0.9, 1.4) * self.per_force;
        let rms = self.coulomb * rng.range(0.7, 1.5) * self.per_force;
        let mut tones = Tones::multisine(rng, rms, 0.7_f64.min(0.1 * self.top_hz), 1.1 * self.top_hz, 28);
        let hz = rng.range(2.0, 4.0) / self.m.duration;
        let phase = rng.range(0.0, 6.0);
        tones.tones.push((slow, hz, phase));
        tones.tones.push((0.5 * slow, hz * rng.range(2.2, 3.4), phase * 2.0));
        Drive { tones, ..Drive::default() }
    }

    fn levels(&self, rng: &mut Rng) -> Drive {
        let (coulomb, per_force) = (self.coulomb, self.per_force);
        let count = 12;
        let each = self.m.duration / f64::from(count);
        let levels = (0..count)
            .map(|i| {
                let level = coulomb * rng.range(1.05, 1.3)
                    + self.m.plant.viscous * self.m.top_speed * rng.range(0.05, 1.0)
                    + coulomb * 0.2 * f64::from(i % 4);
                (level * per_force * if i % 2 == 0 { 1.0 } else { -1.0 }, each)
            })
            .collect();
        let tones = Tones::multisine(rng, 0.3 * coulomb * per_force, 0.5, 0.5 * self.top_hz, 10);
        Drive { levels, tones, ..Drive::default() }
    }

    fn hold_ramps(&self, rng: &mut Rng) -> Drive {
        let ramp = (self.m.duration / 14.0).max(0.4);
        let mut side = rng.sign();
        let mut elapsed = 0.0;
        let mut levels = vec![(0.0, 0.05)];
        while elapsed < self.m.duration {
            let level = self.coulomb * rng.range(1.3, 2.2) * self.per_force * side;
            for step in [(0.0, 0.15 * ramp), (level, ramp), (0.0, 0.05 * ramp)] {
                levels.push(step);
                elapsed += step.1;
            }
            side = -side;
        }
        Drive { levels, ramps: true, ..Drive::default() }
    }

    fn one_sine(&self, rng: &mut Rng) -> Drive {
        let hz = rng.range(4.0, 7.0) / self.m.duration;
        let amplitude = (0.5 * self.m.top_speed / (std::f64::consts::TAU * hz)).min(0.5 * self.m.travel);
        let tones = Tones { tones: vec![(amplitude, hz, rng.range(0.0, 6.0))] };
        let profile = Profile::from_tones(&tones, self.m.duration);
        Drive { profile: Some(profile), ..Drive::default() }
    }

    fn one_speed(&self, rng: &mut Rng) -> Drive {
        let t = self.m.duration;
        let speed = (self.m.top_speed * rng.range(0.2, 0.6)).min(self.m.travel / t);
        self.speeds(&[(speed, t)], self.acceleration)
    }

    fn slow_multisine(&self, rng: &mut Rng) -> Drive {
        let slow = self.friction() * self.per_force;
        let tones = Tones::multisine(rng, 1.2 * slow, 2.0 / self.m.duration, 1.5, 6);
        Drive { tones, ..Drive::default() }
    }

    /// Draws the loop that follows a motion.
    fn control(&self, rng: &mut Rng) -> Loop {
        let plant = &self.m.plant;
        let velocity_loop = rng.chance(0.3);
        let damping = if velocity_loop { rng.range(1.2, 2.0) } else { rng.range(0.7, 1.0) };
        let integral = if rng.chance(0.6) { rng.range(0.05, 0.2) } else { 0.0 };
        let bandwidth = self.m.bandwidth * rng.range(0.7, 1.0);
        let mut control = Loop::tuned(plant.inertia, plant.gain, bandwidth, damping, integral);
        control.most = 0.3 * self.m.limit;
        if rng.chance(0.4) {
            let off = rng.range(0.8, 1.2);
            control.forward = (
                plant.inertia * self.per_force * off,
                plant.viscous * self.per_force * off,
                0.7 * self.coulomb * self.per_force,
            );
        }
        control
    }
}

/// Adds `legs` runs out and back at `speed`, each run of so many seconds.
fn push_legs(segments: &mut Vec<(f64, f64)>, speed: f64, legs: f64, seconds: f64) {
    for _ in 0..legs as usize {
        segments.push((speed, seconds));
        segments.push((-speed, seconds));
    }
}
