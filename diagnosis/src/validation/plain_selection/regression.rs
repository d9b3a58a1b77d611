//! Least squares of the equation of motion in one band, with stretches left out in turn.

use numerics::linear::{Factor, Square};

/// Folds of stretches of time, and stretches of a recording.
const FOLDS: usize = 5;
const STRETCHES: usize = 20;

/// Columns and target of one recording at the kept rows, forces.
#[derive(Clone, Default)]
pub(super) struct Block {
    pub(super) columns: Vec<Vec<f64>>,
    pub(super) target: Vec<f64>,
}

impl Block {
    /// The residual of coefficients at each row.
    pub(super) fn left(&self, coefficients: &[f64]) -> Vec<f64> {
        let mut left = self.target.clone();
        for (c, column) in coefficients.iter().zip(&self.columns).filter(|(c, _)| **c != 0.0) {
            left.iter_mut().zip(column).for_each(|(l, x)| *l -= c * x);
        }
        left
    }

    fn fold(&self, row: usize) -> usize {
        row * STRETCHES / self.target.len() % FOLDS
    }

    /// Adds sums of products over the rows that count.
    fn add_to(&self, (square, score): (&mut Square, &mut [f64]), counts: impl Fn(usize) -> bool) {
        for row in (0..self.target.len()).filter(|row| counts(*row)) {
            for (i, a) in self.columns.iter().enumerate().filter(|(_, a)| a[row] != 0.0) {
                score[i] += a[row] * self.target[row];
                for (j, b) in self.columns.iter().enumerate() {
                    square.add(i, j, a[row] * b[row]);
                }
            }
        }
    }
}

fn solve_where(blocks: &[Block], counts: impl Fn(&Block, usize) -> bool) -> Vec<f64> {
    let n = blocks.first().map_or(0, |block| block.columns.len());
    let (mut square, mut score) = (Square::zero(n), vec![0.0; n]);
    for block in blocks {
        block.add_to((&mut square, &mut score), |row| counts(block, row));
    }
    Factor::new(&square).solve(&score)
}

/// Least squares over the blocks.
pub(super) fn solve(blocks: &[Block]) -> Vec<f64> {
    solve_where(blocks, |_, _| true)
}

/// Root mean square left on stretches that were left out of the fit.
pub(super) fn left_out(blocks: &[Block]) -> f64 {
    let mut errors = Vec::new();
    for fold in 0..FOLDS {
        let coefficients = solve_where(blocks, |block, row| block.fold(row) != fold);
        for block in blocks {
            let left = block.left(&coefficients);
            errors
                .extend(left.iter().enumerate().filter(|(row, _)| block.fold(*row) == fold).map(|(_, e)| *e));
        }
    }
    rms(&errors)
}

/// Root mean square left by coefficients.
pub(super) fn left_on(blocks: &[Block], coefficients: &[f64]) -> f64 {
    rms(&blocks.iter().flat_map(|block| block.left(coefficients)).collect::<Vec<_>>())
}

fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt()
}
