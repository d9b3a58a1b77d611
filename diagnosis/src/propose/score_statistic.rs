//! The score test of an effect: how much likelihood its terms would add, with everything already in
//! the model projected out.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::effective_command::{effective_command, effective_commands};
use crate::fit::input::Input;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::nominal::Nominal;
use crate::fit::regressors::effect_inputs;
use crate::laws::Effect;
use crate::propose::context::PER_COEFFICIENT;
use numerics::linear::dot;
use numerics::linear::{Factor, Square};
use numerics::parallel;

/// The result of a score test.
#[derive(Debug, Clone)]
pub(crate) struct Score {
    /// Gain of log-likelihood if the terms were free.
    pub(crate) gain: f64,
}

/// Whitened responses of an effect's terms over each recording: `[recording][term][block]`.
pub(crate) type Terms = Vec<Vec<Vec<f64>>>;

/// Inputs that an effect would add to a model over one recording; `after` is the effective command
/// with it, where it acts on the command.
fn added_inputs(
    model: &Model,
    track: &BlockedRecording,
    effect: &Effect,
    after: Option<&Vec<f64>>,
) -> Vec<Input> {
    let before = effective_command(track, &model.effects);
    let command = before.as_deref().unwrap_or(&track.rows.command);
    if let Some(after) = after {
        let change: Vec<f64> = after.iter().zip(command).map(|(a, b)| a - b).collect();
        return vec![track.rows.input(&change)];
    }
    effect_inputs(track, effect, command, track.bias, || track.drive(before.as_deref()))
}

/// Sums that a score test needs: information of the terms with the model projected out, and their
/// score.
pub(crate) struct ScoreSums {
    pub(crate) information: Square,
    pub(crate) score: Vec<f64>,
}

/// Projects the model out of terms. `own` gives each recording its own coefficients.
pub(crate) fn project(fit: &Fit, residuals: &[Vec<f64>], terms: &Terms, own: bool) -> ScoreSums {
    let k = terms.iter().map(Vec::len).max().unwrap_or(0);
    let size = if own { k * terms.len() } else { k };
    let base = fit.keys.len();
    let mut information = Square::zero(size);
    let mut score = vec![0.0; size];
    let mut cross = vec![0.0; size * base];
    for (r, columns) in terms.iter().enumerate() {
        let shift = if own { r * k } else { 0 };
        for (i, a) in columns.iter().enumerate() {
            score[shift + i] += dot(a, &residuals[r]);
            for (j, b) in columns.iter().enumerate().take(i + 1) {
                let x = dot(a, b);
                information.add(shift + i, shift + j, x);
                if i != j {
                    information.add(shift + j, shift + i, x);
                }
            }
            for (response, place) in fit.prepared[r].responses.iter().zip(&fit.places[r]) {
                cross[(shift + i) * base + place] += dot(a, response);
            }
        }
    }
    let c = &fit.solution.covariance;
    for i in 0..size {
        let row: Vec<f64> =
            (0..base).map(|b| (0..base).map(|a| cross[i * base + a] * c.at(a, b)).sum()).collect();
        for j in 0..size {
            let x: f64 = (0..base).map(|b| row[b] * cross[j * base + b]).sum();
            let before = information.at(i, j);
            // The rest after projection must be more than rounding.
            let left = before - x;
            information.a[i * size + j] = if i == j && left < 1e-7 * before { 0.0 } else { left };
        }
    }
    ScoreSums { information, score }
}

/// The score test of an effect of a given shape.
pub(crate) fn score(
    fit: &Fit,
    residuals: &[Vec<f64>],
    model: &Model,
    tracks: &[BlockedRecording],
    effect: &Effect,
    nominal: &Nominal,
) -> Score {
    let all: Vec<Effect> = model.effects.iter().chain([effect]).cloned().collect();
    let effective = effective_commands(tracks, &all);
    let ignores = |effective: &Vec<Vec<f64>>| nominal.ignores_too_much(tracks, effective);
    if !effect.name.definition().is_possible(effect) || effective.as_ref().is_some_and(ignores) {
        return Score { gain: 0.0 };
    }
    // Responses of the effect's terms under the noise of the fit.
    let response = |r: usize| -> Vec<Vec<f64>> {
        let (track, one) = (&tracks[r], &fit.prepared[r]);
        let after = effective.as_ref().map(|all| &all[r]);
        let inputs = added_inputs(model, track, effect, after);
        let observed = track.observed();
        one.gains.responses(&observed, &inputs.iter().collect::<Vec<_>>())
    };
    let terms: Terms = parallel::map(tracks.len(), response);
    let sums = project(fit, residuals, &terms, effect.name.definition().has_own_phase());
    if effective.is_some() {
        // The change of the command enters with the gain itself, or the shape would mean nothing.
        let gain = fit.value(crate::fit::nominal::Key::Gain).unwrap_or(0.0);
        let value = gain * sums.score[0] - 0.5 * gain * gain * sums.information.at(0, 0);
        return Score { gain: if value.is_finite() { value } else { 0.0 } };
    }
    let coefficients = Factor::new(&sums.information).solve(&sums.score);
    let mut gain = 0.5 * dot(&coefficients, &sums.score);
    if coefficients.len() == 1 {
        let (low, high) = nominal.limits(effect.name, 0);
        let x = coefficients[0].clamp(low, high);
        gain = x * sums.score[0] - 0.5 * x * x * sums.information.at(0, 0);
    }
    Score { gain: if gain.is_finite() { gain } else { 0.0 } }
}

/// The best shape of an effect on its grid, with its gain.
pub(crate) fn best_on_grid(
    fit: &Fit,
    residuals: &[Vec<f64>],
    model: &Model,
    tracks: &[BlockedRecording],
    grid: &[Effect],
    nominal: &Nominal,
) -> Option<(Effect, Score)> {
    let scores = parallel::map_all(grid, |effect| score(fit, residuals, model, tracks, effect, nominal));
    // Of profiles along the travel the finer has more values to fit.
    let values = |effect: &Effect| effect.name.definition().profile_values(effect);
    let net = |effect: &Effect, score: &Score| score.gain - PER_COEFFICIENT * values(effect);
    let mut best: Option<(Effect, Score)> = None;
    for (effect, score) in grid.iter().zip(scores) {
        if score.gain > 0.0 && best.as_ref().is_none_or(|(e, b)| net(effect, &score) > net(e, b)) {
            best = Some((effect.clone(), score));
        }
    }
    best
}
