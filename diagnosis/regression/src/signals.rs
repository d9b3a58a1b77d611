//! A recording on an even grid: force, motion, direction, and the mask around rest and reversals.

use crate::constants::{
    MASK_S, REST, REST_ERRORS, SPEED_BAND, SPEED_BAND_HZ, SPEED_ERROR, SPEED_FORCED_HZ, SPEED_WIDEST,
};
use crate::data::{Recording, Rig};
use crate::filters::{derivative, first_order, low_pass, quantile};
use crate::grid;
use std::f64::consts::TAU;

/// Signals of one recording at every grid point.
pub(crate) struct Signals {
    /// Step, s, and rate, Hz.
    pub(crate) h: f64,
    pub(crate) rate_hz: f64,
    /// Readings, rad or m, and the same low-passed for signs.
    pub(crate) q_raw: Vec<f64>,
    pub(crate) q: Vec<f64>,
    pub(crate) v: Vec<f64>,
    /// k·u under the hat.
    pub(crate) force: Vec<f64>,
    /// True near rest and reversals, where dry friction is a reaction.
    pub(crate) masked: Vec<bool>,
    /// Mean sign of the speed over the cell; zero where masked.
    pub(crate) direction: Vec<f64>,
    /// Travel since the last reversal.
    pub(crate) since: Vec<f64>,
    /// sin of the tilt, and the measured load.
    pub(crate) tilt: Option<Vec<f64>>,
    pub(crate) load: Option<Vec<f64>>,
    /// Standard deviation of a reading, rad or m, and the least that it can be.
    pub(crate) noise: f64,
    pub(crate) least_noise: f64,
    pub(crate) narrowest_hz: f64,
    /// 95 % of the time the speed is below this.
    pub(crate) fast: f64,
}

impl Signals {
    /// Puts a recording on its grid.
    pub(crate) fn new(recording: &Recording, rig: &Rig) -> Self {
        let start = recording.time_s[0];
        let stamps: Vec<f64> = recording.time_s.iter().map(|t| t - start).collect();
        let n = stamps.len();
        let h = stamps[n - 1] / (n - 1) as f64;
        let rate_hz = 1.0 / h;
        let at: Vec<f64> = (0..n).map(|i| i as f64 * h).collect();
        let zero = if rig.absolute { 0.0 } else { recording.position_counts[0] };
        let counts = &recording.position_counts;
        let least_noise = grid::quantisation(counts).hypot(rig.noise_counts);
        let noise = grid::reading_noise(counts).max(least_noise).max(1e-9) / rig.counts_per_unit;
        let least_noise = least_noise / rig.counts_per_unit;
        let readings: Vec<f64> = counts.iter().map(|c| (c - zero) / rig.counts_per_unit).collect();
        let q_raw = grid::cubic(&stamps, &readings, &at);
        let late: Vec<f64> = stamps.iter().map(|t| t + rig.known_delay_s).collect();
        let force: Vec<f64> = grid::mean_under_hat(&late, &recording.command, &at, h);
        let force: Vec<f64> = force.iter().map(|u| rig.gain.nominal * u).collect();
        let force: Vec<f64> = rig.known_lags_s.iter().fold(force, |force, lag| first_order(&force, h, *lag));
        let narrowest_hz = (SPEED_BAND * rate_hz).max(SPEED_BAND_HZ);
        let rough = derivative(&low_pass(&q_raw, rate_hz, narrowest_hz, 2), h);
        let fast = quantile(rough.iter().map(|v| v.abs()), 0.95) + 1e-30;
        // White readings low-passed at f have a speed of variance σ²·(2π)²·2f³/(3·rate).
        let error = SPEED_ERROR * fast / (TAU * noise);
        let widest = (error * error * 1.5 * rate_hz).cbrt();
        let band =
            widest.min((SPEED_WIDEST * rate_hz).max(narrowest_hz)).max(narrowest_hz.min(SPEED_FORCED_HZ));
        let q = low_pass(&q_raw, rate_hz, band, 2);
        let v = derivative(&q, h);
        let fast = quantile(v.iter().map(|v| v.abs()), 0.95) + 1e-30;
        let speed_error = noise * TAU * (band.powi(3) / (1.5 * rate_hz)).sqrt();
        let slow = (REST * fast).max((REST_ERRORS * speed_error).min(fast / 10.0));
        let reach = ((1.0 / band).min(MASK_S) * rate_hz).ceil() as usize;
        let masked = mask(&v, slow, reach);
        let direction = direction(&v, &masked);
        let since = since_reversal(&q, &v, &masked);
        let interpolated = |x: &Option<Vec<f64>>| x.as_ref().map(|x| grid::linear(&stamps, x, &at));
        let tilt = interpolated(&recording.tilt_rad).map(|x| x.iter().map(|x| x.sin()).collect());
        let load = interpolated(&recording.load);
        Self {
            h,
            rate_hz,
            q_raw,
            q,
            v,
            force,
            masked,
            direction,
            since,
            tilt,
            load,
            noise,
            least_noise,
            narrowest_hz,
            fast,
        }
    }

    /// Number of grid points.
    pub(crate) fn len(&self) -> usize {
        self.q.len()
    }

    /// Returns a column with its masked points set to zero.
    pub(crate) fn apply_mask(&self, column: &[f64]) -> Vec<f64> {
        column.iter().zip(&self.masked).map(|(x, masked)| if *masked { 0.0 } else { *x }).collect()
    }
}

/// True within `reach` points of a speed below `slow` or of a change of its sign.
fn mask(v: &[f64], slow: f64, reach: usize) -> Vec<bool> {
    let n = v.len();
    let mut masked = vec![false; n];
    let mut free_from = 0;
    for i in 0..n {
        if v[i].abs() <= slow || (i > 0 && v[i] * v[i - 1] <= 0.0) {
            let end = (i + reach + 1).min(n);
            masked[free_from.max(i.saturating_sub(reach))..end].fill(true);
            free_from = end.min(i + 1);
        }
    }
    masked
}

/// The mean sign of a speed that is straight between the middles of neighbouring points.
fn direction(v: &[f64], masked: &[bool]) -> Vec<f64> {
    let n = v.len();
    let middle = |i: usize| match i {
        0 => v[0],
        _ if i == n => v[n - 1],
        _ => 0.5 * (v[i - 1] + v[i]),
    };
    let direction = |i: usize| {
        let (l, r) = (middle(i), middle(i + 1));
        match masked[i] {
            true => 0.0,
            false if l * r >= 0.0 => v[i].signum(),
            false => (l + r) / (l.abs() + r.abs() + 1e-300),
        }
    };
    (0..n).map(direction).collect()
}

/// The travel since the axis last turned round; a masked stretch belongs to the way before it.
fn since_reversal(q: &[f64], v: &[f64], masked: &[bool]) -> Vec<f64> {
    let (mut way, mut start) = (0.0, q[0]);
    let travel = |i: usize| {
        if !masked[i] && v[i].signum() != way {
            (way, start) = (v[i].signum(), q[i]);
        }
        (q[i] - start).abs()
    };
    (0..q.len()).map(travel).collect()
}
