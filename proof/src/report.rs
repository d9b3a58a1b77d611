//! The honest table: what was wanted beside what was measured, on the terminal, as markdown and as JSON.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::cases::STRENGTHS;
use crate::generator::case::Category;
use crate::judge::{Record, Sums, share_text};
use crate::options::Options;
use crate::stats::{Rate, quantile, wilson};
use crate::tool::Weighed;

/// How long the tool took for 60 s at 10 kHz of some hidden physics.
#[derive(Clone, Debug)]
pub(crate) struct Timed {
    pub(crate) hidden: &'static str,
    pub(crate) seconds: f64,
}

fn times_text(times: &[Timed]) -> String {
    let one = |t: &Timed| format!("{:.1} s ({})", t.seconds, t.hidden);
    times.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// What was run, for the head of the report.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) options: Options,
    pub(crate) tool: String,
    pub(crate) seconds: f64,
    /// Times for 60 s at 10 kHz, where they were measured.
    pub(crate) speed: Option<Vec<Timed>>,
    /// Cases that the run would have had with time for all.
    pub(crate) planned: usize,
    /// Cases that no machine drawn could show at the strength asked for: not run.
    pub(crate) unbuilt: usize,
}

/// (measure, wanted, measured).
fn rows(s: &Sums, run: &Run) -> Vec<[String; 3]> {
    let row = |a: &str, b: &str, c: String| [a.to_string(), b.to_string(), c];
    let mut list = Vec::new();
    for (i, wanted) in ["≥ 97 %", "≥ 92 %", "≥ 65 %"].iter().enumerate() {
        let label = format!("right name or class (≤ 3), at {} times the noise", STRENGTHS[i]);
        list.push([label, (*wanted).into(), s.right[i].text()]);
    }
    for (i, strength) in STRENGTHS.iter().enumerate() {
        list.push([format!("… and no other name, at {strength} times"), "–".into(), s.exact[i].text()]);
    }
    list.push(row("false alarms on nulls", "≤ 1 %, upper bound ≤ 2.5 %", s.null_alarms.text()));
    list.push(row("… nulls answered `no_mismatch`", "–", s.null_verdicts.text()));
    list.push(row("names under a pure disturbance", "–", s.disturbance_alarms.text()));
    list.push(row("… answered `random_disturbance`", "–", s.disturbance_verdicts.text()));
    list.push(row("wrong parameter called physics", "≤ 3 %", s.parameters_called_physics.text()));
    list.push(row("false discoveries among all names", "≤ 5 %", s.false_names.text()));
    list.push(row("outside the library: abstains", "≥ 90 %", s.outside_abstains.text()));
    list.push(row("outside the library: confidently wrong (≥ 0.8)", "≤ 2 %", s.outside_confident.text()));
    list.push(row("pairs: both found, none false", "≥ 80 %", s.pairs.text()));
    list.push(row("pairs: at least one found", "–", s.pairs_first.text()));
    list.push(row("cannot tell: class with the truth, or says so", "–", s.cannot_tell.text()));
    list.push(row("cannot tell: a wrong name", "–", s.cannot_tell_wrong.text()));
    let wanted = "median ≥ 95 %, tenth percentile ≥ 80 %";
    list.push(row("held-out improvement, share of an oracle's, all", wanted, share_text(&s.shares)));
    list.push(row("… where the name is right", "–", share_text(&s.shares_right)));
    list.push(row("95 % intervals that hold the truth", "92–98 %", s.coverage.text()));
    let time = run.speed.as_deref().map_or("not measured in this run".into(), times_text);
    list.push(row("60 s at 10 kHz, two cores", "≤ 10 s", time));
    list.push(row("cases in which the tool gave no report", "0", s.failures.to_string()));
    list.push(row("cases that no machine drawn could show, not run", "–", run.unbuilt.to_string()));
    list
}

fn table(out: &mut String, head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    let _ = writeln!(out, "| {} |", head.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(head.len()));
    for row in rows {
        let _ = writeln!(out, "| {} |", row.join(" | "));
    }
    out.push('\n');
}

/// The whole report as markdown.
pub(crate) fn markdown(records: &[Record], s: &Sums, run: &Run) -> String {
    let mut out = String::new();
    let o = &run.options;
    let cut = if records.len() + run.unbuilt < run.planned {
        format!(" of {} planned, in an order that says nothing, stopped by --minutes", run.planned)
    } else {
        String::new()
    };
    let size = if o.quick { "quick run".into() } else { format!("{} draws a cell", o.cases) };
    let _ = writeln!(
        out,
        "Blinded benchmark of {}: {} cases{cut}, seed {}, {size}; {:.0} s. Rates with Wilson's 95 % interval.\n",
        run.tool,
        records.len(),
        o.seed,
        run.seconds
    );
    table(&mut out, &["measure", "wanted", "measured"], rows(s, run).into_iter().map(|r| r.to_vec()));
    out.push_str("### By effect: right at 10 / 3 / 1 times the noise\n\n");
    let count = |r: &Rate| if r.trials == 0 { "–".into() } else { format!("{}/{}", r.hits, r.trials) };
    let line = |name: &str, r: &[Rate; 3]| {
        std::iter::once(format!("`{name}`")).chain(r.iter().map(count)).collect::<Vec<_>>()
    };
    table(&mut out, &["effect", "10", "3", "1"], s.by_effect.iter().map(|(n, r)| line(n, r)));
    if !s.by_outside.is_empty() {
        out.push_str("### Outside the library: abstained\n\n");
        table(
            &mut out,
            &["hidden", "abstained"],
            s.by_outside.iter().map(|(n, r)| vec![format!("{n}"), count(r)]),
        );
    }
    out.push_str("### Rivals on the same cases\n\n");
    let rivals = s.rivals.iter().map(|r| {
        let or = |text: String| if r.names_something { text } else { "names nothing".into() };
        vec![
            r.name.to_string(),
            or(r.right.map(|x| count(&x)).join(" · ")),
            or(r.null_alarms.text()),
            or(r.parameters_called_physics.text()),
            or(r.false_names.text()),
            or(r.outside_abstains.text()),
            share_text(&r.shares),
        ]
    });
    let this = vec![
        "**this tool**".to_string(),
        s.right.map(|x| count(&x)).join(" · "),
        s.null_alarms.text(),
        s.parameters_called_physics.text(),
        s.false_names.text(),
        s.outside_abstains.text(),
        share_text(&s.shares),
    ];
    let head = [
        "method",
        "right at 10 · 3 · 1",
        "null alarms",
        "parameters called physics",
        "false names",
        "outside: abstains",
        "held-out share of an oracle's",
    ];
    table(&mut out, &head, std::iter::once(this).chain(rivals));
    out.push_str("### Confidence: of the names given with it, right\n\n");
    let bins = s.confidence.iter().map(|(a, b, r)| vec![format!("{a:.2}–{:.2}", b.min(1.0)), r.text()]);
    table(&mut out, &["confidence", "right"], bins);
    if !s.by_parameter.is_empty() {
        out.push_str("### Intervals that hold the truth, by parameter\n\n");
        table(
            &mut out,
            &["parameter", "held"],
            s.by_parameter.iter().map(|(n, r)| vec![format!("`{n}`"), count(r)]),
        );
    }
    out.push_str("### Confusion: hidden → first answer (singles at 10 and 3 times, and the rest)\n\n");
    table(
        &mut out,
        &["hidden", "first answer", "cases"],
        s.confusion.iter().map(|((a, b), n)| vec![a.clone(), b.clone(), n.to_string()]),
    );
    let _ = writeln!(out, "### Every miss\n");
    table(
        &mut out,
        &["case", "kind", "hidden", "strength", "machine", "answer (confidence)"],
        records.iter().filter(|r| !r.right()).map(|r| {
            vec![
                r.id.to_string(),
                r.category.word().into(),
                if r.hidden.is_empty() { "nothing".into() } else { r.hidden.join(" + ") },
                if r.strength > 0.0 { r.strength.to_string() } else { "–".into() },
                format!("{}, {:.0} Hz", r.machine, r.rate),
                r.answer_text().replace('|', "/"),
            ]
        }),
    );
    out
}

/// What the terminal shows: the table, the confusion matrix, the misses.
pub(crate) fn terminal(records: &[Record], s: &Sums, run: &Run) -> String {
    let mut out = String::new();
    let lines = rows(s, run);
    let width = |i: usize| lines.iter().map(|r| r[i].chars().count()).max().unwrap_or(0);
    let (a, b) = (width(0), width(1));
    for [measure, wanted, measured] in &lines {
        let _ = writeln!(out, "{measure:<a$}  {wanted:<b$}  {measured}");
    }
    let _ = writeln!(out, "\nby effect, right at 10 / 3 / 1");
    for (name, r) in &s.by_effect {
        let text = r.map(|x| if x.trials == 0 { "–".into() } else { format!("{}/{}", x.hits, x.trials) });
        let _ = writeln!(out, "  {name:<28} {:>6} {:>6} {:>6}", text[0], text[1], text[2]);
    }
    let _ = writeln!(out, "\nrivals: right at 10 · 3 · 1, null alarms, held-out share of an oracle's");
    for r in &s.rivals {
        let right = r.right.map(|x| format!("{}/{}", x.hits, x.trials)).join(" · ");
        let named = if r.names_something {
            format!("{right}; {}", r.null_alarms.text())
        } else {
            "names nothing".into()
        };
        let _ = writeln!(out, "  {:<26} {named}; {}", r.name, share_text(&r.shares));
    }
    out.push_str(&matrix(s));
    let misses: Vec<&Record> = records.iter().filter(|r| !r.right()).collect();
    let _ = writeln!(out, "\n{} misses", misses.len());
    for r in misses {
        let hidden = if r.hidden.is_empty() { "nothing".into() } else { r.hidden.join(" + ") };
        let _ = writeln!(
            out,
            "  case {:>4} {:<15} {hidden} at {}: {}",
            r.id,
            r.category.word(),
            r.strength,
            r.answer_text()
        );
    }
    out
}

/// The confusion as a matrix with numbered columns.
fn matrix(s: &Sums) -> String {
    let answers: Vec<&String> =
        s.confusion.keys().map(|k| &k.1).collect::<BTreeSet<_>>().into_iter().collect();
    let hidden: Vec<&String> =
        s.confusion.keys().map(|k| &k.0).collect::<BTreeSet<_>>().into_iter().collect();
    let mut out =
        String::from("\nconfusion, hidden against first answer (singles at 10 and 3, and the rest)\n");
    let width = hidden.iter().map(|h| h.chars().count()).max().unwrap_or(0);
    let _ = write!(out, "  {:width$}", "");
    for i in 0..answers.len() {
        let _ = write!(out, "{:>4}", i + 1);
    }
    out.push('\n');
    for h in &hidden {
        let _ = write!(out, "  {h:<width$}");
        for a in &answers {
            match s.confusion.get(&((*h).clone(), (*a).clone())) {
                Some(n) => {
                    let _ = write!(out, "{n:>4}");
                }
                None => out.push_str("   ·"),
            }
        }
        out.push('\n');
    }
    for (i, a) in answers.iter().enumerate() {
        let _ = writeln!(out, "  {:>3} {a}", i + 1);
    }
    out
}

fn rate_json(r: &Rate) -> Value {
    let (low, high) = wilson(r.hits, r.trials);
    json!({ "hits": r.hits, "trials": r.trials, "ci95": [low, high] })
}

fn weighed_json((weighed, right): (&Weighed, bool)) -> Value {
    json!({ "name": weighed.name, "right": right, "evidence": weighed.evidence })
}

/// The whole result as JSON: sums, and one line for every case.
pub(crate) fn json(records: &[Record], s: &Sums, run: &Run) -> Value {
    let shares = |x: &[f64]| json!({ "median": quantile(x, 0.5), "p10": quantile(x, 0.1), "cases": x.len() });
    let by_effect: serde_json::Map<String, Value> = s
        .by_effect
        .iter()
        .map(|(n, r)| (n.to_string(), json!(r.iter().map(rate_json).collect::<Vec<_>>())))
        .collect();
    let rivals: Vec<Value> = s
        .rivals
        .iter()
        .map(|r| {
            json!({
                "name": r.name,
                "right": r.right.iter().map(rate_json).collect::<Vec<_>>(),
                "null_alarms": rate_json(&r.null_alarms),
                "parameters_called_physics": rate_json(&r.parameters_called_physics),
                "false_names": rate_json(&r.false_names),
                "outside_abstains": rate_json(&r.outside_abstains),
                "held_out_share": shares(&r.shares),
            })
        })
        .collect();
    let times: Option<serde_json::Map<String, Value>> =
        run.speed.as_ref().map(|times| times.iter().map(|t| (t.hidden.into(), json!(t.seconds))).collect());
    let cases: Vec<Value> = records
        .iter()
        .map(|r| {
            json!({
                "id": r.id, "category": r.category.word(), "hidden": r.hidden, "strength": r.strength,
                "achieved": r.achieved, "machine": r.machine, "rate_hz": r.rate, "right": r.right(),
                "answer": r.answer_text(), "share": r.share(),
                "refit": r.answer.as_ref().ok().map(|a| a.refit_holdout), "patched": r.answer.as_ref().ok().map(|a| a.patched_holdout),
                "oracle": r.oracle.sqrt(), "seconds": r.seconds,
                "weighed": r.weighed().map(weighed_json).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "format": 1,
        "tool": run.tool,
        "seed": run.options.seed,
        "quick": run.options.quick,
        "draws": run.options.cases,
        "only": run.options.only,
        "planned": run.planned,
        "unbuilt": run.unbuilt,
        "right": s.right.iter().map(rate_json).collect::<Vec<_>>(),
        "exactly_right": s.exact.iter().map(rate_json).collect::<Vec<_>>(),
        "by_effect": by_effect,
        "null_alarms": rate_json(&s.null_alarms),
        "disturbance_alarms": rate_json(&s.disturbance_alarms),
        "parameters_called_physics": rate_json(&s.parameters_called_physics),
        "false_names": rate_json(&s.false_names),
        "outside_abstains": rate_json(&s.outside_abstains),
        "outside_confidently_wrong": rate_json(&s.outside_confident),
        "pairs": rate_json(&s.pairs),
        "cannot_tell": rate_json(&s.cannot_tell),
        "held_out_share": shares(&s.shares),
        "held_out_share_where_right": shares(&s.shares_right),
        "coverage": rate_json(&s.coverage),
        "seconds_60s_10khz": times,
        "failures": s.failures,
        "rivals": rivals,
        "cases": cases,
    })
}

/// What may be told to the tool's author: rates by effect and confusion, nothing of single cases.
pub(crate) fn aggregate(records: &[Record], s: &Sums, run: &Run) -> String {
    let full = markdown(records, s, run);
    let end = full.find("### Every miss").unwrap_or(full.len());
    let mut out = full[..end].to_string();
    out.push_str("### Verdicts by category\n\n");
    let mut counts: std::collections::BTreeMap<(Category, String), usize> = Default::default();
    for r in records {
        let verdict = r.answer.as_ref().map_or("failed".to_string(), |a| a.verdict.clone());
        *counts.entry((r.category, verdict)).or_default() += 1;
    }
    table(
        &mut out,
        &["category", "verdict", "cases"],
        counts.iter().map(|((c, v), n)| vec![c.word().into(), v.clone(), n.to_string()]),
    );
    let mut seconds = s.seconds.clone();
    seconds.sort_by(f64::total_cmp);
    if let (Some(median), Some(most)) = (quantile(&seconds, 0.5), seconds.last()) {
        let _ = writeln!(out, "Seconds a case with others running: median {median:.1}, longest {most:.1}.");
    }
    out
}
