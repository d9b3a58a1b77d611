//! Physics that has no name: what no law of the library makes is reported by its inputs, and what
//! has a name keeps it.

use crate::common::{Setup, record, rig};
use diagnosis::laws::{EffectName, Variable};
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use diagnosis::{Outcome, Verdict, diagnose_recordings};

fn diagnosed(effect: &'static str, closed: bool) -> Outcome {
    let setup = Setup { effect, size: 1.0, closed, rate: 1000.0, seconds: 12.0, disturbance: 0.05, seed: 5 };
    let fit = [record(&setup, 1), record(&setup, 3)];
    diagnose_recordings(&rig([0.0; 4], "offset = 0.0"), &fit, &[record(&setup, 2)], &|_, _| ())
        .expect("the recordings are right")
}

fn is_told_by(outcome: &Outcome, inputs: &str) {
    let report = &outcome.report;
    assert_eq!(report.verdict, Verdict::Unexplained, "{inputs}: {}", report.sentence);
    assert!(report.effects.is_empty());
    assert!(report.sentence.contains(inputs), "{inputs}: {}", report.sentence);
}

#[test]
fn a_sine_of_the_speed_is_no_friction_of_the_library() {
    is_told_by(&diagnosed("sine_of_speed", false), "speed");
}

#[test]
#[ignore = "nightly: 15 s"]
fn a_bump_of_travel_times_speed_is_no_damping_along_the_travel() {
    for closed in [false, true] {
        is_told_by(&diagnosed("bump_of_travel_times_speed", closed), "travel and speed");
    }
}

#[test]
fn under_feedback_no_form_takes_what_a_null_leaves() {
    let report = diagnosed("none", true).report;
    assert_eq!(report.verdict, Verdict::NoMismatch, "{}", report.sentence);
}

#[test]
fn the_free_form_force_runs_in_the_simulator_as_fitted() {
    let outcome = diagnosed("sine_of_speed", true);
    is_told_by(&outcome, "speed");
    let told = outcome.report.free_form.expect("the form is told");
    assert!(told.holdout_gain.is_some_and(|gain| gain > 0.0), "{told:?}");
    assert!(told.in_words.is_some_and(|words| words.contains("speed")));
    let fit = &outcome.report.fit;
    assert!(fit.patched.holdout < fit.refit.holdout, "{} of {}", fit.patched.holdout, fit.refit.holdout);
    // Written and read back, as host-sim does.
    let rig = Rig::parse(&outcome.patched_rig.to_toml(), "patched").expect("the patched rig is right");
    let [effect] = rig.effects.as_slice() else { panic!("the table alone") };
    assert_eq!(effect.name, EffectName::Table);
    let table = effect.table.as_ref().expect("it holds its table");
    assert_eq!(table.over, [Variable::Speed]);
    let bare = Rig { effects: Vec::new(), ..rig.clone() };
    let dt = 1e-6;
    let acceleration = |rig: &Rig, v: f64| {
        let mut plant = Plant::new(rig);
        plant.place(1.0, v);
        plant.step(0.0, Surroundings::default(), dt);
        (plant.velocity() - v) / dt
    };
    let largest = table.force.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    for (v, force) in table.grid[0].iter().zip(&table.force).filter(|(v, _)| v.abs() > 0.5) {
        let run = (acceleration(&rig, *v) - acceleration(&bare, *v)) * rig.model.inertia;
        let fitted = force * effect.coefficient("force");
        assert!((run - fitted).abs() < 1e-3 * largest, "{run:e} instead of {fitted:e} at {v} rad/s");
    }
}
