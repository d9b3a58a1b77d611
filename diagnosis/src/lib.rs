//! Where a simulation and a recording differ, which physics was left out, how sure that is, and the proof.
//!
//! Given a rig (the nominal simulation) and recordings, [`diagnose`] refits the nominal values, looks for the effects of
//! [`effects::EffectName`] in what remains, judges them on recordings that were not used for fitting, and reports.
//! This crate knows rigs and recordings; it may not know devices, links or plots of other crates.
//!
//! Order of the stages, one module each: [`recording`], [`rig`] and `check` (read and check), `track` (blocks), `kalman`
//! and `noise` (innovations, smoother), `model`, `solve` and `fit` (the linear fit), `null` (the refit), `library`,
//! `screen`, `periodic`, `descend`, `select` and `pipeline` (name), `judge`, `known` and `found` (held-out recordings),
//! `locate` and `excitation` (where, and what cannot be told), `rivals`, `foreign`, `weigh` and `confidence` (how sure),
//! `residuals`, `shown`, `verdict`, `conclude`, `patch`, `values` and `prescribe` (what follows), `outcome` and `html`
//! (what people read).

// Matrices are read by row and column.
#![allow(clippy::needless_range_loop)]

mod check;
mod conclude;
mod confidence;
mod descend;
pub mod effects;
mod error;
mod estimate;
mod excitation;
mod fit;
mod foreign;
mod found;
mod html;
mod inputs;
mod joint;
mod judge;
mod kalman;
mod known;
mod library;
mod locate;
mod model;
mod noise;
mod null;
mod outcome;
mod patch;
mod periodic;
mod pipeline;
mod prescribe;
pub mod recording;
pub mod report;
mod residuals;
pub mod rig;
mod rivals;
mod screen;
mod select;
mod shown;
mod slices;
mod solve;
mod steps;
mod track;
mod unnamed;
mod values;
mod verdict;
mod weigh;

pub use error::InputError;
pub use locate::Map;
pub use outcome::{Evidence, Outcome, Series};
pub use report::{Report, Verdict};

use recording::Recording;
use rig::Rig;
use std::path::PathBuf;

/// What to diagnose.
#[derive(Debug, Clone)]
pub struct Request {
    /// `rig.toml`.
    pub rig: PathBuf,
    /// Recordings that may be used to choose and to fit.
    pub fit: Vec<PathBuf>,
    /// Recordings that only judge.
    pub holdout: Vec<PathBuf>,
}

/// Reads, diagnoses and concludes. `progress` hears the stage and the fraction done.
pub fn diagnose(request: &Request, progress: &(dyn Fn(&str, f64) + Sync)) -> Result<Outcome, InputError> {
    progress("reading", 0.0);
    if request.fit.is_empty() || request.holdout.is_empty() {
        return Err(InputError::new("at least one recording to fit and one to hold out are needed"));
    }
    let rig = Rig::read(&request.rig)?;
    let read =
        |paths: &[PathBuf]| paths.iter().map(|path| Recording::read(path)).collect::<Result<Vec<_>, _>>();
    diagnose_recordings(&rig, &read(&request.fit)?, &read(&request.holdout)?, progress)
}

/// The same for a rig and recordings that are already read.
pub fn diagnose_recordings(
    rig: &Rig,
    fit: &[Recording],
    holdout: &[Recording],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Outcome, InputError> {
    if let Some(reason) = fit.iter().chain(holdout).find_map(|r| check::too_little(r, rig)) {
        return Ok(Outcome::cannot_tell(rig, reason));
    }
    let search = pipeline::search(rig, fit, holdout, progress)?;
    progress("writing down", 0.95);
    let outcome = conclude::conclude(search);
    progress("done", 1.0);
    Ok(outcome)
}
