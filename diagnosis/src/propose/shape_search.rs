//! Moves all values of a shape together: Gauss–Newton on whitened innovations, with the
//! coefficients projected out.

use crate::fit::filter::Noise;
use crate::fit::input::Input;
use crate::fit::linear_fit::Fit;
use crate::fit::model::{Model, total};
use crate::propose::candidates;
use crate::propose::context::FitContext;
use crate::propose::score_statistic::{Terms, project};
use numerics::linear::Factor;
use numerics::parallel;

/// Most steps, and the longest, as a change of a value's logarithm.
const STEPS: usize = 6;
const LONGEST: f64 = 0.5;
/// Change of a logarithm over which derivatives are taken.
const APART: f64 = 0.02;
/// Parts of a step that are tried.
const PARTS: [f64; 3] = [1.0, 0.4, 0.15];
/// Gain of log-likelihood below which it is not worth going on.
const ENOUGH: f64 = 0.5;

/// The model with the shape of its last effect where `log_score` is larger than `best`, as far as
/// steps downhill lead, and its score there.
pub(crate) fn descend(
    context: &FitContext,
    mut model: Model,
    noise: &Noise,
    mut best: f64,
    log_score: &dyn Fn(&Model) -> f64,
) -> (f64, Model) {
    let last = model.effects.len() - 1;
    let movable = candidates::movable(&model.effects[last], context.span);
    for _ in 0..STEPS {
        let step = step(context, &model, noise);
        let moved = |part: f64| {
            let mut trial = model.clone();
            for ((key, low, high), step) in movable.iter().zip(&step) {
                let at = trial.effects[last].shape.get_mut(*key).expect("what may move is there");
                *at = (*at * (part * step.clamp(-LONGEST, LONGEST)).exp()).clamp(*low, *high);
            }
            let value = log_score(&trial);
            (value > best).then_some((value, trial))
        };
        let Some((value, trial)) = PARTS.into_iter().find_map(moved) else { break };
        let gain = value - best;
        (best, model) = (value, trial);
        if gain < ENOUGH {
            break;
        }
    }
    (best, model)
}

/// The change of each value's logarithm that would leave the least.
fn step(context: &FitContext, model: &Model, noise: &Noise) -> Vec<f64> {
    let last = model.effects.len() - 1;
    let fit = Fit::new(model, context.nominal, context.tracks, noise);
    let residuals: Vec<Vec<f64>> = (0..context.tracks.len()).map(|r| fit.residual(r)).collect();
    let moved: Vec<Model> = candidates::movable(&model.effects[last], context.span)
        .iter()
        .map(|(key, _, _)| {
            let mut moved = model.clone();
            *moved.effects[last].shape.get_mut(*key).expect("what may move is there") *= APART.exp();
            moved
        })
        .collect();
    let terms: Terms = context
        .tracks
        .iter()
        .zip(&fit.prepared)
        .enumerate()
        .map(|(r, (track, one))| {
            let theta = fit.theta(r);
            let here = total(track, &one.columns, &theta);
            let derivative = |moved: &Model| {
                let there = total(track, &moved.columns(context.nominal, track, noise), &theta);
                let per = |there: &[f64], here: &[f64]| -> Vec<f64> {
                    there.iter().zip(here).map(|(a, b)| (a - b) / APART).collect()
                };
                let input = Input::Rows {
                    dv: per(&there.dv, &here.dv),
                    dq: per(&there.dq, &here.dq),
                    dz: per(&there.dz, &here.dz),
                };
                one.gains.response(&track.observed(), &input)
            };
            parallel::map_all(&moved, derivative)
        })
        .collect();
    let sums = project(&fit, &residuals, &terms, false);
    Factor::new(&sums.information).solve(&sums.score)
}
