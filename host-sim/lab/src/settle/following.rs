//! The round that follows the last one, or the conclusion.

use super::play::Limited;
use super::{Asked, Inputs, Settings, Settled};
use device_sim::error::Error;
use diagnosis::report::{Report, Verdict};
use experiment::{Case, design};
use std::path::Path;

/// The longest input of a round, s: it is played twice, once to fit and once, with other numbers,
/// to judge.
const INPUT_S: f64 = 16.0;
/// A round that is shorter than this, s, shows nothing new.
const LEAST_ROUND_S: f64 = 10.0;

/// The round that follows, or the conclusion if none does.
pub(super) fn following(
    limited: &Limited,
    report: &Report,
    folder: &Path,
    settings: &Settings,
    settled: &Settled,
) -> Result<Result<Asked, String>, Error> {
    let (played, rounds) = (settled.motion_s(), settled.rounds.len());
    let left_s = settings.motion_s - played;
    let is_sure = settled.unsure.is_empty() || settings.inputs != Inputs::Designed;
    if let Some(conclusion) = is_settled(report, settled).filter(|_| is_sure) {
        return Ok(Err(conclusion));
    }
    if rounds >= settings.rounds {
        return Ok(Err(format!("the limit of rounds, {rounds}, was reached")));
    }
    if left_s < LEAST_ROUND_S {
        return Ok(Err(format!(
            "{played:.0} s of motion were played, and {:.0} s are allowed",
            settings.motion_s
        )));
    }
    next(limited, report, folder, settings, (rounds as u64 + settings.seed, left_s))
}

/// The conclusion if each name is single, or nothing is there to be named.
fn is_settled(report: &Report, settled: &Settled) -> Option<String> {
    let explained = matches!(report.verdict, Verdict::NoMismatch | Verdict::ParametersOnly);
    let has_names = settled.rounds.last().is_some_and(|round| !round.names.is_empty());
    if explained && !has_names && settled.rounds.len() >= 2 {
        return Some("two rounds or more leave nothing that an effect would explain".to_owned());
    }
    let rivals = report.contenders.iter().filter(|one| one.name.is_some()).count();
    if rivals > 0 || matches!(report.verdict, Verdict::InsufficientExcitation) {
        return None;
    }
    let names: Vec<&str> = report.effects.iter().map(|effect| effect.name.as_str()).collect();
    Some(match names[..] {
        [] => "no effect contends: the simulation leaves out nothing that these inputs show".to_owned(),
        _ => format!("{} is left, and no rival", names.join(" and ")),
    })
}

/// The next round, or why there is none; `number` seeds it and `left_s` is the motion that is left.
fn next(
    limited: &Limited,
    report: &Report,
    folder: &Path,
    settings: &Settings,
    (seed, left_s): (u64, f64),
) -> Result<Result<Asked, String>, Error> {
    let most_s = INPUT_S.min(0.5 * left_s);
    match settings.inputs {
        Inputs::Characterise => {
            Ok(Err("the set of characterise was played, shortened to the motion allowed".into()))
        }
        Inputs::Multisines => limited.multisine(seed, most_s).map(Ok),
        Inputs::Designed if report.verdict == Verdict::InsufficientExcitation => {
            limited.general("the recordings so far could not tell", most_s).map(Ok)
        }
        Inputs::Designed if report.contenders.is_empty() => {
            limited.general("a name without a rival is not sure enough yet", most_s).map(Ok)
        }
        Inputs::Designed => {
            let (travel, speed, force) = limited.limits();
            let case = match Case::read(folder, Some(travel), Some(speed), Some(force)) {
                Ok(case) => case,
                Err(sentence) => return Ok(Err(sentence)),
            };
            let design = match design(&case, most_s, seed) {
                Ok(design) => design,
                Err(sentence) => return Ok(Err(sentence)),
            };
            if !design.decides() {
                let sentence = design.limits_in_words().unwrap_or_default();
                return Ok(Err(sentence));
            }
            limited.designed(design).map(Ok)
        }
    }
}
