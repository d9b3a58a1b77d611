//! Physics that has no name in the library and looks like some that has: a spring that creeps, a load that changes at once,
//! an inertia that changes along the travel, a gear that loses a part of what it carries. Nothing here is named; it only
//! speaks against a name.

use crate::effects::{Effect, EffectName as N};
use crate::estimation::fit::Fit;
use crate::estimation::model::Model;
use crate::estimation::noise::Colour;
use crate::selection::search::{FitContext, FittedModel, PER_COEFFICIENT};
use crate::thresholds::{OUTSIDE_ALONE, OUTSIDE_PART};
use crate::validation::held_out::HeldOut;
use crate::validation::judge::judge_all;
use rayon::prelude::*;

/// Times in which a force may fade, s.
const FADES_S: [f64; 6] = [0.1, 0.25, 0.6, 1.5, 4.0, 10.0];
/// Times, as parts of the longest recording, at which a load may change at once.
const CHANGES: usize = 40;
/// Degree of the polynomial along the travel that an inertia may follow.
const INERTIA_DEGREE: f64 = 12.0;

/// OutOfLibrary physics in an effect's place, or alone.
struct OutOfLibrary {
    effect: Effect,
    /// As how many values its freedom counts.
    freedom: f64,
    /// What it is, in words.
    what: String,
}

/// A spring whose force fades, in as long as it may take; `spring` is one whose force does not.
fn creeping_springs(spring: &Effect) -> Vec<OutOfLibrary> {
    let with = |time: f64| {
        let mut effect = spring.clone();
        effect.shape.insert("fades_s".into(), time);
        let what = format!("a spring that creeps, whose force fades within {time} s,");
        OutOfLibrary { effect, freedom: 4.0, what }
    };
    FADES_S.map(with).into()
}

/// A load that changes at once, at any time of a recording.
fn changing_loads(context: &FitContext) -> Vec<OutOfLibrary> {
    let at = |i: usize| {
        let time = context.span.duration * i as f64 / CHANGES as f64;
        let effect =
            Effect::shaped(N::GainDrift, &[("time_constant", context.span.duration), ("at_once_s", time)]);
        OutOfLibrary { effect, freedom: 4.0, what: format!("a load that changes at once, at {time:.1} s,") }
    };
    (1..CHANGES).map(at).collect()
}

fn changing_inertia(context: &FitContext) -> OutOfLibrary {
    let shape = [
        ("low", context.span.low),
        ("high", context.span.high),
        ("degree", INERTIA_DEGREE),
        ("of_inertia", 1.0),
    ];
    OutOfLibrary {
        effect: Effect::shaped(N::PositionDependentDamping, &shape),
        freedom: INERTIA_DEGREE,
        what: "an inertia that changes along the travel".into(),
    }
}

fn gear_loss() -> OutOfLibrary {
    OutOfLibrary {
        effect: Effect::shaped(N::LoadDependentFriction, &[("of_drive", 1.0)]),
        freedom: 1.0,
        what: "friction in proportion to the force of the drive, as a gear loses it,".into(),
    }
}

/// What may look like an effect.
fn like(effect: &Effect, context: &FitContext) -> Vec<OutOfLibrary> {
    let mut all = match effect.name {
        N::PositionSpring => creeping_springs(effect),
        N::GainDrift => changing_loads(context),
        N::EncoderEccentricity | N::MassImbalance | N::PositionDependentDamping => {
            vec![changing_inertia(context)]
        }
        _ => Vec::new(),
    };
    // Whatever bends with speed, force or command may be the loss of a gear.
    all.push(gear_loss());
    all
}

/// What foreign physics would explain of a refit where nothing is named, if it is most of it and as sure as of a name.
pub(crate) fn alone(context: &FitContext, refit: &FittedModel, holdout: &HeldOut) -> Option<String> {
    let spring = Effect::shaped(N::PositionSpring, &[("from", 0.0)]);
    let mut all = creeping_springs(&spring);
    all.extend(changing_loads(context));
    all.extend([changing_inertia(context), gear_loss()]);
    let model = |foreign: &OutOfLibrary| Model { effects: vec![foreign.effect.clone()], ..Model::default() };
    let merit = |foreign: &OutOfLibrary| {
        let fit = Fit::new(&model(foreign), context.nominal, context.tracks, &refit.noise);
        fit.log_likelihood - foreign.freedom * PER_COEFFICIENT
    };
    let tried: Vec<(f64, OutOfLibrary)> =
        all.into_par_iter().map(|foreign| (merit(&foreign), foreign)).collect();
    let (_, best) = tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let fitted = context.fit(model(&best), &refit.noise, Colour::White);
    let found = judge_all(context, &fitted, &refit.noise, holdout).pop()?;
    let is_sure = found.rejection_reason().is_none() && found.is_certain() && found.share > OUTSIDE_ALONE;
    is_sure.then(|| format!("{} would explain {:.0} % of it", best.what, 100.0 * found.share.min(1.0)))
}

/// What foreign physics a fitted effect would rather be, where some in its place explains surely more; `gain` is the
/// effect's own.
pub(crate) fn rather(context: &FitContext, fitted: &FittedModel, effect: usize, gain: f64) -> Option<String> {
    let more = |foreign: &OutOfLibrary| {
        let mut model = fitted.model.clone();
        model.effects[effect] = foreign.effect.clone();
        let fit = Fit::new(&model, context.nominal, context.tracks, &fitted.noise);
        let least = (OUTSIDE_PART * gain).max(foreign.freedom * PER_COEFFICIENT);
        fit.log_likelihood - fitted.fit.log_likelihood - least
    };
    let all = like(&fitted.model.effects[effect], context);
    let tried: Vec<(f64, OutOfLibrary)> =
        all.into_par_iter().map(|foreign| (more(&foreign), foreign)).collect();
    tried
        .into_iter()
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(more, _)| *more > 0.0)
        .map(|(_, foreign)| format!("{} would explain more", foreign.what))
}
