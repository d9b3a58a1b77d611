//! The skew between command and reading: a log may store a command up to a row before or after the
//! time at which it acts, and a simulation that integrates by Euler's method is half a row early or
//! late. If that explains most of the residual of the nominal model, every model allows for it, so
//! that no effect has to explain it.
//!
//! Large skews shift the commands themselves; the rest is a column of the linear fit, and so is
//! what happens within a row: a command may change there, or act all at once.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::effective_command::delayed;
use crate::fit::filter::Noise;
use crate::fit::force_residual::Estimator;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::nominal::{Key, Nominal};
use crate::fit::skew_columns::MOST_ROWS;

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

/// A skew under a model.
struct Skew {
    /// Rows by which commands act late.
    rows: f64,
    /// The recordings with their commands delayed by it.
    tracks: Vec<BlockedRecording>,
    /// The model and a skew, fitted to them.
    fit: Fit,
}

/// Finds the skew on top of a model by fitting it and shifting the commands in turn; none where it
/// is more than a row or adds less than [`SEEN`] to the log-likelihood `without` it.
fn find(
    model: &Model,
    nominal: &Nominal,
    tracks: &[BlockedRecording],
    noise: &Noise,
    without: f64,
) -> Option<Skew> {
    let mut rows = 0.0;
    let mut shifted = tracks.to_vec();
    let fitted = |rows: f64, tracks: &[BlockedRecording]| {
        Fit::new(model, &Nominal { skew_rows: Some(rows), ..nominal.clone() }, tracks, noise)
    };
    let mut fit = fitted(rows, &shifted);
    if fit.log_likelihood - without < SEEN {
        return None;
    }
    for _ in 0..ROUNDS {
        let step = fit.value(Key::Skew)? / fit.value(Key::Gain)?;
        rows += step;
        if rows.abs() > AT_LIMIT * MOST_ROWS {
            return None;
        }
        delay_commands(&mut shifted, step);
        fit = fitted(rows, &shifted);
        if step.abs() < FOUND {
            break;
        }
    }
    Some(Skew { rows, tracks: shifted, fit })
}

/// True if a skew takes most of the mean square above the noise of the sensor that a model leaves.
fn takes_most(
    skew: &Skew,
    without: &Fit,
    nominal: &Nominal,
    tracks: &[BlockedRecording],
    noise: &Noise,
    scale: f64,
) -> bool {
    let estimator = Estimator::new(tracks, noise, scale);
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let power_left = |fit: &Fit, tracks: &[BlockedRecording]| {
        let totals = fit.totals(tracks);
        let residuals: Vec<Vec<f64>> =
            tracks.iter().zip(&totals).map(|(track, total)| estimator.residual(track, total)).collect();
        estimator.rms(&residuals, tracks).powi(2) - estimator.counting(tracks, noise, count).powi(2)
    };
    power_left(&skew.fit, &skew.tracks) < MOST_LEFT * power_left(without, tracks)
}

/// Finds the skew of recordings under the nominal model and delays their commands by it. Nothing
/// changes if the recordings show no skew or more than a row of it, or if it does not explain most
/// of the residual of the nominal model.
pub(crate) fn settle(nominal: &mut Nominal, tracks: &mut [BlockedRecording], noise: &Noise, scale: f64) {
    let model = Model::default();
    let without = Fit::new(&model, nominal, tracks, noise);
    let Some(skew) = find(&model, nominal, tracks, noise, without.log_likelihood) else { return };
    if takes_most(&skew, &without, nominal, tracks, noise, scale) {
        tracks.clone_from_slice(&skew.tracks);
        nominal.skew_rows = Some(skew.rows);
    }
}

/// Returns the skew, in rows, that an effect of a model represents, or that takes most of the
/// residual of the model: missing effects may hide a skew until they are in the model. None where
/// the nominal model allows for a skew already.
pub(crate) fn hidden(
    model: &Model,
    nominal: &Nominal,
    tracks: &[BlockedRecording],
    noise: &Noise,
    scale: f64,
) -> Option<f64> {
    if nominal.skew_rows.is_some() || model.effects.is_empty() {
        return None;
    }
    let whole = Fit::new(model, nominal, tracks, noise);
    let replaces = |effect: usize| {
        let mut less = model.clone();
        less.effects.remove(effect);
        let skew = find(&less, nominal, tracks, noise, f64::NEG_INFINITY)?;
        (skew.fit.log_likelihood >= whole.log_likelihood).then_some(skew)
    };
    let better = |a: &Skew, b: &Skew| a.fit.log_likelihood.total_cmp(&b.fit.log_likelihood);
    let replacing = (0..model.effects.len()).filter_map(replaces).max_by(better);
    let skew = replacing.or_else(|| {
        let skew = find(model, nominal, tracks, noise, whole.log_likelihood)?;
        takes_most(&skew, &whole, nominal, tracks, noise, scale).then_some(skew)
    })?;
    Some(skew.rows)
}
