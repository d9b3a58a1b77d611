//! What people and files are told: the verdict, what to record next, the patched rig, and the pages. Nothing here fits.

pub(crate) mod conclude;
mod html;
pub(crate) mod next_experiment;
pub(crate) mod outcome;
pub(crate) mod patched_rig;
pub(crate) mod verdict;

pub use crate::io::schema::{
    Both, FitTable, Hypothesis, Named, Parameter, Place, Region, Report, Stretch, Verdict,
};
