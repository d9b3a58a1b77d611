//! The judge's own inverse dynamics: what a rig, refitted or patched, leaves of the force on a
//! recording. It reads the files of the contract (`rig.toml`, recordings, `patched-rig.toml`) and
//! neither the report's numbers nor the tool's code.

mod band;
mod joint;
mod known;
mod laws;
pub(crate) mod motion;
mod patched;
pub(crate) mod recording;
mod residual;
mod rig;
#[cfg(test)]
mod tests;

pub(crate) use residual::JudgeDynamics;
