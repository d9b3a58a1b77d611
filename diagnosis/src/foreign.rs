//! Physics that has no name in the library and looks like some that has: a spring that creeps, a load that changes at once,
//! an inertia that changes along the travel, a gear that loses a part of what it carries. Nothing here is named; it only
//! speaks against a name.

use crate::effects::{Effect, EffectName as N};
use crate::fit::Fit;
use crate::select::{Bench, Candidate, PER_COEFFICIENT};
use rayon::prelude::*;

/// Times in which a force may fade, s.
const FADES_S: [f64; 6] = [0.1, 0.25, 0.6, 1.5, 4.0, 10.0];
/// Times, as parts of the longest recording, at which a load may change at once.
const CHANGES: usize = 40;
/// Degree of the polynomial along the travel that an inertia may follow.
const INERTIA_DEGREE: f64 = 12.0;
/// Part of what an effect gains that foreign physics must gain beside it: a law of slightly another form gains a little.
const MUCH: f64 = 0.1;

/// Foreign physics in an effect's place.
struct Foreign {
    effect: Effect,
    /// As how many values its freedom counts.
    freedom: f64,
    /// What it would be.
    says: String,
}

/// What may look like an effect.
fn like(effect: &Effect, bench: &Bench) -> Vec<Foreign> {
    let with = |key: &str, value: f64, says: String| {
        let mut effect = effect.clone();
        effect.shape.insert(key.into(), value);
        Foreign { effect, freedom: 4.0, says }
    };
    let mut all: Vec<Foreign> = match effect.name {
        N::PositionSpring => FADES_S
            .map(|time| {
                let says = format!("its force would fade within {time} s, as that of a spring that creeps does");
                with("fades_s", time, says)
            })
            .into(),
        N::GainDrift => (1..CHANGES)
            .map(|i| {
                let time = bench.span.duration * i as f64 / CHANGES as f64;
                let says =
                    format!("it would come all at once, at {time:.1} s, as where the load changes and not where a drive warms");
                with("at_once_s", time, says)
            })
            .collect(),
        N::EncoderEccentricity | N::MassImbalance | N::PositionDependentDamping => {
            let shape = [
                ("low", bench.span.low),
                ("high", bench.span.high),
                ("degree", INERTIA_DEGREE),
                ("of_inertia", 1.0),
            ];
            vec![Foreign {
                effect: Effect::shaped(N::PositionDependentDamping, &shape),
                freedom: INERTIA_DEGREE,
                says: "an inertia that changes along the travel would explain more".into(),
            }]
        }
        _ => Vec::new(),
    };
    // Whatever bends with speed, force or command may be the loss of a gear.
    all.push(Foreign {
        effect: Effect::shaped(N::LoadDependentFriction, &[("of_drive", 1.0)]),
        freedom: 1.0,
        says: "friction in proportion to the force of the drive, as a gear loses it, would explain more"
            .into(),
    });
    all
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
        .map(|(_, foreign)| foreign.says)
}
