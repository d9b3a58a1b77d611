//! The skew between command and reading: a log may store a command up to a row before or after the
//! time at which it acts, and a simulation that integrates by Euler's method is half a row early or
//! late. If that explains most of the residual of the nominal model, every model allows for it, so
//! that no effect has to explain it.
//!
//! Large skews shift the commands themselves; the rest is a column of the linear fit, and so is
//! what happens within a row: a command may change there, or act all at once.

use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::effective_command::delayed;
use crate::estimation::filter::Noise;
use crate::estimation::fit::Fit;
use crate::estimation::force_residual::Estimator;
use crate::estimation::model::Model;
use crate::estimation::nominal::{Key, Nominal};
use crate::estimation::skew_columns::MOST_ROWS;

/// Gain in log-likelihood from which there is a skew, nats.
const SEEN: f64 = 6.0;
/// Part of the largest skew from which it is at its limit.
const AT_LIMIT: f64 = 0.98;
/// Part of the mean square above the noise of the sensor that a skew may leave. Other physics, and
/// commands that a loop makes of noise, show false skews, which leave most of it.
const MOST_LEFT: f64 = 0.5;
/// Rounds of shifting the commands and fitting the rest.
const ROUNDS: usize = 3;
/// A skew that changes by less is found, rows.
const FOUND: f64 = 0.01;

/// Delays the commands of recordings by a number of their rows; a negative number advances them.
pub(crate) fn delay_commands(tracks: &mut [BlockedRecording], rows: f64) {
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

/// Finds the skew of recordings under the nominal model and delays their commands by it. Nothing
/// changes if the recordings show no skew or more than a row of it, or if it does not explain most
/// of the residual of the nominal model.
pub(crate) fn settle(nominal: &mut Nominal, tracks: &mut [BlockedRecording], noise: &Noise, scale: f64) {
    let without = Fit::new(&Model::default(), nominal, tracks, noise);
    let mut trial = Nominal { skew_rows: Some(0.0), ..nominal.clone() };
    let mut shifted = tracks.to_vec();
    let mut fit = Fit::new(&Model::default(), &trial, &shifted, noise);
    if fit.log_likelihood - without.log_likelihood < SEEN {
        return;
    }
    for _ in 0..ROUNDS {
        let (Some(skew), Some(gain)) = (fit.value(Key::Skew), fit.value(Key::Gain)) else { return };
        let (before, step) = (trial.skew_rows.unwrap_or(0.0), skew / gain);
        if (before + step).abs() > AT_LIMIT * MOST_ROWS {
            return;
        }
        trial.skew_rows = Some(before + step);
        delay_commands(&mut shifted, step);
        fit = Fit::new(&Model::default(), &trial, &shifted, noise);
        if step.abs() < FOUND {
            break;
        }
    }
    let estimator = Estimator::new(tracks, noise, scale);
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let left = |fit: &Fit, tracks: &[BlockedRecording]| {
        let totals = fit.totals(tracks);
        let residuals: Vec<Vec<f64>> =
            tracks.iter().zip(&totals).map(|(track, total)| estimator.residual(track, total)).collect();
        estimator.rms(&residuals, tracks).powi(2) - estimator.counting(tracks, noise, count).powi(2)
    };
    if left(&fit, &shifted) < MOST_LEFT * left(&without, tracks) {
        tracks.clone_from_slice(&shifted);
        nominal.skew_rows = trial.skew_rows;
    }
}
