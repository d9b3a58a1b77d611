//! `--export`: a rig for other simulators.

use device_sim::error::Error;
use diagnosis::report::exports::{Format, export};
use diagnosis::rig::Rig;
use live::say;
use std::path::Path;

/// The formats of `--export`.
pub(super) fn formats(names: &[String]) -> Result<Vec<Format>, Error> {
    let find = |name: &String| {
        Format::find(name).ok_or_else(|| {
            Error::input(format_args!("--export {name}: unknown format; use mjcf, urdf or json"))
        })
    };
    names.iter().map(find).collect()
}

/// Writes a rig in each format into a folder.
pub(super) fn write(rig: &Rig, formats: &[Format], dir: &Path) -> Result<(), Error> {
    for format in formats {
        let path = dir.join(format.file());
        std::fs::write(&path, export(rig, *format)).map_err(|cause| {
            Error::failed(format_args!(
                "{}: cannot be written ({cause}); free some space or choose another --out",
                path.display()
            ))
        })?;
        say!("export: {}", path.display());
    }
    Ok(())
}
