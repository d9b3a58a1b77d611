//! A cannulation as it is taught passes, and each wrong one fails for its own reason and no other:
//! in the score, the debrief and the xAPI statements alike. The scripts were written before the
//! code that judges them.

use crate::common::{folder, run_well, text};
use control_core::TICK_HZ;
use link::frames::EventKind;
use recording::read::Recording;
use recording::stretches::{Stretch, stretches};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Each script, and the only reason why it fails; none for the right one.
const SCRIPTS: [(&str, Option<&str>); 11] = [
    ("right", None),
    ("far-wall", Some("far_wall")),
    ("catheter-early", Some("catheter_early")),
    ("lowered-early", Some("lowered_early")),
    ("not-lowered", Some("not_lowered")),
    ("steep", Some("angle")),
    ("tourniquet-left-on", Some("tourniquet_left_on")),
    ("withdrawn-early", Some("withdrawn_early")),
    ("artery", Some("artery")),
    ("nerve", Some("nerve")),
    ("second-puncture", Some("second_puncture")),
];

/// Keys and words of the reasons in a verdict.
fn reasons(verdict: &Value) -> Vec<(String, String)> {
    let list = verdict["reasons"].as_array().unwrap_or_else(|| panic!("no reasons in {verdict}"));
    let word = |reason: &Value, key: &str| reason[key].as_str().expect("a text").to_owned();
    list.iter().map(|reason| (word(reason, "key"), word(reason, "words"))).collect()
}

/// Records a script on a patient once; the file, in a folder of its own.
fn recorded(patient: &str, script: &str, test: &str) -> PathBuf {
    let recorded = folder(&format!("{test}-{patient}-{script}")).join("a.mcap");
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("procedures/cannulation/{script}.toml"));
    let steps: toml::Table = std::fs::read_to_string(&file).expect("a script").parse().expect("TOML");
    let slowest_mm_s = 5.0;
    let seconds: f64 = steps["step"]
        .as_array()
        .expect("steps")
        .iter()
        .map(|step| step.get("seconds").and_then(toml::Value::as_float).unwrap_or(slowest_mm_s))
        .sum();
    run_well(&[
        "run",
        "--headless",
        "--fast",
        "--profile",
        patient,
        "--procedure",
        text(&file),
        "--seconds",
        &seconds.to_string(),
        "--record",
        text(&recorded),
    ]);
    recorded
}

/// Runs a script on a patient and judges the one attempt in it everywhere.
fn judged(patient: &str, script: &str, wanted: Option<&str>) {
    let recorded = recorded(patient, script, "cannulation");
    let name = format!("{script} on {patient}");
    let score: Value = serde_json::from_str(&run_well(&["score", text(&recorded), "--json"])).expect("JSON");
    let [one] = &score["insertions"].as_array().expect("insertions")[..] else {
        panic!("{name}: not one attempt: {score}")
    };
    let verdict = &one["verdict"];
    let found = reasons(verdict);
    let keys: Vec<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
    assert_eq!(keys, wanted.into_iter().collect::<Vec<_>>(), "{name}: {verdict}");
    // What would harm a patient is a critical error: blood from an artery is.
    let harms = ["far_wall", "catheter_early", "tourniquet_left_on", "withdrawn_early", "artery", "nerve"];
    for reason in verdict["reasons"].as_array().expect("a list") {
        let key = reason["key"].as_str().expect("a key");
        assert_eq!(reason["critical"], Value::Bool(harms.contains(&key)), "{name}: {verdict}");
    }
    assert_eq!(verdict["passed"], Value::Bool(wanted.is_none()), "{name}: {verdict}");
    let steps = verdict["steps"].as_array().expect("steps");
    assert_eq!(steps.len(), 10, "{name}: {verdict}");
    if wanted.is_none() {
        assert!(steps.iter().all(|step| step["state"] == "done"), "{name}: {verdict}");
    }

    let out = recorded.with_file_name("debrief");
    run_well(&["debrief", text(&recorded), "--out", text(&out)]);
    let page = std::fs::read_to_string(out.join("debrief.html")).expect("written");
    let said = found.first().map_or("Passed.".to_owned(), |(_, words)| format!("Not passed: {words}."));
    assert!(page.contains(&said), "{name}: the debrief does not say {said}");

    let xapi = run_well(&["score", text(&recorded), "--xapi", "--actor", "trainee@example.org"]);
    let statements: Value = serde_json::from_str(&xapi).expect("JSON");
    let [statement] = &statements.as_array().expect("an array")[..] else { panic!("{name}: {statements}") };
    let result = &statement["result"];
    assert_eq!(result["success"], Value::Bool(wanted.is_none()), "{name}: {result}");
    assert_eq!(result["extensions"]["urn:needle-insertion:figure:verdict"], *verdict, "{name}");
}

#[test]
fn each_wrong_cannulation_fails_for_its_own_reason() {
    for (script, wanted) in SCRIPTS {
        judged("forearm", script, wanted);
    }
}

#[test]
fn patients_of_level_layers_are_judged_alike() {
    for patient in ["firm-skin", "thin-elderly", "child"] {
        judged(patient, "right", None);
    }
    for (script, wanted) in SCRIPTS.into_iter().filter(|(script, _)| !["artery", "nerve"].contains(script)) {
        judged("adult", script, wanted);
    }
}

/// The tick at which a task was done.
fn done(stretch: &Stretch, task: &str) -> u64 {
    stretch.tasks.iter().find(|done| done.name == task).map(|done| done.tick).expect("it is in the script")
}

/// From the flashback to the catheter the needle is lowered and advanced in the vein: the device
/// reports nothing, and a needle that does not move feels no step.
#[test]
fn a_needle_that_is_lowered_stays_in_the_vein() {
    for patient in ["adult", "forearm", "firm-skin", "thin-elderly"] {
        let recorded = recorded(patient, "right", "lowered");
        let [stretch] = &stretches(&Recording::read(&recorded).expect("it was recorded"))[..] else {
            panic!("{patient}: a gap")
        };
        let kinds = stretch.events.iter();
        let flashback = kinds.clone().find(|event| matches!(event.kind, EventKind::Flashback { .. }));
        let (from, to) = (flashback.expect("blood shows").tick, done(stretch, "catheter"));
        let within = kinds.filter(|event| (from + 1..to).contains(&event.tick));
        let told: Vec<&EventKind> = within.map(|event| &event.kind).collect();
        assert!(told.is_empty(), "{patient}: after the flashback the device reports {told:?}");
        // The wall that has given way is gone after 50 ms.
        let begin = (from - stretch.first_tick) as usize + TICK_HZ as usize / 20;
        let samples = &stretch.samples[begin..(to - stretch.first_tick) as usize];
        let force = |at: usize| stretch.hello.force_n(samples[at].dac);
        let at_rest = (1..samples.len()).filter(|at| samples[*at].count == samples[at - 1].count);
        let step = at_rest.map(|at| (force(at) - force(at - 1)).abs()).fold(0.0, f64::max);
        assert!(step <= 0.010, "{patient}: a step of {step:.4} N");
    }
}
