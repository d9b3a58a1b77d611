//! From a recording to what the diagnosis reads: `rig.toml` and a CSV file for every stretch
//! without a gap. The command is the converter's code less its mid-scale, so that `gain · command`
//! is the motor's torque.

use control_core::TICK_HZ;
use device_sim::error::Error;
use device_sim::plant::{GRAVITY, PlantConfig};
use diagnosis::rig::{Actuator, Encoder, Kind, Model, Rig, Uncertainty};
use recording::messages::Hello;
use recording::read::Recording;
use recording::stretches::{Stretch, stretches};
use std::fmt::Write as _;
use std::io::{BufWriter, Write as _};
use std::path::{Path, PathBuf};

/// The files that were written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Exported {
    /// The rig file.
    pub rig: PathBuf,
    /// A file for every stretch, with its number of rows.
    pub recordings: Vec<(PathBuf, usize)>,
}

fn counts_per_turn(hello: &Hello) -> f64 {
    std::f64::consts::TAU * hello.roller_radius_mm / hello.mm_per_count
}

/// Returns the parameters of the mechanism behind `hello`, as its data sheets give them.
pub fn mechanism(hello: &Hello) -> PlantConfig {
    // The plant takes the encoder's resolution as a whole number.
    let counts = counts_per_turn(hello).round() as u16;
    PlantConfig::new(hello.roller_radius_mm * 1e-3, counts, hello.full_scale_torque_mnm * 1e-3)
}

/// The nominal simulation of the mechanism behind `hello`, as its data sheets have it.
pub fn rig(name: &str, hello: &Hello) -> Rig {
    let radius = hello.roller_radius_mm * 1e-3;
    let counts_per_turn = counts_per_turn(hello);
    let full_scale = hello.full_scale_torque_mnm * 1e-3;
    let plant = mechanism(hello);
    let span = f64::from(hello.dac().span());
    Rig {
        format: 1,
        name: name.to_owned(),
        kind: Kind::Rotary,
        model: Model {
            inertia: plant.inertia + plant.needle_mass * radius * radius,
            viscous: Some(plant.bearing.viscous),
            coulomb: Some(plant.bearing.coulomb),
            offset: None,
            weight: Some(plant.needle_mass * GRAVITY * radius),
            ..Model::default()
        },
        uncertainty: Uncertainty {
            inertia: Some(0.15),
            viscous: Some(0.5),
            coulomb: Some(0.5),
            offset: None,
            weight: Some(0.1),
            gain: Some(0.1),
            ..Uncertainty::default()
        },
        actuator: Actuator {
            gain: full_scale / span,
            command_unit: "dac".into(),
            limit: Some(span),
            ..Actuator::default()
        },
        encoder: Encoder {
            counts_per_unit: counts_per_turn / std::f64::consts::TAU,
            turn: Some(std::f64::consts::TAU),
            ..Encoder::default()
        },
        effects: Vec::new(),
        searched: Vec::new(),
    }
}

/// Writes `rig.toml` and the CSV files to `dir`, which is made where it is missing.
pub fn export(recording: &Recording, dir: &Path) -> Result<Exported, Error> {
    let stretches = stretches(recording);
    let Some(first) = stretches.iter().find(|s| s.samples.len() > 1) else {
        return Err(Error::input(format_args!("{}: has no samples to export", recording.file)));
    };
    std::fs::create_dir_all(dir).map_err(|cause| {
        Error::input(format_args!(
            "{}: the folder cannot be made ({cause}); choose another --out",
            dir.display()
        ))
    })?;
    let rig_path = dir.join("rig.toml");
    let name = format!("{}, recorded with a hand on the needle", recording.setup.source);
    write(&rig_path, |out| out.write_all(rig(&name, &first.hello).to_toml().as_bytes()))?;
    let mut recordings = Vec::new();
    let several = stretches.len() > 1;
    for (index, stretch) in stretches.iter().enumerate() {
        let file = if several { format!("recording-{}.csv", index + 1) } else { "recording.csv".into() };
        let path = dir.join(file);
        write(&path, |out| csv(stretch, out))?;
        recordings.push((path, stretch.samples.len()));
    }
    Ok(Exported { rig: rig_path, recordings })
}

/// Writes a file by `fill`, whole or not at all; an error names its path.
pub fn write(
    path: &Path,
    fill: impl FnOnce(&mut BufWriter<std::fs::File>) -> std::io::Result<()>,
) -> Result<(), Error> {
    let half = path.with_file_name(format!(".{}.part", path.file_name().unwrap_or_default().display()));
    let written = std::fs::File::create(&half).and_then(|file| {
        let mut out = BufWriter::new(file);
        fill(&mut out)?;
        out.into_inner().map_err(std::io::IntoInnerError::into_error)?.sync_all()?;
        std::fs::rename(&half, path)
    });
    written.map_err(|cause| {
        // What was written of it serves nobody.
        let _ = std::fs::remove_file(&half);
        Error::failed(format_args!(
            "{}: cannot be written ({cause}); free some space or choose another --out",
            path.display()
        ))
    })
}

fn csv(stretch: &Stretch, out: &mut impl std::io::Write) -> std::io::Result<()> {
    const _: () = assert!(TICK_HZ == 10_000, "time is written with four decimals, exactly a tick");
    let middle = i32::from(stretch.hello.dac().mid_scale());
    out.write_all(b"time_s,command,position_counts,tilt_rad,state\n")?;
    let mut row = String::new();
    for (tick, sample) in stretch.samples.iter().enumerate() {
        row.clear();
        let (seconds, part) = (tick / TICK_HZ as usize, tick % TICK_HZ as usize);
        let command = i32::from(sample.dac) - middle;
        let tilt = f64::from(sample.tilt_mrad) * 1e-3;
        // Writing to a string does not fail.
        let _ = writeln!(row, "{seconds}.{part:04},{command},{},{tilt:.3},{}", sample.count, sample.state);
        out.write_all(row.as_bytes())?;
    }
    Ok(())
}
