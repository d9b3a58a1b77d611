//! Tests that faults of a log are found before any law is searched and are said as such, from
//! `import` to the report.

use crate::common::axis::{asked, file, has_values, import, motion, reading, report, table, torque};
use crate::common::{folder, refused, run, text};
use serde_json::Value;

const HEADER: &str = "t_s,tau_Nm,theta_rad";
const INERTIA: [&str; 2] = ["--inertia", "0.002"];

/// That both recordings have one fault, of this kind and size, and no other.
fn has_fault(name: &str, report: &Value, kind: &str, size: f64) {
    let faults = report["data_faults"].as_array().unwrap_or_else(|| panic!("{name}: {report:#}"));
    assert_eq!(faults.len(), 2, "{name}: {faults:?}");
    for fault in faults {
        let value = fault["value"].as_f64().expect("a size");
        assert!(fault["kind"] == kind && (value / size - 1.0).abs() < 0.06, "{name}: {fault}");
    }
}

fn sentence(report: &Value) -> &str {
    report["sentence"].as_str().expect("a sentence")
}

#[test]
fn a_sound_log_is_not_accused() {
    let sound = table(HEADER, 14.0, |_, t| format!("{t:.4},{:.6},{:.6}", torque(t), reading(t)));
    let report = report("sound", &sound, &INERTIA);
    assert_eq!(report["data_faults"], Value::Null);
    has_values("sound", &report);
}

#[test]
fn held_readings_count_once() {
    let held = table(HEADER, 14.0, |i, t| {
        let read = (i / 3 * 3) as f64 / 500.0;
        format!("{t:.4},{:.6},{:.6}", torque(t), reading(read))
    });
    let report = report("held", &held, &INERTIA);
    has_fault("held", &report, "held_readings", 500.0 / 3.0);
    has_values("held", &report);
}

#[test]
fn a_torque_that_is_logged_late_is_taken_back() {
    let late =
        table(HEADER, 14.0, |_, t| format!("{t:.4},{:.6},{:.6}", torque((t - 0.012).max(0.0)), reading(t)));
    let report = report("late", &late, &INERTIA);
    has_fault("late", &report, "late_command", 0.012);
    has_values("late", &report);
}

#[test]
fn readings_that_are_logged_late_are_said_to_look_like_a_delay() {
    let late =
        table(HEADER, 14.0, |_, t| format!("{t:.4},{:.6},{:.6}", torque(t), reading((t - 0.012).max(0.0))));
    let report = report("late-reading", &late, &INERTIA);
    let effects = report["effects"].as_array().expect("effects");
    let delay = effects.iter().find(|one| one["name"] == "command_delay").expect("the time between");
    let interval = &delay["parameters"]["delay"]["ci95"];
    let [low, high] = [0, 1].map(|end| interval[end].as_f64().expect("an end"));
    assert!(low < 0.012 && 0.012 < high && high - low < 0.002, "{delay}");
    let notes = report["notes"].as_array().expect("notes");
    let says = |note: &Value| note.as_str().is_some_and(|note| note.contains("logged late look the same"));
    assert!(notes.iter().any(says), "{notes:?}");
}

#[test]
fn a_command_that_is_renewed_slowly_is_no_physics() {
    let held = |every: usize| {
        table(HEADER, 14.0, |i, t| {
            let renewed = (i / every * every) as f64 / 500.0;
            format!("{t:.4},{:.6},{:.6}", torque(renewed), motion(t, 0))
        })
    };
    let slow = report("slow", &held(50), &[&INERTIA[..], &["--counts-per-unit", "1e5"]].concat());
    has_fault("slow", &slow, "slow_command", 10.0);
    assert!(slow["effects"].as_array().is_some_and(Vec::is_empty), "{slow:#}");
    assert!(sentence(&slow).contains("only 10 new values of the command a second"), "{}", sentence(&slow));
    let fair = report("fair", &held(5), &[&INERTIA[..], &["--counts-per-unit", "1e5"]].concat());
    has_fault("fair", &fair, "slow_command", 100.0);
    has_values("fair", &fair);
}

#[test]
fn motion_one_way_does_not_tell_friction_from_a_constant_force() {
    // The axis of the other tests, carried along at 12 rad/s.
    let speed = |t: f64| 12.0 + motion(t, 1);
    let rows = table(HEADER, 14.0, |_, t| {
        let at = |t: f64| 0.002 * motion(t, 2) + 0.004 * speed(t) + 0.05;
        format!("{t:.4},{:.6},{:.6}", at(t + 0.001), 12.0 * t + motion(t, 0))
    });
    let report = report("one-way", &rows, &[&INERTIA[..], &["--counts-per-unit", "1e5"]].concat());
    assert_eq!(report["data_faults"][0]["kind"], "one_way_motion", "{report:#}");
    has_values("one way", &report);
    let effects = report["effects"].as_array().expect("effects");
    let dry = effects.iter().find(|one| one["name"] == "coulomb_friction").expect("it is named");
    let class = dry["class"].as_array().expect("a class");
    assert!(class.contains(&"asymmetric_friction".into()), "{class:?}");
}

#[test]
fn a_gear_is_among_the_mistakes_behind_a_far_inertia() {
    let rows = table(HEADER, 14.0, |_, t| format!("{t:.4},{:.8},{:.6}", torque(t) / 50.0, reading(t)));
    let (path, out) = file("gear.csv", &rows);
    let imported =
        run(&[&["import", text(&path), "--split", "0.6", "--out", text(&out)], &INERTIA[..]].concat());
    assert!(imported.status.success());
    let [rig, fit, holdout, report] = ["rig.toml", "fit.csv", "holdout.csv", "r"].map(|file| out.join(file));
    let sources = ["--rig", text(&rig), "--fit", text(&fit), "--holdout", text(&holdout)];
    let said = run(&[&["diagnose"][..], &sources, &["--out", text(&report)]].concat());
    refused(&said, 2, &["per degree (multiply it by 57.2958)", "(multiply actuator.gain"]);
    let said = String::from_utf8_lossy(&said.stderr);
    let ratio = said.split("gear of about ").nth(1).and_then(|rest| rest.split(' ').next());
    let ratio: f64 = ratio.and_then(|ratio| ratio.parse().ok()).expect("a ratio");
    assert!((ratio / 50.0 - 1.0).abs() < 0.1 && !said.contains("could still be used"), "{said}");
}

#[test]
fn axes_in_one_column_are_refused_by_both_commands() {
    let of = |header: &str, unit: f64| {
        table(header, 8.0, |i, t| {
            let place = if i % 2 == 0 { motion(t, 0) } else { 0.2 * motion(t, 0) + 1.0 };
            format!("{t:.4},{:.6},{:.0}", torque(t), place * unit)
        })
    };
    let (path, out) = file("both.csv", &of("t_s,tau_Nm,theta_counts", 1e4));
    asked(&path, &out, &[], &["--rows 1/2"]);
    let dir = folder("both-axes");
    let [rig, fit, holdout, report] = ["rig.toml", "fit.csv", "holdout.csv", "r"].map(|file| dir.join(file));
    let rig_text = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 0.002\n[actuator]\ngain = 1.0\n[encoder]\ncounts_per_unit = 10000.0\n";
    std::fs::write(&rig, rig_text).expect("written");
    std::fs::write(&fit, of("time_s,command,position_counts", 1e4)).expect("written");
    std::fs::write(&holdout, of("time_s,command,position_counts", 1.1e4)).expect("written");
    let sources = ["--rig", text(&rig), "--fit", text(&fit), "--holdout", text(&holdout)];
    let said = run(&[&["diagnose"][..], &sources, &["--out", text(&report)]].concat());
    refused(&said, 2, &["2 axes are in one column", "--rows 1/2"]);
}

/// Numbers between -0.5 and 0.5, always the same.
fn noise() -> impl FnMut() -> f64 {
    let mut state = 7_u64;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as f64 / (1_u64 << 31) as f64 - 0.5
    }
}

#[test]
fn an_analogue_reading_is_asked_for_its_noise() {
    // 0.005 rad, which are 3.26 counts.
    let mut noise = noise();
    let places: Vec<f64> =
        (0..7000).map(|i| motion(f64::from(i) / 500.0, 0) + 0.005 * 12_f64.sqrt() * noise()).collect();
    let rows = table(HEADER, 14.0, |i, t| format!("{t:.4},{:.6},{:.7}", torque(t), places[i]));
    let (path, out) = file("analogue.csv", &rows);
    let options = ["--split", "0.6", "--inertia", "0.002", "--counts-per-turn", "4096"];
    import(&path, &out, &options);
    let [rig, fit, holdout, report] = ["rig.toml", "fit.csv", "holdout.csv", "r"].map(|file| out.join(file));
    let sources = ["--rig", text(&rig), "--fit", text(&fit), "--holdout", text(&holdout)];
    let diagnose = [&["diagnose"][..], &sources, &["--out", text(&report)]].concat();
    let said = run(&diagnose);
    refused(&said, 2, &["analogue sensor", "set encoder.noise_counts"]);
    let said = String::from_utf8_lossy(&said.stderr);
    let counts = said.split("scatters by about ").nth(1).and_then(|rest| rest.split(' ').next());
    let counts: f64 = counts.and_then(|counts| counts.parse().ok()).expect("counts");
    assert!((counts / 3.26 - 1.0).abs() < 0.1, "{counts}");
    let asked = std::fs::read_to_string(&rig).expect("it is there");
    let with = asked.replacen("[encoder]", &format!("[encoder]\nnoise_counts = {counts}"), 1);
    std::fs::write(&rig, with).expect("written");
    assert!(run(&diagnose).status.success());
}

#[test]
fn what_noise_hides_is_not_called_right() {
    // A rig with the right values, read to half a radian.
    let mut noise = noise();
    let places: Vec<f64> = (0..7000).map(|i| motion(i as f64 / 500.0, 0) + noise()).collect();
    let rows = table(HEADER, 14.0, |i, t| format!("{t:.4},{:.6},{:.6}", 0.2 * torque(t), places[i]));
    let report = report("noisy", &rows, &["--inertia", "0.0004", "--counts-per-unit", "1e4"]);
    let fit = &report["fit"];
    let part = fit["patched"]["holdout"].as_f64().unwrap_or(0.0)
        / fit["force_rms"]["holdout"].as_f64().unwrap_or(1.0);
    assert!(part > 0.5, "the noise hides most of the force: {part}");
    let next = report["record_next"].as_str().expect("a clause");
    assert!(
        !sentence(&report).contains("right") && !next.starts_with("nothing"),
        "{}; {next}",
        sentence(&report)
    );
    assert!(sentence(&report).contains(" % of the force"), "{}", sentence(&report));
}
