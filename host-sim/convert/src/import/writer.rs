//! The contract's files: a rig of which the values are still to be filled in, and a CSV for every
//! run.

use super::encoder_resolution::Scale;
use super::role::Role;
use super::rows::Rows;
use super::units::Quantity;
use crate::export::write;
use device_sim::error::Error;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// The known values of the rig.
#[derive(Clone, Debug, Default)]
pub struct RigValues {
    /// kg·m² or kg.
    pub inertia: Option<f64>,
    /// N·m or N per unit of command.
    pub gain: Option<f64>,
}

fn value(x: Option<f64>, unit: &str, what: &str) -> String {
    match x {
        Some(x) => format!("{x:?}              # {unit}"),
        None => format!("nan                # {unit}: fill in {what}"),
    }
}

/// Returns the text of `rig.toml`. Values that no recording gives are `nan`, which `diagnose`
/// refuses until they are filled in.
pub(super) fn rig(name: &str, rows: &Rows, scale: Scale, known: &RigValues) -> String {
    let linear = rows.position == Quantity::Length;
    let (kind, force, mass, length) =
        if linear { ("linear", "N", "kg", "m") } else { ("rotary", "N·m", "kg·m²", "rad") };
    let already_force = matches!((rows.command, linear), (Quantity::Torque, false) | (Quantity::Force, true));
    let gain = known.gain.or(already_force.then_some(1.0));
    let unit = match rows.command {
        Quantity::Plain => "1",
        other => other.unit(),
    };
    let mut out = String::new();
    let _ = write!(
        out,
        "# Written by host-sim import. Fill in what your simulation believes; a term whose key is missing is not in it.\n\
         format = 1\nname = {:?}\nkind = \"{kind}\"{}\n\n[model]\ninertia = {}\n\
         # viscous = 0.0    # {force}·s/{length}\n# coulomb = 0.0    # {force}\n# offset = 0.0     # {force}\n",
        name,
        if rows.position == Quantity::Counts {
            "                # or \"linear\": the recording has counts only"
        } else {
            ""
        },
        value(known.inertia, mass, "what the command moves, at the coordinate")
    );
    if rows.columns.contains_key(&Role::Tilt) {
        let _ = writeln!(out, "# weight = 0.0     # {force}, the load at a tilt of 90°");
    }
    let _ = write!(
        out,
        "\n[uncertainty]      # relative standard deviations of the values above\n\
         inertia = 0.15\nviscous = 0.5\ncoulomb = 0.5\ngain = 0.1\n\n[actuator]\ngain = {}\ncommand_unit = \"{unit}\"\n\
         # limit = 1.0      # the largest |command| that the drive accepts\n\n[encoder]\ncounts_per_unit = {}\n",
        value(gain, &format!("{force} per {unit}"), "the force for one unit of command"),
        value(scale.counts_per_unit, &format!("counts per {length}"), "the encoder's resolution")
    );
    out
}

/// Counts to a thousandth, without zeros that say nothing.
fn count(out: &mut String, x: f64, whole: bool) {
    if whole || x.fract() == 0.0 {
        let _ = write!(out, "{:.0}", x + 0.0);
    } else {
        let _ = write!(out, "{x:.3}");
    }
}

fn csv(run: &Rows, scale: Scale, out: &mut impl std::io::Write) -> std::io::Result<()> {
    let optional: Vec<(Role, &str)> = [
        (Role::Tilt, "tilt_rad"),
        (Role::Reference, "reference_counts"),
        (Role::Force, "force"),
        (Role::Velocity, "velocity"),
    ]
    .into_iter()
    .filter(|(role, _)| run.columns.contains_key(role))
    .collect();
    let mut line = String::from("time_s,command,position_counts");
    for (_, name) in &optional {
        line.push(',');
        line.push_str(name);
    }
    line.push('\n');
    out.write_all(line.as_bytes())?;
    let per = |quantity: Quantity| {
        if quantity == Quantity::Counts { 1.0 } else { scale.counts_per_unit.unwrap_or(1.0) }
    };
    let (of_position, of_reference) = (per(run.position), per(run.reference));
    let (command, position) = (&run.columns[&Role::Command], &run.columns[&Role::Position]);
    for i in 0..run.time.len() {
        line.clear();
        // Tenths of a microsecond; writing to a string does not fail.
        let _ = write!(line, "{:.7},{},", run.time[i], command[i]);
        count(&mut line, position[i] * of_position, scale.whole);
        for (role, _) in &optional {
            line.push(',');
            let x = run.columns[role][i];
            if *role == Role::Reference {
                count(&mut line, x * of_reference, false);
            } else {
                let _ = write!(line, "{x}");
            }
        }
        line.push('\n');
        out.write_all(line.as_bytes())?;
    }
    Ok(())
}

/// Writes every run and, where `rig` has a text, `rig.toml`, into `dir`; the paths of the runs.
pub(super) fn files(
    dir: &Path,
    rig: Option<&str>,
    runs: &[(String, Rows)],
    scale: Scale,
) -> Result<Vec<PathBuf>, Error> {
    std::fs::create_dir_all(dir).map_err(|cause| {
        Error::input(format_args!(
            "{}: the folder cannot be made ({cause}); choose another --out",
            dir.display()
        ))
    })?;
    if let Some(text) = rig {
        write(&dir.join("rig.toml"), |out| out.write_all(text.as_bytes()))?;
    }
    let mut paths = Vec::new();
    for (name, run) in runs {
        let path = dir.join(format!("{name}.csv"));
        write(&path, |out| csv(run, scale, out))?;
        paths.push(path);
    }
    Ok(paths)
}
