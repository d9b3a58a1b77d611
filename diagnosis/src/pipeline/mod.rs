//! The stages of a diagnosis, one after another: this folder alone sequences them.
//!
//! [`prepare`] cuts rig and recordings into blocks and refits the nominal model; [`search`] adds
//! and removes effects, [`reshaped_command`] those that only shrink the command; [`by_shares`]
//! selects them by shares of the force error where other physics and not noise limits; [`assess`]
//! weighs those that remain; [`decide`] names them, or says why nothing is named. Each stage is one
//! function that takes what the one before it returns, and changes none of it. The result is a
//! [`diagnosis::Diagnosis`].

mod assess;
mod by_plain;
mod by_shares;
mod contenders;
mod decide;
pub(crate) mod diagnosis;
mod patched_rig;
mod prepare;
mod reshaped_command;
mod run_forward;
mod search;
mod verdict;

use crate::data_faults::Checked;
use crate::estimation::{plausibility, skew};
use crate::io::error::InputError;
use crate::io::recording::Recording;
use crate::io::rig::Rig;
use crate::io::sufficiency;
use crate::selection::context::FittedModel;
use assess::Assessment;
use by_plain::{by_plain, by_plain_alone};
use by_shares::{ByShares, by_shares, confirmed};
use diagnosis::{Diagnosis, Reason};
use prepare::Prepared;
use reshaped_command::without_wrong_sizes;
use search::Found;

/// A callback that receives the stage and the fraction done.
pub(crate) type Progress<'a> = &'a (dyn Fn(&str, f64) + Sync);

/// Diagnoses recordings of a rig; an error where one of them cannot be used at all.
pub(crate) fn run(rig: &Rig, checked: &Checked, progress: Progress) -> Result<Diagnosis, InputError> {
    let (fit, holdout) = (&*checked.fit, &*checked.holdout);
    let all: Vec<&Recording> = fit.iter().chain(holdout).collect();
    if let Some(sentence) = unusable(&all, rig) {
        return Err(InputError::new(sentence));
    }
    if let Some(sentence) = checked.too_slow.clone().or_else(|| sufficiency::too_little(fit, holdout)) {
        let reason = Reason::Recordings(sentence);
        return Ok(Diagnosis::CannotTell { rig: Box::new(rig.clone()), reason, rate_hz: None });
    }
    let mut prepared = prepare::prepare(rig, checked, None, progress);
    let mut found = search::search(&prepared, Vec::new(), progress);
    if let Some(rows) = hidden_skew(&prepared, &found) {
        prepared = prepare::prepare(rig, checked, Some(rows), progress);
        found = search::search(&prepared, Vec::new(), progress);
    }
    let found = without_wrong_sizes(&prepared, found, progress);
    progress("comparing shares of the force", 0.9);
    let assessed = assessed(&prepared, found);
    progress("writing down", 0.95);
    let rate_hz = all.iter().map(|recording| recording.rate_hz()).min_by(f64::total_cmp);
    Ok(match assessed {
        Ok(assessment) => decide::decide(&prepared, &assessment, holdout, rate_hz),
        Err(reason) => Diagnosis::CannotTell { rig: Box::new(prepared.nominal.rig.clone()), reason, rate_hz },
    })
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

/// Assesses what was found; where nothing is named, what a plain selection found.
fn assessed(prepared: &Prepared, found: Found) -> Result<Assessment, Reason> {
    let by_plain = by_plain(prepared, &found);
    let assessed = assessed_as_found(prepared, found);
    match by_plain {
        Some(plain) if assessed.as_ref().is_ok_and(|one| one.weighed.named().is_empty()) => {
            let plain = by_selected(prepared, plain, None).and_then(by_plain_alone);
            plain.map_or(assessed, Ok)
        }
        _ => assessed,
    }
}

/// Assesses what was found, by shares of the force error where other physics limits; where those
/// name nothing in the end, likelihoods decide as elsewhere.
fn assessed_as_found(prepared: &Prepared, found: Found) -> Result<Assessment, Reason> {
    match by_shares(prepared, &found) {
        ByShares::Nothing => assess::assess(prepared, found),
        ByShares::Confirmed(materials) => assess::assess(prepared, confirmed(found, materials)),
        ByShares::Selected { with, alone } => {
            by_selected(prepared, *with, alone).map_or_else(|| assess::assess(prepared, found), Ok)
        }
    }
}

/// The assessment of what shares selected, `with` what they cannot judge or `alone`, whichever has
/// more of it named; none where nothing is named or what is named lowers no error.
fn by_selected(prepared: &Prepared, with: Found, alone: Option<Box<Found>>) -> Option<Assessment> {
    let all = with.standing.materials.len();
    let assessed = |found| assess::assess(prepared, found).ok();
    let named = |one: &Assessment| {
        let is_selected = |i: &&usize| one.weighed.effects[**i].found.material.is_some();
        one.weighed.named().iter().filter(is_selected).count()
    };
    let with = assessed(with);
    // An effect that a regression cannot judge may occupy the position of a selected one.
    let is_short = with.as_ref().is_none_or(|one| named(one) < all);
    let alone = alone.filter(|_| is_short).and_then(|alone| assessed(*alone));
    let best = match (with, alone) {
        (Some(with), Some(alone)) if named(&alone) > named(&with) => Some(alone),
        (with, alone) => with.or(alone),
    };
    best.filter(|one| !one.weighed.named().is_empty() && lowers_error(one))
}

/// True if the named effects together take a material part off the held-out force error.
fn lowers_error(one: &Assessment) -> bool {
    assess::is_material(&one.named_alone.as_ref().unwrap_or(&one.weighed.shown).table)
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
