//! Tests that `import`, `simulate` and `fit-force` keep a file that somebody changed and never
//! leave part of one under its name, and that strangers' files are right from `import` to the
//! report.

use crate::common::axis::{RATE_HZ, file, has_values, import, motion, reading, report, table, torque};
use crate::common::{folder, refused, run, run_well, text};
use std::path::Path;
use std::process::Command;

fn plain(seconds: f64) -> String {
    table("t_s,tau_Nm,theta_rad", seconds, |_, t| format!("{t:.4},{:.6},{:.6}", torque(t), reading(t)))
}

#[test]
fn an_import_replaces_its_own_files_and_no_others() {
    let (path, out) = file("kept.csv", &plain(4.0));
    let again = |options: &[&str]| run(&[&["import", text(&path), "--out", text(&out)], options].concat());
    assert!(again(&[]).status.success());
    // The advice to split replaces the whole recording, and a value that was missing the skeleton.
    assert!(again(&["--split", "0.6", "--inertia", "0.002"]).status.success());
    assert!(!out.join("recording.csv").exists() && out.join("holdout.csv").exists());
    let rig = out.join("rig.toml");
    let edited =
        std::fs::read_to_string(&rig).expect("written").replace("# viscous = 0.0", "viscous = 0.004");
    std::fs::write(&rig, &edited).expect("written");
    refused(&again(&["--split", "0.6", "--inertia", "0.003"]), 2, &["rig.toml", "--rig", "another --out"]);
    assert_eq!(std::fs::read_to_string(&rig).expect("it is there"), edited);
    assert!(again(&["--split", "0.5", "--rig", text(&rig)]).status.success());
    assert_eq!(std::fs::read_to_string(&rig).expect("it is there"), edited);
    // A file of that name that no import wrote.
    std::fs::write(out.join("recording.csv"), "mine").expect("written");
    refused(&again(&["--rig", text(&rig)]), 2, &["recording.csv", "not as import wrote it"]);
    assert_eq!(std::fs::read_to_string(out.join("recording.csv")).expect("it is there"), "mine");
}

/// Runs the program where no file may be longer than some blocks of 512 bytes, as on a full disk.
#[cfg(unix)]
fn on_a_full_disk(arguments: &[&str]) {
    let line = format!("ulimit -f 64; exec '{}' \"$@\"", env!("CARGO_BIN_EXE_host-sim"));
    let done = Command::new("sh").args(["-c", &line, "sh"]).args(arguments).output().expect("it starts");
    assert!(!done.status.success(), "{arguments:?}");
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_no_truncated_file_under_a_final_name() {
    let (path, out) = file("full.csv", &plain(8.0));
    on_a_full_disk(&["import", text(&path), "--out", text(&out)]);
    let names = |dir: &Path| -> Vec<String> {
        let entries = std::fs::read_dir(dir).expect("it is there").flatten();
        entries
            .map(|e| e.file_name().to_string_lossy().into_owned())
            .filter(|n| !n.starts_with('.'))
            .collect()
    };
    assert_eq!(names(&out), ["rig.toml"]);
    import(&path, &out, &["--inertia", "0.002"]);
    let (rig, recording) = (out.join("rig.toml"), out.join("recording.csv"));
    let [whole, to] = ["whole", "cut"].map(|name| out.join(name));
    let simulate = ["simulate", "--rig", text(&rig), "--recording", text(&recording), "--out"];
    run_well(&[&simulate[..], &[text(&whole)]].concat());
    on_a_full_disk(&[&simulate[..], &[text(&to)]].concat());
    for name in names(&to) {
        let content = |dir: &Path| std::fs::read(dir.join(&name)).expect("it is there");
        assert!(content(&to) == content(&whole), "{name} is truncated");
    }
    assert!(names(&to).len() < names(&whole).len());
}

#[test]
fn forces_that_no_needle_meets_are_refused_by_fit_force() {
    let dir = folder("strange-forces");
    let insertion = |speed: f64, of: &dyn Fn(f64) -> f64| {
        let rows = (0..(11.0 / speed * RATE_HZ) as usize).map(|i| {
            let (t, depth) = (i as f64 / RATE_HZ, i as f64 / RATE_HZ * speed - 1.0);
            let force = if depth > 4.0 { 0.3 } else { 0.25 * depth.max(0.0) };
            format!("{t:.4},{depth:.4},{:.4},60\n", of(force + 0.004 * (i as f64 * 12.9).sin()))
        });
        format!("time_s,depth_mm,force_n,angle_deg\n{}", rows.collect::<String>())
    };
    let out = dir.join("table.toml");
    for (name, of, hints) in [
        ("turned", (|f| -f) as fn(f64) -> f64, &["negative throughout", "turn its sign"][..]),
        ("milli", |f| 1e3 * f, &["if it is in mN"]),
        ("resting", |f| f + 20.0, &["20.00 N before the needle touches"]),
    ] {
        let files = [1.0, 3.0].map(|speed| {
            let path = dir.join(format!("{name}-{speed}.csv"));
            std::fs::write(&path, insertion(speed, &of)).expect("written");
            path
        });
        refused(&run(&["fit-force", text(&files[0]), text(&files[1]), "--out", text(&out)]), 2, hints);
        assert!(!out.exists());
    }
}

/// Two reports of 14 s: some seconds each.
#[test]
fn strange_units_and_stamps_give_the_values_in_the_report() {
    let milli = table("t_s,tau_mNm,theta_rad", 14.0, |_, t| {
        format!("{t:.4},{:.3},{:.6}", 1e3 * torque(t), reading(t))
    });
    let sparse = table("__time,joint/position_rad,motor/torque_Nm", 14.0, |i, t| {
        let stamp = 1_766_147_454_233_218_075_u64 + i as u64 * 2_000_000;
        let place = if i % 3 != 1 { format!("{:.6}", motion(t, 0)) } else { String::new() };
        let u = if i % 3 != 2 { format!("{:.6}", torque(t)) } else { String::new() };
        format!("{stamp},{place},{u}")
    });
    for (name, content) in [("milli", milli), ("sparse", sparse)] {
        has_values(name, &report(&format!("report-{name}"), &content, &["--inertia", "0.002"]));
    }
}
