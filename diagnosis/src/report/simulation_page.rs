//! The page of `simulate`: the sentence, simulated against recorded motion, force, and what to do next.

use crate::numerics::digits::short;
use crate::report::axes::safe;
use crate::report::motion_picture::{force, motions, scale, table, under_reference, words};
use crate::simulation::comparison::Comparison;
use std::fmt::Write as _;

const STYLE: &str = include_str!("report.css");

/// Returns the position errors of the models in a free run as one sentence without its full stop.
pub fn sentence(compared: &Comparison) -> String {
    let (factor, unit) = scale(compared);
    let parts: Vec<String> = compared
        .models
        .iter()
        .map(|m| {
            let off = format!("{} {unit}", short(factor * m.figures.free_run.position_rms));
            match m.model.as_str() {
                "nominal" => format!("{off} as the simulation stands"),
                other => format!("{off} {}", words(other)),
            }
        })
        .collect();
    let all = match parts.split_last() {
        Some((last, [_, ..])) => {
            format!("{} and {last}", parts[..parts.len() - 1].join(", "))
        }
        _ => parts.concat(),
    };
    format!(
        "Run over the {:.1} s of {} under its command alone, the simulated position is off by {all} (root mean square)",
        compared.motion.seconds(),
        compared.file
    )
}

/// The page. `notes` are sentences without their full stop that a reader has to mind; `next` says what to do, one item each, as
/// plain text in which `backticks` mark commands.
pub fn page(title: &str, compared: &[Comparison], notes: &[String], next: &[String]) -> String {
    let mut out = String::with_capacity(400_000);
    let first = compared.first().map_or_else(|| "Nothing was simulated".to_owned(), sentence);
    let _ = write!(
        out,
        "<!doctype html><html lang=en><head><meta charset=utf-8><meta name=viewport content=\"width=device-width,initial-scale=1\">\
         <title>Simulated: {0}</title><style>{STYLE}</style></head><body><main><p class=rig>{0}</p><h1>{1}.</h1>",
        safe(title),
        safe(&first)
    );
    for note in notes {
        let _ = write!(out, "<p class=next><b>Warning:</b> {}.</p>", safe(note));
    }
    for one in compared {
        let names: Vec<&str> = one.models.iter().map(|m| m.model.as_str()).collect();
        let _ = write!(out, "<section><h2>Simulated beside recorded: {}</h2>", safe(&one.file));
        motions(&mut out, one, &names);
        table(&mut out, one);
        under_reference(&mut out, one, &names);
        force(&mut out, one, &names);
        out.push_str("</section>");
    }
    what_next(&mut out, next);
    out.push_str("</main></body></html>\n");
    out
}

/// The last part of a page: what to do next. Text between `backticks` is a command.
pub(crate) fn what_next(out: &mut String, items: &[String]) {
    if items.is_empty() {
        return;
    }
    out.push_str("<section><h2>What to do next</h2><ul>");
    for item in items {
        out.push_str("<li>");
        for (k, part) in item.split('`').enumerate() {
            let part = safe(part);
            let _ = if k % 2 == 1 { write!(out, "<code>{part}</code>") } else { write!(out, "{part}") };
        }
        out.push_str("</li>");
    }
    out.push_str("</ul></section>");
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::recording::Recording;
    use crate::io::rig::Rig;
    use crate::simulation::{Plant, Surroundings};

    /// A recording of 10 s of a machine with dry friction.
    fn recorded(truth: &Rig) -> Recording {
        let mut plant = Plant::new(truth);
        let mut csv = String::from("time_s,command,position_counts\n");
        for row in 0..2000 {
            let t = f64::from(row) * 5e-3;
            let command = 0.05 * (2.0 * t).sin() + 0.03 * (7.0 * t).sin();
            csv += &format!("{t:.4},{command:.6},{}\n", plant.counts());
            for _ in 0..50 {
                plant.step(command, Surroundings::default(), 1e-4);
            }
        }
        Recording::parse(&csv, "bench.csv").expect("it keeps the contract")
    }

    #[test]
    fn the_page_opens_with_the_sentence_then_motion_then_force_then_what_to_do() {
        let (truth, viscous) = (Rig::of_values(2e-3, 4e-3, 1e-2), Rig::of_values(2e-3, 4e-3, 0.0));
        let recording = recorded(&truth);
        let models = vec![("nominal".to_owned(), viscous), ("patched".to_owned(), truth)];
        let compared = Comparison::new(&recording, &models, &[0.1, 1.0]);
        let said = sentence(&compared);
        assert!(
            said.starts_with(
                "Run over the 10.0 s of bench.csv under its command alone, the simulated position is off by "
            ) && said.contains(" as the simulation stands and ")
                && said.ends_with(" with what was found (root mean square)"),
            "{said}"
        );
        let afresh = compared.models[0].afresh.as_ref().expect("10 s hold five starts");
        for (i, t) in compared.motion.time.iter().enumerate() {
            if (t / 2.0).fract() < 1e-6 && i + 1 < afresh.len() {
                assert!((afresh[i] - compared.motion.position[i]).abs() < 1e-9, "a start at {t} s");
            }
        }
        let page = page(
            "bench <1>",
            std::slice::from_ref(&compared),
            &["a note".into()],
            &["Run `host-sim x <y>`.".into()],
        );
        let places: Vec<usize> = [
            "<h1>Run over the",
            "<b>Warning:</b> a note.",
            "<h3>Position</h3>",
            "<h3>Position, started from the measured state every 2 s</h3>",
            "<h3>Speed</h3>",
            "position off, rms",
            "<h3>Force along the recorded motion</h3>",
            "<h2>What to do next</h2>",
            "<code>host-sim x &lt;y&gt;</code>",
        ]
        .iter()
        .map(|part| page.find(part).unwrap_or_else(|| panic!("{part} is missing")))
        .collect();
        assert!(places.is_sorted(), "{places:?}");
        assert!(page.contains("position, rad · time, s") && !page.contains("bench <1>"));
    }
}
