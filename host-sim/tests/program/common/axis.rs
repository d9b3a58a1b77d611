//! An axis whose truth is known, files of it as strangers have them, and what `import` makes of
//! them.

use super::{folder, refused, run, run_well, text};
use diagnosis::recording::Recording;
use serde_json::Value;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

pub(crate) const RATE_HZ: f64 = 500.0;
const COUNTS: f64 = 4096.0;
/// kg·m², N·m·s/rad, N·m.
const AXIS: [f64; 3] = [0.002, 0.004, 0.05];
/// Amplitude, rad, frequency, Hz, and phase, rad, of each part of the motion.
const PARTS: [(f64, f64, f64); 4] = [(0.9, 0.31, 0.1), (0.35, 0.83, 1.0), (0.12, 1.9, 2.2), (0.03, 4.7, 0.5)];

/// Position, rad, or one of its derivatives by time.
pub(crate) fn motion(t: f64, derivative: i32) -> f64 {
    let part = |(a, hz, phase): &(f64, f64, f64)| {
        let omega = TAU * hz;
        a * omega.powi(derivative) * (omega * t + phase + f64::from(derivative) * TAU / 4.0).sin()
    };
    PARTS.iter().map(part).sum()
}

/// The torque that makes the motion, N·m: the mean over a row, as it is held.
pub(crate) fn torque(t: f64) -> f64 {
    let [inertia, viscous, dry] = AXIS;
    let at = |t: f64| inertia * motion(t, 2) + viscous * motion(t, 1) + dry * motion(t, 1).signum();
    (0..5).map(|k| at(t + (f64::from(k) + 0.5) / 5.0 / RATE_HZ)).sum::<f64>() / 5.0
}

/// The angle as the encoder reads it, rad.
pub(crate) fn reading(t: f64) -> f64 {
    (motion(t, 0) * COUNTS / TAU).round() * TAU / COUNTS
}

/// A file of `seconds` with a line for each row from its number and its time.
pub(crate) fn table(header: &str, seconds: f64, row: impl Fn(usize, f64) -> String) -> String {
    let rows = (0..(seconds * RATE_HZ) as usize).map(|i| row(i, i as f64 / RATE_HZ));
    std::iter::once(header.to_owned())
        .chain(rows)
        .filter(|line| !line.is_empty())
        .collect::<Vec<_>>()
        .join("\n")
        + "\n"
}

pub(crate) fn file(name: &str, content: &str) -> (PathBuf, PathBuf) {
    let dir = folder(&format!("strangers-{}", name.replace(['/', ' ', '.'], "-")));
    let path = dir.join(name.replace(['/', ' '], "-"));
    std::fs::write(&path, content).expect("written");
    (path, dir.join("out"))
}

/// Imports a file; what was said, and its recordings in order.
pub(crate) fn import(path: &Path, out: &Path, options: &[&str]) -> (String, Vec<Recording>) {
    let _ = std::fs::remove_dir_all(out);
    let said = run_well(&[&["import", text(path), "--keep-idle", "--out", text(out)], options].concat());
    let mut paths: Vec<PathBuf> = std::fs::read_dir(out)
        .expect("the folder is there")
        .map(|entry| entry.expect("it can be read").path())
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    paths.sort();
    (said, paths.iter().map(|path| Recording::read(path).expect("it keeps the contract")).collect())
}

/// Refused with status 2 and these words, and nothing is written.
pub(crate) fn asked(path: &Path, out: &Path, options: &[&str], hints: &[&str]) {
    refused(&run(&[&["import", text(path), "--out", text(out)], options].concat()), 2, hints);
    assert!(!out.exists(), "nothing is half written: {}", path.display());
}

/// That a recording holds the motion from `begin` s on, its position in rad and its command with
/// `gain` N·m for one of it; the command within `close` N·m in the mean.
pub(crate) fn holds(name: &str, recording: &Recording, begin: f64, (per_unit, gain, close): (f64, f64, f64)) {
    let zero = recording.position_counts[0] / per_unit - motion(begin, 0);
    let (mut off, mut size) = (0.0, 0.0);
    for ((t, u), counts) in recording.time_s.iter().zip(&recording.command).zip(&recording.position_counts) {
        let place = counts / per_unit - zero;
        assert!((place - motion(begin + t, 0)).abs() < 1.6 * TAU / COUNTS, "{name}: {place} rad at {t} s");
        off += (u * gain - torque(begin + t)).abs();
        size += torque(begin + t).abs();
    }
    let rows = recording.len() as f64;
    assert!(off / rows < close, "{name}: off by {} of {} N·m", off / rows, size / rows);
}

pub(crate) const PER_UNIT: f64 = COUNTS / TAU;
pub(crate) const EXACT: (f64, f64, f64) = (PER_UNIT, 1.0, 1e-6);

/// Imports a file and diagnoses its last two fifths by its first three; `diagnosis.json`.
pub(crate) fn report(name: &str, content: &str, options: &[&str]) -> Value {
    let (path, out) = file(&format!("{name}.csv"), content);
    import(&path, &out, &[&["--split", "0.6"], options].concat());
    let [rig, fit, holdout, report] =
        ["rig.toml", "fit.csv", "holdout.csv", "report"].map(|file| out.join(file));
    let sources = ["--rig", text(&rig), "--fit", text(&fit), "--holdout", text(&holdout)];
    run_well(&[&["diagnose"][..], &sources, &["--out", text(&report)]].concat());
    let json = std::fs::read_to_string(report.join("diagnosis.json")).expect("it is there");
    serde_json::from_str(&json).expect("it is JSON")
}

/// That a report names the friction of the axis with its values, within 11 %.
pub(crate) fn has_values(name: &str, report: &Value) {
    let effects = report["effects"].as_array().expect("effects");
    for (effect, parameter, truth) in
        [("coulomb_friction", "coulomb", AXIS[2]), ("viscous_friction", "viscous", AXIS[1])]
    {
        let found = effects.iter().find(|e| e["name"] == effect);
        let found = found.unwrap_or_else(|| panic!("{name}: {effect}: {report:#}"));
        let found = found["parameters"][parameter]["value"].as_f64().expect("a value");
        assert!((found / truth - 1.0).abs() < 0.11, "{name}: {parameter} {found}");
    }
}
