//! The round that follows the last one, or the conclusion.

use super::play::Limited;
use super::{Inputs, PlannedRound, Settings, Settled};
use device_sim::error::Error;
use diagnosis::report::{Contending, Report, Verdict};
use experiment::{Case, design};
use std::path::Path;

/// The longest input of a round, s: it is played twice, once to fit and once, with other numbers,
/// to judge.
const INPUT_S: f64 = 16.0;
/// Rounds before a diagnosis counts: a second input shows an effect that hides in the first.
const LEAST_ROUNDS: usize = 2;
/// A round that is shorter than this, s, shows nothing new.
const LEAST_ROUND_S: f64 = 10.0;

/// The round that follows, or the conclusion if none does.
pub(super) fn next_round(
    limited: &Limited,
    report: &Report,
    folder: &Path,
    settings: &Settings,
    settled: &Settled,
) -> Result<Result<PlannedRound, String>, Error> {
    let (played, rounds) = (settled.motion_s(), settled.rounds.len());
    let left_s = settings.rounds_s() - played;
    let is_sure = settled.unsure.is_empty() || settings.inputs != Inputs::Designed;
    if let Some(conclusion) =
        is_settled(report, settled, LEAST_ROUNDS.min(settings.rounds)).filter(|_| is_sure)
    {
        return Ok(Err(conclusion));
    }
    if let Some(conclusion) = not_distinguished(settled).filter(|_| settings.inputs == Inputs::Designed) {
        return Ok(Err(conclusion));
    }
    let at = |limit: &str| Ok(Err(unsettled(limit, &report.contenders, &report.remains)));
    if rounds >= settings.rounds {
        return at(&format!("the limit of rounds, {rounds}, was reached"));
    }
    if left_s < LEAST_ROUND_S {
        let allowed_s = settings.rounds_s();
        return at(&format!("{played:.0} s of motion were played, and {allowed_s:.0} s are allowed"));
    }
    next(limited, report, folder, settings, (rounds, left_s))
}

/// The conclusion at a limit: what still contends, and how much of the force nothing explains.
fn unsettled(limit: &str, contenders: &[Contending], remains: &str) -> String {
    let named = |one: &Contending| one.name.map_or("no effect", |name| name.as_str());
    let contenders: Vec<&str> = contenders.iter().map(named).collect();
    let undecided = match contenders.as_slice() {
        [] | [_] => String::new(),
        several => format!("; not decided between {}", several.join(", ")),
    };
    format!("{limit}{undecided}; what remains is {remains}")
}

/// Speeds and forces of later general rounds, as parts of those of the first of them: a round that
/// repeats another shows nothing new.
const PACES: [f64; 4] = [1.0, 0.75, 0.88, 0.66];

/// Rounds that are designed against a class before it stays as it is.
const DESIGNED_AGAINST: usize = 2;

/// The conclusion if inputs that were designed to distinguish the members of a class left all of
/// them.
fn not_distinguished(settled: &Settled) -> Option<String> {
    let since = settled.rounds.len().checked_sub(DESIGNED_AGAINST + 1)?;
    let [first, later @ ..] = &settled.rounds[since..] else { return None };
    let is_same = |class: &[String]| {
        later.iter().all(|round| {
            class.iter().all(|member| round.designed_against.contains(member))
                && round.names.iter().any(|name| has_members(&name.class, class))
        })
    };
    let name = first.names.iter().find(|name| name.class.len() > 1 && is_same(&name.class))?;
    Some(format!(
        "{DESIGNED_AGAINST} inputs that were designed to decide between {} did not",
        name.in_words()
    ))
}

fn has_members(a: &[String], b: &[String]) -> bool {
    a.len() == b.len() && a.iter().all(|one| b.contains(one))
}

/// The conclusion if each name is single, or nothing is there to be named, after `least_rounds` or
/// more.
fn is_settled(report: &Report, settled: &Settled, least_rounds: usize) -> Option<String> {
    let explained = matches!(report.verdict, Verdict::NoMismatch | Verdict::ParametersOnly);
    let has_names = settled.rounds.last().is_some_and(|round| !round.names.is_empty());
    if explained && !has_names && settled.rounds.len() >= LEAST_ROUNDS {
        return Some("two rounds or more leave nothing that an effect would explain".to_owned());
    }
    let rivals = report.contenders.iter().filter(|one| one.name.is_some()).count();
    if rivals > 0 || matches!(report.verdict, Verdict::InsufficientExcitation) {
        return None;
    }
    if settled.rounds.len() < least_rounds {
        return None;
    }
    Some(if report.effects.is_empty() {
        "no effect contends: the simulation leaves out nothing that these inputs show".to_owned()
    } else {
        format!("no rival is left; what remains is {}", report.remains)
    })
}

/// Returns the next round after `rounds`, or the reason why no round follows; `left_s` is the
/// remaining motion, s.
fn next(
    limited: &Limited,
    report: &Report,
    folder: &Path,
    settings: &Settings,
    (rounds, left_s): (usize, f64),
) -> Result<Result<PlannedRound, String>, Error> {
    let seed = rounds as u64 + settings.seed;
    let again = |why: &str, most_s| limited.general_again(why, PACES[(rounds - 1) % PACES.len()], most_s);
    let most_s = INPUT_S.min(0.5 * left_s);
    match settings.inputs {
        Inputs::Characterise => {
            Ok(Err("the set of characterise was played, shortened to the motion allowed".into()))
        }
        Inputs::Passive => Ok(Err("recordings of practice have no further round".into())),
        Inputs::Multisines => limited.multisine(seed, most_s).map(Ok),
        Inputs::Designed if report.verdict == Verdict::InsufficientExcitation => {
            again("the recordings so far could not tell", most_s).map(Ok)
        }
        Inputs::Designed if report.contenders.is_empty() => {
            again("no rival is left; other speeds and forces show whether that holds", most_s).map(Ok)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settle::{Name, Round};
    use diagnosis::laws::EffectName;

    fn round(class: &[&str]) -> Round {
        let class: Vec<String> = class.iter().map(|name| (*name).to_owned()).collect();
        let names = vec![Name { name: class[0].clone(), class, confidence: 0.9 }];
        let (asked, why, sentence) = (String::new(), String::new(), String::new());
        let designed_against = ["command_delay", "electrical_lag", "none"].map(str::to_owned).to_vec();
        Round { asked, why, designed_against, seconds: 20.0, sentence, contenders: vec![], names }
    }

    #[test]
    fn at_a_limit_it_says_what_is_open() {
        let contender = |name| Contending { name, probability: 0.5, rig: String::new() };
        let both = [contender(Some(EffectName::TiltGravity)), contender(None)];
        let remains = "47.8 % of the force: a further effect is missing";
        assert_eq!(
            unsettled("the limit of rounds, 2, was reached", &both, remains),
            format!(
                "the limit of rounds, 2, was reached; not decided between tilt_gravity, no effect; what remains is {remains}"
            )
        );
        assert_eq!(unsettled("enough", &[], remains), format!("enough; what remains is {remains}"));
    }

    #[test]
    fn two_designed_rounds_that_leave_a_class_are_enough() {
        let twins = ["electrical_lag", "command_delay"];
        let turned = ["command_delay", "electrical_lag"];
        let of = |rounds: Vec<Round>| not_distinguished(&Settled { rounds, ..Settled::default() });
        assert_eq!(of(vec![round(&twins), round(&twins)]), None, "one round was designed against it");
        assert!(of(vec![round(&twins), round(&turned), round(&twins)]).is_some());
        assert_eq!(
            of(vec![round(&twins), round(&twins), round(&twins[..1])]),
            None,
            "they are distinguished"
        );
        assert_eq!(of(vec![round(&twins[..1]); 3]), None, "a single name");
        let general = Round { designed_against: vec![], ..round(&twins) };
        let rounds = vec![round(&twins), round(&twins), general];
        assert_eq!(of(rounds), None, "the last input was not designed against it");
    }
}
