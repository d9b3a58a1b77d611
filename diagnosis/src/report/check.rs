//! A check of recordings in sentences.

use super::{faults, next_experiment, text};
use crate::evidence::check::Check;
use numerics::digits::in_sentence;

/// The sentences, one a line, the recordings first and what to record last.
pub(crate) fn sentences(check: &Check) -> Vec<String> {
    let mut out: Vec<String> = check
        .recordings
        .iter()
        .map(|one| {
            let limit = if one.at_limit > 0.02 {
                format!(", the command at its largest in {:.0} % of the rows", 100.0 * one.at_limit)
            } else {
                String::new()
            };
            format!(
                "{}: {} s at {} rows a second, {} counts of travel{limit}",
                one.file,
                in_sentence(one.seconds),
                in_sentence(one.rate_hz.round()),
                in_sentence(one.counts.round())
            )
        })
        .collect();
    out.extend(
        faults::clauses(&check.faults).into_iter().map(|clause| format!("fault of the data: {clause}")),
    );
    out.push(format!(
        "seen below {} Hz: the simulation with refitted values leaves {:.1} % of the force, reading whole counts {:.1} %",
        in_sentence(check.band_hz),
        100.0 * check.left,
        100.0 * check.noise
    ));
    if let Some(rows) = check.late_rows {
        out.push(format!("commands act {} rows after their time stamps", in_sentence(rows)));
    }
    if check.is_inertia_hidden {
        out.push(
            "the motion shows no inertia: the rig's is kept, and an effect that needs it cannot show".into(),
        );
    }
    for (a, b, correlation) in &check.alike {
        out.push(format!("{a} and {b} cannot be distinguished (correlation {correlation:.2})"));
    }
    if check.excitation.is_one_speed() {
        out.push("all motion is at about one speed: nothing that depends on speed can be named".into());
    }
    for [a, b] in &check.twins {
        let (a, b) = (a.in_words(), b.in_words());
        out.push(format!("{a} and {b} cannot be distinguished in such motion"));
    }
    let unit = check.kind.length();
    for (name, why) in &check.untested {
        out.push(format!("cannot show {}: {}", name.in_words(), text::not_tested(why, unit)));
    }
    out.extend(check.advice().map(|advice| format!("record next: {advice}")));
    out
}

impl Check {
    /// The recording that would show what these cannot; none where they show all that a motion can.
    fn advice(&self) -> Option<String> {
        let separating = || self.twins.iter().find_map(|pair| next_experiment::separating(pair));
        if self.excitation.is_one_speed() {
            Some(next_experiment::SPEEDS.to_owned())
        } else if self.noise > 0.5 * self.left.max(0.05) {
            Some(next_experiment::LOUDER.to_owned())
        } else {
            separating()
        }
    }
}
