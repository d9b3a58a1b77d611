//! `compensate`: turns what a diagnosis found of a device's own forces into what the device feeds
//! forward (`device-setup`), on a serial port or a virtual device.

pub mod files;
pub mod page;

pub use device_setup::compensate::{
    CompensationOutcome, CompensationStep, Part, Wish, angle, coefficients, residual_force, weight,
};

use crate::commission::bench::Line;
use device_setup::pause::block_on;
use device_sim::error::Error;
use diagnosis::rig::Rig;
use std::path::Path;

/// The rig that a diagnosis' report folder holds.
pub fn read_report(dir: &Path) -> Result<Rig, Error> {
    let path = dir.join("patched-rig.toml");
    if !path.is_file() {
        return Err(Error::input(format_args!(
            "{}: no report of diagnose; give the folder that its --out wrote",
            dir.display()
        )));
    }
    Rig::read(&path).map_err(Error::input)
}

/// Compensates the device behind `line` for what `rig` found; `ask` is called with each step before
/// it is done, and may end it.
pub fn compensate(
    line: &mut dyn Line,
    rig: &Rig,
    wish: Wish,
    mut ask: impl FnMut(CompensationStep) -> Result<(), Error>,
) -> Result<CompensationOutcome, Error> {
    block_on(device_setup::compensate::compensate(line, rig, wish, async |step| ask(step)))
}

/// Finds the rotor's angle again on a device that was compensated and then restarted.
pub fn align(line: &mut dyn Line, rig: &Rig) -> Result<angle::Angle, Error> {
    block_on(device_setup::compensate::align(line, rig))
}
