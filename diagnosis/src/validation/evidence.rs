//! An effect as it came through the search, and what speaks for it on fitted and on held-out recordings. Nothing here fits
//! noise or chooses between effects.

use crate::effects::{Effect, EffectName};
use crate::estimation::blocked_recording::{BlockedRecording, Total};
use crate::estimation::filter::Noise;
use crate::estimation::fit::Fit;
use crate::estimation::force_residual::Estimator;
use crate::estimation::model::{Key, Model, Nominal};
use crate::numerics::bootstrap::{Gain, bootstrap};
use crate::selection::candidates;
use crate::selection::periodic;
use crate::selection::predictive::left_out_costs;
use crate::selection::search::{FitContext, FittedModel};
use crate::validation::holdout::{self, HoldoutFit};
use crate::validation::known_travel::known;
use crate::validation::parameters;
use crate::validation::residuals::{above, forces, relative_gain};
use crate::validation::sizes::{played, sizes_on};
use std::ops::Range;

/// An effect as it came through the search, before it is judged.
#[derive(Clone)]
pub(crate) struct EffectEvidence {
    pub(crate) effect: Effect,
    /// Others fitted in its place; none before they are.
    pub(crate) rivals: Vec<Rival>,
    /// Held-out gain of the full model over the model without it.
    pub(crate) holdout: Gain,
    /// The same on blocks of the fitted recordings that were left out of its fit.
    pub(crate) fit: Gain,
    /// How much less force it leaves on held-out recordings, over the square of what is left.
    pub(crate) force: Gain,
    /// Part of the refit's residual above the sensor's noise that it explains, on fitted or on held-out recordings.
    pub(crate) share: f64,
    /// Whether one of its values stands at the end of what is possible.
    pub(crate) at_bound: bool,
    /// Whether its waves, if it has any, are those of teeth or poles.
    pub(crate) is_comb: bool,
    /// Size that it would have on each recording that plays it, over the size that it has on all, fitted ones first; none
    /// where no fitted or no held-out one does.
    pub(crate) sizes: Vec<f64>,
}

/// Part of the refit's residual above the noise that an effect must explain to be named.
const SHARE: f64 = 0.05;
/// Part of a refit's mean square that counts as above the noise at the least: how much of it the noise is, is itself unsure.
const LEAST_EXPLAINABLE: f64 = 0.2;
/// Below this part it must also stand out by [`CERTAIN`]: the form of a larger effect is never quite right.
const FAIR_SHARE: f64 = 0.1;
/// What explains this part is most of what was left out, and this many standard errors are sure.
const MOST_SHARE: f64 = 0.5;
const SURE: f64 = 3.0;
/// Least part of what is hardly sure: a bias that wanders looks like many a small effect for as long as two recordings last.
const UNSURE_SHARE: f64 = 0.7;
/// Standard errors on the fitted recordings of what may carry beside another.
const PROMISING: f64 = 2.5;
/// What explains this part, and takes half of the held-out mean square with it, may rest on few moments there: counts are
/// lost now and then.
const NEARLY_ALL: f64 = 0.9;
const HALF: f64 = 0.5;
/// Part of a gain that is nothing.
const LITTLE: f64 = 0.05;
/// Factors on an effect that are the same size.
const SAME_SIZE: Range<f64> = 0.75..1.33;
const HARDLY_ANOTHER_SIZE: Range<f64> = 0.85..1.18;
/// What a dry friction may gain with time, as parts of what it is at first.
const DRIFT: Range<f64> = -0.95..3.0;
/// Least part where its gain is this many standard errors on fitted and on held-out recordings, however counted.
const LEAST_SHARE: f64 = 0.01;
const CERTAIN: f64 = 6.0;

impl EffectEvidence {
    /// Whether it stands out of every stretch of the held-out recordings and surely of the others, however little it explains
    /// beside larger effects.
    pub(crate) fn is_certain(&self) -> bool {
        self.holdout.z.min(self.holdout.clipped_z).min(self.fit.z.max(self.fit.clipped_z)) >= CERTAIN
    }

    /// Standard errors of its gain on fitted or on held-out recordings, whichever are fewer.
    pub(crate) fn least_z(&self) -> f64 {
        self.holdout.z.max(self.holdout.clipped_z).min(self.fit.z.max(self.fit.clipped_z))
    }

    /// Whether its gain is sure on fitted and on held-out recordings, with or without a limit on what a stretch counts.
    fn stands_out(&self) -> bool {
        self.least_z() >= CERTAIN
    }

    /// Whether it carries to the held-out recordings: by likelihood, or, where it is most of what was left out, by the force
    /// that it leaves and the same size as on the fitted ones. Next to reversals a law of slightly another form may be less
    /// likely at many blocks and yet leave a third of the force.
    fn generalises(&self) -> bool {
        let likely = self.holdout.low > 0.0
            && self.holdout.z.max(self.holdout.clipped_z) >= 2.0
            && (self.least_z() >= SURE || self.share >= UNSURE_SHARE || self.comes_in_events());
        let takes_most = self.force.low > 0.0 && self.share >= MOST_SHARE;
        let takes_all = self.takes_all() && self.holdout.sum > 0.0;
        let least = if takes_all { PROMISING } else { SURE };
        likely
            || (self.is_same_size() && (takes_most || takes_all) && self.fit.z >= least)
            || self.agrees_everywhere()
    }

    /// Whether each of its moments is decided by itself: no bias that wanders looks like a reading that jumps.
    fn comes_in_events(&self) -> bool {
        self.effect.name == EffectName::MissedCounts
    }

    /// Whether it is nearly all that was left out and as large on every recording, or most of it and hardly differs between
    /// them, and costs nothing in those moments of the held-out ones that do not play it, however few do.
    fn agrees_everywhere(&self) -> bool {
        let harms_nowhere = |gain: &Gain| gain.sum > 0.0 && gain.low >= -LITTLE * gain.sum;
        let is_nearly_all = self.share >= NEARLY_ALL && self.is_same_size();
        let is_most = self.share >= MOST_SHARE && self.has_sizes_in(&HARDLY_ANOTHER_SIZE);
        (is_nearly_all || is_most) && harms_nowhere(&self.holdout) && harms_nowhere(&self.force)
    }

    fn has_sizes_in(&self, range: &Range<f64>) -> bool {
        !self.sizes.is_empty() && self.sizes.iter().all(|size| range.contains(size))
    }

    fn is_same_size(&self) -> bool {
        self.has_sizes_in(&SAME_SIZE)
    }

    /// Whether it takes most of what is left, surely, and as much of it everywhere: counts are lost now and then.
    fn recurs(&self) -> bool {
        self.is_same_size() && self.share >= MOST_SHARE && self.holdout.low > 0.0 && self.force.low > 0.0
    }

    /// Whether it takes most of what the others leave, surely, however much they explain.
    fn takes_most_of_the_rest(&self) -> bool {
        self.is_same_size() && self.force.sum >= HALF && self.force.low > 0.0
    }

    fn takes_all(&self) -> bool {
        self.force.sum >= HALF && self.share >= NEARLY_ALL
    }

    /// Whether it leaves hardly anything and is as large on every recording: its law is right, not only near.
    pub(crate) fn fits_everywhere(&self) -> bool {
        self.takes_all() && self.is_same_size()
    }

    /// Whether it may carry beside another effect that is as large: sure on the fitted recordings, and not surely worse than
    /// nothing on the others.
    pub(crate) fn is_provisional(&self) -> bool {
        self.fit.z >= PROMISING && self.holdout.z > -1.0 && self.share >= SHARE
    }

    /// Why it does not generalise, with the figures that say so.
    fn unsure(&self) -> String {
        if self.holdout.sum <= 0.0 {
            return format!("held-out recordings are less likely with it, by {:.0} nats", -self.holdout.sum);
        }
        format!(
            "its gain of {:.0} nats on held-out recordings is unsure ({:.1} standard errors there, {:.1} on left-out blocks of the fitted ones) and it takes {:.0} % of what the noise leaves",
            self.holdout.sum,
            self.holdout.z,
            self.fit.z,
            100.0 * self.share.max(0.0)
        )
    }

    /// Why an effect may not be named, if it may not.
    pub(crate) fn rejection_reason(&self) -> Option<String> {
        if !self.generalises() {
            return Some(self.unsure());
        }
        let rare = self.fit.z.max(self.fit.clipped_z) < 2.0 && self.holdout.z < 3.0;
        if rare && !self.recurs() && !self.agrees_everywhere() {
            return Some("its gain rests on few moments of the fitted recordings".into());
        }
        let may_be_little = self.is_certain() || self.takes_most_of_the_rest();
        if self.share < SHARE && !(self.share >= LEAST_SHARE && may_be_little) {
            return Some(format!(
                "it explains {:.1} % of what the noise leaves, less than 5 %",
                100.0 * self.share
            ));
        }
        if self.share < FAIR_SHARE && !self.stands_out() {
            return Some(format!(
                "it explains {:.1} % of what the noise leaves, and not surely enough for so little",
                100.0 * self.share
            ));
        }
        if !self.is_comb {
            return Some(
                "its orders follow each other without a gap, as at places along the travel, not at teeth or poles"
                    .into(),
            );
        }
        self.at_bound.then(|| "a fitted parameter reached its limit".into())
    }
}

/// How far a rival is behind.
#[derive(Clone, Debug)]
pub(crate) struct Rival {
    pub(crate) name: EffectName,
    /// Mean lead of the winner over its standard error, over all segments.
    pub(crate) z: f64,
    /// Lead of the winner in log-likelihood, and how much of it is on held-out recordings.
    pub(crate) lead: f64,
    pub(crate) held_out_lead: f64,
    /// Why it is none although it explains as much.
    pub(crate) absence: Option<String>,
}

/// Lays a model on every held-out recording.
pub(crate) fn evaluate_all(
    c: &FittedModel,
    nominal: &Nominal,
    tracks: &[BlockedRecording],
    noise: &Noise,
) -> Vec<HoldoutFit> {
    tracks.iter().map(|track| holdout::evaluate(c, nominal, track, noise)).collect()
}

/// What speaks for each effect of a model.
pub(crate) fn judge_all(
    context: &FitContext,
    last: &FittedModel,
    holdout: &[BlockedRecording],
) -> Vec<EffectEvidence> {
    let holdout: &[BlockedRecording] = &known(holdout, &last.model, context.span);
    let with = evaluate_all(last, context.nominal, holdout, &last.noise);
    let with_fit = left_out_costs(&last.fit);
    let estimator = Estimator::new(context.tracks, &last.noise, context.scale);
    let left = |c: &FittedModel, tracks: &[BlockedRecording], totals: &[Total]| {
        forces(&estimator, tracks, totals, parameters::scale(context.nominal, c).0)
    };
    let left_on_fit = |c: &FittedModel| left(c, context.tracks, &c.fit.totals(context.tracks));
    let left_on_holdout = |c: &FittedModel, evaluated: &[HoldoutFit]| {
        left(c, holdout, &evaluated.iter().map(|l| l.total.clone()).collect::<Vec<_>>())
    };
    let square = |left: &[Vec<f64>], tracks: &[BlockedRecording]| estimator.rms(left, tracks).powi(2);
    let null = Fit::new(&Model::default(), context.nominal, context.tracks, &last.noise);
    let null = FittedModel { model: Model::default(), noise: last.noise, fit: null, merit: 0.0 };
    let inertia = parameters::scale(context.nominal, last).0;
    let count = 1.0 / context.nominal.rig.encoder.counts_per_unit;
    let explainable = |left: &[Vec<f64>], tracks: &[BlockedRecording]| {
        let floor = estimator.counting(tracks, &last.noise, count) * inertia;
        above(estimator.rms(left, tracks), floor, LEAST_EXPLAINABLE).max(1e-300)
    };
    let of_null = left_on_holdout(&null, &evaluate_all(&null, context.nominal, holdout, &last.noise));
    let held_out = explainable(&of_null, holdout);
    let fitted = explainable(&left_on_fit(&null), context.tracks);
    let (left_held_out, left_fitted) = (left_on_holdout(last, &with), left_on_fit(last));
    (0..last.model.effects.len())
        .map(|i| {
            let mut less = last.model.clone();
            let effect = less.effects.remove(i);
            let fit = Fit::new(&less, context.nominal, context.tracks, &last.noise);
            let without = FittedModel { model: less, noise: last.noise, fit, merit: 0.0 };
            let without_fit = left_out_costs(&without.fit);
            let gains: Vec<f64> = without_fit.iter().zip(&with_fit).map(|(a, b)| a - b).collect();
            let evaluated = evaluate_all(&without, context.nominal, holdout, &last.noise);
            let holdout_gain = holdout::compare(&with, &evaluated);
            // What one recording hardly plays another may be made for.
            let (less_held_out, less_fitted) = (left_on_holdout(&without, &evaluated), left_on_fit(&without));
            let share = ((square(&less_held_out, holdout) - square(&left_held_out, holdout)) / held_out)
                .max((square(&less_fitted, context.tracks) - square(&left_fitted, context.tracks)) / fitted);
            let force = relative_gain(&estimator, holdout, &less_held_out, &left_held_out);
            let sizes = played(
                sizes_on(&estimator, context.tracks, &left_fitted, &less_fitted),
                sizes_on(&estimator, holdout, &left_held_out, &less_held_out),
            );
            // Bristles without damping are bristles all the same.
            let counts = |term: usize| effect.name != EffectName::PreslidingFriction || term == 0;
            let mut ends = last.fit.keys.iter().zip(&last.fit.solution.bound).filter(|(_, bound)| **bound);
            let is_bound = ends.any(
                |((key, _), _)| matches!(key, Key::Term { effect, term } if *effect == i && counts(*term)),
            );
            let at_bound = is_bound
                || candidates::is_at_end(&effect, context.span)
                || drifts_too_far(&last.fit, i, effect.name);
            let is_comb = periodic::is_comb(&effect, &last.fit.amplitudes(i));
            EffectEvidence {
                effect,
                rivals: Vec::new(),
                holdout: holdout_gain,
                fit: bootstrap(&gains),
                force,
                share,
                at_bound,
                is_comb,
                sizes,
            }
        })
        .collect()
}

/// Whether more of the dry friction goes or comes with time than warming explains.
fn drifts_too_far(fit: &Fit, effect: usize, name: EffectName) -> bool {
    let dry = fit.value(Key::Coulomb).filter(|dry| name == EffectName::FrictionDrift && *dry > 0.0);
    let change = fit.value(Key::Term { effect, term: 0 });
    dry.zip(change).is_some_and(|(dry, change)| !DRIFT.contains(&(change / dry)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gain(sum: f64, low: f64, z: f64) -> Gain {
        Gain { sum, low, high: 2.0 * sum, z, clipped_z: z }
    }

    /// An effect that is sure everywhere.
    fn found() -> EffectEvidence {
        EffectEvidence {
            effect: Effect::shaped(EffectName::QuadraticDrag, &[]),
            rivals: Vec::new(),
            holdout: gain(500.0, 300.0, 8.0),
            fit: gain(900.0, 600.0, 9.0),
            force: gain(0.9, 0.6, 5.0),
            share: 0.9,
            at_bound: false,
            is_comb: true,
            sizes: vec![1.0, 1.02, 0.95],
        }
    }

    fn may_be_named(change: impl FnOnce(&mut EffectEvidence)) -> bool {
        let mut found = found();
        change(&mut found);
        found.rejection_reason().is_none()
    }

    #[test]
    fn what_rests_on_few_moments_carries_only_where_it_is_nearly_all_and_as_large_everywhere() {
        let rare = |found: &mut EffectEvidence| {
            found.holdout = gain(500.0, -60.0, 1.6);
            found.force.low = -1e-6;
            found.share = 0.95;
        };
        assert!(may_be_named(rare));
        assert!(!may_be_named(|found| {
            rare(found);
            found.share = 0.8;
        }));
        assert!(!may_be_named(|found| {
            rare(found);
            found.sizes[2] = 0.5;
        }));
        let fitted = |z: f64| {
            may_be_named(|found| {
                rare(found);
                found.fit = gain(900.0, 100.0, z);
            })
        };
        assert!(fitted(2.6) && !fitted(2.0));
    }

    #[test]
    fn what_is_rare_where_it_was_fitted_must_recur() {
        let rare = |found: &mut EffectEvidence| {
            found.fit = gain(900.0, 100.0, 1.8);
            found.holdout = gain(1400.0, 500.0, 2.7);
        };
        assert!(may_be_named(rare));
        assert!(!may_be_named(|found| {
            rare(found);
            found.sizes[1] = 2.0;
        }));
        assert!(!may_be_named(|found| {
            rare(found);
            found.force.low = -0.1;
        }));
    }

    #[test]
    fn what_is_as_large_everywhere_may_rest_on_one_moment_if_it_harms_in_no_other() {
        let once = |found: &mut EffectEvidence| {
            found.fit = gain(900.0, 100.0, 1.4);
            found.holdout = gain(300.0, -5.0, 1.0);
            found.force = gain(0.2, -1e-4, 1.0);
            found.share = 0.93;
        };
        assert!(may_be_named(once));
        assert!(may_be_named(|found| {
            once(found);
            found.share = 0.6;
        }));
        let harms: [fn(&mut EffectEvidence); 4] = [
            |found| found.holdout.low = -60.0,
            |found| found.force.low = -0.05,
            |found| (found.share, found.sizes[2]) = (0.85, 0.8),
            |found| found.sizes[2] = 0.6,
        ];
        for change in harms {
            assert!(!may_be_named(|found| {
                once(found);
                change(found);
            }));
        }
    }

    #[test]
    fn readings_that_jump_need_not_explain_most() {
        let few = |name| {
            may_be_named(|found| {
                found.effect = Effect::shaped(name, &[]);
                found.holdout = gain(650.0, 230.0, 2.4);
                found.share = 0.16;
            })
        };
        assert!(few(EffectName::MissedCounts) && !few(EffectName::PreslidingFriction));
    }

    #[test]
    fn what_is_hardly_sure_must_explain_most() {
        let hardly = |share: f64| {
            may_be_named(|found| {
                found.fit = gain(130.0, 30.0, 2.2);
                found.sizes[1] = 1.25;
                found.share = share;
            })
        };
        assert!(hardly(0.8) && !hardly(0.6));
        assert!(may_be_named(|found| found.share = 0.6));
    }

    #[test]
    fn a_law_is_right_where_it_leaves_hardly_anything_and_is_as_large_everywhere() {
        assert!(found().fits_everywhere());
        assert!(!EffectEvidence { share: 0.6, ..found() }.fits_everywhere());
        assert!(!EffectEvidence { sizes: vec![1.0, 1.5], ..found() }.fits_everywhere());
        assert!(!EffectEvidence { force: gain(0.3, 0.1, 3.0), ..found() }.fits_everywhere());
    }

    #[test]
    fn a_small_part_must_be_certain() {
        assert!(may_be_named(|found| found.share = 0.04));
        assert!(!may_be_named(|found| found.share = 0.005));
        assert!(!may_be_named(|found| {
            found.share = 0.04;
            found.holdout = gain(50.0, 20.0, 4.0);
        }));
        let beside_more = |found: &mut EffectEvidence| {
            found.share = 0.02;
            (found.holdout.z, found.holdout.clipped_z) = (5.0, 20.0);
        };
        assert!(may_be_named(beside_more), "it takes most of what the others leave");
        assert!(!may_be_named(|found| {
            beside_more(found);
            found.force.sum = 0.4;
        }));
    }

    #[test]
    fn what_promises_is_sure_where_it_was_fitted_and_surely_harms_nowhere() {
        let mut half = found();
        half.holdout = gain(300.0, -20.0, 1.5);
        half.force.low = -0.1;
        half.share = 0.3;
        assert!(half.rejection_reason().is_some() && half.is_provisional());
        half.holdout = gain(-10.0, -50.0, -0.5);
        assert!(half.is_provisional());
        half.holdout = gain(-50.0, -90.0, -1.5);
        assert!(!half.is_provisional());
    }
}
