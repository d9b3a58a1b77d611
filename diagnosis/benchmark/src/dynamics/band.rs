//! A recording in the oracle's band, with the columns and the priors of the nominal structure.

use super::motion::{Motion, widened};
use super::recording::Recording;
use super::rig::Rig;
use crate::key::Oracle;
use crate::signal::Butterworth;

/// Speeds that the laws see are low-passed at this many times the oracle's upper corner.
const LAW_BAND: f64 = 2.0;
/// Relative standard deviations where the rig declares none.
const EASY: f64 = 0.1;
const FRICTION: f64 = 0.5;

/// A recording in the oracle's band.
pub(super) struct Band {
    pub(super) motion: Motion,
    filters_hz: [f64; 2],
    skip_s: f64,
    /// Rows that are judged, thinned to the band.
    kept: Vec<usize>,
}

impl Band {
    pub(super) fn of(r: &Recording, rig: &Rig, oracle: &Oracle, still_s: &[[f64; 2]]) -> Self {
        let upper = oracle.filters_hz[0].max(oracle.filters_hz[1]);
        let motion = Motion::of(r, rig.counts_per_unit, LAW_BAND * upper, still_s);
        let stride = ((motion.rate / (8.0 * upper)) as usize).max(1);
        let corner = oracle.filters_hz[0].min(oracle.filters_hz[1]);
        let kept = settled(&motion, corner, oracle.skip_s).into_iter().step_by(stride).collect();
        Self { filters_hz: oracle.filters_hz, skip_s: oracle.skip_s, kept, motion }
    }

    /// A force of every row, in the band, at the rows that are judged. Rows at rest pass as
    /// nothing.
    pub(super) fn see(&self, force: impl Fn(usize) -> f64) -> Vec<f64> {
        self.filter(|i| if self.motion.rest[i] { 0.0 } else { force(i) })
    }

    /// The acceleration in the same way.
    pub(super) fn acceleration(&self) -> Vec<f64> {
        self.filter(|i| self.motion.acceleration[i])
    }

    fn filter(&self, signal: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut filters = self.filters_hz.map(|hz| Butterworth::new(hz, self.motion.rate));
        let filtered: Vec<f64> =
            (0..self.motion.len()).map(|i| filters.iter_mut().fold(signal(i), |x, f| f.next(x))).collect();
        self.kept.iter().map(|&i| filtered[i]).collect()
    }

    /// Seconds that are judged.
    pub(super) fn seconds(&self) -> f64 {
        self.motion.time[self.motion.len() - 1] - self.skip_s
    }

    /// Acceleration, speed, direction, weight and measured load, with their signs on the left-hand
    /// side of the equation.
    pub(super) fn nominal_columns(&self) -> Vec<Vec<f64>> {
        let m = &self.motion;
        vec![
            self.acceleration(),
            self.see(|i| m.speed[i]),
            self.see(|i| m.direction[i]),
            self.see(|i| -m.tilt[i].sin()),
            self.see(|i| -m.force[i]),
        ]
    }

    /// Returns the number of consecutive rows that count as one independent row.
    pub(super) fn dependence(bands: &[Band], rows: usize, seconds: f64) -> f64 {
        let corner = bands.first().map_or(1.0, |b| b.filters_hz[0].min(b.filters_hz[1]));
        (rows as f64 / (2.0 * corner * seconds).max(1.0)).max(1.0)
    }
}

/// Time after a rest or a reversal in which the filters still show it, and time before, over the
/// inverse of their corner.
const SETTLING: f64 = 1.0;
const AHEAD: f64 = 0.1;
/// At least this part of the moving rows is judged, however often the motion turns round.
const LEAST: f64 = 0.2;

/// Rows that are judged: they move, and the filters have settled since the last rest or reversal,
/// where the direction of friction is not sure to a row.
fn settled(m: &Motion, corner_hz: f64, skip_s: f64) -> Vec<usize> {
    let n = m.len();
    let moving: Vec<usize> = (0..n).filter(|&i| m.time[i] > skip_s && !m.rest[i]).collect();
    let mut settling = SETTLING;
    loop {
        let rows = |share: f64| (share / corner_hz * m.rate) as usize;
        let (after, before) = (rows(settling), rows(AHEAD * settling));
        let blocked = widened(n, before, after, |i| m.rest[i]);
        let kept: Vec<usize> = moving.iter().copied().filter(|&i| !blocked[i]).collect();
        if kept.len() as f64 >= LEAST * moving.len() as f64 || settling < 0.05 {
            return kept;
        }
        settling *= 0.5;
    }
}

/// Nominal values: inertia, viscosity, dry friction, weight, and the measured load's.
pub(super) const NOMINAL: usize = 5;

/// Mean and standard deviation of each nominal value; a deviation of zero where there is no such
/// term. The gain stays, for a common scale of everything cannot be seen.
pub(super) fn prior(rig: &Rig) -> ([f64; NOMINAL], [f64; NOMINAL]) {
    let gain = rig.sigma("gain", EASY);
    let mut means = [rig.inertia, 0.0, 0.0, 0.0, 1.0];
    let mut sds = [rig.inertia * rig.sigma("inertia", EASY).hypot(gain), 0.0, 0.0, 0.0, gain];
    let terms = [
        (rig.viscous, "viscous", FRICTION),
        (rig.coulomb, "coulomb", FRICTION),
        (rig.weight, "weight", EASY),
    ];
    for (k, (value, name, otherwise)) in terms.into_iter().enumerate() {
        if let Some(value) = value {
            means[k + 1] = value;
            sds[k + 1] = value.abs() * rig.sigma(name, otherwise).hypot(gain);
        }
    }
    (means, sds)
}

/// Root mean square, about the mean where a bias of the recording's own is allowed.
pub(super) fn spread(x: &[f64], biased: bool) -> f64 {
    let n = x.len().max(1) as f64;
    let mean = if biased { x.iter().sum::<f64>() / n } else { 0.0 };
    (x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt()
}
