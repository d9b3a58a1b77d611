//! Rows of a recording on an even grid: position between the stamps by a cubic, commands as they
//! were held.

use super::recording::Recording;
use crate::signal::low_pass;

/// A recording on an even grid.
#[derive(Clone, Debug)]
pub(crate) struct Motion {
    /// From the first row, s.
    pub(crate) time: Vec<f64>,
    pub(crate) rate: f64,
    /// Second derivative of the travel as it was read, not filtered; at rest, less what is seen of
    /// it in the band of the laws: nothing is known of the forces there, and to cut the noise of
    /// the counts would bring it down into the band.
    pub(crate) acceleration: Vec<f64>,
    /// Travel and speed, low-passed for the laws that need them.
    pub(crate) place: Vec<f64>,
    pub(crate) speed: Vec<f64>,
    /// Direction of motion, mean over the grid's cell: a reversal within it counts by its place.
    pub(crate) direction: Vec<f64>,
    /// The command held, mean over the grid's cell.
    pub(crate) command: Vec<f64>,
    pub(crate) tilt: Vec<f64>,
    pub(crate) force: Vec<f64>,
    /// The row cannot be judged: too slow for a direction, or so near to a reversal that the
    /// low-passed speed does not show it.
    pub(crate) rest: Vec<bool>,
}

/// Slower than this part of the recording's rms speed is at rest.
const SLOWEST: f64 = 0.01;
/// The time over which a low-pass smears a reversal to either side, relative to the inverse of its
/// corner.
const SMEARED: f64 = 0.35;

/// Rows that are so many before or after one that has something about it.
pub(crate) fn widened(n: usize, before: usize, after: usize, has: impl Fn(usize) -> bool) -> Vec<bool> {
    let mut wide = vec![false; n];
    let mut until = 0;
    for i in (0..n).filter(|&i| has(i)) {
        let end = (i + after + 1).min(n);
        wide[i.saturating_sub(before).max(until).min(end)..end].fill(true);
        until = end;
    }
    wide
}

impl Motion {
    /// `band_hz`: of the speed that the laws see. `still_s`: times at rest, from the first row.
    pub(crate) fn of(r: &Recording, counts_per_unit: f64, band_hz: f64, still_s: &[[f64; 2]]) -> Self {
        let n = r.time.len();
        let start = r.time[0];
        let h = (r.time[n - 1] - start) / (n - 1) as f64;
        let time: Vec<f64> = (0..n).map(|i| i as f64 * h).collect();
        let stamps: Vec<f64> = r.time.iter().map(|t| t - start).collect();
        let travel: Vec<f64> = r.counts.iter().map(|c| (c - r.counts[0]) / counts_per_unit).collect();
        let rate = 1.0 / h;
        let read = cubic(&stamps, &travel, &time);
        let place = low_pass(&read, rate, band_hz);
        let speed = first(&place, h);
        let rms = (speed.iter().map(|v| v * v).sum::<f64>() / n as f64).sqrt();
        let mut still = still_s.iter().peekable();
        let rest: Vec<bool> = time
            .iter()
            .zip(&speed)
            .map(|(t, v)| {
                while still.peek().is_some_and(|s| s[1] <= *t) {
                    still.next();
                }
                v.abs() <= SLOWEST * rms || still.peek().is_some_and(|s| s[0] <= *t)
            })
            .collect();
        let near = (SMEARED / band_hz * rate).ceil() as usize;
        let rest = widened(n, near, near, |i| rest[i] || i > 0 && speed[i] * speed[i - 1] <= 0.0);
        let smooth = second(&place, h);
        let mut acceleration = second(&read, h);
        for (i, a) in acceleration.iter_mut().enumerate().filter(|(i, _)| rest[*i]) {
            *a -= smooth[i];
        }
        Self {
            direction: directions(&speed),
            acceleration,
            place,
            speed,
            command: cells(&stamps, &r.command, &time, h),
            tilt: cells(&stamps, &r.tilt, &time, h),
            force: cells(&stamps, &r.force, &time, h),
            rest,
            time,
            rate,
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.time.len()
    }

    /// Step of the grid, s.
    pub(crate) fn step(&self) -> f64 {
        1.0 / self.rate
    }
}

/// Cubic Hermite interpolation with slopes of the parabola through three neighbours, uneven stamps.
pub(crate) fn cubic(stamps: &[f64], values: &[f64], at: &[f64]) -> Vec<f64> {
    let n = stamps.len();
    let chord = |i: usize| (values[i + 1] - values[i]) / (stamps[i + 1] - stamps[i]);
    let slope = |i: usize| {
        if i == 0 || i + 1 == n {
            return chord(i.min(n - 2));
        }
        let (a, b) = (stamps[i] - stamps[i - 1], stamps[i + 1] - stamps[i]);
        (b * chord(i - 1) + a * chord(i)) / (a + b)
    };
    let mut j = 0;
    at.iter()
        .map(|&t| {
            while j + 2 < n && stamps[j + 1] <= t {
                j += 1;
            }
            let w = stamps[j + 1] - stamps[j];
            let x = ((t - stamps[j]) / w).clamp(0.0, 1.0);
            let (m0, m1) = (slope(j) * w, slope(j + 1) * w);
            let (a, b) = (values[j], values[j + 1]);
            let c = -3.0 * a + 3.0 * b - 2.0 * m0 - m1;
            let d = 2.0 * a - 2.0 * b + m0 + m1;
            a + x * (m0 + x * (c + x * d))
        })
        .collect()
}

/// The mean of a held signal over the cell of width `h` about each grid point.
pub(crate) fn cells(stamps: &[f64], values: &[f64], at: &[f64], h: f64) -> Vec<f64> {
    let n = stamps.len();
    let mut sum = vec![0.0; n];
    for i in 1..n {
        sum[i] = sum[i - 1] + values[i - 1] * (stamps[i] - stamps[i - 1]);
    }
    let mut j = 0;
    let mut until = |t: f64| {
        while j + 1 < n && stamps[j + 1] <= t {
            j += 1;
        }
        sum[j] + values[j] * (t - stamps[j])
    };
    let mut before = until(at[0] - 0.5 * h);
    at.iter()
        .map(|&t| {
            let now = until(t + 0.5 * h);
            let mean = (now - before) / h;
            before = now;
            mean
        })
        .collect()
}

/// Mean of the sign over the cell about each row, of a signal that goes straight from row to row.
pub(crate) fn directions(speed: &[f64]) -> Vec<f64> {
    let half = |inner: f64, outer: f64| {
        // From the row to the middle between the rows.
        let middle = 0.5 * (inner + outer);
        if inner * middle >= 0.0 {
            if inner == 0.0 { middle.signum() } else { inner.signum() }
        } else {
            let before = inner / (inner - middle);
            inner.signum() * (2.0 * before - 1.0)
        }
    };
    let n = speed.len();
    (0..n)
        .map(|i| {
            let (before, after) = (speed[i.saturating_sub(1)], speed[(i + 1).min(n - 1)]);
            0.5 * (half(speed[i], before) + half(speed[i], after))
        })
        .collect()
}

/// First derivative, fourth order inside.
pub(crate) fn first(x: &[f64], h: f64) -> Vec<f64> {
    let n = x.len();
    (0..n)
        .map(|i| {
            if i >= 2 && i + 2 < n {
                (8.0 * (x[i + 1] - x[i - 1]) - (x[i + 2] - x[i - 2])) / (12.0 * h)
            } else {
                let (low, high) = (i.saturating_sub(1), (i + 1).min(n - 1));
                (x[high] - x[low]) / (h * (high - low) as f64)
            }
        })
        .collect()
}

/// Second derivative, fourth order inside, nothing at the ends.
pub(crate) fn second(x: &[f64], h: f64) -> Vec<f64> {
    let n = x.len();
    (0..n)
        .map(|i| {
            if i >= 2 && i + 2 < n {
                let near = 16.0 * (x[i + 1] + x[i - 1]);
                (near - x[i + 2] - x[i - 2] - 30.0 * x[i]) / (12.0 * h * h)
            } else {
                0.0
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    #[test]
    fn a_reversal_counts_by_its_place_between_the_rows() {
        // The sign changes a tenth of a row after the third.
        let d = directions(&[2.1, 1.1, 0.1, -0.9, -1.9]);
        assert_eq!((d[0], d[1], d[4]), (1.0, 1.0, -1.0));
        assert!((d[2] - 0.2).abs() < 1e-12 && (d[3] + 1.0).abs() < 1e-12, "{d:?}");
    }

    #[test]
    fn uneven_stamps_give_derivatives_and_the_mean_of_held_commands() {
        let mut rng = Rng::new(3);
        let n = 4000;
        let time: Vec<f64> = (0..n).map(|i| 7.0 + (f64::from(i) + 0.3 * rng.unit()) * 1e-3).collect();
        let counts = time.iter().map(|t| 1e6 * (20.0 * t).sin()).collect();
        let command: Vec<f64> = time.iter().map(|t| 3.0 + (5.0 * t).sin()).collect();
        let zeros = vec![0.0; time.len()];
        let r = Recording { command, counts, tilt: zeros.clone(), force: zeros, time };
        let m = Motion::of(&r, 1e6, 100.0, &[[1.0, 2.0]]);
        let mean = |i: usize, f: &dyn Fn(f64) -> f64| f(r.time[0] + m.time[i]);
        let moving = (500..3500).step_by(97).filter(|&i| !m.rest[i]);
        assert!(moving.clone().count() > 10);
        for i in moving {
            let a = mean(i, &|t| -400.0 * (20.0 * t).sin());
            assert!((m.acceleration[i] - a).abs() < 8.0, "{} for {a}", m.acceleration[i]);
            let v = mean(i, &|t| 20.0 * (20.0 * t).cos());
            assert!((m.speed[i] - v).abs() < 0.1, "{} for {v}", m.speed[i]);
            // Held from its stamp on: half a row late.
            let u = mean(i, &|t| 3.0 + (5.0 * (t - 5e-4)).sin());
            assert!((m.command[i] - u).abs() < 5e-3, "{} for {u}", m.command[i]);
        }
        assert!(m.rest[1500] && !m.rest[2070]);
    }
}
