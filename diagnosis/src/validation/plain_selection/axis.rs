//! A recording's equation of motion in one band, by differentiation of the readings.

use crate::effects::plain_laws::PlainMotion;
use crate::io::recording::Recording;
use crate::io::rig::Rig;
use numerics::even_grid::{cells, cubic, directions, first, low_pass, second};

/// Part of the sampling rate below which the regression looks, and the least of it, Hz.
const BAND_PART: f64 = 0.03;
const LEAST_BAND_HZ: f64 = 5.0;
/// The speed that laws see is taken in the widest band in which counts make it err by this part of
/// the fastest speed, at most this part of the rate.
const SPEED_ERROR: f64 = 0.01;
const WIDEST_PART: f64 = 0.15;
/// Slower than this part of the fast speed is at rest.
const REST: f64 = 0.004;
/// The speed that one row of twenty exceeds is fast.
const FAST: f64 = 0.95;
/// Most rows of a recording that are looked at: a finer one is thinned, its command averaged.
const MOST_ROWS: usize = 20_000;
/// Kept rows in a period of the band.
const ROWS_A_PERIOD: f64 = 4.0;

/// One recording at rows that move, thinned to the band. Every column has its mean taken off: an
/// offset is each recording's own.
pub(super) struct Axis {
    pub(super) motion: PlainMotion,
    rest: Vec<bool>,
    kept: Vec<usize>,
    /// Forces in the band at the kept rows: the drive's, and those of the nominal model for unit
    /// values.
    pub(super) target: Vec<f64>,
    pub(super) nominal: Vec<Vec<f64>>,
    /// The nominal columns in the band at every point.
    nominal_everywhere: Vec<Vec<f64>>,
}

/// Columns of a recording as the regression takes them, at most [`MOST_ROWS`] rows.
struct Rows {
    /// s, from the first row.
    stamps: Vec<f64>,
    /// rad or m.
    travel: Vec<f64>,
    command: Vec<f64>,
    tilt: Vec<f64>,
    load: Vec<f64>,
}

impl Rows {
    fn of(recording: &Recording, rig: &Rig) -> Self {
        let n = recording.time_s.len();
        let every = n.div_ceil(MOST_ROWS).max(1);
        let first = recording.position_counts[0];
        let zero = if rig.encoder.absolute { 0.0 } else { first };
        let pick = |all: &[f64]| all.iter().step_by(every).copied().collect::<Vec<f64>>();
        let held = |all: &Option<Vec<f64>>| all.as_ref().map_or(vec![0.0; n.div_ceil(every)], |x| pick(x));
        let mean = |part: &[f64]| part.iter().sum::<f64>() / part.len() as f64;
        Self {
            stamps: pick(&recording.time_s).iter().map(|t| t - recording.time_s[0]).collect(),
            travel: pick(&recording.position_counts)
                .iter()
                .map(|counts| (counts - zero) / rig.encoder.counts_per_unit)
                .collect(),
            command: recording.command.chunks(every).map(mean).collect(),
            tilt: held(&recording.tilt_rad),
            load: held(&recording.force),
        }
    }

    /// The smallest step between two readings, rad or m.
    fn resolution(&self) -> f64 {
        let steps = self.travel.windows(2).map(|w| (w[1] - w[0]).abs());
        steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min)
    }
}

/// The band of the regression, Hz.
fn band(rate: f64) -> f64 {
    (BAND_PART * rate).max(LEAST_BAND_HZ)
}

/// The widest band in which speed may be taken from readings, Hz.
fn speed_band(resolution: f64, rate: f64, fast: f64) -> f64 {
    // White rounding noise, differentiated, up to the band.
    let noise = resolution / 12_f64.sqrt() * std::f64::consts::TAU;
    let widest = ((SPEED_ERROR * fast / noise).powi(2) * 1.5 * rate).cbrt();
    widest.clamp(band(rate), (WIDEST_PART * rate).max(band(rate)))
}

/// The size of speed that one row of twenty exceeds.
fn fast(speed: &[f64]) -> f64 {
    let mut all: Vec<f64> = speed.iter().map(|v| v.abs()).collect();
    all.sort_by(f64::total_cmp);
    all.get(((all.len().max(1) - 1) as f64 * FAST) as usize).copied().unwrap_or(0.0)
}

impl Axis {
    /// None where the recording has too few rows to be differentiated. Commands act `late_rows` of
    /// its rows after their time stamps.
    pub(super) fn new(recording: &Recording, rig: &Rig, late_rows: f64) -> Option<Self> {
        let rows = Rows::of(recording, rig);
        let n = rows.stamps.len();
        let seconds = *rows.stamps.last()?;
        if n < 8 || seconds <= 0.0 {
            return None;
        }
        let h = seconds / (n - 1) as f64;
        let (rate, grid): (f64, Vec<f64>) = (1.0 / h, (0..n).map(|i| i as f64 * h).collect());
        let read = cubic(&rows.stamps, &rows.travel, &grid);
        let rough = first(&low_pass(&read, rate, band(rate)), h);
        let place = low_pass(&read, rate, speed_band(rows.resolution(), rate, fast(&rough)));
        let speed = first(&place, h);
        let slow = REST * fast(&speed);
        let rest: Vec<bool> = speed.iter().map(|v| v.abs() <= slow).collect();
        let at_rest = |(d, rest): (&f64, &bool)| if *rest { 0.0 } else { *d };
        let skew_s = late_rows * seconds / (recording.time_s.len() - 1) as f64;
        let known = rig.actuator.delay_s.unwrap_or(0.0) + rig.actuator.lag_s.unwrap_or(0.0) + skew_s;
        let late: Vec<f64> = rows.stamps.iter().map(|t| t + known).collect();
        let drive = cells(&late, &rows.command, &grid, h).iter().map(|u| rig.actuator.gain * u).collect();
        let motion = PlainMotion {
            direction: directions(&speed).iter().zip(&rest).map(at_rest).collect(),
            since_reversal: since_reversal(&place, &speed, slow),
            tilt: cells(&rows.stamps, &rows.tilt, &grid, h).iter().map(|t| t.sin()).collect(),
            load: cells(&rows.stamps, &rows.load, &grid, h),
            time: grid,
            place,
            speed,
            drive,
            rate_hz: rate,
            band_hz: band(rate),
        };
        let edge = ((1.5 / motion.band_hz * rate) as usize).min(n / 10);
        let stride = ((rate / (ROWS_A_PERIOD * motion.band_hz)) as usize).max(1);
        let kept = (edge..n - edge).step_by(stride).filter(|&i| !rest[i]).collect();
        let none = Vec::new();
        let mut axis =
            Self { motion, rest, kept, target: none, nominal: Vec::new(), nominal_everywhere: Vec::new() };
        let columns = axis.nominal_columns(rig, first(&read, h), second(&read, h));
        axis.nominal_everywhere = columns.iter().map(|column| axis.in_band(column)).collect();
        axis.nominal = axis.nominal_everywhere.iter().map(|column| axis.pick(column)).collect();
        axis.target = axis.see(&axis.motion.drive);
        Some(axis)
    }

    fn nominal_columns(&self, rig: &Rig, velocity: Vec<f64>, acceleration: Vec<f64>) -> Vec<Vec<f64>> {
        let (model, motion) = (&rig.model, &self.motion);
        let mut columns = vec![acceleration];
        if model.viscous.is_some() {
            columns.push(velocity);
        }
        if model.coulomb.is_some() {
            columns.push(motion.direction.clone());
        }
        if model.weight.is_some() {
            columns.push(motion.tilt.clone());
        }
        if model.gravity.is_some() {
            let zero = model.gravity_zero.unwrap_or(0.0);
            columns.push(motion.place.iter().map(|q| (q - zero).sin()).collect());
        }
        if motion.load.iter().any(|f| *f != 0.0) {
            columns.push(motion.load.clone());
        }
        columns
    }

    /// A column in the band. Points at rest pass as nothing: a force there is a reaction.
    fn in_band(&self, column: &[f64]) -> Vec<f64> {
        let moving = |(x, rest): (&f64, &bool)| if *rest { 0.0 } else { *x };
        let masked: Vec<f64> = column.iter().zip(&self.rest).map(moving).collect();
        low_pass(&masked, self.motion.rate_hz, self.motion.band_hz)
    }

    fn pick(&self, column: &[f64]) -> Vec<f64> {
        let mean = self.mean(column);
        self.kept.iter().map(|&i| column[i] - mean).collect()
    }

    fn mean(&self, column: &[f64]) -> f64 {
        self.kept.iter().map(|&i| column[i]).sum::<f64>() / self.kept.len().max(1) as f64
    }

    /// A column of the grid in the band at the kept rows.
    pub(super) fn see(&self, column: &[f64]) -> Vec<f64> {
        self.pick(&self.in_band(column))
    }

    pub(super) fn rows(&self) -> usize {
        self.kept.len()
    }

    /// The drive's force that the nominal model asks for by itself, at every point.
    pub(super) fn predicted(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut drive = vec![self.mean(&self.in_band(&self.motion.drive)); self.motion.time.len()];
        for (c, column) in coefficients.iter().zip(&self.nominal_everywhere) {
            drive.iter_mut().zip(column).for_each(|(d, x)| *d += c * x);
        }
        drive
    }
}

fn since_reversal(place: &[f64], speed: &[f64], slow: f64) -> Vec<f64> {
    let (mut reversal, mut direction) = (place.first().copied().unwrap_or(0.0), 0.0);
    let way = |(q, v): (&f64, &f64)| {
        if v.abs() > slow && v.signum() != direction {
            (direction, reversal) = (v.signum(), *q);
        }
        (q - reversal).abs()
    };
    place.iter().zip(speed).map(way).collect()
}
