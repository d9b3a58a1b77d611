//! A recording as motion in SI units: where the axis was and how fast it went.

use crate::data::recording::Recording;
use crate::data::rig::Rig;

/// Length over which a speed is taken from positions, s, and the fewest rows.
const SPAN_S: f64 = 0.02;
const FEWEST: usize = 5;

/// Position and speed at every row of a recording.
#[derive(Debug, Clone)]
pub struct Motion {
    /// s, from the first row.
    pub time: Vec<f64>,
    /// rad or m, from the first row.
    pub position: Vec<f64>,
    /// rad/s or m/s: the slope of a parabola through the rows around.
    pub velocity: Vec<f64>,
    /// The reference of a position loop, as a position.
    pub reference: Option<Vec<f64>>,
}

impl Motion {
    /// The motion of a recording under the resolution of its rig.
    pub fn new(recording: &Recording, rig: &Rig) -> Self {
        let (t0, q0) = (recording.time_s[0], recording.position_counts[0]);
        let scaled = |counts: &Vec<f64>| -> Vec<f64> {
            counts.iter().map(|c| (c - q0) / rig.encoder.counts_per_unit).collect()
        };
        let time: Vec<f64> = recording.time_s.iter().map(|t| t - t0).collect();
        let position = scaled(&recording.position_counts);
        let velocity = slopes(&time, &position);
        Self { time, position, velocity, reference: recording.reference_counts.as_ref().map(scaled) }
    }

    /// Acceleration at every row, the slope of the speeds, rad/s² or m/s².
    pub fn accelerations(&self) -> Vec<f64> {
        slopes(&self.time, &self.velocity)
    }

    /// The mean of a column over the rows from which a speed is taken.
    pub fn smoothed(&self, column: &[f64]) -> Vec<f64> {
        let (mut from, mut to, mut sum) = (0, 0, 0.0);
        (0..column.len())
            .map(|i| {
                while to < column.len() && self.time[to] - self.time[i] <= 0.5 * SPAN_S {
                    sum += column[to];
                    to += 1;
                }
                while self.time[i] - self.time[from] > 0.5 * SPAN_S {
                    sum -= column[from];
                    from += 1;
                }
                sum / (to - from) as f64
            })
            .collect()
    }

    /// Largest minus smallest position.
    pub fn travel(&self) -> f64 {
        let low = self.position.iter().copied().fold(f64::INFINITY, f64::min);
        self.position.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
    }

    /// From the first row to the last, s.
    pub fn seconds(&self) -> f64 {
        self.time.last().copied().unwrap_or(0.0)
    }
}

/// Slope at every row of the parabola that fits the rows within half of [`SPAN_S`] on either side
/// best.
fn slopes(time: &[f64], position: &[f64]) -> Vec<f64> {
    let n = time.len();
    let (mut from, mut to) = (0, 0);
    (0..n)
        .map(|i| {
            while time[i] - time[from] > 0.5 * SPAN_S {
                from += 1;
            }
            while to < n && time[to] - time[i] <= 0.5 * SPAN_S {
                to += 1;
            }
            let a = from.min(i.saturating_sub(FEWEST / 2));
            let b = to.max((i + FEWEST / 2 + 1).min(n));
            slope(&time[a..b], &position[a..b], time[i])
        })
        .collect()
}

/// Slope at `at` of the parabola through points, by least squares.
fn slope(time: &[f64], position: &[f64], at: f64) -> f64 {
    let n = time.len() as f64;
    let scale = (time[time.len() - 1] - time[0]).max(1e-12);
    let (mut s, mut y) = ([0.0; 5], [0.0; 3]);
    for (t, q) in time.iter().zip(position) {
        let x = (t - at) / scale;
        let q = q - position[0];
        let mut power = 1.0;
        for (k, sum) in s.iter_mut().enumerate() {
            *sum += power;
            if k < 3 {
                y[k] += power * q;
            }
            power *= x;
        }
    }
    // Cramer's rule for the middle coefficient of a + b·x + c·x².
    let det = n * (s[2] * s[4] - s[3] * s[3]) - s[1] * (s[1] * s[4] - s[3] * s[2])
        + s[2] * (s[1] * s[3] - s[2] * s[2]);
    if det.abs() < 1e-9 {
        return (position[position.len() - 1] - position[0]) / scale;
    }
    let b = n * (y[1] * s[4] - s[3] * y[2]) - y[0] * (s[1] * s[4] - s[3] * s[2])
        + s[2] * (s[1] * y[2] - y[1] * s[2]);
    b / det / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_slope_of_a_parabola_is_exact_on_a_jittering_clock() {
        let time: Vec<f64> =
            (0..200).map(|i| i as f64 * 1e-3 + if i % 3 == 0 { 2e-4 } else { 0.0 }).collect();
        let position: Vec<f64> = time.iter().map(|t| 3.0 + 2.0 * t - 7.0 * t * t).collect();
        for (t, v) in time.iter().zip(slopes(&time, &position)) {
            assert!((v - (2.0 - 14.0 * t)).abs() < 1e-8, "{v} at {t} s");
        }
    }
}
