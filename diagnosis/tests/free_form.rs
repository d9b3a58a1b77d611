//! Physics that has no name: what no law of the library makes is told by its inputs, and what has a name keeps it.

mod common;

use common::{Setup, record, rig};
use diagnosis::{Outcome, Verdict, diagnose_recordings};

fn diagnosed(effect: &'static str, closed: bool) -> Outcome {
    let setup = Setup { effect, size: 1.0, closed, rate: 1000.0, seconds: 12.0, disturbance: 0.05, seed: 5 };
    let fit = [record(&setup, 1), record(&setup, 3)];
    diagnose_recordings(&rig([0.0; 4], "offset = 0.0"), &fit, &[record(&setup, 2)], &|_, _| ())
        .expect("the recordings are right")
}

fn is_told_by(effect: &'static str, inputs: &str) {
    for closed in [false, true] {
        let report = diagnosed(effect, closed).report;
        assert_eq!(report.verdict, Verdict::Unexplained, "{effect}: {}", report.sentence);
        assert!(report.effects.is_empty());
        assert!(report.sentence.contains(inputs), "{effect}: {}", report.sentence);
    }
}

#[test]
fn a_sine_of_the_speed_is_no_friction_of_the_library() {
    is_told_by("sine_of_speed", "speed");
}

#[test]
fn a_bump_of_travel_times_speed_is_no_damping_along_the_travel() {
    is_told_by("bump_of_travel_times_speed", "travel and speed");
}

#[test]
fn under_feedback_no_form_takes_what_a_null_leaves() {
    let report = diagnosed("none", true).report;
    assert_eq!(report.verdict, Verdict::NoMismatch, "{}", report.sentence);
}
