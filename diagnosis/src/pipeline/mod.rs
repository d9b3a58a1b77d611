//! The stages of a diagnosis, one after another: this folder alone sequences them.
//!
//! [`prepare`] cuts rig and recordings into blocks and refits the nominal model; [`proposals`] asks
//! the regression and [`search`] adds effects by the filter; `decide::choice` weighs the effects of
//! either and takes one of the two models; `decide::decision` names its effects, or says why
//! nothing is named. Each stage is one function that takes what the one before it returns, and
//! changes none of it. The result is a [`Diagnosis`].

mod prepare;
mod proposals;
mod search;

use crate::data::error::InputError;
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::data::sufficiency;
use crate::decide::choice::assessed;
use crate::decide::decision;
use crate::decide::diagnosis::{Diagnosis, Reason};
use crate::decide::elimination::Found;
use crate::evidence::check::{self, Check};
use crate::evidence::prepared::Prepared;
use crate::fit::{plausibility, skew};
use crate::propose::context::FittedModel;
use crate::repair::Checked;
use regression::Hypothesis;

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
    let (mut prepared, mut rounds, mut found) = proposed(rig, checked, None, progress);
    let check = check::check(rig, checked, &prepared);
    if let Some(rows) = hidden_skew(&prepared, &found) {
        (prepared, rounds, found) = proposed(rig, checked, Some(rows), progress);
    }
    let assessed = assessed(&prepared, found, &rounds);
    progress("writing down", 0.95);
    let rate_hz = all.iter().map(|recording| recording.rate_hz()).min_by(f64::total_cmp);
    let diagnosis = match assessed {
        Ok(assessment) => decision::decide(&prepared, &assessment, &rounds, holdout, rate_hz),
        Err(reason) => Diagnosis::CannotTell { rig: Box::new(prepared.nominal.rig.clone()), reason, rate_hz },
    };
    Ok((diagnosis, Some(check)))
}

/// Recordings prepared with a skew of so many rows, if it is known, and what both proposers find in
/// them.
fn proposed(
    rig: &Rig,
    checked: &Checked,
    skew_rows: Option<f64>,
    progress: Progress,
) -> (Prepared, Vec<Vec<Hypothesis>>, Found) {
    let mut prepared = prepare::prepare(rig, checked, skew_rows, progress);
    progress("comparing shares of the force", 0.12);
    let rounds = proposals::propose(&prepared, checked);
    prepared.unsought = proposals::unsought(&rounds);
    let found = search::search(&prepared, progress);
    (prepared, rounds, found)
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
