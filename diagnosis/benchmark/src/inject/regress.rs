//! Least squares of the equation of motion in one band: k·u on the nominal columns and those of
//! laws.

use crate::signal::{Normal, rms};

/// Columns and target of one recording at the kept rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Block {
    pub(crate) columns: Vec<Vec<f64>>,
    pub(crate) target: Vec<f64>,
}

impl Block {
    fn add_to(&self, normal: &mut Normal, wanted: impl Fn(usize) -> bool) {
        let mut row = vec![0.0; self.columns.len()];
        for i in (0..self.target.len()).filter(|i| wanted(*i)) {
            row.iter_mut().zip(&self.columns).for_each(|(x, c)| *x = c[i]);
            normal.add(&row, self.target[i]);
        }
    }

    /// Returns the residual of `coefficients` at each row.
    pub(crate) fn left(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut left = self.target.clone();
        for (c, column) in coefficients.iter().zip(&self.columns) {
            if *c != 0.0 {
                left.iter_mut().zip(column).for_each(|(l, x)| *l -= c * x);
            }
        }
        left
    }

    fn without(&self, column: usize) -> Self {
        let mut other = self.clone();
        other.columns.remove(column);
        other
    }
}

/// Least squares over the blocks.
pub(crate) fn solve(blocks: &[Block]) -> Vec<f64> {
    let n = blocks.first().map_or(0, |b| b.columns.len());
    let mut normal = Normal::new(n);
    blocks.iter().for_each(|b| b.add_to(&mut normal, |_| true));
    normal.solve(&(0..n).collect::<Vec<_>>(), &[])
}

/// Folds of stretches of time.
pub(crate) const FOLDS: usize = 5;
const STRETCHES: usize = 20;

/// Rms left on stretches that were left out of the fit.
pub(crate) fn left_out(blocks: &[Block]) -> f64 {
    let n = blocks.first().map_or(0, |b| b.columns.len());
    let all: Vec<usize> = (0..n).collect();
    let mut errors = Vec::new();
    for fold in 0..FOLDS {
        let outside = |b: &Block, i: usize| i * STRETCHES / b.target.len() % FOLDS == fold;
        let mut normal = Normal::new(n);
        blocks.iter().for_each(|b| b.add_to(&mut normal, |i| !outside(b, i)));
        let coefficients = normal.solve(&all, &[]);
        for block in blocks {
            let left = block.left(&coefficients);
            errors.extend(left.iter().enumerate().filter(|(i, _)| outside(block, *i)).map(|(_, e)| *e));
        }
    }
    rms(&errors)
}

/// Rms left by coefficients on blocks.
pub(crate) fn left_on(blocks: &[Block], coefficients: &[f64]) -> f64 {
    let errors: Vec<f64> = blocks.iter().flat_map(|b| b.left(coefficients)).collect();
    rms(&errors)
}

/// The result of least squares with the known law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Oracle {
    /// Coefficient of the true law, one where it is found as it is.
    pub(crate) coefficient: f64,
    /// Share of the held-out force error that the law takes.
    pub(crate) share: f64,
}

impl Oracle {
    /// The last column of the blocks is the true law.
    pub(crate) fn of(fits: &[Block], holdouts: &[Block]) -> Self {
        let last = fits.first().map_or(0, |b| b.columns.len().saturating_sub(1));
        let without = |blocks: &[Block]| blocks.iter().map(|b| b.without(last)).collect::<Vec<_>>();
        let with = solve(fits);
        let base = left_on(&without(holdouts), &solve(&without(fits)));
        let share = if base > 0.0 { 1.0 - left_on(holdouts, &with) / base } else { 0.0 };
        Self { coefficient: with[last], share }
    }

    /// True if the recordings show the effect to one who knows it.
    pub(crate) fn solves(&self) -> bool {
        (0.6..=1.6).contains(&self.coefficient) && self.share >= 0.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    fn block(rng: &mut Rng, size: f64) -> Block {
        let columns: Vec<Vec<f64>> = (0..2).map(|_| (0..400).map(|_| rng.normal()).collect()).collect();
        let target =
            (0..400).map(|i| 2.0 * columns[0][i] + size * columns[1][i] + 0.5 * rng.normal()).collect();
        Block { columns, target }
    }

    #[test]
    fn the_oracle_solves_what_is_there_and_nothing_else() {
        let mut rng = Rng::new(5);
        let mut blocks = |size: f64| [block(&mut rng, size)];
        let there = Oracle::of(&blocks(1.0), &blocks(1.0));
        // From sqrt(1 + 0.25) to 0.5.
        assert!((there.share - 0.553).abs() < 0.05 && there.solves(), "{there:?}");
        assert!(!Oracle::of(&blocks(0.0), &blocks(0.0)).solves());
        assert!(!Oracle::of(&blocks(1.0), &blocks(0.0)).solves(), "not on the held-out recording");
        let fit = blocks(1.0);
        assert!((left_out(&fit) / 0.5 - 1.0).abs() < 0.1);
    }
}
