//! `simulate` as a person meets it: what it says first, what a fit by motion brings and costs, the
//! files.

use crate::common::{folder, refused, run, run_well, text};
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};

const RIG: &str = "format = 1\nname = \"a joint\"\nkind = \"rotary\"\n[model]\ninertia = 0.17\nviscous = 0.2\ncoulomb = 0.1\n[actuator]\n\
                   gain = 1.0\ncommand_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 1e5\n";

/// Six seconds of a joint under two sines, at 250 rows a second.
fn recorded(rig: &Rig, phase: f64) -> String {
    let mut plant = Plant::new(rig);
    let mut out = String::from("time_s,command,position_counts\n");
    for row in 0..1500 {
        let t = f64::from(row) * 4e-3;
        let torque = 1.2 * (1.7 * t + phase).sin() + 0.7 * (5.1 * t).sin();
        out += &format!("{t:.4},{torque:.6},{}\n", plant.counts());
        for _ in 0..40 {
            plant.step(torque, Surroundings::default(), 1e-4);
        }
    }
    out
}

#[test]
fn the_sentence_comes_first_and_a_fit_by_motion_says_what_it_is() {
    let dir = folder("simulate");
    let truth =
        Rig::parse(&RIG.replace("coulomb = 0.1", "coulomb = 0.25").replace("0.2\n", "0.08\n"), "truth");
    let truth = truth.expect("it is a rig");
    let path = |name: &str, content: &str| {
        let path = dir.join(name);
        std::fs::write(&path, content).expect("written");
        path
    };
    let rig = path("rig.toml", RIG);
    let (fit, holdout) =
        (path("fit.csv", &recorded(&truth, 0.0)), path("holdout.csv", &recorded(&truth, 2.0)));
    let out = dir.join("out");
    let arguments = [
        "simulate",
        "--rig",
        text(&rig),
        "--fit",
        text(&fit),
        "--recording",
        text(&holdout),
        "--out",
        text(&out),
    ];
    let said = run_well(&arguments);
    let first = said.lines().next().expect("a line");
    assert!(
        first.starts_with("In windows of 0.5 s of holdout.csv, the simulated position is off by"),
        "{said}"
    );
    assert!(said.contains("The motion-fitted simulation is the nominal one with the values that bring its free run closest to fit.csv"), "{said}");
    assert!(!said.contains("judges nothing"), "{said}");
    let json = std::fs::read_to_string(out.join("simulation.json")).expect("written");
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    let off = |model: usize| {
        let figures = &json["recordings"][0]["models"][model]["figures"];
        figures["free_run"]["position_rms"].as_f64().expect("a figure")
    };
    assert!(off(1) < 0.05 * off(0), "{} rad became {} rad", off(0), off(1));
    let fitted = Rig::read(&out.join("fitted-rig.toml")).expect("it is a rig");
    let dry = fitted.model.coulomb.expect("it has dry friction");
    assert!((dry - 0.25).abs() < 0.02, "{dry} N·m");
    let page = std::fs::read_to_string(out.join("simulation.html")).expect("written");
    assert!(page.contains("<h2>What to do next</h2>") && page.contains("fitted-rig.toml"));

    let said = run_well(&[&arguments[..], &["--recording", text(&fit)]].concat());
    assert!(
        said.contains(
            "fit.csv was fitted by motion too: what the motion-fitted simulation is off there judges nothing"
        ),
        "{said}"
    );
    refused(&run(&[&arguments[..], &["--export", "stl"]].concat()), 2, &["stl", "mjcf"]);
}

/// A turned sign, a wrong unit and an axis at rest: nothing is diagnosed, and scripts hear it.
#[test]
fn recordings_that_cannot_be_used_end_a_diagnosis_with_2() {
    let dir = folder("unusable");
    let light = RIG.replace("0.2\n", "0.02\n").replace("coulomb = 0.1", "coulomb = 0.02");
    let truth = Rig::parse(&light, "truth").expect("it is a rig");
    let path = |name: &str, content: &str| {
        let path = dir.join(name);
        std::fs::write(&path, content).expect("written");
        path
    };
    let files = [path("fit.csv", &recorded(&truth, 0.0)), path("holdout.csv", &recorded(&truth, 2.0))];
    let resting: String = recorded(&truth, 0.0)
        .lines()
        .map(|line| match line.rsplit_once(',') {
            Some((row, counts)) if counts.parse::<f64>().is_ok() => format!("{row},7\n"),
            _ => format!("{line}\n"),
        })
        .collect();
    let rest = [path("rest.csv", &resting), files[1].clone()];
    let of = |rig: &str, [fit, holdout]: &[std::path::PathBuf; 2], said: &[&str]| {
        let rig = path("rig.toml", rig);
        let out = dir.join("out");
        let arguments = ["diagnose", "--rig", text(&rig), "--fit", text(fit), "--holdout", text(holdout)];
        refused(&run(&[&arguments[..], &["--out", text(&out)]].concat()), 2, said);
    };
    of(&light.replace("gain = 1.0", "gain = -1.0"), &files, &["a sign is wrong", "actuator.gain"]);
    of(&light.replace("gain = 1.0", "gain = 1000.0"), &files, &["thousandths", "actuator.gain"]);
    of(&light, &rest, &["rest.csv"]);
}
