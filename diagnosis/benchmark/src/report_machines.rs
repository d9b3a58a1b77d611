//! The report on real machines: for the terminal, as markdown and as JSON.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::machines::{Machine, MachineSums};
use crate::report::{Run, columns, head, reliability, table};
use crate::report_json::case_json;

fn machine_rows(machines: &[Machine]) -> Vec<Vec<String>> {
    machines
        .iter()
        .map(|m| {
            vec![
                m.record.id.clone(),
                m.outcome().word().into(),
                m.belief.wanted(),
                m.record.answer_text().replace('|', "/"),
                m.belief.source.clone(),
            ]
        })
        .collect()
}

const MACHINE: [&str; 5] = ["case", "judged", "right would be", "answer (confidence)", "belief and source"];

/// Real machines as markdown.
pub(crate) fn markdown(machines: &[Machine], s: &MachineSums, run: &Run) -> String {
    let mut out = head(machines.len(), run) + "\n\n";
    table(&mut out, &["measure", "wanted", "measured"], s.rows().into_iter().map(|r| r.to_vec()));
    let section = reliability(&s.reliability);
    let _ = writeln!(out, "### {}\n", section.title);
    table(&mut out, &section.columns, section.rows);
    out.push_str("### Every case\n\n");
    table(&mut out, &MACHINE, machine_rows(machines));
    out
}

/// Real machines for the terminal; the belief's source is left to the file.
pub(crate) fn terminal(machines: &[Machine], s: &MachineSums, run: &Run) -> String {
    let mut out = head(machines.len(), run) + "\n\n";
    columns(&mut out, &s.rows().iter().map(|r| r.to_vec()).collect::<Vec<_>>());
    let section = reliability(&s.reliability);
    let _ = writeln!(out, "\n{}", section.title);
    columns(&mut out, &section.rows);
    out.push_str("\nevery case\n");
    let rows: Vec<Vec<String>> = machine_rows(machines).into_iter().map(|r| r[..4].to_vec()).collect();
    columns(&mut out, &rows);
    out
}

/// Real machines as JSON.
pub(crate) fn as_json(machines: &[Machine], s: &MachineSums, run: &Run) -> Value {
    let cases: Vec<Value> = machines
        .iter()
        .map(|m| {
            let mut case = case_json(&m.record);
            case["outcome"] = json!(m.outcome().word());
            case["wanted"] = json!(m.belief.wanted());
            case
        })
        .collect();
    json!({
        "format": 2, "tool": run.tool, "source": run.source, "machines": s.json(), "cases": cases,
    })
}
