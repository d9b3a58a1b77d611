//! Diagnosis of the difference between a simulation and recordings: which physics was left out, how
//! sure that is, and the evidence.
//!
//! Given a rig (the nominal simulation) and recordings, [`diagnose`] refits the nominal values,
//! searches the residual for the effects of [`laws::EffectName`], judges them on recordings that
//! were not used for fitting, and reports. This crate knows rigs and recordings; it may not know
//! devices, links or plots of other crates.
//!
//! A diagnosis reads as its folders: `data` (rigs, recordings, the report's shape) is repaired
//! (`repair`: faults of the logs), effects are proposed (`propose`: candidates and their shapes),
//! measured (`evidence`: left-out and held-out stretches), decided on (`decide`: names, confidence
//! and verdict, with every number that decides in `decide/thresholds`) and reported (`report`:
//! sentences, pages and files). `pipeline` alone puts the stages one after another. Below them are
//! `laws` (the effects), `simulation` (a rig run forward) and `fit` (blocks, filter, noise). Each
//! uses only those before it in the order of `tests/behaviour/layout.rs`, which checks this, and
//! that no files use each other in a circle.

// Matrices are read by row and column.
#![allow(clippy::needless_range_loop)]

mod data;
mod decide;
mod evidence;
mod fit;
pub mod laws;
mod pipeline;
mod propose;
mod repair;
pub mod report;
pub mod simulation;

pub use data::error::InputError;
pub use data::{recording, rig};
pub use decide::diagnosis::Series;
pub use evidence::residual_maps::Map;
pub use report::outcome::{Evidence, Made, Outcome};
pub use report::{DataFault, FaultKind, Report, Verdict};

use recording::Recording;
use rig::Rig;
use std::path::PathBuf;

/// The files to diagnose.
#[derive(Debug, Clone, Default)]
pub struct Request {
    /// `rig.toml`.
    pub rig: PathBuf,
    /// Recordings that may be used to choose and to fit.
    pub fit: Vec<PathBuf>,
    /// Recordings that only judge.
    pub holdout: Vec<PathBuf>,
    /// A file of formulas that are searched too.
    pub effects: Option<PathBuf>,
}

/// Reads the files, diagnoses the recordings and reports. `progress` receives the stage and the
/// fraction done.
pub fn diagnose(request: &Request, progress: &(dyn Fn(&str, f64) + Sync)) -> Result<Outcome, InputError> {
    progress("reading", 0.0);
    let (rig, fit, holdout) = read_all(request)?;
    diagnose_recordings(&rig, &fit, &holdout, progress)
}

fn read_all(request: &Request) -> Result<(Rig, Vec<Recording>, Vec<Recording>), InputError> {
    if request.fit.is_empty() || request.holdout.is_empty() {
        return Err(InputError::new("at least one recording to fit and one to hold out are needed"));
    }
    let mut rig = Rig::read(&request.rig)?;
    if let Some(path) = &request.effects {
        let file = path.display().to_string();
        let text = std::fs::read_to_string(path).map_err(|cause| {
            InputError::new(format!("{file}: the effects cannot be read ({cause}); check its path"))
        })?;
        search_effects(&mut rig, &text, &file)?;
    }
    let read =
        |paths: &[PathBuf]| paths.iter().map(|path| Recording::read(path)).collect::<Result<Vec<_>, _>>();
    let (fit, holdout) = (read(&request.fit)?, read(&request.holdout)?);
    data::sets::check(&rig, &fit, &holdout)?;
    Ok((rig, fit, holdout))
}

/// Has a diagnosis of a rig also search the formulas of a file of effects, given by its text and
/// its name in errors.
pub fn search_effects(rig: &mut Rig, text: &str, file: &str) -> Result<(), InputError> {
    rig.searched = laws::read_effects(text, file).map_err(InputError::new)?;
    Ok(())
}

/// The faults of recordings that are seen before any law is searched, as a diagnosis takes them
/// out.
pub fn data_faults(rig: &Rig, fit: &[Recording], holdout: &[Recording]) -> Vec<DataFault> {
    repair::check(rig, fit, holdout).faults
}

/// Reads the files and says what they can and cannot show, a sentence each, before any effect is
/// looked for: rate, resolution, faults of the log, what cannot be distinguished, effects that
/// cannot show and why, and what to record for them. An error where nothing can be learnt from
/// them.
pub fn check(request: &Request) -> Result<Vec<String>, InputError> {
    let (rig, fit, holdout) = read_all(request)?;
    check_recordings(&rig, &fit, &holdout)
}

/// The same of recordings that are already read.
pub fn check_recordings(
    rig: &Rig,
    fit: &[Recording],
    holdout: &[Recording],
) -> Result<Vec<String>, InputError> {
    let checked = repair::check(rig, fit, holdout);
    Ok(report::check::sentences(&pipeline::check(rig, &checked, &|_, _| {})?))
}

/// Diagnoses recordings that are already read; an error where one cannot be used, as where a unit
/// or a sign is wrong.
pub fn diagnose_recordings(
    rig: &Rig,
    fit: &[Recording],
    holdout: &[Recording],
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Outcome, InputError> {
    let checked = repair::check(rig, fit, holdout);
    let (diagnosis, check) = pipeline::run(rig, &checked, progress)?;
    let mut outcome = Outcome::of(diagnosis);
    // Where nothing can be learnt, the verdict says it already.
    outcome.evidence.check = check.as_ref().map(report::check::sentences).unwrap_or_default();
    outcome.report.data_faults = checked.faults;
    progress("done", 1.0);
    Ok(outcome)
}
