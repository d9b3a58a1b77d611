//! The two columns that a skew between command and reading adds to a model, and their priors.

use numerics::linear::Prior;

/// Largest skew, rows: a command that is farther off is late for another reason.
pub(crate) const MOST_ROWS: f64 = 1.0;
/// Largest part that acts in the row before or after.
const MOST_SPREAD: f64 = 0.25;
/// Standard deviation of a skew before anything is known, rows.
const SD_ROWS: f64 = 0.5;

/// Change of a command, held row by row, per row that it acts late.
pub(crate) fn per_row_late(command: &[f64]) -> Vec<f64> {
    let last = command.len().saturating_sub(1);
    (0..command.len()).map(|k| 0.5 * (command[k.saturating_sub(1)] - command[(k + 1).min(last)])).collect()
}

/// Change of a command, held row by row, per part of it that acts in the row before and as much in
/// the row after.
pub(crate) fn per_part_spread(command: &[f64]) -> Vec<f64> {
    let last = command.len().saturating_sub(1);
    (0..command.len())
        .map(|k| command[k.saturating_sub(1)] - 2.0 * command[k] + command[(k + 1).min(last)])
        .collect()
}

/// The prior of a spread. A command that is delayed by half a row, as the mean over each row, is
/// spread by 1/4; one that changes in the middle of the row by 1/8; and one that acts at one
/// instant, as in Euler's method, by nothing.
pub(crate) fn prior_of_spread(gain: f64) -> Prior {
    let most = MOST_SPREAD * gain.abs();
    Prior { mean: 0.0, sd: 0.5 * most, low: -most, high: most }
}

/// The prior of the coefficient of the skew if the commands were already delayed by `rows`: its
/// mean is no skew in all.
pub(crate) fn prior(gain: f64, rows: f64) -> Prior {
    let (a, b) = ((-MOST_ROWS - rows) * gain, (MOST_ROWS - rows) * gain);
    Prior { mean: -rows * gain, sd: SD_ROWS * gain.abs(), low: a.min(b), high: a.max(b) }
}
