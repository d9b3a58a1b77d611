//! The numbers that a decision reads, the same for every hypothesis of every machine.

use crate::problem::Problem;
use numerics::linear::dot;

/// Evidence for one more law beside those of the rounds before. With the filter's gain, its
/// standard error and the motion in windows of 0.1 and 0.5 s, which are not the regression's,
/// these are fourteen numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// Part of the weighted force error that the law takes on left-out frames of the fit: 1 −
    /// √(after/before).
    pub share: f64,
    /// Mean over standard error of what the law takes, frame by frame.
    pub z: f64,
    /// Agreement of the law's force from two halves of the fit; 1 if they are equal, 0.4 if one is
    /// 2.5 times the other.
    pub size_agreement: f64,
    /// Standard errors by which the law is ahead of the next one; negative: behind the round's
    /// first.
    pub lead_z: f64,
    /// The share that smooth functions of speed, travel, time and travel since reversal take beyond
    /// the law.
    pub free_form_more: f64,
    /// Force error after the law over the noise that readings alone would leave.
    pub residual_over_noise: f64,
    /// Rows of the fit, one degree of freedom each.
    pub rows: f64,
    /// The same on the holdout, with values of the fit; for the chosen law and its printed rivals.
    pub held_out: Option<HeldOut>,
}

/// The figures of the holdout, read once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// As [`Evidence::share`].
    pub share: f64,
    /// As [`Evidence::z`].
    pub z: f64,
    /// Agreement of the law's size with that fitted to the holdout alone.
    pub size_agreement: f64,
}

/// Share, and gain by frame as half a logarithm, of residuals `after` against `before`; `first` is
/// the first row's number.
pub(crate) fn compare(p: &Problem, before: &[f64], after: &[f64], first: usize) -> (f64, Vec<f64>) {
    let share = 1.0 - (dot(after, after) / (dot(before, before) + 1e-300)).sqrt();
    let rows = &p.tiling.rows[first..first + before.len()];
    let start = rows.first().map_or(0, |r| r.frame);
    let count = rows.last().map_or(0, |r| r.frame + 1 - start);
    let mut sums = vec![(0.0, 0.0); count];
    for ((row, b), a) in rows.iter().zip(before).zip(after) {
        sums[row.frame - start].0 += b * b;
        sums[row.frame - start].1 += a * a;
    }
    // In logarithms beside the mean frame: a few loud frames do not decide.
    let mean = sums.iter().map(|s| s.1).sum::<f64>() / count.max(1) as f64 + 1e-300;
    (share, sums.iter().map(|(b, a)| 0.5 * ((b + mean) / (a + mean)).ln()).collect())
}

/// Mean over standard error; zero of fewer than three.
pub(crate) fn over_error(x: &[f64]) -> f64 {
    let n = x.len() as f64;
    if x.len() < 3 {
        return 0.0;
    }
    let mean = x.iter().sum::<f64>() / n;
    let variance = x.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    mean / ((variance / n).sqrt() + 1e-9)
}
