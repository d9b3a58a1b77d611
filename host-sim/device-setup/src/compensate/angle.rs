//! Finds the rotor's angle without an index: while the roller turns slowly once to and fro, the
//! motor's torque swings with the waves that were diagnosed, and there is one place from which they
//! fit. Pure calculation.
//!
//! For each order N the torque beyond the inertia's, less its mean in each direction, is projected
//! onto `e^{−iNθ}`. The angle is the shift at which the diagnosed waves and these projections agree
//! best.

use control_core::TICK_HZ;
use control_core::controller::Sample;
use device_sim::error::Error;
use std::f64::consts::TAU;

/// Agreement that is believed: the cosine between what was diagnosed and what the slow turn shows.
const BELIEVED: f64 = 0.7;
/// The smallest and the largest share of their size that counts as agreement.
const SIZE: std::ops::Range<f64> = 0.5..2.0;
/// Ticks over which a speed is taken, and of the rows that are used, one in so many.
const SPAN: usize = 100;
const STRIDE: usize = 10;
/// Slower than this, rad/s, the roller may stick.
const MOVING: f64 = 0.2;

/// The count at which the rotor's angle is zero, and how well it is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Angle {
    /// Counts past the zero.
    pub count: i32,
    /// The agreement of the waves, −1 to 1.
    pub agreement: f64,
}

/// From the samples of a slow turn. `waves` are order, amplitude in N·m, phase in rad;
/// `torque_per_code` is N·m, `middle` the code of no torque, `inertia` kg·m².
pub fn find(
    samples: &[Sample],
    waves: &[(u16, f64, f64)],
    (counts_per_turn, torque_per_code, middle, inertia): (f64, f64, f64, f64),
) -> Result<Angle, Error> {
    let rad = TAU / counts_per_turn;
    let rows = rows(samples, rad, |code| (code - middle) * torque_per_code, inertia);
    let seen = seen_waves(&rows, waves);
    let size = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>().sqrt();
    let expected = size(&mut waves.iter().map(|wave| wave.1));
    let norm = expected * size(&mut seen.iter().map(|s| s.0.hypot(s.1)));
    let agreement = |shift: f64| {
        let sum: f64 = waves
            .iter()
            .zip(&seen)
            .map(|(&(order, amplitude, phase), &(sin, cos))| {
                let (s, c) = (phase - f64::from(order) * shift).sin_cos();
                amplitude * (sin * c + cos * s)
            })
            .sum();
        sum / norm.max(1e-300)
    };
    let best = (0..counts_per_turn as i32)
        .map(|count| Angle { count, agreement: agreement(f64::from(count) * rad) })
        .max_by(|a, b| a.agreement.total_cmp(&b.agreement))
        .filter(|best| {
            best.agreement >= BELIEVED && SIZE.contains(&(best.agreement * norm / expected.powi(2)))
        });
    best.ok_or_else(|| {
        Error::failed(
            "the rotor's angle was not found: a slow turn does not show the cogging that was diagnosed; characterise and diagnose again",
        )
    })
}

/// One row of the slow turn in motion.
struct Row {
    /// Angle of the roller in rad.
    angle: f64,
    /// Torque beyond the inertia's, in N·m.
    torque: f64,
    inwards: bool,
}

/// The rows in which the roller moves. `rad` is the angle of a count, `torque` turns a code into
/// N·m, `inertia` is in kg·m².
fn rows(samples: &[Sample], rad: f64, torque: impl Fn(f64) -> f64, inertia: f64) -> Vec<Row> {
    let speed = |at: usize| {
        let moved = f64::from(samples[at + SPAN / 2].count) - f64::from(samples[at - SPAN / 2].count);
        moved * rad * f64::from(TICK_HZ) / SPAN as f64
    };
    (SPAN..samples.len().saturating_sub(SPAN))
        .step_by(STRIDE)
        .filter_map(|at| {
            let v = speed(at);
            let a = (speed(at + SPAN / 2) - speed(at - SPAN / 2)) * f64::from(TICK_HZ) / SPAN as f64;
            let torque = torque(f64::from(samples[at].dac)) - inertia * a;
            let angle = (f64::from(samples[at].count) + 0.5) * rad;
            (v.abs() > MOVING).then_some(Row { angle, torque, inwards: v > 0.0 })
        })
        .collect()
}

/// The projections of the torque onto sine and cosine of each wave, in N·m; the mean of each
/// direction is left out.
fn seen_waves(rows: &[Row], waves: &[(u16, f64, f64)]) -> Vec<(f64, f64)> {
    let mean = |inwards: bool| {
        let (sum, count) = rows
            .iter()
            .filter(|row| row.inwards == inwards)
            .fold((0.0, 0.0_f64), |(sum, count), row| (sum + row.torque, count + 1.0));
        sum / count.max(1.0)
    };
    let means = [mean(false), mean(true)];
    waves
        .iter()
        .map(|&(order, ..)| {
            let sum = rows.iter().fold((0.0, 0.0), |(sin, cos), row| {
                let (s, c) = (f64::from(order) * row.angle).sin_cos();
                // What the motor has to give is the opposite of what the mechanism adds.
                let left = means[usize::from(row.inwards)] - row.torque;
                (sin + left * s, cos + left * c)
            });
            let norm = 2.0 / rows.len().max(1) as f64;
            (sum.0 * norm, sum.1 * norm)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A turn to and fro at 1 rad/s of a mechanism whose waves begin at `index` counts, with dry
    /// friction and noise.
    fn turn(waves: &[(u16, f64, f64)], index: i32) -> Vec<Sample> {
        let rad = TAU / 4_000.0;
        (0..130_000)
            .map(|tick| {
                let into = f64::from(tick) / 1e4;
                let angle = if into < 6.5 { into } else { 13.0 - into };
                let count = (angle / rad).floor();
                let at = (count - f64::from(index)) * rad;
                let force: f64 = waves.iter().map(|w| w.1 * (f64::from(w.0) * at + w.2).sin()).sum();
                let noise = 2e-5 * (f64::from(tick * 7_919 % 1_000) / 500.0 - 1.0);
                let torque = 4e-4 * if into < 6.5 { 1.0 } else { -1.0 } - force + noise;
                let dac = (2_048.0 + torque / 1.4069e-5).round() as u16;
                Sample { count: count as i32, dac, state: 6, tilt_mrad: 0 }
            })
            .collect()
    }

    const SCALE: (f64, f64, f64, f64) = (4_000.0, 1.4069e-5, 2_048.0, 1.5e-6);

    #[test]
    fn a_slow_turn_shows_the_angle_to_a_degree() {
        // Orders without a common divisor: one place a turn.
        let waves = [(7, 5e-4, 0.9), (12, 3e-4, -2.0), (1, 1e-4, 0.3)];
        for index in [0, 123, 2_777, 3_999] {
            let found = find(&turn(&waves, index), &waves, SCALE).expect("it shows");
            let off = (found.count - index + 2_000).rem_euclid(4_000) - 2_000;
            assert!(off.abs() <= 11 && found.agreement > 0.95, "{found:?} for {index}");
        }
    }

    #[test]
    fn a_mechanism_without_these_waves_is_not_believed() {
        let waves = [(7, 5e-4, 0.9), (12, 3e-4, -2.0)];
        let other = [(5, 5e-4, 0.9), (9, 3e-4, -2.0)];
        assert!(find(&turn(&other, 0), &waves, SCALE).is_err());
        let weak = waves.map(|(order, amplitude, phase)| (order, 0.3 * amplitude, phase));
        assert!(find(&turn(&weak, 0), &waves, SCALE).is_err());
        assert!(find(&[], &waves, SCALE).is_err());
    }
}
