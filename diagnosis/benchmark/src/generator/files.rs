//! The files that the tool gets, to the letter of the contract, and the key that it does not get.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::Path;

use super::case::Case;
use super::outside;
use super::simulate::Row;
use super::strength::slowest;
use crate::key::{Category, Key, Oracle};
use crate::tool::Paths;

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
    if m.noise_counts > 0.0 && m.noise_told {
        let _ = writeln!(out, "noise_counts = {:.3}", m.noise_counts);
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
        let _ = write!(out, "{:.6},{:.9},{:.0}", row.stamp, row.command, row.counts);
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

/// The key of the case, as every folder of cases has it.
pub(crate) fn key(case: &Case) -> Key {
    let outside = case.category == Category::Outside;
    let hidden = case.spec.hidden.first();
    let band = case.machine.residual_bandwidth();
    let held = case.held_out(band);
    Key {
        effects: if outside { Vec::new() } else { case.spec.hidden.iter().map(|h| (*h).into()).collect() },
        unknown: hidden.filter(|_| outside).map(|h| (*h).into()),
        detector: outside && hidden.is_some_and(|h| outside::has_detector(h)),
        strength: case.level,
        snr: (case.spec.strength > 0.0).then_some(case.together.effect / case.together.noise),
        poverty: (case.category == Category::CannotTell).then(|| {
            // Poor recordings leave two names; what was asked for and does not show is hidden.
            if case.spec.poor.is_some() { "twin".into() } else { "hidden".into() }
        }),
        rig: format!("{}, {:.0} Hz", case.machine.name, case.machine.rate),
        oracle: Some(Oracle {
            floor: held.noise,
            refit: held.noise.hypot(held.effect),
            filters_hz: [band; 2],
            skip_s: 2.0 / band,
            still_s: still(&case.recordings[2]),
        }),
        parameters: case.truths.clone(),
        true_gain: Some(case.plant.gain),
        true_inertia: Some(case.plant.inertia),
        ..Key::of(case.category)
    }
}

/// Times in which the rows do not move or turn round.
fn still(rows: &[Row]) -> Vec<[f64; 2]> {
    let slowest = slowest(rows);
    let mut list: Vec<[f64; 2]> = Vec::new();
    for pair in rows.windows(2) {
        if pair[0].moving && pair[0].v.abs() > slowest && pair[0].v * pair[1].v > 0.0 {
            continue;
        }
        match list.last_mut().filter(|last| last[1] == pair[0].stamp) {
            Some(last) => last[1] = pair[1].stamp,
            None => list.push([pair[0].stamp, pair[1].stamp]),
        }
    }
    list
}
