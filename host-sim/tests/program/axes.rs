//! A log of several axes, taken apart and diagnosed with one command each.

use crate::common::{folder, refused, run, run_well, text};
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use serde_json::Value;
use std::path::Path;

/// Forty seconds of a knee with dry friction and a hip without, at 200 Hz.
fn log(path: &Path) {
    let mut plants = ["coulomb = 0.25\n", ""].map(|friction| {
        let rig = format!(
            "format = 1\nkind = \"rotary\"\n[model]\ninertia = 0.17\n{friction}[actuator]\ngain = 1.0\ncommand_unit = \"N·m\"\n\
             [encoder]\ncounts_per_unit = 1e5\n"
        );
        Plant::new(&Rig::parse(&rig, "an axis").expect("it is a rig"))
    });
    let mut log = String::from("t,knee_pos_deg,hip_pos_deg,knee_torque_Nm,hip_torque_Nm\n");
    for row in 0..8000 {
        let t = f64::from(row) * 5e-3;
        let knee = 1.2 * (1.4 * t).sin() + 0.8 * (3.8 * t).sin() + 0.5 * (12.0 * t).sin();
        let hip = 0.9 * (1.1 * t + 1.0).sin() + 0.7 * (4.3 * t).sin() + 0.5 * (11.0 * t).sin();
        let [a, b] = [0, 1].map(|i| plants[i].position().to_degrees());
        log += &format!("{t:.4},{a:.4},{b:.4},{knee:.5},{hip:.5}\n");
        for _ in 0..50 {
            plants[0].step(knee, Surroundings::default(), 1e-4);
            plants[1].step(hip, Surroundings::default(), 1e-4);
        }
    }
    std::fs::write(path, log).expect("written");
}

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|cause| panic!("{}: {cause}", path.display()))
}

#[test]
fn axes_of_one_log_are_diagnosed_as_each_is_alone() {
    let dir = folder("axes");
    let [file, robot, together, alone] =
        ["robot.csv", "robot", "together", "alone"].map(|name| dir.join(name));
    log(&file);
    let options = ["--axes", "--split", "0.6", "--inertia", "0.17", "--out", text(&robot)];
    let said = run_well(&[&["import", text(&file)], &options[..]].concat());
    assert!(said.contains("axis knee:") && said.contains("axis hip:"), "{said}");
    run_well(&["diagnose", "--all", text(&robot), "--out", text(&together)]);
    let page = read(&together.join("index.html"));
    for (axis, named) in [("knee", &["coulomb_friction"][..]), ("hip", &[])] {
        let [rig, fit, held] = ["rig.toml", "fit.csv", "holdout.csv"].map(|name| robot.join(axis).join(name));
        let out = alone.join(axis);
        run_well(&[
            "diagnose",
            "--rig",
            text(&rig),
            "--fit",
            text(&fit),
            "--holdout",
            text(&held),
            "--out",
            text(&out),
        ]);
        let found = read(&out.join("diagnosis.json"));
        assert_eq!(found, read(&together.join(axis).join("diagnosis.json")), "{axis}");
        let found: Value = serde_json::from_str(&found).expect("it is JSON");
        let names: Vec<_> =
            found["effects"].as_array().expect("effects").iter().map(|one| &one["name"]).collect();
        assert_eq!(names, named, "{axis}: {found}");
        let sentence = found["sentence"].as_str().expect("a sentence");
        assert!(page.contains(sentence), "{sentence} is not in: {page}");
        let link = format!("{axis}/report.html");
        assert!(page.contains(&format!("href=\"{link}\"")) && together.join(&link).is_file(), "{page}");
    }
}

#[test]
fn columns_belong_to_the_axis_that_their_names_say() {
    let dir = folder("axes-names");
    let cases: [(&str, &[&str], [&str; 2]); 3] = [
        (
            "t,q1,q2,tau1,tau2",
            &["--column", "position=q1:rad", "--column", "position=q2:rad"],
            ["axis-1", "axis-2"],
        ),
        (
            "t,left_knee_pos_rad,left_hip_pos_rad,left_knee_torque_Nm,left_hip_torque_Nm",
            &[],
            ["left-knee", "left-hip"],
        ),
        (
            "t,motor_0.position_rad,motor_1.position_rad,motor_0.current_A,motor_1.current_A",
            &[],
            ["axis-0", "axis-1"],
        ),
    ];
    for (index, (head, options, names)) in cases.into_iter().enumerate() {
        let (file, out) = (dir.join(format!("{index}.csv")), dir.join(format!("{index}")));
        let mut log = format!("{head}\n");
        for row in 0..800 {
            let t = f64::from(row) * 5e-3;
            let [q, p] = [3.0, 2.0].map(|w: f64| (w * t).sin() + 0.2 * (7.0 * t).sin());
            log += &format!("{t:.4},{q:.6},{p:.6},{:.5},{:.5}\n", (3.0 * t).cos(), 0.5 + (2.0 * t).cos());
        }
        std::fs::write(&file, log).expect("written");
        run_well(&[&["import", text(&file), "--axes", "--out", text(&out)], options].concat());
        for (name, first) in names.into_iter().zip([1.0, 1.5]) {
            let csv = read(&out.join(name).join("recording.csv"));
            let command = csv.lines().nth(1).and_then(|line| line.split(',').nth(1)).expect("a row");
            let command: f64 = command.parse().expect("a number");
            assert!((command - first).abs() < 1e-3, "{name}: {command} instead of {first}");
        }
    }
}

#[test]
fn an_axis_that_cannot_be_diagnosed_is_a_row_too() {
    let dir = folder("axes-failed");
    let (robot, out) = (dir.join("robot"), dir.join("out"));
    std::fs::create_dir_all(robot.join("wrist")).expect("made");
    std::fs::write(robot.join("wrist/rig.toml"), "format = 1\n").expect("written");
    refused(&run(&["diagnose", "--all", text(&robot), "--out", text(&out)]), 2, &["1 of 1 axes"]);
    assert!(read(&out.join("index.html")).contains("has no two recordings"));
    refused(&run(&["diagnose", "--all", text(&dir), "--out", text(&out)]), 2, &["import --axes"]);
    let file = dir.join("one.csv");
    std::fs::write(&file, "t,knee_pos_deg,knee_torque_Nm\n0,1,2\n0.1,1,2\n0.2,1,3\n").expect("written");
    refused(
        &run(&["import", text(&file), "--axes", "--out", text(&out)]),
        2,
        &["finds one axis", "--column position=NAME"],
    );
}
