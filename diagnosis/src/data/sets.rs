//! Rig and recordings together: what each file allows and the set does not.

use crate::data::error::InputError;
use crate::data::recording::Recording;
use crate::data::rig::Rig;

/// Refuses one recording as fit and holdout, and a key of the rig that has no column to act on.
pub(crate) fn check(rig: &Rig, fit: &[Recording], holdout: &[Recording]) -> Result<(), InputError> {
    for held in holdout {
        if let Some(same) = fit.iter().find(|f| is_same(f, held)) {
            return Err(InputError::new(format!(
                "{} is given to fit and, as {}, to hold out: it would judge what it was fitted to; hold out another recording, or cut it in two with host-sim import --split 0.6",
                same.file, held.file
            )));
        }
    }
    if rig.model.weight.is_some_and(|w| w != 0.0)
        && let Some(without) = fit.iter().chain(holdout).find(|r| r.tilt_rad.is_none())
    {
        return Err(InputError::new(format!(
            "model.weight acts through the tilt and {} has no column tilt_rad; record the tilt, or take weight out of the rig and put what it adds into offset",
            without.file
        )));
    }
    for formula in
        rig.searched.iter().chain(rig.effects.iter().map(|e| &e.name)).filter_map(|name| name.formula())
    {
        if formula.uses("tilt")
            && let Some(without) = fit.iter().chain(holdout).find(|r| r.tilt_rad.is_none())
        {
            return Err(InputError::new(format!(
                "effect {}: formula \"{}\" needs the tilt and {} has no column tilt_rad; record the tilt, or leave the effect out",
                formula.name(),
                formula.text.formula,
                without.file
            )));
        }
    }
    Ok(())
}

fn is_same(a: &Recording, b: &Recording) -> bool {
    a.time_s == b.time_s && a.command == b.command && a.position_counts == b.position_counts
}
