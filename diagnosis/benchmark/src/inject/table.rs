//! The tables of `prove --inject`.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde_json::{Value, json};

use super::PLAIN_SHARES;
use super::judge::{Case, Said};
use super::plain::Found;
use crate::metrics::{BELIEVED, Reliability};
use crate::stats::Rate;
use crate::tool::Named;

fn row(out: &mut String, cells: &[String]) {
    let _ = writeln!(out, "| {} |", cells.join(" | "));
}

fn head(out: &mut String, title: &str, columns: &[&str]) {
    let _ = writeln!(out, "\n### {title}\n");
    row(out, &columns.iter().map(|c| (*c).to_string()).collect::<Vec<_>>());
    let _ = writeln!(out, "|{}", " --- |".repeat(columns.len()));
}

fn rate(cases: &[&Case], hit: impl Fn(&Case) -> bool) -> Rate {
    let mut rate = Rate::default();
    cases.iter().for_each(|c| rate.add(hit(c)));
    rate
}

/// A method of the table.
#[derive(Clone, Copy)]
enum Method {
    Tool,
    /// A plain regression, named from this share of the force error on.
    Plain(f64),
}

impl Method {
    fn name(self) -> String {
        match self {
            Method::Tool => "the tool".into(),
            Method::Plain(share) => format!("plain regression from {:.0} %", 100.0 * share),
        }
    }

    fn said(self, case: &Case) -> Said {
        match self {
            Method::Tool => case.said(),
            Method::Plain(share) => case.plain_said(share),
        }
    }

    /// For every new name, whether it is right, and whether it is right or believed of the machine.
    fn names(self, case: &Case) -> Vec<(bool, bool)> {
        match self {
            Method::Tool => case
                .new_names()
                .into_iter()
                .map(|(named, right)| (right, right || case.is_believed(&named.name, named.judged_class())))
                .collect(),
            Method::Plain(share) => case
                .plain_names(share)
                .into_iter()
                .map(|(name, right)| (right, right || case.is_believed(name, &[])))
                .collect(),
        }
    }
}

/// Everything as markdown.
pub(crate) fn markdown(first: &str, cases: &[&Case], without: &[String]) -> String {
    let mut out = format!("{first} Rates with Wilson's 95 % interval.\n");
    if !without.is_empty() {
        let _ = writeln!(out, "\nWithout a fit: {}.", without.join(", "));
    }
    overall(&mut out, cases);
    let solved: Vec<&Case> = cases.iter().copied().filter(|c| c.oracle.solves()).collect();
    grouped(&mut out, "By effect, of those that the oracle solves", &solved, |c| c.hidden.into());
    grouped(&mut out, "By machine, of those that the oracle solves", &solved, |c| c.machine.clone());
    reliability(&mut out, cases);
    lost(&mut out, &solved);
    every(&mut out, cases);
    out
}

fn overall(out: &mut String, cases: &[&Case]) {
    head(
        out,
        "Concealed effects",
        &[
            "method",
            "found at 3 ×, solvable",
            "found at 1 ×, solvable",
            "found, not solvable",
            "false among names",
            "neither concealed nor believed of the machine",
        ],
    );
    let part = |factor: f64, solved: bool| -> Vec<&Case> {
        cases
            .iter()
            .copied()
            .filter(|c| c.oracle.solves() == solved && (c.factor == factor || !solved))
            .collect()
    };
    for method in [Method::Tool].into_iter().chain(PLAIN_SHARES.map(Method::Plain)) {
        let found = |list: &[&Case]| rate(list, |c| method.said(c) == Said::Found).text();
        let (mut wrong, mut unbelieved) = (Rate::default(), Rate::default());
        for (right, known) in cases.iter().flat_map(|c| method.names(c)) {
            wrong.add(!right);
            unbelieved.add(!known);
        }
        row(
            out,
            &[
                method.name(),
                found(&part(3.0, true)),
                found(&part(1.0, true)),
                found(&part(0.0, false)),
                wrong.text(),
                unbelieved.text(),
            ],
        );
    }
}

fn grouped(out: &mut String, title: &str, cases: &[&Case], key: impl Fn(&Case) -> String) {
    head(
        out,
        title,
        &["", "cases", "tool: found · false · silent", "plain from 15 %: found · false · silent"],
    );
    let mut groups: BTreeMap<String, Vec<&Case>> = BTreeMap::new();
    cases.iter().for_each(|c| groups.entry(key(c)).or_default().push(c));
    for (name, list) in groups {
        let counts = |method: Method| {
            let count = |what: Said| list.iter().filter(|c| method.said(c) == what).count();
            format!(
                "{} · {} · {}",
                count(Said::Found),
                count(Said::False),
                count(Said::Silent) + count(Said::NoReport)
            )
        };
        let plain = counts(Method::Plain(PLAIN_SHARES[0]));
        row(out, &[name, list.len().to_string(), counts(Method::Tool), plain]);
    }
}

fn reliability(out: &mut String, cases: &[&Case]) {
    let of = |right: &dyn Fn(&Case, &Named, bool) -> bool| -> Reliability {
        let names: Vec<(f64, bool)> = cases
            .iter()
            .flat_map(|c| {
                c.new_names().into_iter().map(|(n, is_right)| (n.confidence, right(c, n, is_right)))
            })
            .collect();
        Reliability::of(&names)
    };
    head(
        out,
        "Reliability: of the tool's names given with a confidence, right",
        &["confidence", "mean", "right", "right or believed of the machine"],
    );
    let metrics = of(&|_, _, right| right);
    let believed = of(&|case, named, right| right || case.is_believed(&named.name, named.judged_class()));
    for (i, bin) in metrics.bins.iter().enumerate() {
        let Some(mean) = bin.mean() else { continue };
        let range = format!("{:.1}–{:.1}", i as f64 / 10.0, (i + 1) as f64 / 10.0);
        row(out, &[range, format!("{mean:.2}"), bin.right.text(), believed.bins[i].right.text()]);
    }
    let last = [format!("{BELIEVED} or more"), "–".into(), metrics.believed.text(), believed.believed.text()];
    row(out, &last);
}

/// A reason without its figures, so that like reasons count together.
fn bare(reason: &str) -> String {
    let mut text = String::new();
    let mut inside = false;
    for c in reason.chars() {
        let figure = c.is_ascii_digit() || inside && c == '.';
        if figure && !inside {
            text.push('#');
        } else if !figure {
            text.push(c);
        }
        inside = figure;
    }
    text.replace('|', "/")
}

fn lost(out: &mut String, solved: &[&Case]) {
    let mut places: BTreeMap<(String, String), usize> = BTreeMap::new();
    for case in solved.iter().filter(|c| c.said() != Said::Found) {
        let place = (case.lost.word().to_string(), bare(case.lost.reason()));
        *places.entry(place).or_default() += 1;
    }
    let mut list: Vec<_> = places.into_iter().collect();
    list.sort_by_key(|(place, count)| (place.0.clone(), std::cmp::Reverse(*count)));
    head(out, "Where the tool loses what the oracle solves", &["the true law", "cases", "refused because"]);
    for ((place, why), count) in list {
        row(out, &[place, count.to_string(), why]);
    }
}

fn answer(case: &Case) -> String {
    match &case.answer {
        Err(e) => format!("failed: {e}"),
        Ok(a) if a.effects.is_empty() => a.verdict.clone(),
        Ok(a) => {
            let names = a.effects.iter().map(|e| {
                let mark = if e.holds(case.hidden) { "✓ " } else { "" };
                format!("{mark}{} ({:.2})", e.class.join(" or "), e.confidence)
            });
            names.collect::<Vec<_>>().join(", ")
        }
    }
}

fn every(out: &mut String, cases: &[&Case]) {
    head(
        out,
        "Every case",
        &[
            "case",
            "carrier",
            "hidden",
            "×",
            "oracle: coefficient, share",
            "the tool",
            "plain regression",
            "the true law",
        ],
    );
    for c in cases {
        let plain: Vec<String> =
            c.plain.iter().map(|found| format!("{} {:.0} %", found.name, 100.0 * found.share)).collect();
        let solved = if c.oracle.solves() { "" } else { ", not solvable" };
        row(
            out,
            &[
                c.id.clone(),
                c.carrier.clone(),
                c.hidden.into(),
                format!("{}", c.factor),
                format!("{:.2}, {:.0} %{solved}", c.oracle.coefficient, 100.0 * c.oracle.share),
                answer(c).replace('|', "/"),
                plain.join(", "),
                format!("{}: {}", c.lost.word(), c.lost.reason()).replace('|', "/"),
            ],
        );
    }
}

/// Everything as JSON, for further work.
pub(crate) fn json(first: &str, cases: &[&Case]) -> Value {
    let list = |all: &[Found]| -> Vec<Value> {
        let one = |f: &Found| json!({ "name": f.name, "share": f.share });
        all.iter().map(one).collect()
    };
    let one = |c: &&Case| {
        let names: Vec<Value> = c
            .new_names()
            .iter()
            .map(|(n, right)| {
                let believed = c.is_believed(&n.name, n.judged_class());
                json!({ "name": n.name, "class": n.class, "confidence": n.confidence, "right": right, "believed": believed })
            })
            .collect();
        json!({
            "id": c.id, "kind": "effect", "carrier": c.carrier, "machine": c.machine, "hidden": c.hidden,
            "strength": c.factor, "size": c.size, "solvable": c.oracle.solves(),
            "oracle": { "coefficient": c.oracle.coefficient, "share": c.oracle.share },
            "said": format!("{:?}", c.said()).to_lowercase(), "names": names, "answer": answer(c),
            "lost": c.lost.word(), "rejected_because": c.lost.reason(), "plain": list(&c.plain), "plain_untouched": list(&c.plain_own),
            "own": c.own.iter().map(|n| n.name.clone()).collect::<Vec<_>>(),
            "seconds": c.seconds,
        })
    };
    json!({ "format": 1, "source": first, "cases": cases.iter().map(one).collect::<Vec<_>>() })
}

#[cfg(test)]
mod tests {
    use super::super::judge::tests::case;
    use super::*;

    #[test]
    fn every_number_of_the_table_has_its_case() {
        let cases = [
            case("quadratic_drag", &[("quadratic_drag", 0.95)], &[]),
            case("cogging", &[("backlash", 0.92)], &[]),
            case("cogging", &[], &[]),
        ];
        let cases: Vec<&Case> = cases.iter().collect();
        let text = markdown("three", &cases, &[]);
        assert!(
            text.contains("| the tool | 33.3 % (1/3, 6.1–79.2) | no case | no case | 50.0 % (1/2"),
            "{text}"
        );
        assert!(text.contains("| cogging | 2 | 0 · 1 · 1 | 2 · 0 · 0 |"), "{text}");
        assert!(text.contains("| 0.9 or more | – | 50.0 % (1/2"), "{text}");
        assert_eq!(json("three", &cases)["cases"][1]["said"], "false");
    }

    #[test]
    fn reasons_count_together_whatever_their_figures() {
        assert_eq!(bare("it cannot, takes 67 %, less than 70.5 %"), "it cannot, takes # %, less than # %");
    }
}
