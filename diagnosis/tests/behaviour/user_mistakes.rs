//! Mistakes that people make with units, signs, columns and files: each gets the sentence that
//! helps, and none a name.

use diagnosis::laws::EffectName;
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use diagnosis::{Outcome, Request, Verdict, diagnose, diagnose_recordings};
use std::path::PathBuf;

const RIG: &str = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 2.0e-3\nviscous = 2.0e-3\ncoulomb = 0.02\n[actuator]\n\
                   gain = 1.0\ncommand_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 636.62\n";

fn rig() -> Rig {
    Rig::parse(RIG, "rig.toml").expect("the rig is right")
}

/// Eight seconds of the rig under a command of two sines, at a thousand rows a second.
fn recorded(file: &str, phase: f64) -> Recording {
    let mut plant = Plant::new(&rig());
    let mut out = Recording { file: file.into(), ..Recording::default() };
    for row in 0..8000 {
        let t = f64::from(row) * 1e-3;
        let command = 0.15 * (5.0 * t + phase).sin() + 0.1 * (17.0 * t).sin();
        out.time_s.push(t);
        out.command.push(command);
        out.position_counts.push(plant.counts());
        for _ in 0..10 {
            plant.step(command, Surroundings::default(), 1e-4);
        }
    }
    out
}

fn both(spoil: impl Fn(&mut Recording)) -> (Recording, Recording) {
    let (mut fit, mut holdout) = (recorded("fit.csv", 0.0), recorded("holdout.csv", 1.0));
    spoil(&mut fit);
    spoil(&mut holdout);
    (fit, holdout)
}

fn said(rig: &Rig, spoil: impl Fn(&mut Recording)) -> Outcome {
    let (fit, holdout) = both(spoil);
    diagnose_recordings(rig, &[fit], &[holdout], &|_, _| ()).expect("they can be read")
}

/// That a mistake is an error whose sentence has `hint`.
fn helps(what: &str, rig: &Rig, spoil: impl Fn(&mut Recording), hint: &str) {
    let (fit, holdout) = both(spoil);
    let error = diagnose_recordings(rig, &[fit], &[holdout], &|_, _| ()).expect_err(what).to_string();
    assert!(error.contains(hint), "{what} should say \"{hint}\": {error}");
    assert!(!error.contains("could still be used"), "{what}: both are wrong: {error}");
}

#[test]
fn the_recordings_that_could_still_be_used_are_said() {
    let all = [recorded("fit.csv", 0.0), recorded("fit2.csv", 0.5), recorded("holdout.csv", 1.0)];
    let error = |spoiled: usize, spoil: &dyn Fn(&mut Recording)| {
        let mut all = all.clone();
        spoil(&mut all[spoiled]);
        let [fit, more, holdout] = all;
        diagnose_recordings(&rig(), &[fit, more], &[holdout], &|_, _| ())
            .expect_err("it is refused")
            .to_string()
    };
    let turned = error(1, &|r| r.position_counts.iter_mut().for_each(|q| *q = -*q));
    assert!(turned.starts_with("the axis of fit2.csv moves against its command"), "{turned}");
    assert!(turned.ends_with("; fit.csv and holdout.csv could still be used"), "{turned}");
    let tenfold = error(1, &|r| r.command.iter_mut().for_each(|u| *u *= 10.0));
    assert!(tenfold.starts_with("the force of fit2.csv for its motion is 10 times as large"), "{tenfold}");
    assert!(tenfold.ends_with("; fit.csv and holdout.csv could still be used"), "{tenfold}");
    let at_rest = error(2, &|r| r.position_counts.fill(17.0));
    assert!(at_rest.starts_with("holdout.csv is at rest"), "{at_rest}");
    assert!(at_rest.ends_with("; fit.csv and fit2.csv could still be used"), "{at_rest}");
}

#[test]
fn a_constant_command_in_one_recording_leaves_the_others_usable() {
    let mut all = [recorded("fit.csv", 0.0), recorded("fit2.csv", 0.5), recorded("holdout.csv", 1.0)];
    all[1].command.fill(0.1);
    let [fit, more, holdout] = all;
    let outcome = diagnose_recordings(&rig(), &[fit, more], &[holdout], &|_, _| ()).expect("it is told");
    assert_eq!(outcome.report.verdict, Verdict::InsufficientExcitation);
    let sentence = &outcome.report.sentence;
    assert!(
        sentence.contains(
            "fit2.csv is constant; record one that changes; fit.csv and holdout.csv could still be used"
        ),
        "{sentence}"
    );
}

#[test]
fn every_effect_of_the_library_is_tested_or_said_not_to_be() {
    let report = said(&rig(), |_| ()).report;
    for name in EffectName::ALL.iter().filter(|name| **name != EffectName::Table) {
        let is_of_rig = matches!(name, EffectName::ViscousFriction | EffectName::CoulombFriction);
        let is_named = report.effects.iter().any(|one| one.class.contains(name));
        let is_tested = report.hypotheses.iter().any(|one| one.name == *name);
        let is_untested = report.untested.iter().any(|one| one.name == *name);
        assert_eq!(
            u8::from(is_of_rig) + u8::from(is_named || is_tested) + u8::from(is_untested),
            1,
            "{name} is in one list: {}",
            report.sentence
        );
    }
}

#[test]
fn a_verdict_without_a_fit_has_no_force_error() {
    let what = "a constant command";
    let outcome = said(&rig(), |r| r.command.fill(0.1));
    let report = &outcome.report;
    assert_eq!(report.verdict, Verdict::InsufficientExcitation, "{what}: {}", report.sentence);
    assert!(report.sentence.contains("is constant"), "{}", report.sentence);
    assert!(report.effects.is_empty(), "{what}");
    let json = serde_json::to_value(report).expect("it can be written");
    for model in ["nominal", "refit", "patched"] {
        for of in ["fit", "holdout"] {
            assert!(
                json["fit"][model][of].is_null(),
                "{what}: {model} {of} is a number that nobody measured"
            );
        }
    }
    assert!(!outcome.summary().contains("force error"), "{what}: {}", outcome.summary());
    let again: diagnosis::Report = serde_json::from_value(json).expect("what was written can be read");
    assert!(again.fit.nominal.fit.is_nan());
}

#[test]
fn a_recording_without_a_mistake_is_diagnosed() {
    let outcome = said(&rig(), |_| ());
    assert_eq!(outcome.report.verdict, Verdict::NoMismatch, "{}", outcome.summary());
    let simulation = outcome.report.simulation.expect("the models are run forward");
    let free = simulation.free_run.nominal.expect("the nominal too");
    // It starts from a speed that is known from counts of 1.6 mrad.
    assert!(free < 0.2, "the true model follows the motion: {free} rad");
}

#[test]
fn wrong_units_signs_and_columns_get_a_sentence_that_helps() {
    let counts = 636.62;
    helps(
        "radians as counts",
        &rig(),
        |r| r.position_counts.iter_mut().for_each(|q| *q = (*q + 0.3) / counts),
        "they seem to be in radians, degrees or metres; multiply them by counts_per_unit",
    );
    helps(
        "degrees as counts",
        &rig(),
        |r| r.position_counts.iter_mut().for_each(|q| *q = ((*q + 0.3) / counts).to_degrees()),
        "they seem to be in radians, degrees or metres",
    );
    helps(
        "millinewtonmetres",
        &rig(),
        |r| r.command.iter_mut().for_each(|u| *u *= 1000.0),
        "command or gain is in thousandths, as mN·m for N·m; correct actuator.gain",
    );
    helps(
        "newtonmetres for milli",
        &rig(),
        |r| r.command.iter_mut().for_each(|u| *u *= 1e-3),
        "times too small for its motion with the rig's inertia",
    );
    helps(
        "milliseconds",
        &rig(),
        |r| r.time_s.iter_mut().for_each(|t| *t *= 1000.0),
        "are its times in milliseconds?",
    );
    helps(
        "a wrapped angle",
        &rig(),
        |r| r.position_counts.iter_mut().for_each(|q| *q = (3.0 * *q).rem_euclid(4000.0)),
        "they wrap; make them continuous, as host-sim import does",
    );
    helps(
        "swapped",
        &rig(),
        |r| std::mem::swap(&mut r.command, &mut r.position_counts),
        "the two columns seem swapped; swap their names in the header",
    );
    helps(
        "a turned sign",
        &rig(),
        |r| r.position_counts.iter_mut().for_each(|q| *q = -*q),
        "a sign is wrong; change the sign of actuator.gain",
    );
    helps("at rest", &rig(), |r| r.position_counts.fill(17.0), "is at rest");
}

fn folder(name: &str) -> PathBuf {
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&dir).expect("the target folder can be written");
    dir
}

fn csv(recording: &Recording) -> String {
    let mut out = String::from("time_s,command,position_counts\n");
    for i in 0..recording.len() {
        out += &format!(
            "{:.4},{:.9},{}\n",
            recording.time_s[i], recording.command[i], recording.position_counts[i]
        );
    }
    out
}

/// Rig, fitted and held-out file, and the sentence that refuses them.
const MISTAKES: [(&str, &str, &str, &str); 10] = [
    ("rig.toml", "fit.csv", "fit.csv", "is given to fit and, as fit.csv, to hold out"),
    (
        "rig.toml",
        "fit.csv",
        "copy.csv",
        "fit.csv is given to fit and, as copy.csv, to hold out: it would judge what it was fitted to",
    ),
    (
        "rig.toml",
        "semicolons.csv",
        "holdout.csv",
        "semicolons.csv, line 1: fields are separated by semicolons; let host-sim import read the file",
    ),
    ("rig.toml", "tabs.csv", "holdout.csv", "tabs.csv, line 1: fields are separated by tabs"),
    (
        "rig.toml",
        "commented.csv",
        "holdout.csv",
        "commented.csv, line 1: a comment line where the header belongs",
    ),
    ("rig.toml", "remark.csv", "holdout.csv", "remark.csv, line 5: a comment line; take it out"),
    (
        "misspelt.toml",
        "fit.csv",
        "holdout.csv",
        "[model] viscuos is not a key of a rig file; do you mean [model] viscous",
    ),
    (
        "misplaced.toml",
        "fit.csv",
        "holdout.csv",
        "[encoder] limit is not a key of a rig file; it belongs in [actuator], as limit",
    ),
    (
        "weight.toml",
        "fit.csv",
        "holdout.csv",
        "model.weight acts through the tilt and fit.csv has no column tilt_rad",
    ),
    ("unfilled.toml", "fit.csv", "holdout.csv", "model.inertia is not filled in"),
];

#[test]
fn wrong_files_and_keys_are_refused_with_their_place() {
    let dir = folder("mistakes");
    let path = |name: &str| dir.join(name);
    let write = |name: &str, text: &str| std::fs::write(path(name), text).expect("written");
    let (fit, holdout) = both(|_| ());
    write("rig.toml", RIG);
    write("fit.csv", &csv(&fit));
    write("copy.csv", &csv(&fit));
    write("holdout.csv", &csv(&holdout));
    write("semicolons.csv", &csv(&fit).replace(',', ";"));
    write("tabs.csv", &csv(&fit).replace(',', "\t"));
    write("commented.csv", &format!("# bench 3\n{}", csv(&fit)));
    write("remark.csv", &csv(&fit).replacen("\n0.0030", "\n# a remark\n0.0030", 1));
    write("misspelt.toml", &RIG.replace("viscous", "viscuos"));
    write("misplaced.toml", &format!("{RIG}limit = 1.0\n"));
    write("weight.toml", &RIG.replace("coulomb = 0.02", "coulomb = 0.02\nweight = 0.1"));
    write("unfilled.toml", &RIG.replace("inertia = 2.0e-3", "inertia = nan"));
    for (rig, fit, holdout, sentence) in MISTAKES {
        let request =
            Request { rig: path(rig), fit: vec![path(fit)], holdout: vec![path(holdout)], effects: None };
        let error = diagnose(&request, &|_, _| ()).expect_err(sentence).to_string();
        assert!(error.contains(sentence), "should say \"{sentence}\": {error}");
        assert!(!error.contains('\n'), "{error}");
    }
}
