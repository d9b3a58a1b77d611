//! The stages of a diagnosis, one after another: this folder alone sequences them.
//!
//! [`prepare`] cuts rig and recordings into blocks and refits the nominal model; [`search`] adds and removes effects; [`assess`]
//! weighs those that stand; [`decide`] names them, or says why nothing is named. Each stage is one function that takes what the
//! one before it returns, and changes none of it. What comes out is a [`diagnosis::Diagnosis`].

mod assess;
mod decide;
pub(crate) mod diagnosis;
mod patched_rig;
mod prepare;
mod run_forward;
mod search;
mod verdict;

use crate::estimation::plausibility;
use crate::io::recording::Recording;
use crate::io::rig::Rig;
use crate::io::sufficiency;
use diagnosis::{Diagnosis, Reason};

/// A callback that receives the stage and the fraction done.
pub(crate) type Progress<'a> = &'a (dyn Fn(&str, f64) + Sync);

/// Diagnoses recordings of a rig.
pub(crate) fn run(rig: &Rig, fit: &[Recording], holdout: &[Recording], progress: Progress) -> Diagnosis {
    let all: Vec<&Recording> = fit.iter().chain(holdout).collect();
    let mistake = plausibility::mistakes(&all, rig).or_else(|| sufficiency::too_little(fit, holdout, rig));
    if let Some(sentence) = mistake {
        let reason = Reason::Recordings(sentence);
        return Diagnosis::CannotTell { rig: Box::new(rig.clone()), reason, rate_hz: None };
    }
    let prepared = prepare::prepare(rig, fit, holdout, progress);
    let found = search::search(&prepared, progress);
    progress("writing down", 0.95);
    let rate_hz = all.iter().map(|recording| recording.rate_hz()).min_by(f64::total_cmp);
    match assess::assess(&prepared, found) {
        Ok(assessment) => decide::decide(&prepared, &assessment, holdout, rate_hz),
        Err(reason) => Diagnosis::CannotTell { rig: Box::new(prepared.nominal.rig.clone()), reason, rate_hz },
    }
}
