//! The search for the joint between a motor and its load: the values of its law go together, have
//! many optima, and depend on the fitted machine parameters. It moves shapes and chooses no
//! effects.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::Noise;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::fit::refit;
use crate::fit::smoother::Knows;
use crate::laws::{Effect, WholeMachine};
use crate::propose::candidates;
use crate::propose::context::{FitContext, FittedModel};
use crate::propose::shape_search::descend;
use numerics::parallel;

/// From how many of the best places a search goes downhill, and how many of the ends are settled.
const STARTS: usize = 4;
const SETTLED: usize = 2;
/// The number of refits of the machine, and the gain of log-likelihood below which they stop.
const ROUNDS: usize = 8;
const ENOUGH: f64 = 1.0;

/// True if the law of an effect is built on the rest of the machine.
pub(crate) fn is_joint(effect: &Effect) -> bool {
    effect.is_joint()
}

fn ends_in_joint(model: &Model) -> bool {
    model.effects.last().is_some_and(is_joint)
}

/// Models with the shape of the last effect at every combination of its factors.
fn elsewhere(context: &FitContext, model: &Model) -> Vec<Model> {
    let last = model.effects.len() - 1;
    let factors = model.effects[last].name.definition().start_factors();
    let movable = candidates::movable(&model.effects[last], context.span);
    let mut out = vec![model.clone()];
    for (key, factors) in factors {
        let (_, low, high) = movable.iter().find(|(k, _, _)| k == key).expect("what has factors may move");
        let moved = |model: &Model, factor: f64| {
            let mut moved = model.clone();
            let at = moved.effects[last].shape.get_mut(*key).expect("what may move is there");
            *at = (*at * factor).clamp(*low, *high);
            moved
        };
        out = out.iter().flat_map(|model| factors.iter().map(|factor| moved(model, *factor))).collect();
    }
    out
}

/// The best model that ways downhill from other places lead to, with its penalised
/// log-likelihood; none where the last
/// effect is no joint.
pub(crate) fn search(
    context: &FitContext,
    model: &Model,
    noise: &Noise,
    log_score: &(dyn Fn(&Model) -> f64 + Sync),
) -> Option<(f64, Model)> {
    if !ends_in_joint(model) {
        return None;
    }
    let best = |mut found: Vec<(f64, Model)>, count: usize| {
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        found.truncate(count);
        found
    };
    let all: Vec<Model> = elsewhere(context, model).into_iter().collect();
    let starts = parallel::map_all(&all, log_score).into_iter().zip(all).collect();
    let ends = parallel::map_all(&best(starts, STARTS), |(value, start)| {
        descend(context, start.clone(), noise, *value, log_score)
    });
    let settled =
        parallel::map_all(&best(ends, SETTLED), |end| settle(context, end.clone(), noise, log_score));
    settled.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))
}

/// The model with its joint on another machine.
fn on(machine: &WholeMachine, model: &Model) -> Model {
    let mut on = model.clone();
    on.effects.last_mut().expect("there is a joint").put_on(machine);
    on
}

/// Gives the law of a joint the machine and the standing forces that were fitted with it, where it
/// began with others, and moves its shape again, for as long as that helps; a model without one
/// stays as it is.
pub(crate) fn settle(
    context: &FitContext,
    (mut best, mut model): (f64, Model),
    noise: &Noise,
    log_score: &dyn Fn(&Model) -> f64,
) -> (f64, Model) {
    if !ends_in_joint(&model) {
        return (best, model);
    }
    for _ in 0..ROUNDS {
        let fit = Fit::new(&model, context.nominal, context.tracks, noise);
        let mut trial = on(&context.nominal.machine(&|key| fit.value(key)), &model);
        trial.bias = (0..context.tracks.len()).map(|r| fit.bias(r)).collect();
        let start = log_score(&trial);
        let (value, trial) = descend(context, trial, noise, start, log_score);
        if value <= best {
            break;
        }
        let gain = value - best;
        (best, model) = (value, trial);
        if gain < ENOUGH {
            break;
        }
    }
    (best, model)
}

/// A fitted model with its joint, if its last effect is one, settled on motion that has changed.
pub(crate) fn settled(context: &FitContext, candidate: FittedModel) -> FittedModel {
    if !ends_in_joint(&candidate.model) {
        return candidate;
    }
    let log_score = |model: &Model| context.log_score_of(model, &candidate.noise);
    let found = (log_score(&candidate.model), candidate.model.clone());
    let (_, model) = settle(context, found, &candidate.noise, &log_score);
    context.fit(model, &candidate.noise, Colour::White)
}

/// Fitted recordings smoothed with a model fitted to them, and the model fitted again: what a null
/// leaves out is noise to its smoother, and next to rest and reversals such a smoother knows
/// neither the speed nor its sign.
pub(crate) fn in_its_own_motion(
    tracks: &[BlockedRecording],
    candidate: FittedModel,
    on: &FitContext,
) -> (Vec<BlockedRecording>, FittedModel) {
    let mut own = tracks.to_vec();
    let count = 1.0 / on.nominal.rig.encoder.counts_per_unit;
    refit::estimate_motion(&mut own, &candidate.fit.totals(tracks), &candidate.noise, count, Knows::All);
    let context = FitContext { tracks: &own, ..*on };
    let again = context.fit(candidate.model, &candidate.noise, Colour::White);
    let again = settled(&context, again);
    (own, again)
}
