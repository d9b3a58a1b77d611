//! The effect that a plain selection finds, where nothing else is named although other physics and
//! not noise limits, if the recordings bear it out in the filter's motion too.

use super::assess::Assessment;
use super::by_shares::{class_of, discrepancy, is_foreign, shown, standing};
use super::prepare::Prepared;
use super::search::Found;
use crate::thresholds::{LIMITED_BY_PHYSICS, NAMED_SHARE, SUREST_BESIDE_PHYSICS};
use crate::validation::shares::material::Material;
use crate::validation::shares::select::Selection;

/// The recordings with the effect that a plain selection finds first, where it takes enough to be
/// named; none where noise limits or the other regression cannot see it.
pub(crate) fn by_plain(prepared: &Prepared, found: &Found) -> Option<Found> {
    let first = prepared.plain.found.first().filter(|first| first.share >= NAMED_SHARE)?;
    if discrepancy(prepared, found, &found.null, &found.null.noise) < LIMITED_BY_PHYSICS {
        return None;
    }
    let context = prepared.context(&prepared.fit);
    let selection = Selection::new(&context, prepared.noise, &prepared.holdout.smoothed)?;
    let share = selection.best_of(first.name)?;
    if is_foreign(prepared, found) && selection.is_rather_unnamed(&[&share.effect]) {
        return None;
    }
    let twins = first.name.definition().twins(&share.effect, &shown(prepared, found));
    let class = class_of(first.name, twins, Vec::new());
    let material = Material { name: first.name, share: first.share, class, beside_noise: false };
    Some(standing(prepared, found, vec![share.effect], vec![material], Vec::new()))
}

/// An assessment of what only a plain selection found: less sure, and none where something without
/// a name explains more.
pub(crate) fn by_plain_alone(mut assessment: Assessment) -> Option<Assessment> {
    for one in &mut assessment.weighed.effects {
        one.confidence = one.confidence.min(SUREST_BESIDE_PHYSICS);
    }
    assessment.weighed.resembled().is_none().then_some(assessment)
}
