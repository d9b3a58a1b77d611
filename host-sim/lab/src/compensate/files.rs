//! The files that a compensation leaves: a page, and the device's part of the configuration.

use super::{CompensationOutcome, page};
use device_sim::device::device_config;
use device_sim::error::Error;
use std::path::{Path, PathBuf};

/// Writes `compensation.html` and `device.toml` of the device called `device` to a folder, which is
/// made; returns their paths.
///
/// # Errors
/// A sentence if they cannot be written.
pub fn write(folder: &Path, device: &str, outcome: &CompensationOutcome) -> Result<Vec<PathBuf>, Error> {
    let refuse = |cause: std::io::Error| {
        Error::input(format_args!(
            "{}: cannot be written ({cause}); the device keeps its compensation; choose another --out",
            folder.display()
        ))
    };
    std::fs::create_dir_all(folder).map_err(refuse)?;
    let device = device_config::to_toml(device, &outcome.record)?;
    let mut written = Vec::new();
    for (file, text) in [("compensation.html", page::html(outcome)), ("device.toml", device)] {
        let path = folder.join(file);
        std::fs::write(&path, text).map_err(refuse)?;
        written.push(path);
    }
    Ok(written)
}
