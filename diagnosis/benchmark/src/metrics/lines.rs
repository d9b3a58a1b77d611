//! The lines of the main table.

use super::figure::{Figure, Line};
use super::reliability::Reliability;
use super::select::{STRENGTHS, confident, names, of, rate};
use crate::judge::{CONFIDENT, Gain, Record};
use crate::key::Category;
use crate::stats::Rate;

/// From this confidence on the second generator's own score calls a wrong name confidently wrong.
const LIKELY: f64 = 0.5;

/// Returns the lines over all records.
pub(super) fn all(records: &[Record]) -> Vec<Line> {
    let mut lines = Lines { records, list: Vec::new() };
    lines.put_singles();
    lines.put_names();
    lines.put_nulls();
    lines.put_outside();
    lines.put_detected();
    lines.put_combinations();
    lines.put_cannot_tell();
    lines.put_gains();
    lines.put_soundness();
    lines.list
}

/// The lines as they are written.
struct Lines<'a> {
    records: &'a [Record],
    list: Vec<Line>,
}

impl<'a> Lines<'a> {
    fn put(&mut self, key: &str, measure: &str, wanted: &'static str, figure: Figure) {
        self.list.push(Line { key: key.into(), measure: measure.into(), wanted, figure });
    }

    /// Adds the share of a category's records for which `hit` is true.
    fn put_rate(
        &mut self,
        key: &str,
        measure: &str,
        wanted: &'static str,
        category: Category,
        hit: impl Fn(&Record) -> bool,
    ) {
        let figure = Figure::Rate(rate(of(self.records, &[category]), hit));
        self.put(key, measure, wanted, figure);
    }

    /// Adds the share of the single effects of a strength for which `hit` is true.
    fn put_single(
        &mut self,
        (key, measure): (&str, &str),
        strength: f64,
        wanted: &'static str,
        hit: impl Fn(&Record) -> bool,
    ) {
        let single = of(self.records, &[Category::Single]).filter(|r| r.key.strength == strength);
        let figure = Figure::Rate(rate(single, hit));
        self.put(&format!("{key}_{strength}"), &format!("{measure} {strength} times"), wanted, figure);
    }

    fn put_singles(&mut self) {
        for (strength, wanted) in STRENGTHS.into_iter().zip(["≥ 97 %", "≥ 92 %", "≥ 75 %"]) {
            let single = of(self.records, &[Category::Single]).filter(|r| r.key.strength == strength);
            let figure = Figure::Rate(rate(single, Record::classy));
            let measure = format!("right name or class (≤ 3), at {strength} times the noise");
            self.put(&format!("right_{strength}"), &measure, wanted, figure);
        }
        for strength in STRENGTHS {
            self.put_single(("exact", "… the name itself, at"), strength, "–", Record::exact);
        }
        for strength in STRENGTHS {
            let text = ("clean", "… and no false name beside, at");
            self.put_single(text, strength, "–", |r| r.classy() && r.none_false());
        }
    }

    fn put_names(&mut self) {
        let names = names(self.records);
        let mut false_names = Rate::default();
        names.iter().for_each(|(_, right)| false_names.add(!right));
        self.put("false_names", "false among all names", "≤ 5 %", Figure::Rate(false_names));
        let believed = Figure::Rate(Reliability::of(&names).believed);
        self.put("believed", "right among the names given with 0.9 or more", "≥ 90 %", believed);
    }

    /// Cases in which no effect is hidden.
    fn put_nulls(&mut self) {
        use Category::{Disturbance, Null, ParametersOnly};
        self.put_rate(
            "parameters_called_physics",
            "wrong values called physics",
            "≤ 3 %",
            ParametersOnly,
            Record::names_physics,
        );
        self.put_rate("parameters_verdict", "… answered `parameters_only`", "–", ParametersOnly, |r| {
            r.verdict() == "parameters_only"
        });
        self.put_rate("null_alarms", "nulls named", "≤ 1 %", Null, Record::names_physics);
        self.put_rate(
            "null_any_alarm",
            "… anything but `no_mismatch` or `parameters_only`",
            "–",
            Null,
            |r| !matches!(r.verdict(), "no_mismatch" | "parameters_only"),
        );
        self.put_rate(
            "disturbance_alarms",
            "names under a pure disturbance",
            "–",
            Disturbance,
            Record::names_physics,
        );
        self.put_rate("disturbance_verdicts", "… answered `random_disturbance`", "–", Disturbance, |r| {
            r.verdict() == "random_disturbance"
        });
    }

    /// Foreign physics, by whether the tool has a detector for the kind.
    fn foreign(&self, detector: bool) -> impl Iterator<Item = &'a Record> + use<'a> {
        of(self.records, &[Category::Outside]).filter(move |r| r.key.detector == detector)
    }

    /// Adds the share of the foreign physics for which `hit` is true.
    fn put_foreign(
        &mut self,
        detector: bool,
        key: &str,
        measure: &str,
        wanted: &'static str,
        hit: impl Fn(&Record) -> bool,
    ) {
        let figure = Figure::Rate(rate(self.foreign(detector), hit));
        self.put(key, measure, wanted, figure);
    }

    fn put_outside(&mut self) {
        let abstains = "outside the library: abstains";
        self.put_foreign(false, "outside_abstains", abstains, "≥ 90 %", Record::abstains);
        let measure = "outside the library: confidently wrong (≥ 0.8)";
        self.put_foreign(false, "outside_confident", measure, "≤ 2 %", |r| confident(r, CONFIDENT));
        let measure = "… wrong with 0.5 or more";
        self.put_foreign(false, "outside_likely", measure, "–", |r| confident(r, LIKELY));
        self.put_foreign(false, "outside_named", "… names anything", "–", Record::names_physics);
        let unnamed: Vec<f64> = self.foreign(false).filter_map(Record::unnamed_gain).collect();
        self.put(
            "outside_gain",
            "… held-out gain of its force without a name, over the oracle's",
            "–",
            Figure::Shares(unnamed),
        );
    }

    fn put_detected(&mut self) {
        let measure = "kinds that the tool has a detector for: no name, reported as such";
        self.put_foreign(true, "detector_abstains", measure, "–", Record::abstains);
        let measure = "… confidently wrong (≥ 0.8)";
        self.put_foreign(true, "detector_confident", measure, "–", |r| confident(r, CONFIDENT));
    }

    fn put_combinations(&mut self) {
        use Category::{Pair, Triple};
        self.put_rate("pairs", "pairs: both found, none false", "≥ 80 %", Pair, Record::right);
        self.put_rate("pairs_one", "… at least one found", "–", Pair, |r| r.found() > 0);
        self.put_rate("pairs_false", "… something false", "–", Pair, |r| !r.none_false());
        let measure = "triples: two of three found, none false";
        self.put_rate("triples", measure, "≥ 60 %", Triple, Record::right);
        let all_three = |r: &Record| r.right() && r.found() == 3;
        self.put_rate("triples_all", "… all three, none false", "–", Triple, all_three);
    }

    fn put_cannot_tell(&mut self) {
        use Category::CannotTell;
        let measure = "cannot tell: class with the truth, or no name";
        self.put_rate("cannot_tell", measure, "–", CannotTell, Record::right);
        self.put_rate(
            "cannot_tell_says_so",
            "… answered `insufficient_excitation`",
            "–",
            CannotTell,
            |r| r.verdict() == "insufficient_excitation",
        );
        self.put_rate("cannot_tell_wrong", "… a wrong name", "–", CannotTell, |r| !r.none_false());
        for (word, key) in [("hidden", "cannot_tell_hidden"), ("twin", "cannot_tell_twin")] {
            let some = of(self.records, &[CannotTell]).filter(|r| r.key.poverty.as_deref() == Some(word));
            let figure = Figure::Rate(rate(some, Record::right));
            self.put(key, &format!("… handled right, {word}"), "–", figure);
        }
    }

    /// Shares of the held-out residual that the patched rig removes.
    fn put_gains(&mut self) {
        let gains: Vec<(&Record, f64)> = self.records.iter().filter_map(|r| Some((r, r.gain()?))).collect();
        self.put(
            "gain",
            "held-out gain over the oracle's",
            "median ≥ 95 %, tenth percentile ≥ 60 %",
            Figure::Shares(gains.iter().map(|g| g.1).collect()),
        );
        self.put(
            "gain_right",
            "… where the name is right",
            "–",
            Figure::Shares(gains.iter().filter(|g| g.0.classy()).map(|g| g.1).collect()),
        );
        let reported: Vec<Gain> = self.records.iter().filter_map(Record::reported_gain).collect();
        self.put(
            "gain_reported",
            "… as the report's residuals have it, over the key's",
            "–",
            Figure::Shares(reported.iter().map(|g| g.of_oracle).collect()),
        );
        self.put(
            "gain_reported_of_own",
            "… as the report's residuals have it, over what its own refit leaves above the noise",
            "–",
            Figure::Shares(reported.iter().map(|g| g.of_own).collect()),
        );
    }

    /// Reports that cannot be judged, and intervals that hold the truth.
    fn put_soundness(&mut self) {
        let records = self.records;
        let unjudged =
            records.iter().filter(|r| r.answer.is_ok() && r.key.oracle.is_some() && r.left.is_err());
        let unjudged = Figure::Count(unjudged.count());
        self.put("unjudged", "patched rigs that the judge cannot run", "–", unjudged);
        let mut coverage = Rate::default();
        records.iter().flat_map(Record::coverage).for_each(|(_, inside)| coverage.add(inside));
        self.put("coverage", "95 % intervals that hold the truth", "92–98 %", Figure::Rate(coverage));
        let failures = records.iter().filter(|r| r.answer.is_err()).count();
        self.put("failures", "cases in which the tool gave no report", "0", Figure::Count(failures));
    }
}
