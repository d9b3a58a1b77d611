//! The definition of an effect's strength.
//!
//! Let B be 100 Hz, or a twentieth of the sampling rate where that is less. In the two fit
//! recordings, on rows that move (no instant at rest, and faster than 1 % of the recording's rms
//! speed):
//!
//! - **noise** is the rms of what an observer of bandwidth B would see with the true model in hand:
//!   the disturbance and bias wander below B, plus inertia times the second derivative of the
//!   encoder's rounding below B; each recording's mean is left out.
//! - **effect** is the rms of the force that the nominal structure lacks, with its true values in
//!   it: inertia times true acceleration less the believed forces, below B (what a sensor effect
//!   does to the reading counts through inertia and viscosity), after taking out what a refit of
//!   the nominal terms within their declared uncertainty, and an offset of each recording, could
//!   imitate. The gain stays: scaling everything together is not a refit.
//!
//! Strength is effect / noise.

use super::plant::sign;
use super::simulate::{Believed, Row};
use crate::signal::{Normal, derivative, low_pass, rms};

/// Relative standard deviations that the rig declares.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Declared {
    pub(crate) inertia: f64,
    pub(crate) viscous: f64,
    pub(crate) coulomb: f64,
    pub(crate) gain: f64,
    pub(crate) weight: f64,
    /// Absolute.
    pub(crate) offset: f64,
    /// Each recording may have an offset of its own; false where the rig rules an offset out.
    pub(crate) offset_allowed: bool,
}

/// The measurements of a set of recordings.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Measured {
    pub(crate) effect: f64,
    pub(crate) noise: f64,
    /// Share of the rows that move.
    pub(crate) moving: f64,
}

struct Columns {
    effect: Vec<f64>,
    noise: Vec<f64>,
    acceleration: Vec<f64>,
    speed: Vec<f64>,
    direction: Vec<f64>,
    tilt: Vec<f64>,
    moving: Vec<bool>,
    seconds: f64,
}

/// Rows slower than this count as at rest: 1 % of the recording's rms speed.
pub(crate) fn slowest(rows: &[Row]) -> f64 {
    0.01 * (rows.iter().map(|r| r.v * r.v).sum::<f64>() / rows.len().max(1) as f64).sqrt()
}

fn columns(rows: &[Row], believed: &Believed, rate: f64, band: f64) -> Columns {
    let below = |x: Vec<f64>| low_pass(&x, rate, band);
    let of = |f: &dyn Fn(&Row) -> f64| rows.iter().map(f).collect::<Vec<f64>>();
    let (sensor, rounding) =
        (below(of(&|r| r.sensor_effect)), below(of(&|r| r.reading_error - r.sensor_effect)));
    let sensor_speed = derivative(&sensor, rate);
    let sensor_acceleration = derivative(&sensor_speed, rate);
    let rounding_acceleration = derivative(&derivative(&rounding, rate), rate);
    let mut effect = below(of(&|r| r.missing));
    for i in 0..effect.len() {
        effect[i] += believed.inertia * sensor_acceleration[i] + believed.viscous * sensor_speed[i];
    }
    let mut noise = below(of(&|r| r.disturbance));
    for i in 0..noise.len() {
        noise[i] += believed.inertia * rounding_acceleration[i];
    }
    let speed = of(&|r| r.v);
    let slowest = slowest(rows);
    // The ends carry the filter's transient.
    let edge = ((2.0 * rate / band) as usize).min(rows.len() / 10);
    let moving = rows
        .iter()
        .enumerate()
        .map(|(i, r)| r.moving && r.v.abs() > slowest && i >= edge && i + edge < rows.len())
        .collect();
    Columns {
        effect,
        noise,
        acceleration: below(derivative(&below(of(&|r| r.v)), rate)),
        // Through the same filter as the effect: a step of friction at a reversal is smeared alike
        // on both sides.
        direction: below(of(&|r| if r.moving { sign(r.v) } else { 0.0 })),
        tilt: below(of(&|r| r.tilt.sin())),
        seconds: rows.len() as f64 / rate,
        speed: below(speed),
        moving,
    }
}

/// Measures `recordings` at bandwidth `band`; what a refit can imitate is fitted on the first
/// `fitted` of them (offsets on each) and the numbers are of the rest, or of all where `fitted` is
/// all.
pub(crate) fn measure(
    recordings: &[&[Row]],
    fitted: usize,
    believed: &Believed,
    declared: &Declared,
    rate: f64,
    band: f64,
) -> Measured {
    let sets: Vec<Columns> = recordings.iter().map(|r| columns(r, believed, rate, band)).collect();
    let stride = ((rate / (4.0 * band)) as usize).max(1);
    let judged = if fitted < sets.len() { fitted..sets.len() } else { 0..sets.len() };
    // Noise first: the refit's prior needs it.
    let noise = noise_rms(&sets[judged.clone()], stride);
    let refit = Refit { believed, declared, width: NOMINAL + sets.len(), stride };
    let shared = refit.solve(&sets[..fitted.min(sets.len())], noise, band);
    let mut effect = Vec::new();
    for (k, set) in sets.iter().enumerate().skip(judged.start) {
        let left: Vec<f64> = picks(set, stride)
            .map(|i| {
                let x = refit.row(set, k, i);
                let imitated = x[..NOMINAL].iter().zip(&shared[..NOMINAL]).map(|(a, b)| a * b).sum::<f64>();
                set.effect[i] - imitated
            })
            .collect();
        let mean =
            if declared.offset_allowed { left.iter().sum::<f64>() / left.len().max(1) as f64 } else { 0.0 };
        effect.extend(left.iter().map(|x| x - mean));
    }
    Measured { effect: rms(&effect), noise, moving: moving_share(&sets[judged]) }
}

/// Rms of the noise on the rows that move, each recording's mean left out.
fn noise_rms(sets: &[Columns], stride: usize) -> f64 {
    let mut noise = Vec::new();
    for set in sets {
        let kept: Vec<f64> = picks(set, stride).map(|i| set.noise[i]).collect();
        let mean = kept.iter().sum::<f64>() / kept.len().max(1) as f64;
        noise.extend(kept.iter().map(|x| x - mean));
    }
    rms(&noise)
}

/// Share of the rows that move.
fn moving_share(sets: &[Columns]) -> f64 {
    let moving: usize = sets.iter().map(|set| set.moving.iter().filter(|&&m| m).count()).sum();
    let all: usize = sets.iter().map(|set| set.moving.len()).sum();
    moving as f64 / f64::max(all as f64, 1.0)
}

/// Nominal terms that are refitted: inertia, viscosity, dry friction, weight. An offset of each
/// recording follows them.
const NOMINAL: usize = 4;

/// A refit of the nominal terms within their declared uncertainty, and of an offset of each
/// recording.
struct Refit<'a> {
    believed: &'a Believed,
    declared: &'a Declared,
    width: usize,
    stride: usize,
}

impl Refit<'_> {
    /// The terms at row `i` of recording `k`.
    fn row(&self, set: &Columns, k: usize, i: usize) -> Vec<f64> {
        let mut x = vec![0.0; self.width];
        x[0] = self.believed.inertia * set.acceleration[i];
        x[1] = self.believed.viscous * set.speed[i];
        x[2] = self.believed.coulomb * set.direction[i];
        x[3] = self.believed.weight * set.tilt[i];
        x[NOMINAL + k] = if self.declared.offset_allowed { 1.0 } else { 0.0 };
        x
    }

    /// Returns the values of the terms that imitate the effect best. `noise`: rms of the noise, as
    /// a force; `band` in Hz.
    fn solve(&self, sets: &[Columns], noise: f64, band: f64) -> Vec<f64> {
        let mut normal = Normal::new(self.width);
        let mut independent = 0.0;
        for (k, set) in sets.iter().enumerate() {
            for i in picks(set, self.stride) {
                normal.add(&self.row(set, k, i), set.effect[i]);
            }
            independent += 2.0 * band * set.seconds;
        }
        // Rows that follow each other closely are not independent: the prior weighs accordingly.
        let weight = (normal.rows as f64 / f64::max(independent, 1.0)).max(1.0);
        let prior = |sigma: f64| weight * noise * noise / (sigma * sigma).max(1e-12);
        let declared = self.declared;
        let mut penalty = vec![
            prior(declared.inertia),
            prior(declared.viscous),
            prior(declared.coulomb),
            prior(declared.weight),
        ];
        penalty.resize(self.width, 0.0);
        let active: Vec<usize> = (0..self.width).collect();
        normal.solve(&active, &penalty)
    }
}

fn picks(set: &Columns, stride: usize) -> impl Iterator<Item = usize> + '_ {
    (0..set.moving.len()).step_by(stride).filter(|&i| set.moving[i])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    const BELIEVED: Believed =
        Believed { inertia: 1.0, viscous: 0.1, coulomb: 1.0, gain: 1.0, offset: 0.0, weight: 0.0 };
    const DECLARED: Declared = Declared {
        inertia: 0.1,
        viscous: 0.4,
        coulomb: 0.4,
        gain: 0.05,
        weight: 0.1,
        offset: 0.1,
        offset_allowed: true,
    };

    /// A machine that swings at 0.7 Hz with noise of 0.05, and what is missing given by time and
    /// speed.
    fn rows(missing: impl Fn(f64, f64) -> f64) -> Vec<Row> {
        let mut rng = Rng::new(6);
        (0..20_000)
            .map(|i| {
                let time = f64::from(i) * 1e-3;
                let v = 3.0 * (4.4 * time).sin() + 1.5 * (13.1 * time).sin();
                let row = Row { time, v, moving: true, ..Row::default() };
                Row { missing: missing(time, v), disturbance: 0.2 * rng.normal(), ..row }
            })
            .collect()
    }

    fn ratio(rows: &[Row], declared: &Declared) -> f64 {
        let m = measure(&[rows, rows], 2, &BELIEVED, declared, 1000.0, 50.0);
        m.effect / m.noise
    }

    #[test]
    fn a_force_that_no_refit_makes_counts_by_its_rms() {
        let rows = rows(|t, _| 0.3 * (40.0 * t).sin());
        let m = measure(&[&rows, &rows], 2, &BELIEVED, &DECLARED, 1000.0, 50.0);
        assert!((m.effect / (0.3 / 2_f64.sqrt()) - 1.0).abs() < 0.03, "{}", m.effect);
        // White noise of 0.2 at 1 kHz, Butterworth run twice at 50 Hz: about
        // 0.2·sqrt(2·0.835·50/1000).
        assert!((m.noise / 0.058 - 1.0).abs() < 0.12, "{}", m.noise);
    }

    #[test]
    fn what_a_refit_can_imitate_does_not_count() {
        let dry = rows(|_, v| 0.3 * v.signum());
        assert!(ratio(&dry, &DECLARED) < 0.1, "{}", ratio(&dry, &DECLARED));
        // The prior holds a value near what the rig declares: this much friction is no refit any
        // more.
        let sure = Declared { coulomb: 1e-4, ..DECLARED };
        assert!(ratio(&dry, &sure) > 2.0, "{}", ratio(&dry, &sure));
        let offset = rows(|_, _| 0.3);
        assert!(ratio(&offset, &DECLARED) < 1e-6);
        let none = Declared { offset_allowed: false, ..DECLARED };
        assert!(ratio(&offset, &none) > 4.0, "an offset where the rig rules one out is physics");
    }
}
