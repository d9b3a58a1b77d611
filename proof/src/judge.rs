//! Opens the key: every answer against what was hidden, and the sums over all cases.

use std::collections::BTreeMap;

use crate::cases::STRENGTHS;
use crate::generator::case::{Case, Category};
use crate::generator::effects::Parameter;
use crate::rivals::Opinion;
use crate::stats::{Rate, quantile};
use crate::tool::{Answer, Named, Weighed};

/// From this confidence on a wrong name is confidently wrong.
pub(crate) const CONFIDENT: f64 = 0.8;
/// A class of more names than this is no answer.
const WIDEST_CLASS: usize = 3;

/// One case after the tool and the rivals have answered; the recordings are gone.
#[derive(Clone, Debug)]
pub(crate) struct Record {
    pub(crate) id: usize,
    pub(crate) category: Category,
    pub(crate) hidden: Vec<&'static str>,
    pub(crate) strength: f64,
    pub(crate) achieved: Vec<f64>,
    pub(crate) machine: &'static str,
    pub(crate) rate: f64,
    pub(crate) answer: Result<Answer, String>,
    /// Mean square that is left on the held-out recording with the true model in hand, at the tool's bandwidth.
    pub(crate) oracle: f64,
    pub(crate) opinions: Vec<Opinion>,
    /// The same at the rivals' bandwidth.
    pub(crate) oracle_rivals: f64,
    pub(crate) seconds: f64,
    truths: Vec<(&'static str, Vec<Parameter>)>,
    true_gain: f64,
    nominal_gain: f64,
}

impl Record {
    /// Puts a case and the answers to it together.
    pub(crate) fn new(
        case: &Case,
        answer: Result<Answer, String>,
        opinions: Vec<Opinion>,
        seconds: f64,
    ) -> Self {
        let own = case.machine.residual_bandwidth();
        let band = match &answer {
            // Beyond a fifth of the rate the definition's filter has no meaning.
            Ok(a) if a.bandwidth_hz > 0.0 => a.bandwidth_hz.min(0.2 * case.machine.rate),
            _ => own,
        };
        Self {
            id: case.spec.id,
            category: case.spec.category,
            hidden: case.spec.hidden.clone(),
            strength: case.spec.strength,
            achieved: case.alone.clone(),
            machine: case.machine.name,
            rate: case.machine.rate,
            answer,
            oracle: case.held_out(band).noise.powi(2),
            opinions,
            oracle_rivals: case.held_out(own).noise.powi(2),
            seconds,
            truths: case.truths.clone(),
            true_gain: case.plant.gain,
            nominal_gain: case.nominal.gain,
        }
    }

    fn effects(&self) -> &[Named] {
        self.answer.as_ref().map_or(&[], |a| &a.effects)
    }

    fn is_true(&self, named: &Named) -> bool {
        self.holds_truth(&named.name, &named.class)
    }

    fn holds_truth(&self, name: &str, class: &[String]) -> bool {
        self.category != Category::Outside
            && class.len() <= WIDEST_CLASS
            && (self.hidden.iter().any(|h| *h == name || class.iter().any(|c| c == h)))
    }

    /// What came through the tool's search with its evidence, and whether it was right.
    pub(crate) fn weighed(&self) -> impl Iterator<Item = (&Weighed, bool)> {
        let all = self.answer.as_ref().map_or(&[][..], |a| &a.weighed);
        all.iter().map(|w| (w, self.holds_truth(&w.name, &w.class)))
    }

    fn found(&self, hidden: &str) -> bool {
        self.effects().iter().any(|e| {
            e.class.len() <= WIDEST_CLASS && (e.name == hidden || e.class.iter().any(|c| c == hidden))
        })
    }

    fn all_found(&self) -> bool {
        self.hidden.iter().all(|h| self.found(h))
    }

    fn none_false(&self) -> bool {
        self.effects().iter().all(|e| self.is_true(e))
    }

    /// What the case's category calls right.
    pub(crate) fn right(&self) -> bool {
        let Ok(answer) = &self.answer else { return false };
        match self.category {
            Category::Single => self.all_found(),
            Category::Pair => self.all_found() && self.none_false(),
            Category::Null | Category::Disturbance | Category::ParametersOnly | Category::Outside => {
                answer.effects.is_empty()
            }
            Category::CannotTell => {
                let told = answer.effects.iter().any(|e| self.is_true(e));
                if answer.effects.is_empty() { answer.verdict == "insufficient_excitation" } else { told }
            }
        }
    }

    /// The answer in a few words.
    pub(crate) fn answer_text(&self) -> String {
        match &self.answer {
            Err(e) => format!("failed: {e}"),
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

    /// Share of what an oracle gets on the held-out recording; `None` where there is nothing to get.
    pub(crate) fn share(&self) -> Option<f64> {
        // A tool that fails improves nothing.
        let Ok(answer) = &self.answer else { return Some(0.0) };
        share_of_oracle(answer.refit_holdout.powi(2), answer.patched_holdout.powi(2), self.oracle)
    }

    /// Whether each 95 % interval of a parameter with a known truth holds it. Where the unit has force in it the truth is
    /// taken in the scale of the gain that the tool believes: motor data cannot tell the gain.
    fn coverage(&self) -> Vec<(String, bool)> {
        let Ok(answer) = &self.answer else { return Vec::new() };
        let gain = answer.gain.unwrap_or(self.nominal_gain);
        let mut out = Vec::new();
        for (name, list) in &self.truths {
            let Some(named) = answer.effects.iter().find(|e| e.name == *name) else { continue };
            for truth in list {
                let Some((_, _, Some([low, high]))) = named.parameters.iter().find(|p| p.0 == truth.name)
                else {
                    continue;
                };
                let value = if truth.force { truth.value * gain / self.true_gain } else { truth.value };
                out.push((format!("{name}.{}", truth.name), *low <= value && value <= *high));
            }
        }
        out
    }
}

/// Least part of what a refit leaves that must be left to explain for shares of it to mean anything.
const EXPLAINABLE: f64 = 0.05;

/// Share of the way from what a refit leaves to what an oracle leaves, all of them mean squares on the held-out recording:
/// the oracle has the true model and leaves the noise.
fn share_of_oracle(refit: f64, patched: f64, oracle: f64) -> Option<f64> {
    let all = refit - oracle;
    let gain = refit - patched;
    (gain.is_finite() && all > EXPLAINABLE * refit).then(|| (gain / all).clamp(-2.0, 2.0))
}

/// What one rival reached.
#[derive(Clone, Debug, Default)]
pub(crate) struct RivalSums {
    pub(crate) name: &'static str,
    /// By strength, as [`STRENGTHS`].
    pub(crate) right: [Rate; 3],
    pub(crate) null_alarms: Rate,
    pub(crate) parameters_called_physics: Rate,
    pub(crate) false_names: Rate,
    pub(crate) outside_abstains: Rate,
    pub(crate) shares: Vec<f64>,
    pub(crate) names_something: bool,
}

/// Everything that the report prints.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sums {
    pub(crate) right: [Rate; 3],
    pub(crate) exact: [Rate; 3],
    pub(crate) by_effect: BTreeMap<&'static str, [Rate; 3]>,
    pub(crate) null_alarms: Rate,
    pub(crate) null_verdicts: Rate,
    pub(crate) disturbance_alarms: Rate,
    pub(crate) disturbance_verdicts: Rate,
    pub(crate) parameters_called_physics: Rate,
    pub(crate) false_names: Rate,
    pub(crate) outside_abstains: Rate,
    pub(crate) outside_confident: Rate,
    pub(crate) by_outside: BTreeMap<&'static str, Rate>,
    pub(crate) pairs: Rate,
    pub(crate) pairs_first: Rate,
    pub(crate) cannot_tell: Rate,
    pub(crate) cannot_tell_wrong: Rate,
    /// Of singles and pairs, all of them; and of those answered right.
    pub(crate) shares: Vec<f64>,
    pub(crate) shares_right: Vec<f64>,
    pub(crate) coverage: Rate,
    pub(crate) by_parameter: BTreeMap<String, Rate>,
    /// Confidence from, to, and how many of the names were right.
    pub(crate) confidence: Vec<(f64, f64, Rate)>,
    /// (what was hidden, what was answered first) → how often; strengths 10 and 3 only.
    pub(crate) confusion: BTreeMap<(String, String), usize>,
    pub(crate) failures: usize,
    pub(crate) seconds: Vec<f64>,
    pub(crate) rivals: Vec<RivalSums>,
}

/// Sums over all records.
pub(crate) fn sum(records: &[Record]) -> Sums {
    let mut s = Sums {
        confidence: [(0.0, 0.5), (0.5, 0.8), (0.8, 0.9), (0.9, 0.95), (0.95, 1.01)]
            .map(|(a, b)| (a, b, Rate::default()))
            .to_vec(),
        ..Sums::default()
    };
    for r in records {
        s.failures += usize::from(r.answer.is_err());
        s.seconds.push(r.seconds);
        let verdict = r.answer.as_ref().map_or("failed", |a| a.verdict.as_str());
        let silent = r.effects().is_empty();
        for e in r.effects() {
            let right = r.is_true(e);
            s.false_names.add(!right);
            if let Some(bin) = s.confidence.iter_mut().find(|b| b.0 <= e.confidence && e.confidence < b.1) {
                bin.2.add(right);
            }
        }
        match r.category {
            Category::Single => {
                if let Some(level) = STRENGTHS.iter().position(|x| *x == r.strength) {
                    s.right[level].add(r.right());
                    s.exact[level].add(r.right() && r.none_false());
                    s.by_effect.entry(r.hidden[0]).or_default()[level].add(r.right());
                }
            }
            Category::Pair => {
                s.pairs.add(r.right());
                s.pairs_first.add(r.hidden.iter().any(|h| r.found(h)));
            }
            Category::Null => {
                s.null_alarms.add(!silent);
                s.null_verdicts.add(verdict == "no_mismatch");
            }
            Category::Disturbance => {
                s.disturbance_alarms.add(!silent);
                s.disturbance_verdicts.add(verdict == "random_disturbance");
            }
            Category::ParametersOnly => s.parameters_called_physics.add(!silent),
            Category::Outside => {
                s.outside_abstains.add(silent && r.answer.is_ok());
                s.outside_confident.add(r.effects().iter().any(|e| e.confidence >= CONFIDENT));
                s.by_outside.entry(r.hidden[0]).or_default().add(silent && r.answer.is_ok());
            }
            Category::CannotTell => {
                s.cannot_tell.add(r.right());
                s.cannot_tell_wrong.add(!r.none_false());
            }
        }
        if matches!(r.category, Category::Single | Category::Pair) {
            if let Some(share) = r.share() {
                s.shares.push(share);
                if r.right() {
                    s.shares_right.push(share);
                }
            }
            for (name, inside) in r.coverage() {
                s.coverage.add(inside);
                s.by_parameter.entry(parameter_family(&name)).or_default().add(inside);
            }
        }
        if r.strength != 1.0 && !(r.category == Category::Single && r.right()) {
            let hidden =
                if r.hidden.is_empty() { r.category.word().to_string() } else { r.hidden.join(" + ") };
            let first = r.effects().first().map_or(verdict.to_string(), |e| e.name.clone());
            *s.confusion.entry((hidden, first)).or_default() += 1;
        } else if r.category == Category::Single {
            *s.confusion.entry((r.hidden[0].to_string(), r.hidden[0].to_string())).or_default() +=
                usize::from(r.strength != 1.0);
        }
    }
    s.confusion.retain(|_, n| *n > 0);
    s.rivals =
        crate::rivals::RIVALS.iter().enumerate().map(|(i, name)| sum_rival(records, i, name)).collect();
    s
}

/// `cogging.order_12` and its like are one family.
fn parameter_family(name: &str) -> String {
    match name.find(".order_") {
        Some(at) => format!("{}.order_N", &name[..at]),
        None => name.to_string(),
    }
}

fn sum_rival(records: &[Record], i: usize, name: &'static str) -> RivalSums {
    let mut s = RivalSums { name, names_something: i == 1 || i == 2, ..RivalSums::default() };
    for r in records {
        let Some(o) = r.opinions.get(i) else { continue };
        let silent = o.names.is_empty();
        for n in &o.names {
            s.false_names.add(r.category == Category::Outside || !r.hidden.contains(n));
        }
        match r.category {
            Category::Single => {
                if let Some(level) = STRENGTHS.iter().position(|x| *x == r.strength) {
                    s.right[level].add(o.names.contains(&r.hidden[0]));
                }
            }
            Category::Null => s.null_alarms.add(!silent),
            Category::ParametersOnly => s.parameters_called_physics.add(!silent),
            Category::Outside => s.outside_abstains.add(silent),
            _ => {}
        }
        if matches!(r.category, Category::Single | Category::Pair) {
            s.shares.extend(share_of_oracle(o.refit_mean_square, o.mean_square, r.oracle_rivals));
        }
    }
    s
}

/// Median and tenth percentile as text.
pub(crate) fn share_text(shares: &[f64]) -> String {
    match (quantile(shares, 0.5), quantile(shares, 0.1)) {
        (Some(median), Some(tenth)) => {
            format!(
                "median {:.0} %, tenth percentile {:.0} % ({})",
                100.0 * median,
                100.0 * tenth,
                shares.len()
            )
        }
        _ => "no case".into(),
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    pub(crate) fn record(
        category: Category,
        hidden: &[&'static str],
        strength: f64,
        answer: Answer,
    ) -> Record {
        Record {
            id: 1,
            category,
            hidden: hidden.to_vec(),
            strength,
            achieved: vec![strength],
            machine: "bench",
            rate: 1000.0,
            answer: Ok(answer),
            oracle: 1.0,
            opinions: Vec::new(),
            oracle_rivals: 1.0,
            seconds: 1.0,
            truths: vec![(
                "stribeck_friction",
                vec![Parameter { name: "peak".into(), value: 1.0, force: true }],
            )],
            true_gain: 1.0,
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
            weighed: Vec::new(),
            refit_holdout: 2.0,
            patched_holdout: 1.0,
            bandwidth_hz: 100.0,
            gain: None,
        }
    }

    #[test]
    fn names_are_judged_by_category() {
        let s = "stribeck_friction";
        let c = "cogging";
        assert!(record(Category::Single, &[s], 10.0, says(&[(s, 0.9)])).right());
        assert!(!record(Category::Single, &[s], 10.0, says(&[(c, 0.9)])).right());
        assert!(!record(Category::Single, &[s], 10.0, says(&[])).right());
        assert!(!record(Category::Pair, &[s, c], 10.0, says(&[(s, 0.9)])).right());
        assert!(record(Category::Pair, &[s, c], 10.0, says(&[(c, 0.9), (s, 0.9)])).right());
        assert!(
            !record(Category::Pair, &[s, c], 10.0, says(&[(c, 0.9), (s, 0.9), ("backlash", 0.5)])).right()
        );
        assert!(record(Category::Null, &[], 0.0, says(&[])).right());
        assert!(!record(Category::Outside, &["hum"], 10.0, says(&[(c, 0.3)])).right());
        // Silence without the reason is no answer where the data cannot tell.
        assert!(!record(Category::CannotTell, &[s], 5.0, says(&[])).right());
        let mut answer = says(&[]);
        answer.verdict = "insufficient_excitation".into();
        assert!(record(Category::CannotTell, &[s], 5.0, answer).right());
    }

    #[test]
    fn a_class_counts_up_to_three_names() {
        let mut answer = says(&[("quadratic_drag", 0.9)]);
        answer.effects[0].class =
            ["quadratic_drag", "stribeck_friction", "cogging"].map(String::from).to_vec();
        let r = record(Category::Single, &["stribeck_friction"], 3.0, answer.clone());
        assert!(r.right());
        answer.effects[0].class.push("backlash".into());
        assert!(!record(Category::Single, &["stribeck_friction"], 3.0, answer).right());
    }

    #[test]
    fn sums_count_alarms_false_names_shares_and_coverage() {
        let s = "stribeck_friction";
        let records = [
            record(Category::Single, &[s], 10.0, says(&[(s, 0.97), ("cogging", 0.6)])),
            record(Category::Single, &[s], 1.0, says(&[])),
            record(Category::Null, &[], 0.0, says(&[("cogging", 0.97)])),
            record(Category::Null, &[], 0.0, says(&[])),
            record(Category::Outside, &["hum"], 10.0, says(&[("cogging", 0.7)])),
        ];
        let sums = sum(&records);
        assert_eq!(
            (sums.right[0], sums.right[2]),
            (Rate { hits: 1, trials: 1 }, Rate { hits: 0, trials: 1 })
        );
        assert_eq!(sums.exact[0].hits, 0);
        assert_eq!(sums.null_alarms, Rate { hits: 1, trials: 2 });
        assert_eq!(sums.false_names, Rate { hits: 3, trials: 4 });
        assert_eq!(sums.outside_confident, Rate { hits: 0, trials: 1 });
        // From 2² to 1², which is what the oracle leaves.
        assert_eq!(records[0].share(), Some(1.0));
        assert_eq!(share_of_oracle(4.0, 2.5, 1.0), Some(0.5));
        assert_eq!(share_of_oracle(4.0, 3.9, 3.9), None, "nothing to get");
        // Truth 1 with the true gain is 2 in the scale of the gain that the tool believes.
        assert_eq!(sums.coverage, Rate { hits: 1, trials: 1 });
        assert_eq!(sums.confidence[4].2, Rate { hits: 1, trials: 2 });
        assert_eq!(sums.confusion[&("null".to_string(), "cogging".to_string())], 1);
    }
}
