//! The skew between command and reading: a log may store a command up to a row before or after the time at which it acts, and a
//! simulation that integrates by Euler's method is half a row early or late. Every model has it, so that no effect has to explain it.
//!
//! Large skews shift the commands themselves; what is left is a column of the linear fit, and so is what happens within a row: a
//! command may change there, or act all at once.

use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::effective_command::delayed;
use crate::estimation::filter::Noise;
use crate::estimation::fit::Fit;
use crate::estimation::model::Model;
use crate::estimation::nominal::{Key, Nominal};
use crate::numerics::linear::Prior;

/// Largest skew, rows: a command that is farther off is late for another reason.
const MOST_ROWS: f64 = 1.0;
/// Largest part that acts in the row before or after.
const MOST_SPREAD: f64 = 0.25;
/// Standard deviation of a skew before anything is known, rows.
const SD_ROWS: f64 = 0.5;
/// Gain in log-likelihood from which there is a skew, nats.
const SEEN: f64 = 6.0;
/// Part of the largest skew from which it is at its limit.
const AT_LIMIT: f64 = 0.98;
/// Rounds of shifting the commands and fitting what is left.
const ROUNDS: usize = 3;
/// A skew that changes by less is found, rows.
const FOUND: f64 = 0.01;

/// Change of a command, held row by row, per row that it acts late.
pub(crate) fn per_row_late(command: &[f64]) -> Vec<f64> {
    let last = command.len().saturating_sub(1);
    (0..command.len()).map(|k| 0.5 * (command[k.saturating_sub(1)] - command[(k + 1).min(last)])).collect()
}

/// Change of a command, held row by row, per part of it that acts in the row before and as much in the row after.
pub(crate) fn per_part_spread(command: &[f64]) -> Vec<f64> {
    let last = command.len().saturating_sub(1);
    (0..command.len())
        .map(|k| command[k.saturating_sub(1)] - 2.0 * command[k] + command[(k + 1).min(last)])
        .collect()
}

/// The prior of a spread. A command that is put off by half a row as the mean over each row is spread by 1/4, where it changes
/// within the row by 1/8, and where it acts at once, as Euler's method has it, by none.
pub(crate) fn prior_of_spread(gain: f64) -> Prior {
    let most = MOST_SPREAD * gain.abs();
    Prior { mean: 0.0, sd: 0.5 * most, low: -most, high: most }
}

/// The prior of the column's coefficient where commands were put off by `rows` already: all together is about zero.
pub(crate) fn prior(gain: f64, rows: f64) -> Prior {
    let (a, b) = ((-MOST_ROWS - rows) * gain, (MOST_ROWS - rows) * gain);
    Prior { mean: -rows * gain, sd: SD_ROWS * gain.abs(), low: a.min(b), high: a.max(b) }
}

/// Puts the commands of recordings off by a number of their rows.
pub(crate) fn put_off(tracks: &mut [BlockedRecording], rows: f64) {
    for track in tracks {
        let late = delayed(&track.rows.command, &track.rows.hold, rows * row_s(track));
        track.set_command(late);
    }
}

/// Rows by which the commands of a fit act late, in all.
pub(crate) fn total_rows(nominal: &Nominal, fit: &Fit) -> Option<f64> {
    let before = nominal.skew_rows?;
    Some(before + fit.value(Key::Skew)? / fit.value(Key::Gain)?)
}

/// Mean length of a row, s.
pub(crate) fn row_s(track: &BlockedRecording) -> f64 {
    let hold = &track.rows.hold;
    hold.iter().sum::<f64>() / hold.len().max(1) as f64
}

/// Finds the skew of recordings under the nominal model and puts their commands off by it. Nothing changes where the
/// recordings show none, or more than a row.
pub(crate) fn settle(nominal: &mut Nominal, tracks: &mut [BlockedRecording], noise: &Noise) {
    let without = Fit::new(&Model::default(), nominal, tracks, noise).log_likelihood;
    let mut trial = Nominal { skew_rows: Some(0.0), ..nominal.clone() };
    let mut shifted = tracks.to_vec();
    for _ in 0..ROUNDS {
        let fit = Fit::new(&Model::default(), &trial, &shifted, noise);
        let (Some(skew), Some(gain)) = (fit.value(Key::Skew), fit.value(Key::Gain)) else { return };
        let before = trial.skew_rows.unwrap_or(0.0);
        let step = skew / gain;
        if fit.log_likelihood - without < SEEN || (before + step).abs() > AT_LIMIT * MOST_ROWS {
            return;
        }
        trial.skew_rows = Some(before + step);
        put_off(&mut shifted, step);
        if step.abs() < FOUND {
            break;
        }
    }
    tracks.clone_from_slice(&shifted);
    nominal.skew_rows = trial.skew_rows;
}
