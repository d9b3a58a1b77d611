//! The files that the tool gets, to the letter of the contract, and the key that it does not get.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::case::Case;
use super::simulate::Row;

/// Where the case's files lie.
#[derive(Clone, Debug)]
pub(crate) struct Paths {
    pub(crate) rig: PathBuf,
    pub(crate) fit: Vec<PathBuf>,
    pub(crate) holdout: Vec<PathBuf>,
}

/// Writes `rig.toml`, `fit-a.csv`, `fit-b.csv` and `holdout.csv` into `dir`, which is created.
pub(crate) fn write_case(case: &Case, dir: &Path) -> io::Result<Paths> {
    fs::create_dir_all(dir)?;
    let rig = dir.join("rig.toml");
    fs::write(&rig, rig_toml(case))?;
    let names = ["fit-a.csv", "fit-b.csv", "holdout.csv"];
    let mut files = Vec::new();
    for (k, name) in names.iter().enumerate() {
        let path = dir.join(name);
        fs::write(&path, csv(case, k))?;
        files.push(path);
    }
    let holdout = vec![files.pop().expect("three files were pushed")];
    Ok(Paths { rig, fit: files, holdout })
}

fn rig_toml(case: &Case) -> String {
    let (m, n, d) = (&case.machine, &case.nominal, &case.declared);
    let mut out = String::new();
    let kind = if m.rotary { "rotary" } else { "linear" };
    let _ = writeln!(out, "format = 1\nname = \"{}\"\nkind = \"{kind}\"\n\n[model]", m.name);
    let _ = writeln!(out, "inertia = {:e}", n.inertia);
    let mut key = |name: &str, value: Option<f64>| {
        if let Some(value) = value {
            let _ = writeln!(out, "{name} = {value:e}");
        }
    };
    key("viscous", n.viscous);
    key("coulomb", n.coulomb);
    key("offset", n.offset);
    key("weight", n.weight);
    let _ = writeln!(out, "\n[uncertainty]\ninertia = {:.4}\ngain = {:.4}", d.inertia, d.gain);
    let mut sigma = |name: &str, present: bool, value: f64| {
        if present {
            let _ = writeln!(out, "{name} = {value:e}");
        }
    };
    sigma("viscous", n.viscous.is_some(), d.viscous);
    sigma("coulomb", n.coulomb.is_some(), d.coulomb);
    sigma("offset", n.offset.is_some(), d.offset);
    sigma("weight", n.weight.is_some(), d.weight);
    let _ = writeln!(
        out,
        "\n[actuator]\ngain = {:e}\ncommand_unit = \"{}\"\nlimit = {:e}\n\n[encoder]\ncounts_per_unit = {:.6}",
        n.gain, m.command_unit, m.limit, case.plant.counts_per_unit
    );
    if m.turn_told {
        let _ = writeln!(out, "turn = {:.9}", case.plant.turn);
    }
    if let Some(spread) = m.start_spread {
        let _ = writeln!(out, "start_spread = {spread:e}");
    }
    out
}

fn csv(case: &Case, k: usize) -> String {
    let rows: &[Row] = &case.recordings[k];
    let (tilt, reference, force) = (case.machine.tilt, case.with_reference[k], case.with_force);
    let mut out = String::with_capacity(rows.len() * 40);
    out.push_str("time_s,command,position_counts");
    for (present, name) in [(tilt, "tilt_rad"), (reference, "reference_counts"), (force, "force")] {
        if present {
            out.push(',');
            out.push_str(name);
        }
    }
    out.push('\n');
    for row in rows {
        let _ = write!(out, "{:.6},{:.9},{:.0}", row.time, row.command, row.counts);
        if tilt {
            let _ = write!(out, ",{:.4}", row.tilt);
        }
        if reference {
            let _ = write!(out, ",{:.0}", row.reference_counts);
        }
        if force {
            let _ = write!(out, ",{:.6e}", row.force);
        }
        out.push('\n');
    }
    out
}

/// The key as a record of what is hidden: for people who look at examples, never beside the case's files.
pub(crate) fn key(case: &Case) -> Value {
    let truths: Vec<Value> = case
        .truths
        .iter()
        .map(|(name, list)| {
            let values: serde_json::Map<String, Value> =
                list.iter().map(|p| (p.name.clone(), json!(p.value))).collect();
            json!({ "name": name, "parameters": values })
        })
        .collect();
    json!({
        "id": case.spec.id,
        "category": case.spec.category.word(),
        "hidden": case.spec.hidden,
        "strength_wanted": case.spec.strength,
        "strength_alone": case.alone,
        "effect_rms": case.together.effect,
        "noise_rms": case.together.noise,
        "force_rms": case.together.force,
        "moving_share": case.together.moving,
        "machine": case.machine.name,
        "rate_hz": case.machine.rate,
        "recordings": case.kinds.iter().map(|k| format!("{k:?}")).collect::<Vec<_>>(),
        "truth": truths,
        "true_model": {
            "inertia": case.plant.inertia, "viscous": case.plant.viscous, "coulomb": case.plant.dry.coulomb,
            "offset": case.plant.offset, "weight": case.plant.weight, "gain": case.plant.gain,
        },
    })
}
