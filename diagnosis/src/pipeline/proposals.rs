//! The regression's proposals: rig and recordings as it reads them, and no opinion.

use crate::data::recording::Recording;
use crate::data::rig::{Kind, Rig};
use crate::decide::thresholds::FOLLOWS_SHARE;
use crate::evidence::prepared::Prepared;
use crate::fit::skew;
use crate::laws::EffectName;
use crate::repair::Checked;
use regression::laws::{ActsOn, Law};
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

/// The laws of the command that have no size in any round of the regression and take next to
/// nothing of the force error there; none where it found nothing at all. A term with the recorded
/// command in it makes both sides smaller, so likelihood alone finds such laws wherever other
/// physics limits; the regression's columns hold none of it.
pub(crate) fn unsought(rounds: &[Vec<Hypothesis>]) -> Vec<EffectName> {
    let takes = |one: &Hypothesis| one.valid || one.evidence.share >= FOLLOWS_SHARE;
    let is_held = |law: &Law| rounds.iter().flatten().any(|one| one.law == law && takes(one));
    let all = regression::laws::library().filter(|law| law.acts_on == ActsOn::Command && !is_held(law));
    let found = if rounds.is_empty() { Vec::new() } else { all.collect() };
    found.iter().filter_map(|law| EffectName::find(law.key)).collect()
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
    regression::Rig {
        rotary: rig.kind == Kind::Rotary,
        inertia: value(model.inertia, spread.inertia),
        viscous: model.viscous.map(|x| value(x, spread.viscous)),
        coulomb: model.coulomb.map(|x| value(x, spread.coulomb)),
        weight: model.weight.map(|x| value(x, spread.weight)),
        gravity: model.gravity.map(|x| (value(x, spread.gravity), model.gravity_zero.unwrap_or(0.0))),
        has_offset: model.offset.is_some(),
        gain: value(rig.actuator.gain, spread.gain),
        known_delay_s: rig.actuator.delay_s.unwrap_or(0.0) + late_s,
        known_lags_s: rig.actuator.lag_s.into_iter().chain(encoder.filter_s).collect(),
        counts_per_unit: encoder.counts_per_unit,
        absolute: encoder.absolute,
        noise_counts: encoder.noise_counts.unwrap_or(0.0),
        turn: rig.turn(),
        start_spread: encoder.start_spread,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use regression::{Evidence, laws};

    fn of(name: &str, valid: bool, share: f64) -> Hypothesis {
        let evidence = Evidence {
            share,
            z: 3.0,
            size_agreement: 0.9,
            lead_z: 1.0,
            free_form_more: 0.0,
            residual_over_noise: 10.0,
            rows: 1000.0,
            held_out: None,
        };
        let law = laws::library().find(|law| law.key == name).expect("a law of the library");
        Hypothesis { law, shapes: Vec::new(), coefficients: vec![1.0], valid, evidence }
    }

    #[test]
    fn a_law_of_the_command_that_takes_nothing_is_not_sought() {
        assert!(unsought(&[]).is_empty(), "nothing was found at all");
        let delay = of("command_delay", false, 0.04);
        let rounds = [
            vec![of("cogging", true, 0.6), delay, of("supply_limit", true, 0.01)],
            vec![of("command_deadband", false, 0.06)],
        ];
        let left_out = unsought(&rounds);
        assert!(left_out.contains(&EffectName::CommandDelay) && left_out.contains(&EffectName::GainDrift));
        assert!(!left_out.contains(&EffectName::CommandDeadband), "it takes a part in one round");
        assert!(!left_out.contains(&EffectName::SupplyLimit), "it has a size in one round");
        assert!(!left_out.contains(&EffectName::ViscousFriction), "it is of the motion");
    }
}
