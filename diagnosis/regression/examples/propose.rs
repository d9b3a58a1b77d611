//! Reads a case and writes a minimal `diagnosis.json`, so that `prove --tool` can judge what the
//! regression proposes. The decision below measures the proposer; it is not the tool's.
//!
//!     propose --rig rig.toml --fit a.csv --holdout b.csv --out DIR

use diagnosis::{recording, rig};
use regression::{Hypothesis, Part, Proposals, Recording, Rig, Value};
use serde_json::json;
use std::path::{Path, PathBuf};

/// The prototype's rule C0: least share and z on left-out frames and on the holdout, least
/// agreement of sizes, and what makes a rival a member of the class.
const SHARE: f64 = 0.15;
const Z: f64 = 1.0;
const AGREEMENT: f64 = 0.4;
const CLASS_SHARE: f64 = 0.85;
const CLASS_Z: f64 = 2.0;
/// Share from which the confidence is 0.9 and not 0.7.
const SURE: f64 = 0.3;

fn rig_of(r: &rig::Rig) -> Rig {
    let u = &r.uncertainty;
    let value = |nominal: f64, spread: Option<f64>| Value { nominal, spread };
    let (m, e) = (&r.model, &r.encoder);
    let known = [r.actuator.delay_s, r.actuator.lag_s, e.filter_s];
    Rig {
        rotary: r.kind == rig::Kind::Rotary,
        inertia: value(m.inertia, u.inertia),
        viscous: m.viscous.map(|x| value(x, u.viscous)),
        coulomb: m.coulomb.map(|x| value(x, u.coulomb)),
        weight: m.weight.map(|x| value(x, None)),
        gravity: m.gravity.map(|x| (value(x, None), m.gravity_zero.unwrap_or(0.0))),
        has_offset: m.offset.is_some(),
        gain: value(r.actuator.gain, u.gain),
        known_delay_s: known.into_iter().flatten().sum(),
        counts_per_unit: e.counts_per_unit,
        absolute: e.absolute,
        noise_counts: e.noise_counts.unwrap_or(0.0),
        turn: r.turn(),
        start_spread: e.start_spread,
    }
}

fn read(path: &Path, part: Part) -> Result<Recording, String> {
    let r = recording::Recording::read(path).map_err(|e| e.to_string())?;
    Ok(Recording {
        part,
        time_s: r.time_s,
        command: r.command,
        position_counts: r.position_counts,
        tilt_rad: r.tilt_rad,
        load: r.force,
    })
}

/// The smaller of a figure on left-out frames and on the holdout.
fn both(fit: f64, held: impl Fn(regression::HeldOut) -> f64, h: &Hypothesis) -> f64 {
    h.evidence.held_out.map_or(f64::NEG_INFINITY, |out| fit.min(held(out)))
}

fn is_named(h: &Hypothesis) -> bool {
    let e = &h.evidence;
    h.valid
        && both(e.share, |o| o.share, h) >= SHARE
        && both(e.z, |o| o.z, h) >= Z
        && both(e.size_agreement, |o| o.size_agreement, h) >= AGREEMENT
}

/// The names that the data cannot tell from the round's first.
fn class(round: &[Hypothesis]) -> Vec<&'static str> {
    let least = CLASS_SHARE * round[0].evidence.share;
    let near = |h: &&Hypothesis| h.valid && h.evidence.share >= least && h.evidence.lead_z > -CLASS_Z;
    let rivals = round[1..].iter().filter(near).take(2).map(|h| h.law.name);
    [round[0].law.name].into_iter().chain(rivals).collect()
}

fn answer(proposals: &Proposals) -> serde_json::Value {
    let named = proposals.rounds.iter().filter(|round| is_named(&round[0])).take(3);
    let effect = |round: &Vec<Hypothesis>| {
        let share = both(round[0].evidence.share, |o| o.share, &round[0]);
        let confidence = if share > SURE { 0.9 } else { 0.7 };
        json!({"name": round[0].law.name, "class": class(round), "confidence": confidence, "parameters": {}})
    };
    let effects: Vec<_> = named.map(effect).collect();
    let hypothesis = |(k, h): (usize, &Hypothesis)| {
        let e = &h.evidence;
        let held =
            e.held_out.map(|o| json!({"share": o.share, "z": o.z, "size_agreement": o.size_agreement}));
        let shapes: Vec<_> = h.shapes.iter().map(|s| json!([s.form, s.value])).collect();
        json!({"round": k, "name": h.law.name, "shapes": shapes, "size": h.coefficients[0], "valid": h.valid,
               "share": e.share, "z": e.z, "size_agreement": e.size_agreement, "lead_z": e.lead_z,
               "free_form_more": e.free_form_more, "residual_over_noise": e.residual_over_noise,
               "rows": e.rows, "held_out": held})
    };
    let rows = proposals.rounds.iter().enumerate().flat_map(|(k, round)| round.iter().map(move |h| (k, h)));
    let [refit, patched] = [0, proposals.rounds.len()].map(|n| proposals.errors[n]);
    let error = |e: regression::ForceError| json!({"fit": e.fit, "holdout": e.holdout});
    json!({
        "format": 1,
        "verdict": if effects.is_empty() { "no_mismatch" } else { "missing_physics" },
        "effects": effects,
        "fit": {"metric": "force_rmse", "refit": error(refit), "patched": error(patched)},
        "residual_bandwidth_hz": proposals.band_hz,
        "proposals": rows.map(hypothesis).collect::<Vec<_>>(),
    })
}

fn run() -> Result<(), String> {
    let (mut rig_file, mut out, mut recordings) = (None, None, Vec::new());
    let mut words = std::env::args().skip(1);
    while let (Some(flag), Some(value)) = (words.next(), words.next()) {
        let path = PathBuf::from(&value);
        match flag.as_str() {
            "--rig" => rig_file = Some(path),
            "--out" => out = Some(path),
            "--fit" => recordings.push(read(&path, Part::Fit)?),
            "--holdout" => recordings.push(read(&path, Part::Holdout)?),
            _ => return Err(format!("{flag} is no flag of propose")),
        }
    }
    let (Some(rig_file), Some(out)) = (rig_file, out) else {
        return Err("propose --rig rig.toml --fit a.csv --holdout b.csv --out DIR".into());
    };
    let text = std::fs::read_to_string(&rig_file).map_err(|e| format!("{}: {e}", rig_file.display()))?;
    let rig = rig::Rig::parse(&text, &rig_file.display().to_string()).map_err(|e| e.to_string())?;
    let report = match regression::propose(&rig_of(&rig), &recordings) {
        Ok(proposals) => answer(&proposals),
        Err(refusal) => json!({"format": 1, "verdict": "insufficient_excitation", "effects": [],
            "fit": {"refit": {"holdout": null}, "patched": {"holdout": null}}, "refusal": refusal.0}),
    };
    std::fs::write(out.join("diagnosis.json"), report.to_string()).map_err(|e| e.to_string())
}

fn main() -> std::process::ExitCode {
    match run() {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("{error}");
            std::process::ExitCode::from(2)
        }
    }
}
