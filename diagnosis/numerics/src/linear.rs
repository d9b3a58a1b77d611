//! Small dense linear algebra: symmetric positive systems with a prior, bounds and removal of rows.

/// A square symmetric matrix, row by row.
#[derive(Debug, Clone)]
pub struct Square {
    /// Rows, as many as columns.
    pub n: usize,
    /// `n`² entries, row by row.
    pub a: Vec<f64>,
}

impl Square {
    /// Returns a matrix of zeros.
    pub fn zero(n: usize) -> Self {
        Self { n, a: vec![0.0; n * n] }
    }
    /// Returns the entry of a row and a column.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.a[i * self.n + j]
    }
    /// Adds to the entry of a row and a column.
    pub fn add(&mut self, i: usize, j: usize, x: f64) {
        self.a[i * self.n + j] += x;
    }
}

/// Cholesky factor of a symmetric matrix scaled to a unit diagonal; directions without information
/// are left out.
#[derive(Debug, Clone)]
pub struct Factor {
    n: usize,
    l: Vec<f64>,
    scale: Vec<f64>,
    live: Vec<bool>,
}

/// Smallest pivot of the scaled matrix that still counts as information.
const PIVOT: f64 = 1e-10;

impl Factor {
    /// Factors `m`, whose lower half is read.
    pub fn new(m: &Square) -> Self {
        let n = m.n;
        let scale: Vec<f64> = (0..n)
            .map(|i| m.at(i, i))
            .map(|d| if d > 0.0 && d.is_finite() { 1.0 / d.sqrt() } else { 0.0 })
            .collect();
        let mut l = vec![0.0; n * n];
        let mut live = vec![true; n];
        for i in 0..n {
            for j in 0..=i {
                let mut sum = m.at(i, j) * scale[i] * scale[j];
                for k in 0..j {
                    sum -= l[i * n + k] * l[j * n + k];
                }
                if i == j {
                    if sum > PIVOT {
                        l[i * n + i] = sum.sqrt();
                    } else {
                        live[i] = false;
                        for k in 0..=i {
                            l[i * n + k] = 0.0;
                        }
                    }
                } else if live[j] {
                    l[i * n + j] = sum / l[j * n + j];
                }
            }
        }
        Self { n, l, scale, live }
    }

    /// Logarithm of the determinant, without the directions that carry no information.
    pub fn log_det(&self) -> f64 {
        let live = (0..self.n).filter(|i| self.live[*i]);
        live.map(|i| 2.0 * (self.l[i * self.n + i] / self.scale[i]).ln()).sum()
    }

    /// Solves for a right-hand side; zero in directions without information.
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        let n = self.n;
        let mut x: Vec<f64> = b.iter().zip(&self.scale).map(|(b, s)| b * s).collect();
        for i in 0..n {
            if !self.live[i] {
                x[i] = 0.0;
                continue;
            }
            for k in 0..i {
                x[i] -= self.l[i * n + k] * x[k];
            }
            x[i] /= self.l[i * n + i];
        }
        for i in (0..n).rev() {
            if !self.live[i] {
                continue;
            }
            for k in i + 1..n {
                x[i] -= self.l[k * n + i] * x[k];
            }
            x[i] /= self.l[i * n + i];
        }
        x.iter().zip(&self.scale).map(|(x, s)| x * s).collect()
    }

    /// The inverse, zero in directions without information.
    pub fn inverse(&self) -> Square {
        let mut out = Square::zero(self.n);
        for j in 0..self.n {
            let mut unit = vec![0.0; self.n];
            unit[j] = 1.0;
            let column = self.solve(&unit);
            for (i, x) in column.iter().enumerate() {
                out.a[i * self.n + j] = if self.live[j] { *x } else { 0.0 };
            }
        }
        out
    }
}

/// Inner product of two stretches.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    // Four partial sums in a fixed order: fast, and the same on every machine and thread count.
    let mut sum = [0.0; 4];
    let (a4, b4) = (a.chunks_exact(4), b.chunks_exact(4));
    let rest: f64 = a4.remainder().iter().zip(b4.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a4.zip(b4) {
        for i in 0..4 {
            sum[i] += a[i] * b[i];
        }
    }
    (sum[0] + sum[1]) + (sum[2] + sum[3]) + rest
}

/// Correlation of two signals of the same length; zero where one does not vary.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len().min(b.len()).max(1) as f64;
    let mean = |x: &[f64]| x.iter().sum::<f64>() / n;
    let (ma, mb) = (mean(a), mean(b));
    let (mut aa, mut bb, mut ab) = (0.0, 0.0, 0.0);
    for (x, y) in a.iter().zip(b) {
        let (x, y) = (x - ma, y - mb);
        aa += x * x;
        bb += y * y;
        ab += x * y;
    }
    if aa > 0.0 && bb > 0.0 { ab / (aa * bb).sqrt() } else { 0.0 }
}

/// The prior of a coefficient, with its bounds.
#[derive(Debug, Clone, Copy)]
pub struct Prior {
    /// Expected value.
    pub mean: f64,
    /// Infinite where nothing is known.
    pub sd: f64,
    /// Smallest value allowed.
    pub low: f64,
    /// Largest value allowed.
    pub high: f64,
}

impl Prior {
    /// Nothing is known, nothing is forbidden.
    pub const FREE: Self = Self { mean: 0.0, sd: f64::INFINITY, low: f64::NEG_INFINITY, high: f64::INFINITY };
}

/// The answer of [`bounded`].
#[derive(Debug, Clone)]
pub struct Solution {
    /// The coefficients.
    pub x: Vec<f64>,
    /// True if a coefficient is at a bound.
    pub bound: Vec<bool>,
    /// Covariance with the prior, for unit residual variance; zero at bounds.
    pub covariance: Square,
    /// ½·prior square.
    pub prior_cost: f64,
}

/// Solves for the coefficients that are not fixed; gives their places, the factor of their matrix
/// and the solution.
fn solve_free(full: &Square, right: &[f64], fixed: &[Option<f64>]) -> (Vec<usize>, Factor, Vec<f64>) {
    let free: Vec<usize> = (0..fixed.len()).filter(|i| fixed[*i].is_none()).collect();
    let mut part = Square::zero(free.len());
    let mut rhs = vec![0.0; free.len()];
    for (a, i) in free.iter().enumerate() {
        rhs[a] = right[*i];
        for (j, value) in fixed.iter().enumerate() {
            if let Some(value) = value {
                rhs[a] -= full.at(*i, j) * value;
            }
        }
        for (b, j) in free.iter().enumerate() {
            part.a[a * free.len() + b] = full.at(*i, *j);
        }
    }
    let factor = Factor::new(&part);
    let solution = factor.solve(&rhs);
    (free, factor, solution)
}

/// The free coefficient that is furthest outside its bounds, if one is.
fn worst_outside(free: &[usize], x: &[f64], priors: &[Prior]) -> Option<usize> {
    let outside = |i: usize| {
        let out = (priors[i].low - x[i]).max(x[i] - priors[i].high).max(0.0);
        let width = priors[i].high - priors[i].low;
        (i, out / if width.is_finite() { width } else { x[i].abs().max(1e-300) })
    };
    let all = free.iter().map(|i| outside(*i)).filter(|(_, out)| *out > 0.0);
    all.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i)
}

/// Minimises ½ xᵀMx − bᵀx plus the priors within bounds, by an active set.
pub fn bounded(m: &Square, b: &[f64], priors: &[Prior]) -> Solution {
    let n = m.n;
    let mut full = m.clone();
    let mut right = b.to_vec();
    for (i, prior) in priors.iter().enumerate() {
        if prior.sd.is_finite() {
            let w = 1.0 / (prior.sd * prior.sd);
            full.add(i, i, w);
            right[i] += w * prior.mean;
        }
    }
    let mut fixed: Vec<Option<f64>> = vec![None; n];
    let mut x = vec![0.0; n];
    let mut covariance = Square::zero(n);
    for _ in 0..=n {
        let (free, factor, y) = solve_free(&full, &right, &fixed);
        for (i, value) in fixed.iter().enumerate() {
            if let Some(value) = value {
                x[i] = *value;
            }
        }
        for (i, y) in free.iter().zip(y) {
            x[*i] = y;
        }
        if let Some(i) = worst_outside(&free, &x, priors) {
            fixed[i] = Some(x[i].clamp(priors[i].low, priors[i].high));
            continue;
        }
        let inverse = factor.inverse();
        for (a, i) in free.iter().enumerate() {
            for (b, j) in free.iter().enumerate() {
                covariance.a[i * n + j] = inverse.at(a, b);
            }
        }
        break;
    }
    let mut prior_cost = 0.0;
    for (x, prior) in x.iter().zip(priors) {
        if prior.sd.is_finite() {
            prior_cost += 0.5 * ((x - prior.mean) / prior.sd).powi(2);
        }
    }
    Solution { x, bound: fixed.iter().map(Option::is_some).collect(), covariance, prior_cost }
}
