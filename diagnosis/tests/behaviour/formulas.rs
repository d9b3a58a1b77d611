//! An effect of a user's own: hidden in a simulated machine by its formula, searched for with its
//! values unknown, named, patched and simulated.

use crate::common::Random;
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use diagnosis::{Request, Verdict, diagnose};
use std::path::{Path, PathBuf};

const RIG: &str = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 2.0e-3\nviscous = 2.0e-3\ncoulomb = 0.02\n[actuator]\n\
                   gain = 1.0\ncommand_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 6366.2\n";
/// A drive whose force droops with speed: what no built-in effect says.
const FORMULA: &str = "-a*u*(v/b)^2/(1 + (v/b)^2)";

fn recorded(rig: &Rig, seed: u64) -> String {
    let mut plant = Plant::new(rig);
    let mut random = Random::new(seed);
    let tones: Vec<(f64, f64)> =
        (0..9).map(|k| (0.9 * 1.7_f64.powi(k), random.between(0.0, std::f64::consts::TAU))).collect();
    let mut out = String::from("time_s,command,position_counts\n");
    for row in 0..16_000 {
        let t = f64::from(row) * 1e-3;
        let command = 0.025 * tones.iter().map(|(w, p)| (w * t + p).sin()).sum::<f64>()
            + 0.06 * (0.35 * t + tones[0].1).sin().signum();
        out += &format!("{t:.3},{command:.9},{}\n", plant.counts());
        // A disturbance that nobody recorded.
        let external = 2e-4 * random.normal();
        for _ in 0..10 {
            plant.step(command, Surroundings { external, ..Surroundings::default() }, 1e-4);
        }
    }
    out
}

fn folder(name: &str) -> PathBuf {
    let dir = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    std::fs::create_dir_all(&dir).expect("the target folder can be written");
    dir
}

#[test]
fn a_hidden_formula_is_found_by_its_name_and_simulated() {
    let dir = folder("formulas");
    let write = |name: &str, text: &str| std::fs::write(dir.join(name), text).expect("written");
    let hidden = format!(
        "{RIG}[[effect]]\nname = \"formula\"\ntitle = \"droop\"\nformula = \"{FORMULA}\"\nshape = {{ b = 9.0 }}\ncoefficients = {{ a = 0.6 }}\n"
    );
    let truth = Rig::parse(&hidden, "hidden.toml").expect("a rig may hold a formula");
    write("rig.toml", RIG);
    write("fit.csv", &recorded(&truth, 1));
    write("holdout.csv", &recorded(&truth, 2));
    write(
        "own.toml",
        &format!(
            "[[effect]]\nname = \"droop\"\nwords = \"the drive's force droops with speed\"\nformula = \"{FORMULA}\"\n\
             parameters = {{ a = [0.0, 2.0], b = [1.0, 100.0] }}\n"
        ),
    );
    let request = Request {
        rig: dir.join("rig.toml"),
        fit: vec![dir.join("fit.csv")],
        holdout: vec![dir.join("holdout.csv")],
        effects: Some(dir.join("own.toml")),
    };
    let outcome = diagnose(&request, &|_, _| ()).expect("it is usable");
    println!("{}", outcome.summary());
    let report = &outcome.report;
    assert_eq!(report.verdict, Verdict::MissingPhysics, "{}", report.sentence);
    assert_eq!(report.effects[0].name.as_str(), "droop", "{}", outcome.summary());
    assert!(report.sentence.contains("the drive's force droops with speed"), "{}", report.sentence);
    let value = |name: &str| report.effects[0].parameters[name].value;
    assert!(
        (value("a") - 0.6).abs() < 0.1 && (value("b") - 9.0).abs() < 2.0,
        "a {}, b {}",
        value("a"),
        value("b")
    );
    // The patched rig holds it, can be read again, and follows the motion better than the refitted
    // one.
    let text = outcome.patched_rig.to_toml();
    assert!(text.contains("name = \"formula\"") && text.contains("title = \"droop\""), "{text}");
    let again = Rig::parse(&text, "patched-rig.toml").expect("the patched rig is a rig");
    assert_eq!(again.effects, outcome.patched_rig.effects);
    let simulation = report.simulation.as_ref().expect("the models are run forward");
    let half = simulation.windows.iter().find(|w| w.seconds == 0.5).expect("windows of half a second");
    let (refit, patched) = (half.position.refit.expect("refit"), half.position.patched.expect("patched"));
    assert!(patched < 0.5 * refit, "windows: refit {refit}, patched {patched} rad");
    let json = serde_json::to_value(report).expect("it can be written");
    assert_eq!(json["effects"][0]["name"], "droop");
}

#[test]
fn a_formula_without_its_column_is_refused_with_its_place() {
    let dir = folder("formulas-refused");
    let write = |name: &str, text: &str| std::fs::write(dir.join(name), text).expect("written");
    let rig = Rig::parse(RIG, "rig.toml").expect("the rig is right");
    write("rig.toml", RIG);
    write("fit.csv", &recorded(&rig, 1));
    write("holdout.csv", &recorded(&rig, 2));
    write(
        "own.toml",
        "[[effect]]\nname = \"hang\"\nformula = \"w*sin(tilt)^3\"\nparameters = { w = [0.0, 2.0] }\n",
    );
    let request = Request {
        rig: dir.join("rig.toml"),
        fit: vec![dir.join("fit.csv")],
        holdout: vec![dir.join("holdout.csv")],
        effects: Some(dir.join("own.toml")),
    };
    let said = diagnose(&request, &|_, _| ()).expect_err("there is no tilt").to_string();
    assert!(
        said.contains(
            "effect hang: formula \"w*sin(tilt)^3\" needs the tilt and fit.csv has no column tilt_rad"
        ),
        "{said}"
    );
}
