//! The check of the laws that reshape the recorded command.
//!
//! Such a law takes force from the command and so shrinks what is to be explained: where other
//! physics limits, that alone looks like a fit. The motion says how much force is missing. A law
//! stays if the force that it takes, in a regression of its own size, is the missing one, and the
//! search begins again without those that do not.

use super::Progress;
use super::by_shares::Regime;
use super::prepare::Prepared;
use super::search::{Found, search};
use crate::effects::Effect;
use crate::validation::elimination::RejectedHypothesis;
use crate::validation::rejection::Rejection;
use crate::validation::shares::laws::AS_IT_IS;
use crate::validation::shares::select::Selection;

/// Most searches that leave a law out; each leaves out at least one more.
const ROUNDS: usize = 2;

/// Returns what is found without the laws of the command whose force is not the missing one.
pub(super) fn without_wrong_sizes(prepared: &Prepared, mut found: Found, progress: Progress) -> Found {
    let mut excluded = Vec::new();
    for _ in 0..ROUNDS {
        let wrong = wrong_sizes(prepared, &found);
        if wrong.is_empty() {
            break;
        }
        excluded.extend(wrong);
        found = search(prepared, excluded.clone(), progress);
    }
    found
}

/// Returns the laws of the command in the found model that do not have the size that the motion
/// shows, if other physics limits.
fn wrong_sizes(prepared: &Prepared, found: &Found) -> Vec<RejectedHypothesis> {
    let effects = &found.standing.effects;
    if !effects.iter().any(|one| one.effect.name.definition().command_law(&one.effect).is_some())
        || Regime::of(prepared, found) != Regime::Physics
    {
        return Vec::new();
    }
    let context = prepared.context(&prepared.fit);
    let Some(selection) = Selection::new(&context, prepared.noise, &prepared.holdout.smoothed) else {
        return Vec::new();
    };
    let rejected = |place: usize| {
        let others: Vec<&Effect> = effects
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != place)
            .map(|(_, one)| &one.effect)
            .collect();
        let one = &effects[place];
        let (on_fit, on_holdout) = selection.size_of_map(&one.effect, &others)?;
        let is_wrong = [on_fit, on_holdout].iter().any(|size| !(AS_IT_IS.0..=AS_IT_IS.1).contains(size));
        is_wrong.then_some(RejectedHypothesis {
            name: one.effect.name,
            holdout_gain: Some(one.holdout.sum),
            why: Rejection::TakesOtherForce { on_fit, on_holdout },
        })
    };
    (0..effects.len()).filter_map(rejected).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data_faults::Checked;
    use crate::effects::EffectName as N;
    use crate::io::recording::Recording;
    use crate::io::rig::Rig;
    use crate::pipeline::prepare::prepare;

    /// N·m·s².
    const INERTIA: f64 = 0.01;
    /// N·m, on one side.
    const DEADBAND: f64 = 0.02;

    /// An axis that swings with a known motion; its drive's command is `written` of the force that
    /// the motion needs.
    fn recording(phase: f64, written: impl Fn(f64) -> f64) -> Recording {
        let tones = [(3.0, 0.6), (7.1, 0.12), (11.3, 0.05)];
        let angle = |t: f64| tones.iter().map(|(w, a)| a * (w * t + phase * w).sin()).sum::<f64>();
        let force =
            |t: f64| -INERTIA * tones.iter().map(|(w, a)| a * w * w * (w * t + phase * w).sin()).sum::<f64>();
        let time_s: Vec<f64> = (0..8000).map(|row| f64::from(row) * 1e-3).collect();
        Recording {
            file: format!("{phase}.csv"),
            command: time_s.iter().map(|t| written(force(t + 0.5e-3))).collect(),
            position_counts: time_s.iter().map(|t| (angle(*t) * 2e5).round()).collect(),
            time_s,
            ..Recording::default()
        }
    }

    /// The sizes of a deadband of this width on both sides.
    fn sizes(half_width: f64, written: impl Fn(f64) -> f64 + Copy) -> (f64, f64) {
        let mut rig = Rig::of_values(INERTIA, 0.0, 0.0);
        (rig.encoder.counts_per_unit, rig.actuator.gain) = (2e5, 1.0);
        let prepared = prepare(
            &rig,
            &Checked::unchanged(&[recording(0.0, written)], &[recording(1.0, written)]),
            None,
            &|_, _| {},
        );
        let context = prepared.context(&prepared.fit);
        let selection =
            Selection::new(&context, prepared.noise, &prepared.holdout.smoothed).expect("it moves");
        let law = Effect::shaped(N::CommandDeadband, &[("half_width", half_width), ("shift", 1.0)]);
        selection.size_of_map(&law, &[]).expect("it is a law of the command")
    }

    #[test]
    fn a_law_of_the_command_has_the_size_that_the_motion_misses() {
        let with_deadband = |force: f64| force + DEADBAND * force.signum();
        let near =
            |(a, b): (f64, f64), size: f64| (a - size).abs() < 0.15 * size && (b - size).abs() < 0.15 * size;
        assert!(near(sizes(DEADBAND, with_deadband), 1.0), "{:?}", sizes(DEADBAND, with_deadband));
        assert!(
            near(sizes(DEADBAND / 3.0, with_deadband), 3.0),
            "{:?}",
            sizes(DEADBAND / 3.0, with_deadband)
        );
        let (on_fit, on_holdout) = sizes(DEADBAND, |force| force);
        assert!(on_fit.abs() < 0.1 && on_holdout.abs() < 0.1, "nothing is missing: {on_fit}, {on_holdout}");
    }
}
