//! A cannulation as it is taught passes, and each wrong one fails for its own reason and no other:
//! in the score, the debrief and the xAPI statements alike. The scripts were written before the
//! code that judges them.

use crate::common::{folder, run_well, text};
use serde_json::Value;
use std::path::Path;

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

/// Runs a script on a patient and judges the one attempt in it everywhere.
fn judged(patient: &str, script: &str, wanted: Option<&str>) {
    let dir = folder(&format!("cannulation-{patient}-{script}"));
    let recorded = dir.join("a.mcap");
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
    let name = format!("{script} on {patient}");
    let score: Value = serde_json::from_str(&run_well(&["score", text(&recorded), "--json"])).expect("JSON");
    let [one] = &score["insertions"].as_array().expect("insertions")[..] else {
        panic!("{name}: not one attempt: {score}")
    };
    let verdict = &one["verdict"];
    let found = reasons(verdict);
    let keys: Vec<&str> = found.iter().map(|(key, _)| key.as_str()).collect();
    assert_eq!(keys, wanted.into_iter().collect::<Vec<_>>(), "{name}: {verdict}");
    assert_eq!(verdict["passed"], Value::Bool(wanted.is_none()), "{name}: {verdict}");
    let steps = verdict["steps"].as_array().expect("steps");
    assert_eq!(steps.len(), 10, "{name}: {verdict}");
    if wanted.is_none() {
        assert!(steps.iter().all(|step| step["state"] == "done"), "{name}: {verdict}");
    }

    let out = dir.join("debrief");
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
    for patient in ["adult", "firm-skin", "thin-elderly"] {
        judged(patient, "right", None);
    }
    for (script, wanted) in SCRIPTS.into_iter().filter(|(script, _)| !["artery", "nerve"].contains(script)) {
        judged("adult", script, wanted);
    }
}
