//! The regression's proposals: rig and recordings as it reads them, and no opinion.

use super::prepare::Prepared;
use crate::data_faults::Checked;
use crate::estimation::skew;
use crate::io::recording::Recording;
use crate::io::rig::{Kind, Rig};
use regression::{Hypothesis, Part, Value};

/// The rounds of the regression, each with the best of every law, the chosen one first; none where
/// the recordings are too short for it, or where the rig holds effects already: the regression
/// knows the nominal structure alone.
pub(crate) fn propose(prepared: &Prepared, checked: &Checked) -> Vec<Vec<Hypothesis>> {
    if !prepared.given.effects.is_empty() {
        return Vec::new();
    }
    let late_s = prepared.nominal.skew_rows.map_or(0.0, |rows| rows * skew::row_s(&prepared.fit[0]));
    let part = |all: &[Recording], part| all.iter().map(move |one| plain(one, part)).collect::<Vec<_>>();
    let mut recordings = part(&checked.fit, Part::Fit);
    recordings.extend(part(&checked.holdout, Part::Holdout));
    regression::propose(&nominal(&prepared.given, late_s), &recordings)
        .map_or_else(|_| Vec::new(), |found| found.rounds)
}

fn plain(r: &Recording, part: Part) -> regression::Recording {
    regression::Recording {
        part,
        time_s: r.time_s.clone(),
        command: r.command.clone(),
        position_counts: r.position_counts.clone(),
        tilt_rad: r.tilt_rad.clone(),
        load: r.force.clone(),
    }
}

/// The nominal simulation; commands act `late_s` after their time stamps, s.
fn nominal(rig: &Rig, late_s: f64) -> regression::Rig {
    let (model, encoder, spread) = (&rig.model, &rig.encoder, &rig.uncertainty);
    let value = |nominal: f64, spread: Option<f64>| Value { nominal, spread };
    let known = [rig.actuator.delay_s, rig.actuator.lag_s, encoder.filter_s];
    regression::Rig {
        rotary: rig.kind == Kind::Rotary,
        inertia: value(model.inertia, spread.inertia),
        viscous: model.viscous.map(|x| value(x, spread.viscous)),
        coulomb: model.coulomb.map(|x| value(x, spread.coulomb)),
        weight: model.weight.map(|x| value(x, spread.weight)),
        gravity: model.gravity.map(|x| (value(x, spread.gravity), model.gravity_zero.unwrap_or(0.0))),
        has_offset: model.offset.is_some(),
        gain: value(rig.actuator.gain, spread.gain),
        known_delay_s: known.into_iter().flatten().sum::<f64>() + late_s,
        counts_per_unit: encoder.counts_per_unit,
        absolute: encoder.absolute,
        noise_counts: encoder.noise_counts.unwrap_or(0.0),
        turn: rig.turn(),
        start_spread: encoder.start_spread,
    }
}
