//! The files of a characterisation: the nominal rig and a CSV for each recording.

use control_core::TICK_HZ;
use control_core::controller::Sample;
use convert::export::{self, write};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use recording::messages::Hello;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

/// One recording.
#[derive(Clone, Debug)]
pub struct Track {
    /// Name of its file.
    pub file: &'static str,
    /// The device's scale.
    pub hello: Hello,
    /// 10 kHz, without a gap.
    pub samples: Vec<Sample>,
    /// The servo's reference, in counts.
    pub reference: Vec<f64>,
}

/// The nominal rig of a bare device: what the data sheets say, without a needle.
pub fn nominal_rig(hello: &Hello) -> Rig {
    let mut rig = export::rig("the device with no hand on it, nominal", hello);
    // Without a needle nothing hangs on the roller.
    rig.model.inertia = export::mechanism(hello).inertia;
    rig.model.weight = None;
    rig.uncertainty.weight = None;
    rig
}

/// Writes `rig.toml` and the recordings to `dir`; the paths, the rig's first.
pub fn write_all(dir: &Path, tracks: &[Track]) -> Result<Vec<PathBuf>, Error> {
    let Some(first) = tracks.first() else { return Ok(Vec::new()) };
    std::fs::create_dir_all(dir).map_err(|cause| {
        Error::input(format_args!(
            "{}: the folder cannot be made ({cause}); choose another --out",
            dir.display()
        ))
    })?;
    let mut paths = vec![dir.join("rig.toml")];
    let rig = nominal_rig(&first.hello).to_toml();
    write(&paths[0], |out| std::io::Write::write_all(out, rig.as_bytes()))?;
    for track in tracks {
        let path = dir.join(track.file);
        write(&path, |out| csv(track, out))?;
        paths.push(path);
    }
    Ok(paths)
}

fn csv(track: &Track, out: &mut impl std::io::Write) -> std::io::Result<()> {
    const _: () = assert!(TICK_HZ == 10_000, "time is written with four decimals, exactly a tick");
    let middle = i32::from(track.hello.dac().mid_scale());
    out.write_all(b"time_s,command,position_counts,tilt_rad,reference_counts,state\n")?;
    let mut row = String::new();
    for (tick, (sample, reference)) in track.samples.iter().zip(&track.reference).enumerate() {
        row.clear();
        let (seconds, part) = (tick / TICK_HZ as usize, tick % TICK_HZ as usize);
        let command = i32::from(sample.dac) - middle;
        let tilt = f64::from(sample.tilt_mrad) * 1e-3;
        let (count, state) = (sample.count, sample.state);
        // Writing to a string does not fail.
        let _ = writeln!(row, "{seconds}.{part:04},{command},{count},{tilt:.3},{reference:.2},{state}");
        out.write_all(row.as_bytes())?;
    }
    Ok(())
}
