//! Metrics over all cases of a generator.

mod figure;
mod lines;
mod reliability;
mod select;

use std::collections::BTreeMap;

pub(crate) use figure::share_text;
pub(crate) use reliability::{BELIEVED, Reliability};
pub(crate) use select::STRENGTHS;

use crate::judge::{CONFIDENT, Record};
use crate::key::Category;
use crate::stats::Rate;
use figure::Line;
use select::{confident, level, names, of, rate};

/// The results of one baseline.
#[derive(Clone, Debug, Default)]
pub(crate) struct BaselineMetrics {
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
pub(crate) struct Metrics {
    pub(crate) lines: Vec<Line>,
    /// By strength, as [`STRENGTHS`].
    pub(crate) by_effect: BTreeMap<String, [Rate; 3]>,
    /// Single effects right, by machine.
    pub(crate) by_rig: BTreeMap<String, Rate>,
    /// Abstained, and confidently wrong; with whether the tool has a detector for the kind.
    pub(crate) by_unknown: BTreeMap<(bool, String), [Rate; 2]>,
    /// Both found, one found.
    pub(crate) by_pair: BTreeMap<String, [Rate; 2]>,
    pub(crate) by_parameter: BTreeMap<String, Rate>,
    pub(crate) reliability: Reliability,
    /// (what was hidden, what was answered first) → how often; single effects at strengths 10 and 3
    /// only.
    pub(crate) confusion: BTreeMap<(String, String), usize>,
    pub(crate) rivals: Vec<BaselineMetrics>,
    pub(crate) failures: usize,
    pub(crate) null_alarms: Rate,
    pub(crate) strong: Rate,
}

/// Metrics over all records.
pub(crate) fn sum(records: &[Record]) -> Metrics {
    let mut s = Metrics {
        failures: records.iter().filter(|r| r.answer.is_err()).count(),
        lines: lines::all(records),
        null_alarms: rate(of(records, &[Category::Null]), Record::names_physics),
        strong: rate(of(records, &[Category::Single]).filter(|r| r.key.strength == 10.0), Record::classy),
        reliability: Reliability::of(&names(records)),
        ..Metrics::default()
    };
    for r in records {
        match r.key.category {
            Category::Single => {
                if let Some(level) = level(r) {
                    s.by_effect.entry(r.key.hidden()).or_default()[level].add(r.right());
                }
                // The words before the rate are the machine.
                let machine = r.key.rig.split(',').next().unwrap_or("").to_string();
                s.by_rig.entry(machine).or_default().add(r.right());
            }
            Category::Pair | Category::Triple => {
                let row = s.by_pair.entry(r.key.hidden()).or_default();
                row[0].add(r.right());
                row[1].add(r.found() > 0);
            }
            Category::Outside => {
                let row = s.by_unknown.entry((r.key.detector, r.key.hidden())).or_default();
                row[0].add(r.abstains());
                row[1].add(confident(r, CONFIDENT));
            }
            _ => {}
        }
        if r.gain().is_some() || !r.key.parameters.is_empty() {
            for (name, inside) in r.coverage() {
                s.by_parameter.entry(parameter_family(&name)).or_default().add(inside);
            }
        }
        if r.key.category != Category::Single || r.key.strength != 1.0 {
            let hidden = match r.key.category {
                Category::Single | Category::Pair | Category::Triple | Category::Outside => r.key.hidden(),
                Category::CannotTell => format!("{} (cannot tell)", r.key.hidden()),
                other => other.word().to_string(),
            };
            let first = r.effects().first().map_or(r.verdict().to_string(), |e| e.name.clone());
            *s.confusion.entry((hidden, first)).or_default() += 1;
        }
    }
    s.rivals = crate::baselines::BASELINES
        .iter()
        .enumerate()
        .filter(|(i, _)| records.iter().any(|r| r.opinions.iter().any(|o| o.rival == *i)))
        .map(|(i, rival)| sum_rival(records, i, rival))
        .collect();
    s
}

/// `cogging.order_12` and its like are one family.
fn parameter_family(name: &str) -> String {
    match name.find(".order_") {
        Some(at) => format!("{}.order_N", &name[..at]),
        None => name.to_string(),
    }
}

fn sum_rival(records: &[Record], i: usize, rival: &crate::baselines::Baseline) -> BaselineMetrics {
    let mut s =
        BaselineMetrics { name: rival.name, names_something: rival.names, ..BaselineMetrics::default() };
    for r in records {
        let Some(o) = r.opinions.iter().find(|o| o.rival == i) else { continue };
        let silent = o.names.is_empty();
        let hides = |n: &str| r.key.effects.iter().any(|h| h == n);
        o.names.iter().for_each(|n| s.false_names.add(!hides(n)));
        match r.key.category {
            Category::Single => {
                if let Some(level) = level(r) {
                    s.right[level].add(o.names.iter().any(|n| hides(n)));
                }
            }
            Category::Null => s.null_alarms.add(!silent),
            Category::ParametersOnly => s.parameters_called_physics.add(!silent),
            Category::Outside => s.outside_abstains.add(silent),
            _ => {}
        }
        s.shares.extend(o.share);
    }
    s
}

#[cfg(test)]
mod tests {
    use super::figure::Figure;
    use super::*;
    use crate::judge::tests::{key, record, says};

    fn figure(metrics: &Metrics, key: &str) -> Rate {
        match &metrics.lines.iter().find(|l| l.key == key).expect("the line is there").figure {
            Figure::Rate(rate) => *rate,
            other => panic!("{key} is {other:?}"),
        }
    }

    #[test]
    fn sums_count_alarms_false_names_and_bins() {
        let s = "stribeck_friction";
        let mut detected = key(Category::Outside, &[], 10.0);
        detected.detector = true;
        let mut told = says(&[]);
        told.verdict = "unexplained".into();
        let records = [
            record(key(Category::Single, &[s], 10.0), says(&[(s, 0.97), ("cogging", 0.6)])),
            record(key(Category::Single, &[s], 1.0), says(&[])),
            record(key(Category::Null, &[], 0.0), says(&[("cogging", 0.97)])),
            record(key(Category::Null, &[], 0.0), says(&[])),
            record(key(Category::Outside, &[], 10.0), says(&[("cogging", 0.7)])),
            record(detected, told),
        ];
        let metrics = sum(&records);
        assert_eq!(figure(&metrics, "right_10"), Rate { hits: 1, trials: 1 });
        assert_eq!(figure(&metrics, "clean_10"), Rate { hits: 0, trials: 1 });
        assert_eq!(figure(&metrics, "right_1"), Rate { hits: 0, trials: 1 });
        assert_eq!(figure(&metrics, "null_alarms"), Rate { hits: 1, trials: 2 });
        assert_eq!(figure(&metrics, "false_names"), Rate { hits: 3, trials: 4 });
        assert_eq!(figure(&metrics, "believed"), Rate { hits: 1, trials: 2 });
        assert_eq!(figure(&metrics, "outside_confident"), Rate { hits: 0, trials: 1 });
        assert_eq!(figure(&metrics, "outside_likely"), Rate { hits: 1, trials: 1 });
        assert_eq!(figure(&metrics, "outside_abstains"), Rate { hits: 0, trials: 1 });
        assert_eq!(figure(&metrics, "detector_abstains"), Rate { hits: 1, trials: 1 }, "counted apart");
        assert_eq!(metrics.reliability.bins[9].right, Rate { hits: 1, trials: 2 });
        assert_eq!(metrics.confusion[&("null".to_string(), "cogging".to_string())], 1);
    }
}
