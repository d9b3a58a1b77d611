//! The balance of forces of one recording, for any plain machine: how much of a command remains
//! when inertia, friction, gravity and a constant take their best part of it. Nothing of the rig's
//! values enters but the unit of travel, so that a wrong one hides no fault.

use crate::data::recording::Recording;
use crate::data::rig::{Kind, Rig};
use numerics::even_grid::{cells, cubic, directions, first, low_pass, second};
use numerics::linear::{Factor, Square};

/// Part of the rate below which the balance is looked at, and the range of it, Hz: counts drown
/// accelerations above, and machines that people record swing below.
const BAND_PART: f64 = 0.03;
const BAND_HZ: (f64, f64) = (5.0, 30.0);
/// Part of the speed that one row of twenty exceeds below which an axis rests.
const REST: f64 = 0.004;
/// Kept rows in a period of the band.
const ROWS_A_PERIOD: f64 = 4.0;
/// Most rows of a recording that are balanced: a fault of a log is there all the time.
pub(super) const MOST_ROWS: usize = 60_000;
/// Fewest kept rows to each force.
const FEWEST: usize = 10;

/// A recording on an even grid.
pub(super) struct Balance<'a> {
    recording: &'a Recording,
    grid: Vec<f64>,
    /// Time between its points, s.
    step_s: f64,
    band_hz: f64,
    rest: Vec<bool>,
    kept: Vec<usize>,
    /// Inertia, friction and what else may balance the command, at the kept rows; inertia first.
    forces: Vec<Vec<f64>>,
    factor: Factor,
}

/// The part of a command that its balance leaves.
#[derive(Clone, Copy)]
pub(super) struct Unbalanced {
    /// As a part of its variance.
    pub(super) part: f64,
    /// The part of its variance that inertia takes.
    pub(super) by_inertia: f64,
}

impl<'a> Balance<'a> {
    /// None where too few rows move.
    pub(super) fn new(recording: &'a Recording, rig: &Rig) -> Option<Self> {
        let n = recording.len();
        let stamps: Vec<f64> = recording.time_s.iter().map(|t| t - recording.time_s[0]).collect();
        let step_s = stamps[n - 1] / (n - 1) as f64;
        let grid: Vec<f64> = (0..n).map(|i| i as f64 * step_s).collect();
        let travel: Vec<f64> =
            recording.position_counts.iter().map(|x| x / rig.encoder.counts_per_unit).collect();
        let rate = 1.0 / step_s;
        let band_hz = (BAND_PART * rate).clamp(BAND_HZ.0, BAND_HZ.1);
        let place = low_pass(&cubic(&stamps, &travel, &grid), rate, band_hz);
        let speed = first(&place, step_s);
        let mut sizes: Vec<f64> = speed.iter().map(|v| v.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let slow = REST * sizes[sizes.len() * 19 / 20];
        let rest: Vec<bool> = speed.iter().map(|v| v.abs() <= slow).collect();
        let edge = ((1.5 * rate / band_hz) as usize).min(n / 10);
        let stride = ((rate / (ROWS_A_PERIOD * band_hz)) as usize).max(1);
        let kept: Vec<usize> = (edge..n - edge).step_by(stride).filter(|row| !rest[*row]).collect();
        let mut forces = vec![second(&place, step_s), directions(&speed), speed];
        match rig.kind {
            Kind::Rotary => {
                forces.extend([f64::sin, f64::cos].map(|f| place.iter().map(|x| f(*x)).collect()))
            }
            Kind::Linear => forces.push(place),
        }
        let tilt = recording.tilt_rad.as_ref().map(|tilt| tilt.iter().map(|x| x.sin()).collect());
        forces.extend([tilt, recording.force.clone()].into_iter().flatten());
        let factor = Factor::new(&Square::zero(0));
        let mut balance = Self { recording, grid, step_s, band_hz, rest, kept, forces: Vec::new(), factor };
        balance.forces = forces.iter().map(|force| balance.seen(force)).collect();
        balance.factor = Factor::new(&products(&balance.forces));
        (balance.kept.len() >= FEWEST * forces.len()).then_some(balance)
    }

    /// A column in the band at the kept rows, without its mean: a constant force is always allowed.
    fn seen(&self, column: &[f64]) -> Vec<f64> {
        let moving = |(x, rest): (&f64, &bool)| if *rest { 0.0 } else { *x };
        let masked: Vec<f64> = column.iter().zip(&self.rest).map(moving).collect();
        let smooth = low_pass(&masked, 1.0 / self.step_s, self.band_hz);
        let mean = self.kept.iter().map(|row| smooth[*row]).sum::<f64>() / self.kept.len().max(1) as f64;
        self.kept.iter().map(|row| smooth[*row] - mean).collect()
    }

    /// Returns the part that the balance leaves of the recorded command if it acts `late_s` after
    /// its stamps.
    pub(super) fn left(&self, late_s: f64) -> Unbalanced {
        let start = self.recording.time_s[0];
        let stamps: Vec<f64> = self.recording.time_s.iter().map(|t| t - start + late_s).collect();
        self.left_of(&cells(&stamps, &self.recording.command, &self.grid, self.step_s))
    }

    /// Returns the part that the balance leaves of a command that goes straight from one of some
    /// rows to the next.
    pub(super) fn left_between(&self, rows: &[usize]) -> Unbalanced {
        let start = self.recording.time_s[0];
        let point = |row: &usize| (self.recording.time_s[*row] - start, self.recording.command[*row]);
        let mut next = 0;
        let line: Vec<f64> = self
            .grid
            .iter()
            .map(|t| {
                while next + 1 < rows.len() && point(&rows[next]).0 < *t {
                    next += 1;
                }
                let ((t0, u0), (t1, u1)) = (point(&rows[next.saturating_sub(1)]), point(&rows[next]));
                if t1 > t0 { u0 + (u1 - u0) * ((t - t0) / (t1 - t0)).clamp(0.0, 1.0) } else { u1 }
            })
            .collect();
        self.left_of(&line)
    }

    fn left_of(&self, command: &[f64]) -> Unbalanced {
        let target = self.seen(command);
        let scores: Vec<f64> = self.forces.iter().map(|force| product(force, &target)).collect();
        let x = self.factor.solve(&scores);
        let whole = product(&target, &target).max(f64::MIN_POSITIVE);
        // The part that least squares take off is the scores along the solution.
        let taken: f64 = x.iter().zip(&scores).map(|(x, score)| x * score).sum();
        let inertia = x[0] * x[0] * product(&self.forces[0], &self.forces[0]);
        Unbalanced { part: (1.0 - taken / whole).max(0.0), by_inertia: inertia / whole }
    }
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn products(columns: &[Vec<f64>]) -> Square {
    let mut all = Square::zero(columns.len());
    for (i, a) in columns.iter().enumerate() {
        for (j, b) in columns.iter().enumerate() {
            all.add(i, j, product(a, b));
        }
    }
    all
}
