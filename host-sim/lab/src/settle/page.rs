//! The inputs of each round and the reasons for them, as `settle.json` and a page.

use super::{Round, Settled};
use device_sim::failure::Failure;
use html_report::chart::{Chart, Curve};
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
    if let Some(figure) = contenders(settled) {
        sheet.figures(&[figure]);
    }
    sheet.note("Each round's folder holds its recordings, its experiment (why this input) and its report.");
    sheet.finish()
}

fn rounds(count: usize) -> String {
    if count == 1 { "1 round".to_owned() } else { format!("{count} rounds") }
}

/// Probabilities of the contenders over the rounds.
fn contenders(settled: &Settled) -> Option<(String, String)> {
    let mut names: Vec<&str> = Vec::new();
    for (name, _) in settled.rounds.iter().flat_map(|round| &round.contenders) {
        if !names.contains(&name.as_str()) {
            names.push(name);
        }
    }
    if names.is_empty() || settled.rounds.len() < 2 {
        return None;
    }
    let curve = |(colour, name): (usize, &&str)| {
        let at = |(place, round): (usize, &Round)| {
            let found = round.contenders.iter().find(|(other, _)| other == name);
            ((place + 1) as f64, 100.0 * found.map_or(0.0, |(_, probability)| *probability))
        };
        let points = settled.rounds.iter().enumerate().map(at).collect();
        Curve { name: (*name).to_owned(), colour: colour as u8, dashed: false, points }
    };
    let chart = Chart {
        title: "Names that still contend".into(),
        x_label: "round".into(),
        y_label: "probability, %".into(),
        curves: names.iter().take(6).enumerate().map(curve).collect(),
        ..Chart::default()
    };
    Some((chart.svg(), "A name at zero contends no more, or is settled.".to_owned()))
}
