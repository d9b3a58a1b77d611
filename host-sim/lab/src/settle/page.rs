//! The inputs of each round and the reasons for them, as `settle.json` and a page.

use super::name::effect_in_words;
use super::{Feel, Name, Round, Settled};
use crate::compensate::residual_force::ResidualForce;
use device_sim::error::Error;
use html_report::{Cell, Sheet};
use std::path::Path;

/// Writes `settle.json` and `settle.html`.
pub(super) fn write(settled: &Settled, folder: &Path) -> Result<(), Error> {
    for (name, text) in [("settle.json", json(settled)), ("settle.html", html(settled))] {
        let path = folder.join(name);
        std::fs::write(&path, text).map_err(|cause| {
            Error::failed(format_args!(
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
            "names": names_json(&round.names),
        })
    };
    let value = serde_json::json!({
        "format": 1,
        "names": names_json(&settled.names),
        "unsure": names_json(&settled.unsure),
        "conclusion": settled.conclusion,
        "motion_s": settled.motion_s(),
        "feel": settled.feel.as_ref().map(feel_json),
        "rounds": settled.rounds.iter().map(round).collect::<Vec<_>>(),
    });
    format!("{value:#}\n")
}

fn names_json(names: &[Name]) -> Vec<serde_json::Value> {
    let one = |n: &Name| serde_json::json!({ "name": n.name, "class": n.class, "confidence": n.confidence });
    names.iter().map(one).collect()
}

fn feel_json(feel: &Result<Feel, String>) -> serde_json::Value {
    let phases = |residual: &ResidualForce| {
        let phases = residual.phases().map(|(name, force)| (name.to_owned(), serde_json::json!(1e3 * force)));
        serde_json::Value::Object(phases.into_iter().collect())
    };
    match feel {
        Ok(feel) => serde_json::json!({
            "before_mn_rms": phases(&feel.before),
            "after_mn_rms": phases(&feel.after),
            "motion_s": feel.motion_s,
            "notes": feel.notes,
        }),
        Err(why) => serde_json::json!({ "why_not": why }),
    }
}

fn html(settled: &Settled) -> String {
    let names: Vec<String> = settled
        .names
        .iter()
        .map(|n| format!("{} ({:.0} % sure)", n.in_words(), 100.0 * n.confidence))
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
    for sentence in settled.unsure_in_words() {
        sheet.note(&format!("{}.", capitalised(&sentence)));
    }
    if let Some(feel) = &settled.feel {
        felt(&mut sheet, feel);
    }
    sheet.note("Each round's folder holds its recordings, its experiment (why this input) and its report.");
    sheet.finish()
}

/// Writes the force on a hand before and after.
fn felt(sheet: &mut Sheet, feel: &Result<Feel, String>) {
    sheet.heading("The mechanism's force on a hand, with what was settled fed forward");
    let feel = match feel {
        Ok(feel) => feel,
        Err(why) => return sheet.note(&format!("{}.", capitalised(why))),
    };
    let phases = feel.before.phases().into_iter().zip(feel.after.phases());
    let row = |((name, before), (_, after)): ((&str, f64), (&str, f64))| {
        vec![Cell::text(name), Cell::number(Some(1e3 * before), 1), Cell::number(Some(1e3 * after), 1)]
    };
    let rows: Vec<Vec<Cell>> = phases.map(row).collect();
    sheet.table(&["phase", "before, mN rms", "after, mN rms"], &rows);
    sheet.note(&format!("This took another {:.0} s of slow motion.", feel.motion_s));
    for note in &feel.notes {
        sheet.note(&format!("{}.", capitalised(note)));
    }
    sheet.note(
        "device.toml holds what the device feeds forward, compensation.html where along the travel it helps.",
    );
}

fn capitalised(sentence: &str) -> String {
    let mut letters = sentence.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

fn rounds(count: usize) -> String {
    if count == 1 { "1 round".to_owned() } else { format!("{count} rounds") }
}

/// Writes the probability of each contender after each round, in %; a dash where it does not
/// contend.
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
    sheet.heading("Effects that still contend, and their probability, %");
    let head: Vec<String> =
        (1..=settled.rounds.len()).map(|number| format!("after round {number}")).collect();
    let head: Vec<&str> = std::iter::once("").chain(head.iter().map(String::as_str)).collect();
    let row = |name: &&str| {
        let after = |round: &Round| {
            let found = round.contenders.iter().find(|(other, _)| other == name);
            Cell::number(found.map(|(_, probability)| 100.0 * probability), 1)
        };
        let words = if *name == "none" { "no effect" } else { effect_in_words(name) };
        std::iter::once(Cell::text(words)).chain(settled.rounds.iter().map(after)).collect()
    };
    let rows: Vec<Vec<Cell>> = names.iter().map(row).collect();
    sheet.table(&head, &rows);
}
