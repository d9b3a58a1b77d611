//! Excitations: what is played on a machine. Each kind is what an engineer would play to show some effects and not others.

use super::drive::{Drive, Loop, Profile, Segment, Tones};
use super::machine::Machine;
use super::simulate::Series;
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
    /// Open loop: slow waves and a multisine up to the residual bandwidth (linear machines: under a loop).
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
    let (ac, coulomb) = (m.friction_acceleration(), m.plant.dry.coulomb);
    let per_force = 1.0 / m.plant.gain;
    let (v, travel, t) = (m.top_speed, m.travel, m.duration);
    let strongest = 0.45 * m.limit * m.plant.gain / m.plant.inertia;
    let acceleration = (ac * rng.range(2.0, 5.0)).min(strongest);
    let top_hz = m.residual_bandwidth();
    let mut drive = Drive::default();
    match kind {
        Kind::Staircase => {
            let steps = 6 + rng.below(2);
            let dwell = t / (2 * steps) as f64;
            let mut speeds: Vec<f64> =
                (0..steps).map(|i| v * 10_f64.powf(-2.0 * i as f64 / (steps - 1) as f64)).collect();
            if rng.chance(0.5) {
                speeds.reverse();
            }
            let mut segments = Vec::new();
            for speed in speeds {
                let legs = (speed * dwell / travel).ceil().max(1.0);
                for _ in 0..legs as usize {
                    segments.push((speed, dwell / legs));
                    segments.push((-speed, dwell / legs));
                }
            }
            drive.profile = Some(Profile::from_speeds(&segments, acceleration, t));
        }
        Kind::Triangle | Kind::OneTriangle => {
            let passes: i32 = if kind == Kind::OneTriangle { 1 } else { 2 + rng.below(2) as i32 };
            let first = rng.range(0.08, 0.2);
            let mut segments = Vec::new();
            for i in 0..passes {
                let speed = v * first * 2.2_f64.powi(i);
                let slice = t / f64::from(passes);
                let legs = (speed * slice / (2.0 * travel)).ceil().max(1.0);
                for _ in 0..legs as usize {
                    segments.push((speed, 0.5 * slice / legs));
                    segments.push((-speed, 0.5 * slice / legs));
                }
            }
            drive.profile = Some(Profile::from_speeds(&segments, acceleration, t));
        }
        Kind::Ladder => {
            let count = 24;
            let each = t / f64::from(count);
            let (small, large) = (0.004 * v * each, 0.5 * (v * each).min(travel));
            let segments: Vec<(f64, f64)> = (0..count)
                .map(|i| {
                    let stage = f64::from(i / 2) / f64::from(count / 2 - 1);
                    let amplitude = small.max(1e-12) * (large / small).powf(stage);
                    (amplitude / each * if i % 2 == 0 { 1.0 } else { -1.0 }, each)
                })
                .collect();
            drive.profile = Some(Profile::from_speeds(&segments, acceleration, t));
        }
        Kind::Trapezoids | Kind::Hard | Kind::Injected => {
            let hard = kind == Kind::Hard;
            let acceleration = if hard { 0.8 * strongest.min(ac * 9.0) } else { acceleration };
            let mut segments = vec![(0.0, 0.1)];
            let (mut place, mut elapsed) = (0.0, 0.1);
            while elapsed < t {
                let speed = if hard { v * rng.range(0.6, 1.2) } else { v * rng.log_range(0.08, 1.0) };
                let mut target = travel * rng.range(0.0, 1.0);
                // Moves of a length that the time allows.
                let longest = speed * t / 6.0;
                target = place + (target - place).clamp(-longest, longest);
                let time = ((target - place) / speed).abs().max(0.02);
                segments.push(((target - place) / time, time));
                let pause = if hard { 0.02 } else { rng.range(0.02, 0.25) };
                segments.push((0.0, pause));
                elapsed += time + pause;
                place = target;
            }
            drive.profile = Some(Profile::from_speeds(&segments, acceleration, t));
            if kind == Kind::Injected {
                let rms = coulomb * rng.range(0.8, 1.6) * per_force;
                drive.tones = Tones::multisine(rng, rms, 1.0_f64.min(0.1 * top_hz), 1.1 * top_hz, 24);
            }
        }
        Kind::Multisine => {
            let slow = (coulomb + 0.6 * m.plant.viscous * v) * rng.range(0.9, 1.4) * per_force;
            let rms = coulomb * rng.range(0.7, 1.5) * per_force;
            drive.tones = Tones::multisine(rng, rms, 0.7_f64.min(0.1 * top_hz), 1.1 * top_hz, 28);
            let hz = rng.range(2.0, 4.0) / t;
            let phase = rng.range(0.0, 6.0);
            drive.tones.tones.push((slow, hz, phase));
            drive.tones.tones.push((0.5 * slow, hz * rng.range(2.2, 3.4), phase * 2.0));
        }
        Kind::Levels => {
            let count = 12;
            let each = t / f64::from(count);
            drive.levels = (0..count)
                .map(|i| {
                    let level = coulomb * rng.range(1.05, 1.3)
                        + m.plant.viscous * v * rng.range(0.05, 1.0)
                        + coulomb * 0.2 * f64::from(i % 4);
                    (level * per_force * if i % 2 == 0 { 1.0 } else { -1.0 }, each)
                })
                .collect();
            drive.tones = Tones::multisine(rng, 0.3 * coulomb * per_force, 0.5, 0.5 * top_hz, 10);
        }
        Kind::HoldRamp => {
            drive.ramps = true;
            let ramp = (t / 14.0).max(0.4);
            let mut side = rng.sign();
            let mut elapsed = 0.0;
            drive.levels.push((0.0, 0.05));
            while elapsed < t {
                let level = coulomb * rng.range(1.3, 2.2) * per_force * side;
                for step in [(0.0, 0.15 * ramp), (level, ramp), (0.0, 0.05 * ramp)] {
                    drive.levels.push(step);
                    elapsed += step.1;
                }
                side = -side;
            }
        }
        Kind::OneSine => {
            let hz = rng.range(4.0, 7.0) / t;
            let amplitude = (0.5 * v / (std::f64::consts::TAU * hz)).min(0.5 * travel);
            let tones = Tones { tones: vec![(amplitude, hz, rng.range(0.0, 6.0))] };
            drive.profile = Some(Profile::from_tones(&tones, t));
        }
        Kind::OneSpeed => {
            let speed = (v * rng.range(0.2, 0.6)).min(travel / t);
            drive.profile = Some(Profile::from_speeds(&[(speed, t)], acceleration, t));
        }
        Kind::SlowMultisine => {
            let slow = (coulomb + 0.6 * m.plant.viscous * v) * per_force;
            drive.tones = Tones::multisine(rng, 1.2 * slow, 2.0 / t, 1.5, 6);
        }
    }
    let control = drive.profile.is_some().then(|| {
        let velocity_loop = rng.chance(0.3);
        let damping = if velocity_loop { rng.range(1.2, 2.0) } else { rng.range(0.7, 1.0) };
        let integral = if rng.chance(0.6) { rng.range(0.05, 0.2) } else { 0.0 };
        let mut control =
            Loop::tuned(m.plant.inertia, m.plant.gain, m.bandwidth * rng.range(0.7, 1.0), damping, integral);
        control.most = 0.3 * m.limit;
        if rng.chance(0.4) {
            let off = rng.range(0.8, 1.2);
            control.forward = (
                m.plant.inertia * per_force * off,
                m.plant.viscous * per_force * off,
                0.7 * coulomb * per_force,
            );
        }
        control
    });
    (drive, control)
}

/// A tilt that goes slowly between random inclinations, rad.
pub(crate) fn tilt_sweep(m: &Machine, rng: &mut Rng) -> Series {
    let interval = 0.01;
    let count = (m.duration / interval) as usize + 2;
    let stops = 5;
    let values: Vec<f64> = (0..=stops).map(|_| rng.range(-0.7, 0.7)).collect();
    let values = (0..count)
        .map(|i| {
            let x = i as f64 / count as f64 * f64::from(stops);
            let k = (x as usize).min(values.len() - 2);
            let s = x - k as f64;
            values[k] + (values[k + 1] - values[k]) * s * s * (3.0 - 2.0 * s)
        })
        .collect();
    Series { interval, values }
}

/// Pushes of a hand or a press: smooth bumps of either sign, of rms `size` all together.
pub(crate) fn pushes(m: &Machine, size: f64, rng: &mut Rng) -> Series {
    let interval = 0.002;
    let count = (m.duration / interval) as usize + 2;
    let bumps: Vec<(f64, f64, f64)> = (0..(m.duration / 0.7) as usize + 3)
        .map(|_| {
            let amplitude = rng.sign() * rng.range(0.5, 2.0);
            (amplitude, rng.range(0.0, m.duration), rng.range(0.08, 0.35))
        })
        .collect();
    let mut values: Vec<f64> = (0..count)
        .map(|i| {
            let t = i as f64 * interval;
            bumps.iter().map(|&(a, c, w)| a * (-0.5 * ((t - c) / w).powi(2)).exp()).sum()
        })
        .collect();
    let rms = (values.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt();
    values.iter_mut().for_each(|x| *x *= size / rms);
    Series { interval, values }
}

/// Noise and wander of the force with unit rms: band-limited noise, and a slow part at 30–60 % of it.
pub(crate) fn disturbance(m: &Machine, rng: &mut Rng) -> Series {
    let interval: f64 = 5e-4;
    let count = (m.duration / interval) as usize + 2;
    let corner = rng.log_range(5e-4, 6e-3);
    let keep = (-interval / corner).exp();
    let slow_corner: f64 = rng.range(1.5, 5.0);
    let slow_keep = (-interval / slow_corner).exp();
    let slow_share = rng.range(0.3, 0.6);
    let (mut fast, mut slow, mut slower) = (0.0, 0.0, 0.0);
    let (mut fasts, mut slows) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for _ in 0..count {
        fast = keep * fast + rng.normal();
        slow = slow_keep * slow + rng.normal();
        slower += (slow - slower) * (interval / (0.3 * slow_corner));
        fasts.push(fast);
        slows.push(slower);
    }
    let rms = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt().max(1e-300);
    let (a, b) = (1.0 / rms(&fasts), slow_share / rms(&slows));
    let total = (1.0 + slow_share * slow_share).sqrt();
    Series { interval, values: fasts.iter().zip(&slows).map(|(f, s)| (f * a + s * b) / total).collect() }
}

/// A strong disturbance that depends on nothing recorded: noise of unit rms below a few Hz.
pub(crate) fn rough_disturbance(m: &Machine, rng: &mut Rng) -> Series {
    let interval: f64 = 1e-3;
    let count = (m.duration / interval) as usize + 2;
    let keep = (-interval / rng.log_range(0.01, 0.08)).exp();
    let mut state = 0.0;
    let mut values: Vec<f64> = (0..count)
        .map(|_| {
            state = keep * state + rng.normal();
            state
        })
        .collect();
    let rms = (values.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt();
    values.iter_mut().for_each(|x| *x /= rms);
    Series { interval, values }
}
