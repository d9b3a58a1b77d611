//! The honest table: targets next to measured values, on the terminal, as markdown and as JSON.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use crate::judge::Record;
use crate::metrics::{Metrics, Reliability, share_text};
use crate::options::Options;
use crate::stats::Rate;

/// The tool's time for 60 s at 10 kHz of some hidden physics.
#[derive(Clone, Debug)]
pub(crate) struct Timed {
    pub(crate) hidden: &'static str,
    pub(crate) seconds: f64,
}

fn times_text(times: &[Timed]) -> String {
    let one = |t: &Timed| format!("{:.1} s ({})", t.seconds, t.hidden);
    times.iter().map(one).collect::<Vec<_>>().join(", ")
}

/// The run, for the head of the report.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    pub(crate) options: Options,
    pub(crate) tool: String,
    /// The source of the cases.
    pub(crate) source: String,
    pub(crate) seconds: f64,
    /// Times for 60 s at 10 kHz, where they were measured.
    pub(crate) speed: Option<Vec<Timed>>,
    /// Cases that the run would have had with time for all.
    pub(crate) planned: usize,
    /// Cases of which no recording could be made: not run.
    pub(crate) unbuilt: usize,
}

/// (measure, wanted, measured).
fn rows(s: &Metrics, run: &Run) -> Vec<[String; 3]> {
    let mut list: Vec<[String; 3]> =
        s.lines.iter().map(|l| [l.measure.clone(), l.wanted.to_string(), l.figure.text()]).collect();
    if let Some(times) = &run.speed {
        list.push(["60 s at 10 kHz, two cores".into(), "≤ 10 s".into(), times_text(times)]);
    }
    if run.unbuilt > 0 {
        let what = "cases whose recordings diverged whatever was drawn, not run";
        list.push([what.into(), "0".into(), run.unbuilt.to_string()]);
    }
    list
}

pub(crate) fn table(out: &mut String, head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) {
    let _ = writeln!(out, "| {} |", head.join(" | "));
    let _ = writeln!(out, "|{}", " --- |".repeat(head.len()));
    for row in rows {
        let _ = writeln!(out, "| {} |", row.join(" | "));
    }
    out.push('\n');
}

fn count(r: &Rate) -> String {
    if r.trials == 0 { "–".into() } else { format!("{}/{}", r.hits, r.trials) }
}

pub(crate) fn head(records: usize, run: &Run) -> String {
    let cut = if records + run.unbuilt < run.planned {
        format!(" of {} planned, in an order that says nothing, stopped by --minutes", run.planned)
    } else {
        String::new()
    };
    format!(
        "{} on {}: {records} cases{cut}; {:.0} s. Rates with Wilson's 95 % interval.",
        run.tool, run.source, run.seconds
    )
}

/// A section of the report: its title, the names of its columns, its rows.
pub(crate) struct Section {
    pub(crate) title: &'static str,
    pub(crate) columns: Vec<&'static str>,
    pub(crate) rows: Vec<Vec<String>>,
}

/// Returns the sections below the main table, for every output.
fn sections(s: &Metrics) -> Vec<Section> {
    let mut list = vec![
        Section {
            title: "By effect: right at 10 / 3 / 1 times the noise",
            columns: vec!["effect", "10", "3", "1"],
            rows: s
                .by_effect
                .iter()
                .map(|(name, r)| std::iter::once(name.clone()).chain(r.iter().map(count)).collect())
                .collect(),
        },
        Section {
            title: "Outside the library, by kind",
            columns: vec!["hidden", "the tool has a detector", "abstained", "confidently wrong"],
            rows: s
                .by_unknown
                .iter()
                .map(|((detector, name), r)| {
                    let has = if *detector { "yes, counted apart" } else { "no" };
                    vec![name.clone(), has.into(), count(&r[0]), count(&r[1])]
                })
                .collect(),
        },
        Section {
            title: "Pairs and triples",
            columns: vec!["hidden", "right", "one found"],
            rows: s.by_pair.iter().map(|(n, r)| vec![n.clone(), count(&r[0]), count(&r[1])]).collect(),
        },
        Section {
            title: "By machine: single effects right",
            columns: vec!["machine", "right"],
            rows: s.by_rig.iter().map(|(n, r)| vec![n.clone(), r.text()]).collect(),
        },
        reliability(&s.reliability),
        Section {
            title: "Intervals that hold the truth, by parameter",
            columns: vec!["parameter", "held"],
            rows: s.by_parameter.iter().map(|(n, r)| vec![n.clone(), count(r)]).collect(),
        },
        rivals(s),
    ];
    list.retain(|section| !section.rows.is_empty());
    list
}

pub(crate) fn reliability(r: &Reliability) -> Section {
    let mut rows: Vec<Vec<String>> = Vec::new();
    for (i, bin) in r.bins.iter().enumerate() {
        let Some(mean) = bin.mean() else { continue };
        let range = format!("{:.1}–{:.1}", i as f64 / 10.0, (i + 1) as f64 / 10.0);
        rows.push(vec![range, format!("{mean:.2}"), bin.right.text()]);
    }
    if let Some((error, brier)) = r.errors {
        let text = format!("calibration error {error:.3}, Brier score {brier:.3}");
        rows.push(vec!["all".into(), "–".into(), text]);
    }
    Section {
        title: "Reliability: of the names given with a confidence, right",
        columns: vec!["confidence", "mean", "right"],
        rows,
    }
}

fn rivals(s: &Metrics) -> Section {
    let rows = s.rivals.iter().map(|r| {
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
    Section {
        title: "Rivals on the same cases",
        columns: vec![
            "method",
            "right at 10 · 3 · 1",
            "nulls named",
            "values called physics",
            "false names",
            "outside: abstains",
            "held-out gain over the oracle's",
        ],
        rows: rows.collect(),
    }
}

fn miss(r: &Record) -> Vec<String> {
    vec![
        r.id.clone(),
        r.key.category.word().into(),
        r.key.hidden(),
        if r.key.strength > 0.0 { r.key.strength.to_string() } else { "–".into() },
        r.key.snr.map_or("–".into(), |x| format!("{x:.1}")),
        r.key.rig.clone(),
        r.answer_text().replace('|', "/"),
    ]
}

const MISS: [&str; 7] = ["case", "kind", "hidden", "strength", "reached", "machine", "answer (confidence)"];

/// The whole report as markdown.
pub(crate) fn markdown(records: &[Record], s: &Metrics, run: &Run) -> String {
    let mut out = head(records.len(), run) + "\n\n";
    table(&mut out, &["measure", "wanted", "measured"], rows(s, run).into_iter().map(|r| r.to_vec()));
    for section in sections(s) {
        let _ = writeln!(out, "### {}\n", section.title);
        table(&mut out, &section.columns, section.rows);
    }
    out.push_str("### Confusion: hidden → first answer (single effects at 10 and 3 times, and the rest)\n\n");
    table(
        &mut out,
        &["hidden", "first answer", "cases"],
        s.confusion.iter().map(|((a, b), n)| vec![a.clone(), b.clone(), n.to_string()]),
    );
    out.push_str("### Every miss\n\n");
    table(&mut out, &MISS, records.iter().filter(|r| !r.right()).map(miss));
    out
}

pub(crate) fn columns(out: &mut String, rows: &[Vec<String>]) {
    let count = rows.first().map_or(0, Vec::len);
    let width: Vec<usize> =
        (0..count).map(|i| rows.iter().map(|r| r[i].chars().count()).max().unwrap_or(0)).collect();
    for row in rows {
        let line: Vec<String> = row
            .iter()
            .zip(&width)
            .map(|(text, width)| {
                let pad = width - text.chars().count();
                format!("{text}{}", " ".repeat(pad))
            })
            .collect();
        let _ = writeln!(out, "  {}", line.join("  ").trim_end());
    }
}

/// Returns the output for the terminal: the table, the sections, the confusion matrix, the misses.
pub(crate) fn terminal(records: &[Record], s: &Metrics, run: &Run) -> String {
    let mut out = head(records.len(), run) + "\n\n";
    columns(&mut out, &rows(s, run).iter().map(|r| r.to_vec()).collect::<Vec<_>>());
    for section in sections(s) {
        let _ = writeln!(out, "\n{}", section.title);
        let head: Vec<String> = section.columns.iter().map(|c| (*c).to_string()).collect();
        columns(&mut out, &[vec![head], section.rows].concat());
    }
    out.push_str(&matrix(s));
    let misses: Vec<Vec<String>> = records.iter().filter(|r| !r.right()).map(miss).collect();
    let _ = writeln!(out, "\n{} misses", misses.len());
    columns(&mut out, &misses);
    out
}

/// The confusion as a matrix with numbered columns.
fn matrix(s: &Metrics) -> String {
    let answers: Vec<&String> =
        s.confusion.keys().map(|k| &k.1).collect::<BTreeSet<_>>().into_iter().collect();
    let hidden: Vec<&String> =
        s.confusion.keys().map(|k| &k.0).collect::<BTreeSet<_>>().into_iter().collect();
    let mut out =
        String::from("\nconfusion, hidden against first answer (single effects at 10 and 3, and the rest)\n");
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

/// Returns the part that the tool's author may see: sums and confusion, nothing of single cases.
pub(crate) fn aggregate(records: &[Record], s: &Metrics, run: &Run) -> String {
    let full = markdown(records, s, run);
    let end = full.find("### Every miss").unwrap_or(full.len());
    let mut out = full[..end].to_string();
    out.push_str("### Verdicts by kind\n\n");
    let mut counts: std::collections::BTreeMap<(crate::key::Category, String), usize> = Default::default();
    for r in records {
        *counts.entry((r.key.category, r.verdict().to_string())).or_default() += 1;
    }
    table(
        &mut out,
        &["kind", "verdict", "cases"],
        counts.iter().map(|((c, v), n)| vec![c.word().into(), v.clone(), n.to_string()]),
    );
    out
}
