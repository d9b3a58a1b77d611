//! Metrics over all cases of a generator: the lines of the tables.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::judge::{CONFIDENT, Record};
use crate::key::Category;
use crate::stats::{Rate, quantile};

/// The strengths of single effects, effect over noise.
pub(crate) const STRENGTHS: [f64; 3] = [10.0, 3.0, 1.0];
/// Names given with this or more are the ones that a reader believes.
pub(crate) const BELIEVED: f64 = 0.9;
/// From this confidence on the second generator's own score calls a wrong name confidently wrong.
const LIKELY: f64 = 0.5;

/// A figure of a table.
#[derive(Clone, Debug)]
pub(crate) enum Figure {
    Rate(Rate),
    /// Shares of one, of which median and tenth percentile are told.
    Shares(Vec<f64>),
    Count(usize),
}

impl Figure {
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Rate(rate) => rate.text(),
            Self::Shares(shares) => share_text(shares),
            Self::Count(count) => count.to_string(),
        }
    }

    pub(crate) fn json(&self) -> Value {
        match self {
            Self::Rate(rate) => rate.json(),
            Self::Shares(x) => {
                json!({ "median": quantile(x, 0.5), "p10": quantile(x, 0.1), "cases": x.len() })
            }
            Self::Count(count) => json!(count),
        }
    }
}

/// Median and tenth percentile as text.
pub(crate) fn share_text(shares: &[f64]) -> String {
    match (quantile(shares, 0.5), quantile(shares, 0.1)) {
        (Some(median), Some(tenth)) => {
            let percent = |x: f64| 100.0 * x;
            format!(
                "median {:.0} %, tenth percentile {:.0} % ({})",
                percent(median),
                percent(tenth),
                shares.len()
            )
        }
        _ => "no case".into(),
    }
}

/// One line of the main table.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// Its name in the JSON.
    pub(crate) key: String,
    pub(crate) measure: String,
    pub(crate) wanted: &'static str,
    pub(crate) figure: Figure,
}

/// A bin of the reliability table.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bin {
    /// Sum of the confidences given.
    confidence: f64,
    pub(crate) right: Rate,
}

impl Bin {
    /// Mean confidence of the names in it; `None` of none.
    pub(crate) fn mean(&self) -> Option<f64> {
        (self.right.trials > 0).then(|| self.confidence / self.right.trials as f64)
    }
}

/// Confidence against truth, over all names of all categories.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reliability {
    /// Tenths of confidence; 1.0 is in the last.
    pub(crate) bins: [Bin; 10],
    /// Expected calibration error and Brier score; `None` where nothing was named.
    pub(crate) errors: Option<(f64, f64)>,
    /// The rate of right names among those given with [`BELIEVED`] or more.
    pub(crate) believed: Rate,
}

impl Reliability {
    /// From (confidence, right).
    pub(crate) fn of(names: &[(f64, bool)]) -> Self {
        let mut metrics = Self::default();
        let mut brier = 0.0;
        for &(confidence, right) in names {
            let bin = &mut metrics.bins[((confidence * 10.0).max(0.0) as usize).min(9)];
            bin.confidence += confidence;
            bin.right.add(right);
            brier += (confidence - f64::from(u8::from(right))).powi(2);
            if confidence >= BELIEVED {
                metrics.believed.add(right);
            }
        }
        if !names.is_empty() {
            let n = names.len() as f64;
            let off = metrics.bins.iter().map(|b| (b.confidence - b.right.hits as f64).abs()).sum::<f64>();
            metrics.errors = Some((off / n, brier / n));
        }
        metrics
    }

    pub(crate) fn json(&self) -> Value {
        let bins: Vec<Value> = self
            .bins
            .iter()
            .enumerate()
            .map(|(i, b)| json!({ "from": i as f64 / 10.0, "mean_confidence": b.mean(), "right": b.right.json() }))
            .collect();
        json!({
            "bins": bins, "expected_calibration_error": self.errors.map(|e| e.0), "brier": self.errors.map(|e| e.1),
            "believed": self.believed.json(),
        })
    }
}

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
    /// (what was hidden, what was answered first) → how often; single effects at strengths 10 and 3 only.
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
        lines: lines(records),
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

fn of<'a>(records: &'a [Record], which: &'a [Category]) -> impl Iterator<Item = &'a Record> + Clone {
    records.iter().filter(move |r| which.contains(&r.key.category))
}

fn rate<'a>(records: impl Iterator<Item = &'a Record>, hit: impl Fn(&Record) -> bool) -> Rate {
    let mut rate = Rate::default();
    records.for_each(|r| rate.add(hit(r)));
    rate
}

fn level(r: &Record) -> Option<usize> {
    STRENGTHS.iter().position(|x| *x == r.key.strength)
}

fn confident(r: &Record, least: f64) -> bool {
    r.effects().iter().any(|e| e.confidence >= least && !r.is_true(e))
}

/// Every name of every case: its confidence, and whether it is right by class.
fn names(records: &[Record]) -> Vec<(f64, bool)> {
    records.iter().flat_map(|r| r.effects().iter().map(|e| (e.confidence, r.is_true(e)))).collect()
}

fn lines(records: &[Record]) -> Vec<Line> {
    let mut list: Vec<Line> = Vec::new();
    let mut put = |key: &str, measure: &str, wanted: &'static str, figure: Figure| {
        list.push(Line { key: key.into(), measure: measure.into(), wanted, figure });
    };
    let all = |which: &'static [Category], hit: &dyn Fn(&Record) -> bool| {
        Figure::Rate(rate(of(records, which), hit))
    };
    let at = |strength: f64| of(records, &[Category::Single]).filter(move |r| r.key.strength == strength);
    for (strength, wanted) in STRENGTHS.into_iter().zip(["≥ 97 %", "≥ 92 %", "≥ 75 %"]) {
        put(
            &format!("right_{strength}"),
            &format!("right name or class (≤ 3), at {strength} times the noise"),
            wanted,
            Figure::Rate(rate(at(strength), Record::classy)),
        );
    }
    for strength in STRENGTHS {
        put(
            &format!("exact_{strength}"),
            &format!("… the name itself, at {strength} times"),
            "–",
            Figure::Rate(rate(at(strength), Record::exact)),
        );
    }
    for strength in STRENGTHS {
        put(
            &format!("clean_{strength}"),
            &format!("… and no false name beside, at {strength} times"),
            "–",
            Figure::Rate(rate(at(strength), |r| r.classy() && r.none_false())),
        );
    }
    let names = names(records);
    let mut false_names = Rate::default();
    names.iter().for_each(|(_, right)| false_names.add(!right));
    put("false_names", "false among all names", "≤ 5 %", Figure::Rate(false_names));
    put("believed", "right among the names given with 0.9 or more", "≥ 90 %", {
        Figure::Rate(Reliability::of(&names).believed)
    });
    put(
        "parameters_called_physics",
        "wrong values called physics",
        "≤ 3 %",
        all(&[Category::ParametersOnly], &Record::names_physics),
    );
    put(
        "parameters_verdict",
        "… answered `parameters_only`",
        "–",
        all(&[Category::ParametersOnly], &|r| r.verdict() == "parameters_only"),
    );
    put("null_alarms", "nulls named", "≤ 1 %", all(&[Category::Null], &Record::names_physics));
    put(
        "null_any_alarm",
        "… anything but `no_mismatch` or `parameters_only`",
        "–",
        all(&[Category::Null], &|r| !matches!(r.verdict(), "no_mismatch" | "parameters_only")),
    );
    put(
        "disturbance_alarms",
        "names under a pure disturbance",
        "–",
        all(&[Category::Disturbance], &Record::names_physics),
    );
    put(
        "disturbance_verdicts",
        "… answered `random_disturbance`",
        "–",
        all(&[Category::Disturbance], &|r| r.verdict() == "random_disturbance"),
    );
    let outside =
        |detector: bool| of(records, &[Category::Outside]).filter(move |r| r.key.detector == detector);
    let rated = |detector: bool, hit: &dyn Fn(&Record) -> bool| Figure::Rate(rate(outside(detector), hit));
    put("outside_abstains", "outside the library: abstains", "≥ 90 %", rated(false, &Record::abstains));
    put(
        "outside_confident",
        "outside the library: confidently wrong (≥ 0.8)",
        "≤ 2 %",
        rated(false, &|r| confident(r, CONFIDENT)),
    );
    put("outside_likely", "… wrong with 0.5 or more", "–", rated(false, &|r| confident(r, LIKELY)));
    put("outside_named", "… names anything", "–", rated(false, &Record::names_physics));
    let unnamed: Vec<f64> = outside(false).filter_map(Record::unnamed_gain).collect();
    put(
        "outside_gain",
        "… held-out gain of its force without a name, over the oracle's",
        "–",
        Figure::Shares(unnamed),
    );
    put(
        "detector_abstains",
        "kinds that the tool has a detector for: no name, told as such",
        "–",
        rated(true, &Record::abstains),
    );
    put("detector_confident", "… confidently wrong (≥ 0.8)", "–", rated(true, &|r| confident(r, CONFIDENT)));
    put("pairs", "pairs: both found, none false", "≥ 80 %", all(&[Category::Pair], &Record::right));
    put("pairs_one", "… at least one found", "–", all(&[Category::Pair], &|r| r.found() > 0));
    put("pairs_false", "… something false", "–", all(&[Category::Pair], &|r| !r.none_false()));
    put(
        "triples",
        "triples: two of three found, none false",
        "≥ 60 %",
        all(&[Category::Triple], &Record::right),
    );
    put(
        "triples_all",
        "… all three, none false",
        "–",
        all(&[Category::Triple], &|r| r.right() && r.found() == 3),
    );
    let told = all(&[Category::CannotTell], &Record::right);
    put("cannot_tell", "cannot tell: class with the truth, or no name", "–", told);
    put(
        "cannot_tell_says_so",
        "… answered `insufficient_excitation`",
        "–",
        all(&[Category::CannotTell], &|r| r.verdict() == "insufficient_excitation"),
    );
    put("cannot_tell_wrong", "… a wrong name", "–", all(&[Category::CannotTell], &|r| !r.none_false()));
    for (word, key) in [("hidden", "cannot_tell_hidden"), ("twin", "cannot_tell_twin")] {
        let some = of(records, &[Category::CannotTell]).filter(|r| r.key.poverty.as_deref() == Some(word));
        put(key, &format!("… handled right, {word}"), "–", Figure::Rate(rate(some, Record::right)));
    }
    let gains: Vec<(&Record, f64)> = records.iter().filter_map(|r| Some((r, r.gain()?))).collect();
    put(
        "gain",
        "held-out gain over the oracle's",
        "median ≥ 95 %, tenth percentile ≥ 60 %",
        Figure::Shares(gains.iter().map(|g| g.1).collect()),
    );
    put(
        "gain_right",
        "… where the name is right",
        "–",
        Figure::Shares(gains.iter().filter(|g| g.0.classy()).map(|g| g.1).collect()),
    );
    let reported: Vec<crate::judge::Gain> = records.iter().filter_map(Record::reported_gain).collect();
    put(
        "gain_reported",
        "… as the report's residuals have it, over the key's",
        "–",
        Figure::Shares(reported.iter().map(|g| g.of_oracle).collect()),
    );
    put(
        "gain_reported_of_own",
        "… as the report's residuals have it, over what its own refit leaves above the noise",
        "–",
        Figure::Shares(reported.iter().map(|g| g.of_own).collect()),
    );
    let unjudged = records.iter().filter(|r| r.answer.is_ok() && r.key.oracle.is_some() && r.left.is_err());
    put("unjudged", "patched rigs that the judge cannot run", "–", Figure::Count(unjudged.count()));
    let mut coverage = Rate::default();
    records.iter().flat_map(Record::coverage).for_each(|(_, inside)| coverage.add(inside));
    put("coverage", "95 % intervals that hold the truth", "92–98 %", Figure::Rate(coverage));
    let failures = records.iter().filter(|r| r.answer.is_err()).count();
    put("failures", "cases in which the tool gave no report", "0", Figure::Count(failures));
    list
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

    #[test]
    fn reliability_is_the_mean_gap_of_the_bins() {
        let r = Reliability::of(&[(0.95, true), (0.95, false), (1.0, true), (0.2, false)]);
        // The last bin: 2.9 given, 2 right; the third: 0.2 given, none.
        let (error, brier) = r.errors.unwrap();
        assert!((error - (0.9 + 0.2) / 4.0).abs() < 1e-12, "{error}");
        assert!((brier - (0.0025 + 0.9025 + 0.04) / 4.0).abs() < 1e-12, "{brier}");
        assert_eq!(r.believed, Rate { hits: 2, trials: 3 });
        assert!(Reliability::of(&[]).errors.is_none());
    }
}
