//! Physics that has no name in the library and looks like some that has: a spring that creeps, a load that changes at once,
//! an inertia that changes along the travel, a gear that loses a part of what it carries. Nothing here is named; it only
//! speaks against a name.

use crate::effects::{Effect, EffectName as N};
use crate::fit::Fit;
use crate::found::judge_all;
use crate::model::Model;
use crate::noise::Colour;
use crate::select::{Bench, Candidate, PER_COEFFICIENT};
use crate::track::Track;
use rayon::prelude::*;

/// Times in which a force may fade, s.
const FADES_S: [f64; 6] = [0.1, 0.25, 0.6, 1.5, 4.0, 10.0];
/// Times, as parts of the longest recording, at which a load may change at once.
const CHANGES: usize = 40;
/// Degree of the polynomial along the travel that an inertia may follow.
const INERTIA_DEGREE: f64 = 12.0;
/// Part of what an effect gains that foreign physics must gain beside it: a law of slightly another form gains a little.
const MUCH: f64 = 0.1;
/// Part of what a refit leaves that foreign physics alone must explain to be told of: most of it.
const MOST_ALONE: f64 = 0.5;

/// Foreign physics in an effect's place, or alone.
struct Foreign {
    effect: Effect,
    /// As how many values its freedom counts.
    freedom: f64,
    /// What it is, in words.
    what: String,
}

/// A spring whose force fades, in as long as it may take; `spring` is one whose force does not.
fn creeping_springs(spring: &Effect) -> Vec<Foreign> {
    let with = |time: f64| {
        let mut effect = spring.clone();
        effect.shape.insert("fades_s".into(), time);
        let what = format!("a spring that creeps, whose force fades within {time} s,");
        Foreign { effect, freedom: 4.0, what }
    };
    FADES_S.map(with).into()
}

/// A load that changes at once, at any time of a recording.
fn changing_loads(bench: &Bench) -> Vec<Foreign> {
    let at = |i: usize| {
        let time = bench.span.duration * i as f64 / CHANGES as f64;
        let effect =
            Effect::shaped(N::GainDrift, &[("time_constant", bench.span.duration), ("at_once_s", time)]);
        Foreign { effect, freedom: 4.0, what: format!("a load that changes at once, at {time:.1} s,") }
    };
    (1..CHANGES).map(at).collect()
}

fn changing_inertia(bench: &Bench) -> Foreign {
    let shape =
        [("low", bench.span.low), ("high", bench.span.high), ("degree", INERTIA_DEGREE), ("of_inertia", 1.0)];
    Foreign {
        effect: Effect::shaped(N::PositionDependentDamping, &shape),
        freedom: INERTIA_DEGREE,
        what: "an inertia that changes along the travel".into(),
    }
}

fn gear_loss() -> Foreign {
    Foreign {
        effect: Effect::shaped(N::LoadDependentFriction, &[("of_drive", 1.0)]),
        freedom: 1.0,
        what: "friction in proportion to the force of the drive, as a gear loses it,".into(),
    }
}

/// What may look like an effect.
fn like(effect: &Effect, bench: &Bench) -> Vec<Foreign> {
    let mut all = match effect.name {
        N::PositionSpring => creeping_springs(effect),
        N::GainDrift => changing_loads(bench),
        N::EncoderEccentricity | N::MassImbalance | N::PositionDependentDamping => {
            vec![changing_inertia(bench)]
        }
        _ => Vec::new(),
    };
    // Whatever bends with speed, force or command may be the loss of a gear.
    all.push(gear_loss());
    all
}

/// What foreign physics would explain of a refit where nothing is named, if it is most of it and as sure as of a name.
pub(crate) fn alone(bench: &Bench, refit: &Candidate, held: &[Track]) -> Option<String> {
    let spring = Effect::shaped(N::PositionSpring, &[("from", 0.0)]);
    let mut all = creeping_springs(&spring);
    all.extend(changing_loads(bench));
    all.extend([changing_inertia(bench), gear_loss()]);
    let model = |foreign: &Foreign| Model { effects: vec![foreign.effect.clone()], ..Model::default() };
    let merit = |foreign: &Foreign| {
        let fit = Fit::new(&model(foreign), bench.nominal, bench.tracks, &refit.noise);
        fit.log_likelihood - foreign.freedom * PER_COEFFICIENT
    };
    let tried: Vec<(f64, Foreign)> = all.into_par_iter().map(|foreign| (merit(&foreign), foreign)).collect();
    let (_, best) = tried.into_iter().max_by(|a, b| a.0.total_cmp(&b.0))?;
    let fitted = bench.fit(model(&best), &refit.noise, Colour::White);
    let found = judge_all(bench, &fitted, held).pop()?;
    let is_sure = found.weakness().is_none() && found.is_certain() && found.share > MOST_ALONE;
    is_sure.then(|| format!("{} would explain {:.0} % of it", best.what, 100.0 * found.share.min(1.0)))
}

/// What foreign physics a fitted effect would rather be, where some in its place explains surely more; `gain` is the
/// effect's own.
pub(crate) fn rather(bench: &Bench, fitted: &Candidate, effect: usize, gain: f64) -> Option<String> {
    let more = |foreign: &Foreign| {
        let mut model = fitted.model.clone();
        model.effects[effect] = foreign.effect.clone();
        let fit = Fit::new(&model, bench.nominal, bench.tracks, &fitted.noise);
        let least = (MUCH * gain).max(foreign.freedom * PER_COEFFICIENT);
        fit.log_likelihood - fitted.fit.log_likelihood - least
    };
    let all = like(&fitted.model.effects[effect], bench);
    let tried: Vec<(f64, Foreign)> = all.into_par_iter().map(|foreign| (more(&foreign), foreign)).collect();
    tried
        .into_iter()
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .filter(|(more, _)| *more > 0.0)
        .map(|(_, foreign)| format!("{} would explain more", foreign.what))
}
