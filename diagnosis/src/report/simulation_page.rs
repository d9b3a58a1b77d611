//! The page of `simulate`: the sentence, simulated against recorded motion, force, and what to do
//! next.

use crate::report::motion_picture::{force, free_run, in_windows, scale, table, under_reference, words};
use crate::simulation::comparison::{Comparison, Simulated};
use html_report::{document, plot, safe};
use numerics::digits::short;
use std::fmt::Write as _;

/// The length of the windows by which models are compared in a sentence, s, where they were run:
/// short enough that errors of force do not add up, long enough that the sensor's noise does not
/// matter.
const JUDGING_S: f64 = 0.5;

/// Returns the position errors of the models as one sentence without its full stop: in windows, or
/// in the free run of a recording too short for any.
pub fn sentence(compared: &Comparison) -> String {
    let (factor, unit) = scale(compared);
    let windows = compared.models.first().map_or(&[][..], |m| &m.figures.windows);
    let judging = windows.iter().position(|w| w.seconds >= JUDGING_S);
    let off = |m: &Simulated| judging.map_or(m.figures.free_run, |k| m.figures.windows[k].off).position_rms;
    let parts: Vec<String> = compared
        .models
        .iter()
        .map(|m| {
            let off = format!("{} {unit}", short(factor * off(m)));
            match m.model.as_str() {
                "nominal" => format!("{off} with the simulation as it is"),
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
    let over = match judging {
        Some(k) => format!("In windows of {} s of {}", windows[k].seconds, compared.file),
        None => {
            format!(
                "Run over the {:.1} s of {} under its command alone",
                compared.motion.seconds(),
                compared.file
            )
        }
    };
    format!("{over}, the simulated position is off by {all} (root mean square)")
}

/// The page. `notes` are sentences without their full stop that a reader has to mind; `next` says
/// what to do, one item each, as plain text in which `backticks` mark commands.
pub fn page(title: &str, compared: &[Comparison], notes: &[String], next: &[String]) -> String {
    let mut out = String::with_capacity(400_000);
    let first = compared.first().map_or_else(|| "Nothing was simulated".to_owned(), sentence);
    let _ = write!(out, "<p class=rig>{}</p><h1>{}.</h1>", safe(title), safe(&first));
    for note in notes {
        let _ = write!(out, "<p class=next><b>Warning:</b> {}.</p>", safe(note));
    }
    for one in compared {
        let names: Vec<&str> = one.models.iter().map(|m| m.model.as_str()).collect();
        let _ = write!(out, "<section><h2>Simulated and recorded: {}</h2>", safe(&one.file));
        in_windows(&mut out, one, &names);
        table(&mut out, one);
        free_run(&mut out, one, &names);
        under_reference(&mut out, one, &names);
        force(&mut out, one, &names);
        out.push_str("</section>");
    }
    what_next(&mut out, next);
    whole(&format!("Simulated: {title}"), &out)
}

/// Returns a page in the style of the reports, with the values of its plots under the pointer.
pub(crate) fn whole(title: &str, body: &str) -> String {
    document(title, include_str!("report.css"), body, Some(plot::SCRIPT))
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
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::simulation::comparison::AFRESH_S;
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
    fn the_page_has_sentence_motion_force_and_advice_in_order() {
        let (truth, viscous) = (Rig::of_values(2e-3, 4e-3, 1e-2), Rig::of_values(2e-3, 4e-3, 0.0));
        let recording = recorded(&truth);
        let models = vec![("nominal".to_owned(), viscous), ("patched".to_owned(), truth)];
        let compared = Comparison::new(&recording, &models, &[0.1, 1.0]);
        let said = sentence(&compared);
        assert!(
            said.starts_with("In windows of 1 s of bench.csv, the simulated position is off by ")
                && said.contains(" with the simulation as it is and ")
                && said.ends_with(" with what was found (root mean square)"),
            "{said}"
        );
        let afresh = compared.models[0].afresh.as_ref().expect("10 s hold five starts");
        for (i, t) in compared.motion.time.iter().enumerate() {
            if (t / AFRESH_S).fract() < 1e-6 && i + 1 < afresh.len() {
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
            "<h1>In windows of 1 s",
            "<b>Warning:</b> a note.",
            "<h3>Position in windows of 0.5 s</h3>",
            "<h3>How far off it is</h3>",
            "position error, rms",
            "<details><summary>The free run of 10.0 s",
            "<h3>Position</h3>",
            "<h3>Speed</h3>",
            "<h3>Force along the recorded motion</h3>",
            "<h2>What to do next</h2>",
            "<code>host-sim x &lt;y&gt;</code>",
        ]
        .iter()
        .map(|part| page.find(part).unwrap_or_else(|| panic!("{part} is missing")))
        .collect();
        assert!(places.is_sorted(), "{places:?}");
        assert!(!page.contains("bench <1>"));
        // Every picture has a title on each axis and its ranges; every curve has a name.
        let count = |part: &str| page.matches(part).count();
        assert_eq!(
            (count("<svg "), count("<svg ") * 2),
            (count("data-x="), count("<p class=\"axis level\">") + count("<p class=axis>"))
        );
        assert_eq!(count("<path class=\"motion "), count("<path class=\"motion ").min(count("data-name=")));
    }
}
