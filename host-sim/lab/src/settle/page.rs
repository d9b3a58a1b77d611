//! The inputs of each round and the reasons for them, as `settle.json` and a page.

use super::{Round, Settled};
use device_sim::failure::Failure;
use html_report::{Cell, Sheet};
use std::path::Path;

/// Writes `settle.json` and `settle.html`.
pub(super) fn write(settled: &Settled, folder: &Path) -> Result<(), Failure> {
    for (name, text) in [("settle.json", json(settled)), ("settle.html", html(settled))] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|cause| {
            Failure::failed(format_args!(
                "{}: it cannot be written ({cause}); free some space or choose another --out",
                path.display()
            ))
        })?;
    }
    Ok(())
}

fn json(settled: &Settled) -> String {
    let round = |round: &Round| {
        let contenders: Vec<serde_json::Value> = round
            .contenders
            .iter()
            .map(|(name, probability)| serde_json::json!({ "name": name, "probability": probability }))
            .collect();
        serde_json::json!({
            "asked": round.asked,
            "why": round.why,
            "seconds": round.seconds,
            "sentence": round.sentence,
            "contenders": contenders,
        })
    };
    let names: Vec<serde_json::Value> = settled
        .names
        .iter()
        .map(|n| serde_json::json!({ "name": n.name, "class": n.class, "confidence": n.confidence }))
        .collect();
    let value = serde_json::json!({
        "format": 1,
        "names": names,
        "conclusion": settled.conclusion,
        "motion_s": settled.motion_s(),
        "rounds": settled.rounds.iter().map(round).collect::<Vec<_>>(),
    });
    format!("{value:#}\n")
}

fn html(settled: &Settled) -> String {
    let names: Vec<String> = settled
        .names
        .iter()
        .map(|n| format!("{} ({:.0} % sure)", n.class.join(" or "), 100.0 * n.confidence))
        .collect();
    let named = if names.is_empty() {
        "Nothing is named".to_owned()
    } else {
        format!("Named: {}", names.join(" and "))
    };
    let lead = format!(
        "{named}, after {} and {:.0} s of motion: {}.",
        rounds(settled.rounds.len()),
        settled.motion_s(),
        settled.conclusion
    );
    let mut sheet = Sheet::new("A diagnosis settled by the device", &lead);
    sheet.heading("What was asked, and why");
    let row = |(place, round): (usize, &Round)| {
        vec![
            Cell::number(Some((place + 1) as f64), 0),
            Cell::text(&round.asked),
            Cell::text(&round.why),
            Cell::number(Some(round.seconds), 0),
            Cell::text(&round.sentence),
        ]
    };
    let rows: Vec<Vec<Cell>> = settled.rounds.iter().enumerate().map(row).collect();
    sheet.table(&["round", "asked", "why", "motion, s", "the diagnosis of all recordings so far"], &rows);
    contenders(&mut sheet, settled);
    sheet.note("Each round's folder holds its recordings, its experiment (why this input) and its report.");
    sheet.finish()
}

fn rounds(count: usize) -> String {
    if count == 1 { "1 round".to_owned() } else { format!("{count} rounds") }
}

/// Writes the probability of each contender after each round, in %; a dash where it does not contend.
fn contenders(sheet: &mut Sheet, settled: &Settled) {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in settled.rounds.iter().flat_map(|round| &round.contenders) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    if names.is_empty() {
        return;
    }
    sheet.heading("Names that still contend, and their probability, %");
    let head: Vec<String> =
        (1..=settled.rounds.len()).map(|number| format!("after round {number}")).collect();
    let head: Vec<&str> = std::iter::once("").chain(head.iter().map(String::as_str)).collect();
    let row = |name: &&str| {
        let after = |round: &Round| {
            let found = round.contenders.iter().find(|(other, _)| other == name);
            Cell::number(found.map(|(_, probability)| 100.0 * probability), 1)
        };
        std::iter::once(Cell::text(*name)).chain(settled.rounds.iter().map(after)).collect()
    };
    let rows: Vec<Vec<Cell>> = names.iter().map(row).collect();
    sheet.table(&head, &rows);
}
