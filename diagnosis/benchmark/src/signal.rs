//! The little numerics that strengths and baselines share: a zero-phase low-pass, differences,
//! least squares.

use std::f64::consts::PI;

/// Second-order Butterworth low-pass run forward and backward (zero phase, −6 dB at the corner), on
/// an even grid.
pub(crate) fn low_pass(x: &[f64], rate: f64, corner_hz: f64) -> Vec<f64> {
    if x.is_empty() || corner_hz >= 0.45 * rate {
        return x.to_vec();
    }
    let pass = |input: &mut dyn Iterator<Item = f64>| {
        let mut filter = Butterworth::new(corner_hz, rate);
        input.map(|value| filter.next(value)).collect::<Vec<f64>>()
    };
    let forward = pass(&mut x.iter().copied());
    let mut backward = pass(&mut forward.iter().rev().copied());
    backward.reverse();
    backward
}

/// Second-order Butterworth low-pass run forward only (bilinear transform, prewarped), started
/// settled on its first value.
#[derive(Clone, Debug)]
pub(crate) struct Butterworth {
    b: f64,
    a: [f64; 2],
    /// Two inputs and two outputs ago.
    state: Option<[f64; 4]>,
}

impl Butterworth {
    /// A corner beyond 0.45 of the rate is put there.
    pub(crate) fn new(corner_hz: f64, rate: f64) -> Self {
        let k = (PI * corner_hz.min(0.45 * rate) / rate).tan();
        let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
        Self {
            b: k * k * norm,
            a: [2.0 * (k * k - 1.0) * norm, (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm],
            state: None,
        }
    }

    /// The next output.
    pub(crate) fn next(&mut self, value: f64) -> f64 {
        let [x1, x2, y1, y2] = self.state.unwrap_or([value; 4]);
        let y = self.b * (value + 2.0 * x1 + x2) - self.a[0] * y1 - self.a[1] * y2;
        self.state = Some([value, x1, y, y1]);
        y
    }
}

/// Central difference, one-sided at the ends.
pub(crate) fn derivative(x: &[f64], rate: f64) -> Vec<f64> {
    let n = x.len();
    (0..n)
        .map(|i| {
            let (low, high) = (i.saturating_sub(1), (i + 1).min(n - 1));
            if high == low { 0.0 } else { (x[high] - x[low]) * rate / (high - low) as f64 }
        })
        .collect()
}

/// Root mean square; zero for an empty slice.
pub(crate) fn rms(x: &[f64]) -> f64 {
    if x.is_empty() { 0.0 } else { (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt() }
}

/// Normal equations gathered row by row.
#[derive(Clone, Debug)]
pub(crate) struct Normal {
    n: usize,
    gram: Vec<f64>,
    right: Vec<f64>,
    /// Sum of squares of the target and number of rows.
    pub(crate) energy: f64,
    pub(crate) rows: usize,
}

impl Normal {
    pub(crate) fn new(n: usize) -> Self {
        Self { n, gram: vec![0.0; n * n], right: vec![0.0; n], energy: 0.0, rows: 0 }
    }

    /// Number of columns.
    pub(crate) fn width(&self) -> usize {
        self.n
    }

    pub(crate) fn add(&mut self, row: &[f64], target: f64) {
        for i in 0..self.n {
            if row[i] == 0.0 {
                continue;
            }
            self.right[i] += row[i] * target;
            for j in 0..=i {
                self.gram[i * self.n + j] += row[i] * row[j];
            }
        }
        self.energy += target * target;
        self.rows += 1;
    }

    /// Rms of column `i` over the rows.
    pub(crate) fn column_rms(&self, i: usize) -> f64 {
        (self.gram[i * self.n + i] / self.rows.max(1) as f64).sqrt()
    }

    /// Least squares over the columns in `active` with a penalty per column (empty: none); zeros
    /// elsewhere. Columns that are numerically dependent get zero.
    pub(crate) fn solve(&self, active: &[usize], penalty: &[f64]) -> Vec<f64> {
        let m = active.len();
        let mut a = vec![0.0; m * m];
        let at = |i: usize, j: usize| {
            let (i, j) = if i >= j { (i, j) } else { (j, i) };
            self.gram[i * self.n + j]
        };
        for (r, &i) in active.iter().enumerate() {
            for (c, &j) in active.iter().enumerate() {
                a[r * m + c] = at(i, j);
            }
            a[r * m + r] += penalty.get(i).copied().unwrap_or(0.0);
        }
        // Cholesky with a pivot floor relative to the column's own size.
        let mut l = vec![0.0; m * m];
        let mut dropped = vec![false; m];
        for r in 0..m {
            for c in 0..=r {
                let mut sum = a[r * m + c];
                for k in 0..c {
                    sum -= l[r * m + k] * l[c * m + k];
                }
                if r == c {
                    dropped[r] = sum <= 1e-10 * a[r * m + r].max(1e-300);
                    l[r * m + r] = if dropped[r] { 1.0 } else { sum.sqrt() };
                } else {
                    l[r * m + c] = if dropped[c] { 0.0 } else { sum / l[c * m + c] };
                }
            }
            if dropped[r] {
                for c in 0..r {
                    l[r * m + c] = 0.0;
                }
            }
        }
        let mut y = vec![0.0; m];
        for r in 0..m {
            let mut sum = if dropped[r] { 0.0 } else { self.right[active[r]] };
            for k in 0..r {
                sum -= l[r * m + k] * y[k];
            }
            y[r] = sum / l[r * m + r];
        }
        let mut out = vec![0.0; self.n];
        for r in (0..m).rev() {
            let mut sum = y[r];
            for k in r + 1..m {
                sum -= l[k * m + r] * out[active[k]];
            }
            out[active[r]] = if dropped[r] { 0.0 } else { sum / l[r * m + r] };
        }
        out
    }

    /// The inverse of the columns' second moments on a vector over `active`.
    pub(crate) fn weigh(&self, active: &[usize], right: &[f64]) -> Vec<f64> {
        let mut other = self.clone();
        other.right = right.to_vec();
        other.solve(active, &[])
    }

    /// Least squares of column `target` over the columns in `active`.
    pub(crate) fn regress(&self, active: &[usize], target: usize) -> Vec<f64> {
        let mut other = self.clone();
        other.right = (0..self.n)
            .map(|i| {
                let (high, low) = (i.max(target), i.min(target));
                self.gram[high * self.n + low]
            })
            .collect();
        other.solve(active, &[])
    }

    /// Residual sum of squares for the coefficients.
    pub(crate) fn residual(&self, coefficients: &[f64]) -> f64 {
        let mut total = self.energy;
        for i in 0..self.n {
            if coefficients[i] == 0.0 {
                continue;
            }
            total -= 2.0 * coefficients[i] * self.right[i];
            for j in 0..=i {
                let twice = if i == j { 1.0 } else { 2.0 };
                total += twice * coefficients[i] * coefficients[j] * self.gram[i * self.n + j];
            }
        }
        total.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn low_pass_keeps_the_slow_and_halves_the_corner() {
        let rate = 1000.0;
        let sine = |hz: f64| -> Vec<f64> {
            (0..8000).map(|i| (2.0 * PI * hz * f64::from(i) / rate).sin()).collect()
        };
        let gain = |hz: f64| rms(&low_pass(&sine(hz), rate, 50.0)[2000..6000]) * std::f64::consts::SQRT_2;
        assert!((gain(2.0) - 1.0).abs() < 1e-3);
        assert!((gain(50.0) - 0.5).abs() < 5e-3, "{}", gain(50.0));
        assert!(gain(400.0) < 1e-3);
    }

    #[test]
    fn least_squares_recovers_a_line_and_survives_a_repeated_column() {
        let mut normal = Normal::new(3);
        for i in 0..50 {
            let x = f64::from(i) * 0.1;
            normal.add(&[x, 1.0, 2.0 * x], 3.0 * x - 1.0);
        }
        let c = normal.solve(&[0, 1], &[]);
        assert!((c[0] - 3.0).abs() < 1e-9 && (c[1] + 1.0).abs() < 1e-9);
        let c = normal.solve(&[0, 1, 2], &[]);
        assert!((c[0] + 2.0 * c[2] - 3.0).abs() < 1e-6, "{c:?}");
        assert!(normal.residual(&c) < 1e-6);
    }
}
