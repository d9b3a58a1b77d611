//! Opens the key: one answer against what was hidden. The rules are in `docs/design/benchmark.md`.

use crate::baselines::Opinion;
use crate::key::{Category, Key};
use crate::report_residuals::ResidualRms;
use crate::share::{EXPLAINABLE, share};
use crate::tool::{Answer, Named};

/// From this confidence on a wrong name is confidently wrong.
pub(crate) const CONFIDENT: f64 = 0.8;
/// At this strength and below, random bursts may be taken for noise.
const WEAK: f64 = 1.0;
/// Effect over noise below which anything may be taken for noise.
const INVISIBLE: f64 = 0.7;

/// One case after the tool and the baselines have answered; the recordings are gone.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    pub(crate) id: String,
    pub(crate) key: Key,
    pub(crate) answer: Result<Answer, String>,
    /// The residual on the held-out recording by the judge's own inverse dynamics, or why it could
    /// not be computed.
    pub(crate) left: Result<ResidualRms, String>,
    /// The same by the report's own residuals.
    pub(crate) reported: Option<ResidualRms>,
    pub(crate) opinions: Vec<Opinion>,
    pub(crate) seconds: f64,
    /// The drive's gain as the rig has it.
    pub(crate) nominal_gain: f64,
}

impl Record {
    pub(crate) fn effects(&self) -> &[Named] {
        self.answer.as_ref().map_or(&[], |a| &a.effects)
    }

    pub(crate) fn verdict(&self) -> &str {
        self.answer.as_ref().map_or("failed", |a| a.verdict.as_str())
    }

    /// True if the answer reports missing physics, by name or by verdict.
    pub(crate) fn names_physics(&self) -> bool {
        !self.effects().is_empty() || self.verdict() == "missing_physics"
    }

    /// True if the name or its class is among the hidden effects.
    pub(crate) fn is_true(&self, named: &Named) -> bool {
        self.key.effects.iter().any(|hidden| named.holds(hidden))
    }

    /// The first name itself is hidden.
    pub(crate) fn exact(&self) -> bool {
        self.effects().first().is_some_and(|e| self.key.effects.contains(&e.name))
    }

    /// The first name or its class is hidden.
    pub(crate) fn classy(&self) -> bool {
        self.effects().first().is_some_and(|e| self.is_true(e))
    }

    pub(crate) fn none_false(&self) -> bool {
        self.effects().iter().all(|e| self.is_true(e))
    }

    /// Returns how many of the hidden effects are found, by name or class; never more than there
    /// are names.
    pub(crate) fn found(&self) -> usize {
        let found = self.key.effects.iter().filter(|h| self.effects().iter().any(|e| e.holds(h))).count();
        found.min(self.effects().len())
    }

    /// Names nothing, and says that something is there which it does not know, or which does not
    /// repeat.
    pub(crate) fn abstains(&self) -> bool {
        let invisible = self.key.snr.is_some_and(|snr| snr < INVISIBLE);
        let weak = invisible || self.key.random && self.key.strength <= WEAK;
        let told = match self.verdict() {
            "unexplained" | "random_disturbance" => true,
            "no_mismatch" | "parameters_only" => weak,
            _ => false,
        };
        told && self.effects().is_empty()
    }

    /// True if the answer is right for the case's category.
    pub(crate) fn right(&self) -> bool {
        if self.answer.is_err() {
            return false;
        }
        match self.key.category {
            Category::Single => self.classy(),
            Category::Pair => self.none_false() && self.found() == 2,
            Category::Triple => self.none_false() && self.found() >= 2,
            Category::Null | Category::Disturbance | Category::ParametersOnly => !self.names_physics(),
            Category::Outside => self.abstains(),
            Category::CannotTell if self.effects().is_empty() => {
                matches!(self.verdict(), "insufficient_excitation" | "no_mismatch" | "parameters_only")
            }
            Category::CannotTell => self.classy() && self.none_false(),
        }
    }

    /// The answer in a few words.
    pub(crate) fn answer_text(&self) -> String {
        match &self.answer {
            Err(e) => format!("failed: {e}"),
            Ok(a) if a.effects.is_empty() && a.refused => format!("{}, refused", a.verdict),
            Ok(a) if a.effects.is_empty() => a.verdict.clone(),
            Ok(a) => {
                let names = a.effects.iter().map(|e| {
                    let others: Vec<&str> =
                        e.class.iter().filter(|c| **c != e.name).map(String::as_str).collect();
                    let class = if others.is_empty() {
                        String::new()
                    } else {
                        format!(" or {}", others.join(" or "))
                    };
                    format!("{}{class} ({:.2})", e.name, e.confidence)
                });
                names.collect::<Vec<_>>().join(", ")
            }
        }
    }

    /// The held-out improvement as a share of an oracle's, in mean squares, by the judge's own
    /// inverse dynamics and on the rows that it judges; `None` where there is nothing to improve or
    /// the judge cannot run the patched rig.
    pub(crate) fn gain(&self) -> Option<f64> {
        if !matches!(self.key.category, Category::Single | Category::Pair | Category::Triple) {
            return None;
        }
        self.taken()
    }

    /// The same outside the library: what a patched rig takes by a force that has no name.
    pub(crate) fn unnamed_gain(&self) -> Option<f64> {
        (self.key.category == Category::Outside).then(|| self.taken())?
    }

    fn taken(&self) -> Option<f64> {
        let (floor, _) = self.room()?;
        // A tool that fails improves nothing.
        if self.answer.is_err() {
            return Some(0.0);
        }
        let left = self.left.as_ref().ok()?;
        share(left.refit, left.patched, floor)
    }

    /// The same by the residuals that the report gives, over the whole recording.
    pub(crate) fn reported_gain(&self) -> Option<Gain> {
        if self.key.category == Category::Outside {
            return None;
        }
        let (floor, room) = self.room()?;
        // A report without residuals improves nothing.
        let Some(left) = self.reported.filter(|_| self.answer.is_ok()) else { return Some(Gain::default()) };
        let gain = left.refit.powi(2) - left.patched.powi(2);
        Some(Gain {
            of_oracle: gain / room,
            of_own: gain / (left.refit.powi(2) - floor.powi(2)).max(0.5 * room),
        })
    }

    /// The noise's rms and what an oracle gains in mean square, where there is something to gain.
    fn room(&self) -> Option<(f64, f64)> {
        use Category as C;
        if !matches!(self.key.category, C::Single | C::Pair | C::Triple | C::Outside) {
            return None;
        }
        let oracle = self.key.oracle.as_ref()?;
        let room = oracle.refit.powi(2) - oracle.floor.powi(2);
        (room >= EXPLAINABLE * oracle.floor.powi(2) && room > 0.0).then_some((oracle.floor, room))
    }

    /// Returns whether each 95 % interval of a parameter contains its known true value. If the unit
    /// contains force, that value is scaled by the tool's own gain, because motor data do not
    /// determine the gain.
    pub(crate) fn coverage(&self) -> Vec<(String, bool)> {
        let Ok(answer) = &self.answer else { return Vec::new() };
        let gain = answer.gain.unwrap_or(self.nominal_gain);
        let mut out = Vec::new();
        for truth in &self.key.parameters {
            let Some(named) = answer.effects.iter().find(|e| e.name == truth.effect) else { continue };
            let Some((_, _, Some([low, high]))) = named.parameters.iter().find(|p| p.0 == truth.name) else {
                continue;
            };
            let scale = match (truth.force, self.key.true_gain) {
                (true, Some(true_gain)) => gain / true_gain,
                _ => 1.0,
            };
            let value = truth.value * scale;
            out.push((format!("{}.{}", truth.effect, truth.name), *low <= value && value <= *high));
        }
        out
    }
}

/// A held-out improvement by the report.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Gain {
    /// Over what the oracle gains, whatever noise the tool's own estimator adds.
    pub(crate) of_oracle: f64,
    /// Over what the tool's own refit leaves above the noise: the residual counts against it.
    pub(crate) of_own: f64,
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::key::{Oracle, Parameter};

    pub(crate) fn key(category: Category, effects: &[&str], strength: f64) -> Key {
        Key {
            effects: effects.iter().map(|e| (*e).into()).collect(),
            strength,
            unknown: (category == Category::Outside).then(|| "wells".into()),
            oracle: Some(Oracle { floor: 1.0, refit: 2.0, filters_hz: [50.0, 50.0], ..Oracle::default() }),
            parameters: vec![Parameter {
                effect: "stribeck_friction".into(),
                name: "peak".into(),
                value: 1.0,
                force: true,
            }],
            true_gain: Some(1.0),
            ..Key::of(category)
        }
    }

    pub(crate) fn record(key: Key, answer: Answer) -> Record {
        Record {
            id: "1".into(),
            key,
            answer: Ok(answer),
            left: Ok(ResidualRms { refit: 2.0, patched: 1.0 }),
            reported: None,
            opinions: Vec::new(),
            seconds: 1.0,
            nominal_gain: 2.0,
        }
    }

    pub(crate) fn says(names: &[(&str, f64)]) -> Answer {
        Answer {
            verdict: if names.is_empty() { "no_mismatch".into() } else { "missing_physics".into() },
            effects: names
                .iter()
                .map(|(n, c)| Named {
                    name: (*n).into(),
                    class: vec![(*n).into()],
                    confidence: *c,
                    parameters: vec![("peak".into(), 2.0, Some([1.9, 2.1]))],
                })
                .collect(),
            ..Answer::default()
        }
    }

    fn right(category: Category, hidden: &[&str], names: &[(&str, f64)], verdict: &str) -> bool {
        let mut answer = says(names);
        if !verdict.is_empty() {
            answer.verdict = verdict.into();
        }
        record(key(category, hidden, 10.0), answer).right()
    }

    const S: &str = "stribeck_friction";
    const C: &str = "cogging";
    const B: &str = "backlash";

    #[test]
    fn names_are_judged_by_category() {
        assert!(right(Category::Single, &[S], &[(S, 0.9)], ""));
        assert!(!right(Category::Single, &[S], &[(C, 0.9), (S, 0.9)], ""), "the first name counts");
        assert!(!right(Category::Single, &[S], &[], ""));
        assert!(!right(Category::Pair, &[S, C], &[(S, 0.9)], ""));
        assert!(right(Category::Pair, &[S, C], &[(C, 0.9), (S, 0.9)], ""));
        assert!(!right(Category::Pair, &[S, C], &[(C, 0.9), (S, 0.9), (B, 0.5)], ""));
        assert!(right(Category::Triple, &[S, C, "command_delay"], &[(C, 0.9), (S, 0.9)], ""));
        assert!(!right(Category::Triple, &[S, C, "command_delay"], &[(C, 0.9)], ""));
        assert!(!right(Category::Triple, &[S, C, "command_delay"], &[(C, 0.9), (S, 0.9), (B, 0.9)], ""));
        assert!(right(Category::Null, &[], &[], ""));
        assert!(!right(Category::Null, &[], &[], "missing_physics"), "the verdict names physics too");
        assert!(!right(Category::Outside, &[], &[(C, 0.3)], ""));
        assert!(!right(Category::Outside, &[], &[], ""), "silence is no abstention");
        assert!(right(Category::Outside, &[], &[], "unexplained"));
        assert!(right(Category::CannotTell, &[S], &[], "insufficient_excitation"));
        assert!(!right(Category::CannotTell, &[S], &[(C, 0.5)], ""));
    }

    #[test]
    fn weak_bursts_may_be_noise_and_nothing_else_may() {
        let mut weak = key(Category::Outside, &[], 1.0);
        assert!(!record(weak.clone(), says(&[])).right());
        weak.random = true;
        assert!(record(weak.clone(), says(&[])).right());
        weak.strength = 3.0;
        assert!(!record(weak, says(&[])).right());
    }

    #[test]
    fn classes_count_up_to_three_names_and_find_one_effect_each() {
        let mut answer = says(&[("quadratic_drag", 0.9)]);
        answer.effects[0].class = ["quadratic_drag", S, C].map(String::from).to_vec();
        let r = record(key(Category::Single, &[S], 3.0), answer.clone());
        assert!(r.right() && !r.exact());
        assert!(!record(key(Category::Pair, &[S, C], 3.0), answer.clone()).right());
        answer.effects[0].class.push(B.into());
        assert!(!record(key(Category::Single, &[S], 3.0), answer.clone()).right());
        // The name itself still counts.
        assert!(record(key(Category::Single, &["quadratic_drag"], 3.0), answer).right());
    }

    #[test]
    fn a_gain_is_measured_against_the_oracles() {
        let mut r = record(key(Category::Single, &[S], 3.0), says(&[(S, 0.9)]));
        // From 2² to 1², which is what the oracle leaves.
        assert_eq!(r.gain(), Some(1.0));
        assert_eq!(r.reported_gain(), Some(Gain::default()), "it reports no residuals");
        r.left = Ok(ResidualRms { refit: 2.0, patched: 1.5 });
        assert_eq!(r.gain(), Some(1.75 / 3.0));
        // The tool's own noise counts against it in one of the two figures of its report.
        r.reported = Some(ResidualRms { refit: 10.0_f64.sqrt(), patched: 7.0_f64.sqrt() });
        let gain = r.reported_gain().unwrap();
        assert!((gain.of_oracle - 1.0).abs() < 1e-9 && (gain.of_own - 1.0 / 3.0).abs() < 1e-9, "{gain:?}");
        r.left = Ok(ResidualRms { refit: 1.05, patched: 1.0 });
        assert_eq!(r.gain(), None, "nothing to get on the rows that are judged");
        r.left = Err("a law that the judge does not know".into());
        assert_eq!(r.gain(), None);
        r.answer = Err("broken".into());
        assert_eq!(r.gain(), Some(0.0), "a tool that fails improves nothing");
        r.key.oracle.as_mut().unwrap().refit = 1.05;
        assert_eq!((r.gain(), r.reported_gain()), (None, None), "nothing to get");
    }

    #[test]
    fn an_interval_holds_the_truth_in_the_scale_of_the_gain() {
        // Truth 1 with the true gain is 2 in the scale of the gain that the tool believes.
        let r = record(key(Category::Single, &[S], 3.0), says(&[(S, 0.9)]));
        assert_eq!(r.coverage(), [("stribeck_friction.peak".to_string(), true)]);
    }
}
