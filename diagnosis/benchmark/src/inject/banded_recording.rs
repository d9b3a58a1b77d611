//! A machine's motion, estimated from the recording alone: position and speed at the rows, for the
//! laws, and every column of the equation of motion through one low-pass, for regressions.

use super::rig_file::RigFile;
use crate::dynamics::motion::{cells, cubic, directions, first, second};
use crate::dynamics::recording::Recording;
use crate::signal::low_pass;

/// Part of the sampling rate below which regressions look, and the least of it, Hz.
const BAND_SHARE: f64 = 0.03;
const LEAST_BAND_HZ: f64 = 5.0;
/// The speed that laws see is taken in the widest band in which counts make it err by this part of
/// the fastest speed.
const SPEED_ERROR: f64 = 0.01;
/// Slower than this part of the fast speed is at rest.
const REST: f64 = 0.004;

/// Place and speed at the rows, low-passed as little as the counts allow.
#[derive(Clone, Debug)]
pub(crate) struct State {
    pub(crate) time: Vec<f64>,
    /// From the first row, or from the zero of absolute counts, rad or m.
    pub(crate) place: Vec<f64>,
    pub(crate) speed: Vec<f64>,
    /// Exceeded in a twentieth of the rows, rad/s or m/s.
    pub(crate) fast: f64,
    /// Slower is at rest.
    pub(crate) slow: f64,
}

/// Band of regressions on the recording, Hz.
pub(crate) fn band(r: &Recording) -> f64 {
    let rate = (r.time.len() - 1) as f64 / (r.time[r.time.len() - 1] - r.time[0]);
    (BAND_SHARE * rate).max(LEAST_BAND_HZ)
}

fn top(values: &[f64], share: f64) -> f64 {
    let sizes: Vec<f64> = values.iter().map(|v| v.abs()).collect();
    crate::stats::quantile(&sizes, share).unwrap_or(0.0)
}

/// Travel in units, from the first row or absolute.
fn travel(r: &Recording, rig: &RigFile) -> Vec<f64> {
    let zero = if rig.absolute { 0.0 } else { r.counts[0] };
    r.counts.iter().map(|c| (c - zero) / rig.counts_per_unit).collect()
}

/// An even grid of as many points as there are rows: stamps from zero, grid, its step.
fn grid(r: &Recording) -> (Vec<f64>, Vec<f64>, f64) {
    let n = r.time.len();
    let h = (r.time[n - 1] - r.time[0]) / (n - 1) as f64;
    let stamps = r.time.iter().map(|t| t - r.time[0]).collect();
    (stamps, (0..n).map(|i| i as f64 * h).collect(), h)
}

/// The widest band in which speed may be taken from counts that are `resolution` apart, Hz.
fn law_band(resolution: f64, rate: f64, fast: f64) -> f64 {
    // White rounding noise, differentiated, up to the band.
    let noise = resolution / 12_f64.sqrt() * std::f64::consts::TAU;
    let widest = ((SPEED_ERROR * fast / noise).powi(2) * 1.5 * rate).cbrt();
    let least = (BAND_SHARE * rate).max(LEAST_BAND_HZ);
    widest.clamp(least, (0.15 * rate).max(least))
}

impl State {
    pub(crate) fn of(r: &Recording, rig: &RigFile) -> Self {
        let (stamps, time, h) = grid(r);
        let read = travel(r, rig);
        let even = cubic(&stamps, &read, &time);
        let rough = first(&low_pass(&even, 1.0 / h, band(r)), h);
        let steps = read.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 0.0);
        let resolution = steps.fold(f64::INFINITY, f64::min);
        let corner = law_band(resolution, 1.0 / h, top(&rough, 0.95));
        let place = low_pass(&even, 1.0 / h, corner);
        let speed = first(&place, h);
        let fast = top(&speed, 0.95);
        Self {
            place: cubic(&time, &place, &stamps),
            speed: cubic(&time, &speed, &stamps),
            time: stamps,
            slow: REST * fast,
            fast,
        }
    }

    /// The largest distance between two places, rad or m.
    pub(crate) fn travel(&self) -> f64 {
        let (low, high) = self.place.iter().fold((f64::MAX, f64::MIN), |(l, h), &q| (l.min(q), h.max(q)));
        high - low
    }

    pub(crate) fn seconds(&self) -> f64 {
        self.time[self.time.len() - 1]
    }
}

/// One recording's equation of motion in one band, at rows that move, thinned to the band. Every
/// column has its mean taken off: an offset is each recording's own.
#[derive(Clone, Debug)]
pub(crate) struct BandedRecording {
    rate: f64,
    band: f64,
    stamps: Vec<f64>,
    pub(crate) time: Vec<f64>,
    rest: Vec<bool>,
    kept: Vec<usize>,
    pub(crate) place: Vec<f64>,
    pub(crate) speed: Vec<f64>,
    pub(crate) direction: Vec<f64>,
    pub(crate) tilt: Vec<f64>,
    pub(crate) load: Vec<f64>,
    /// The drive's force by the rig's gain, not filtered.
    pub(crate) drive: Vec<f64>,
    /// Travel since the last reversal.
    pub(crate) since_reversal: Vec<f64>,
    /// In the band, at the kept rows.
    pub(crate) target: Vec<f64>,
    pub(crate) nominal: Vec<Vec<f64>>,
    /// The nominal columns on the whole grid, in the band.
    pub(crate) nominal_grid: Vec<Vec<f64>>,
}

impl BandedRecording {
    /// Estimates the motion of the recording, with the given command and counts instead of its own.
    pub(crate) fn of(r: &Recording, rig: &RigFile, band: f64) -> Self {
        let (stamps, time, h) = grid(r);
        let rate = 1.0 / h;
        let read = cubic(&stamps, &travel(r, rig), &time);
        let state = State::of(r, rig);
        let at_grid = |values: &[f64]| cubic(&state.time, values, &time);
        let (place, speed) = (at_grid(&state.place), at_grid(&state.speed));
        let late: Vec<f64> = stamps.iter().map(|t| t + rig.late_s).collect();
        let drive: Vec<f64> = cells(&late, &r.command, &time, h).iter().map(|u| rig.gain * u).collect();
        let rest: Vec<bool> = speed.iter().map(|v| v.abs() <= state.slow).collect();
        let n = time.len();
        let edge = ((1.5 / band * rate) as usize).min(n / 10);
        let stride = ((rate / (4.0 * band)) as usize).max(1);
        let kept = (edge..n - edge).step_by(stride).filter(|&i| !rest[i]).collect();
        let direction =
            directions(&speed).iter().zip(&rest).map(|(d, r)| if *r { 0.0 } else { *d }).collect();
        let mut sight = Self {
            since_reversal: since_reversal(&place, &speed, state.slow),
            tilt: cells(&stamps, &r.tilt, &time, h).iter().map(|t| t.sin()).collect(),
            load: cells(&stamps, &r.force, &time, h),
            rate,
            band,
            stamps,
            time,
            rest,
            kept,
            place,
            speed,
            direction,
            drive,
            target: Vec::new(),
            nominal: Vec::new(),
            nominal_grid: Vec::new(),
        };
        let (velocity, acceleration) = (first(&read, h), second(&read, h));
        let mut columns = vec![acceleration];
        if rig.viscous.is_some() {
            columns.push(velocity);
        }
        if rig.coulomb.is_some() {
            columns.push(sight.direction.clone());
        }
        if rig.weight.is_some() {
            columns.push(sight.tilt.clone());
        }
        if let Some((_, zero)) = rig.gravity {
            columns.push(sight.place.iter().map(|q| (q - zero).sin()).collect());
        }
        if sight.load.iter().any(|f| *f != 0.0) {
            columns.push(sight.load.clone());
        }
        sight.nominal_grid = columns.iter().map(|c| sight.filter(c)).collect();
        sight.nominal = sight.nominal_grid.iter().map(|c| sight.pick(c)).collect();
        sight.target = sight.see(&sight.drive);
        sight
    }

    /// A column in the band on the whole grid. Rows at rest pass as nothing: what holds there is a
    /// reaction.
    pub(crate) fn filter(&self, column: &[f64]) -> Vec<f64> {
        let masked: Vec<f64> =
            column.iter().zip(&self.rest).map(|(x, rest)| if *rest { 0.0 } else { *x }).collect();
        low_pass(&masked, self.rate, self.band)
    }

    fn pick(&self, filtered: &[f64]) -> Vec<f64> {
        let mean = self.kept.iter().map(|&i| filtered[i]).sum::<f64>() / self.kept.len().max(1) as f64;
        self.kept.iter().map(|&i| filtered[i] - mean).collect()
    }

    /// A column of the grid in the band at the kept rows.
    pub(crate) fn see(&self, column: &[f64]) -> Vec<f64> {
        self.pick(&self.filter(column))
    }

    /// A column of row means, each held until the next row, in the band at the kept rows.
    pub(crate) fn see_rows(&self, rows: &[f64]) -> Vec<f64> {
        self.see(&cells(&self.stamps, rows, &self.time, 1.0 / self.rate))
    }

    /// The forces that an error of reading makes believe, for an inertia and a viscous friction.
    pub(crate) fn reading_force(&self, error: &[f64], inertia: f64, viscous: f64) -> Vec<f64> {
        let h = 1.0 / self.rate;
        let even = cubic(&self.stamps, error, &self.time);
        let (rate, bend) = (first(&even, h), second(&even, h));
        rate.iter().zip(&bend).map(|(v, a)| inertia * a + viscous * v).collect()
    }

    /// A signal delayed by a time, on the grid.
    pub(crate) fn delayed(&self, signal: &[f64], seconds: f64) -> Vec<f64> {
        (0..signal.len())
            .map(|i| {
                let x = (i as f64 - seconds * self.rate).clamp(0.0, (signal.len() - 1) as f64);
                let j = (x as usize).min(signal.len().saturating_sub(2));
                signal[j] + (signal[j + 1] - signal[j]) * (x - j as f64)
            })
            .collect()
    }

    /// A signal behind a first-order lag, on the grid.
    pub(crate) fn lagged(&self, signal: &[f64], seconds: f64) -> Vec<f64> {
        let keep = (-1.0 / (self.rate * seconds)).exp();
        let mut state = signal.first().copied().unwrap_or(0.0);
        let mut last = state;
        signal
            .iter()
            .map(|&x| {
                state = keep * state + (1.0 - keep) * 0.5 * (x + last);
                last = x;
                state
            })
            .collect()
    }

    pub(crate) fn rows(&self) -> usize {
        self.kept.len()
    }

    /// Seconds between two points of the grid.
    pub(crate) fn step(&self) -> f64 {
        1.0 / self.rate
    }

    pub(crate) fn band(&self) -> f64 {
        self.band
    }

    /// Mean of the drive's force in the band where the machine moves.
    pub(crate) fn mean_drive(&self) -> f64 {
        let filtered = self.filter(&self.drive);
        self.kept.iter().map(|&i| filtered[i]).sum::<f64>() / self.kept.len().max(1) as f64
    }
}

fn since_reversal(place: &[f64], speed: &[f64], slow: f64) -> Vec<f64> {
    let (mut reversal, mut direction) = (place.first().copied().unwrap_or(0.0), 0.0);
    place
        .iter()
        .zip(speed)
        .map(|(&q, &v)| {
            if v.abs() > slow && v.signum() != direction {
                direction = v.signum();
                reversal = q;
            }
            (q - reversal).abs()
        })
        .collect()
}
