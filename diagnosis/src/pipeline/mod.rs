//! The stages of a diagnosis, one after another: this folder alone sequences them.
//!
//! [`prepare`] cuts rig and recordings into blocks and refits the nominal model; [`search`] adds
//! and removes effects by the filter, [`proposals`] asks the regression and [`by_regression`]
//! fits what that names; [`assess`] weighs the effects of either; [`decide`] names those of one of
//! them, or says why nothing is named. Each stage is one function that takes what the one before it
//! returns, and changes none of it. The result is a [`diagnosis::Diagnosis`].

mod assess;
mod by_regression;
pub(crate) mod check;
mod contenders;
mod decide;
pub(crate) mod decisive;
pub(crate) mod diagnosis;
mod evidence;
pub(crate) mod evidence_table;
mod law_band;
mod patched_rig;
mod prepare;
mod proposals;
mod run_forward;
mod search;
mod verdict;

use crate::data::error::InputError;
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::data::sufficiency;
use crate::evidence::residuals::above;
use crate::fit::{plausibility, skew};
use crate::propose::context::FittedModel;
use crate::repair::Checked;
use crate::thresholds::CLEARLY_LESS;
use assess::Assessment;
use by_regression::by_regression;
use check::Check;
use diagnosis::{Diagnosis, Reason};
use prepare::Prepared;
use regression::Hypothesis;
use search::Found;

/// A callback that receives the stage and the fraction done.
pub(crate) type Progress<'a> = &'a (dyn Fn(&str, f64) + Sync);

/// The reason why nothing can be learnt from recordings: one of them cannot be used at all, or they
/// show too little.
enum Unusable {
    Refused(String),
    TooLittle(String),
}

fn unusable_or_too_little(rig: &Rig, checked: &Checked) -> Option<Unusable> {
    let all: Vec<&Recording> = checked.fit.iter().chain(&*checked.holdout).collect();
    let too_little = || {
        let sentence = checked.too_slow.clone();
        sentence.or_else(|| sufficiency::too_little(&checked.fit, &checked.holdout))
    };
    unusable(&all, rig).map(Unusable::Refused).or_else(|| too_little().map(Unusable::TooLittle))
}

/// Says what recordings can and cannot show; an error where nothing can be learnt from them.
pub(crate) fn check(rig: &Rig, checked: &Checked, progress: Progress) -> Result<Check, InputError> {
    match unusable_or_too_little(rig, checked) {
        Some(Unusable::Refused(sentence) | Unusable::TooLittle(sentence)) => Err(InputError::new(sentence)),
        None => Ok(check::check(rig, checked, &prepare::prepare(rig, checked, None, progress))),
    }
}

/// Diagnoses recordings of a rig, and says what they can show where they show something; an error
/// where one of them cannot be used at all.
pub(crate) fn run(
    rig: &Rig,
    checked: &Checked,
    progress: Progress,
) -> Result<(Diagnosis, Option<Check>), InputError> {
    match unusable_or_too_little(rig, checked) {
        Some(Unusable::Refused(sentence)) => return Err(InputError::new(sentence)),
        Some(Unusable::TooLittle(sentence)) => {
            let reason = Reason::Recordings(sentence);
            return Ok((Diagnosis::CannotTell { rig: Box::new(rig.clone()), reason, rate_hz: None }, None));
        }
        None => {}
    }
    let (fit, holdout) = (&*checked.fit, &*checked.holdout);
    let all: Vec<&Recording> = fit.iter().chain(holdout).collect();
    let proposed = |skew_rows| {
        let mut prepared = prepare::prepare(rig, checked, skew_rows, progress);
        progress("comparing shares of the force", 0.12);
        let rounds = proposals::propose(&prepared, checked);
        prepared.unsought = proposals::unsought(&rounds);
        let found = search::search(&prepared, progress);
        (prepared, rounds, found)
    };
    let (mut prepared, mut rounds, mut found) = proposed(None);
    let check = check::check(rig, checked, &prepared);
    if let Some(rows) = hidden_skew(&prepared, &found) {
        (prepared, rounds, found) = proposed(Some(rows));
    }
    let assessed = assessed(&prepared, found, &rounds);
    progress("writing down", 0.95);
    let rate_hz = all.iter().map(|recording| recording.rate_hz()).min_by(f64::total_cmp);
    let diagnosis = match assessed {
        Ok(assessment) => decide::decide(&prepared, &assessment, &rounds, holdout, rate_hz),
        Err(reason) => Diagnosis::CannotTell { rig: Box::new(prepared.nominal.rig.clone()), reason, rate_hz },
    };
    Ok((diagnosis, Some(check)))
}

/// The skew between command and reading, in rows, that only shows once the effects that were found
/// are in the model, or that one of them represents.
fn hidden_skew(prepared: &Prepared, found: &Found) -> Option<f64> {
    if prepared.nominal.virtual_inertia > 0.0 {
        return None;
    }
    let FittedModel { model, noise, .. } = &found.standing.model;
    skew::hidden(model, &prepared.nominal, &found.fit, noise, prepared.scale)
}

/// Assesses what the regression names and what the filter found, and takes one of the two.
fn assessed(prepared: &Prepared, found: Found, rounds: &[Vec<Hypothesis>]) -> Result<Assessment, Reason> {
    let by_regression = by_regression(prepared, &found, rounds);
    let by_regression = by_regression.and_then(|found| assess::assess(prepared, found).ok());
    let by_filter = assess::assess(prepared, found);
    let by_regression = by_regression.filter(|one| !one.weighed.named().is_empty() && lowers_error(one));
    match (by_regression, by_filter) {
        (Some(one), Ok(other)) if !is_taken(&one, &other) => Ok(other),
        (Some(mut one), Ok(other)) => {
            one.weighed.is_beside(&other.weighed);
            Ok(one)
        }
        (Some(one), Err(_)) => Ok(one),
        (None, by_filter) => by_filter,
    }
}

/// True if the model of the regression's names is taken and not what the filter found: it is unless
/// the other leaves clearly less of the force error of the fitted recordings, above the noise of
/// reading whole counts. Held-out recordings choose nothing.
fn is_taken(by_regression: &Assessment, by_filter: &Assessment) -> bool {
    let left = |one: &Assessment| {
        let table = one.table();
        let above_noise = |rms: f64| above(rms, one.weighed.floor, 0.0);
        above_noise(table.patched.fit) / above_noise(table.refit.fit).max(1e-300)
    };
    match &by_filter.foreign {
        // Physics without a name that is sure is kept where it leaves as little.
        Some(foreign) => 1.0 - foreign.share >= left(by_regression),
        None if by_filter.weighed.named().is_empty() => true,
        None => left(by_filter) >= CLEARLY_LESS.powi(2) * left(by_regression),
    }
}

/// True if the named effects together take a material part off the held-out force error.
fn lowers_error(one: &Assessment) -> bool {
    assess::is_material(one.table())
}

/// Why a recording cannot be used, as where a unit or a sign is wrong, with those that still could;
/// none where all can.
fn unusable(all: &[&Recording], rig: &Rig) -> Option<String> {
    let wrong = |recording: &&&Recording| {
        plausibility::mistake(recording, rig).or_else(|| sufficiency::unusable(recording, rig))
    };
    let (mut first, mut usable) = (None, Vec::new());
    for recording in all {
        match wrong(&recording) {
            Some(sentence) => first = first.or(Some(sentence)),
            None => usable.push(recording.file.as_str()),
        }
    }
    // A mistake that every recording shows leaves none to be used.
    if let Some(sentence) = plausibility::unit_of_angle(all, rig).filter(|_| first.is_none()) {
        return Some(sentence);
    }
    let odd = || {
        let (place, sentence) = plausibility::odd_one(all, rig)?;
        usable.remove(place);
        Some(sentence)
    };
    first.or_else(odd).map(|sentence| sufficiency::with_usable(sentence, &usable))
}
