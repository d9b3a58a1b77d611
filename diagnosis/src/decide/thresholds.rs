//! Every number that decides a name, a verdict or a confidence, in one place, with its unit, its
//! meaning and its source. Whatever only limits a search (steps, grids, how many candidates are
//! fitted) is where it is used.
//!
//! Shares are parts of the refit's mean square above the noise; z is a gain over its standard
//! error; nats are log-likelihood. Where no other source is given a number was set by hand on
//! development seeds of `cargo xtask prove`; docs/measured/diagnosis.md says how that fares.

use std::ops::Range;

/// Probability: least with which an effect is named, two to one.
pub(crate) const NAMED: f64 = 2.0 / 3.0;
/// Probability of a name where too many effects fit equally well.
pub(crate) const UNDECIDED: f64 = 0.5;
/// Probability: least and most that is ever claimed.
pub(crate) const CLAIMED: (f64, f64) = (0.01, 0.99);

/// Log-odds without any evidence, and what each piece adds: a logistic regression (`prove
/// --calibrate`), rounded towards doubt, on 728 names of seeds 14 and 16 (whole), 13 and 1701 to
/// 1703 (one effect, nulls), 13 and 505 (pairs) and 1501, 1601, 1711 and 1712 (physics without a
/// name), 22 of them wrong.
pub(crate) const BIAS: f64 = 2.0;
/// See [`BIAS`].
pub(crate) const WEIGHTS: [(&str, f64); 5] = [
    ("least_z", 1.4),
    ("share", 0.8),
    ("unexplained", -1.0),
    ("unexplained_of_force", -3.4),
    ("share_of_bristles", 2.0),
];
/// z beyond which the probability grows no more.
pub(crate) const SUREST_Z: f64 = 20.0;
/// Parts of the force that are left: less counts as hardly anything, more as no worse.
pub(crate) const LEFT_OF_FORCE: (f64, f64) = (0.005, 0.3);
/// Least share that counts for an effect that is certain on every stretch: it may be small compared
/// with larger ones.
pub(crate) const CERTAIN_SHARE: f64 = 0.15;

/// Least share that counts for any other effect.
pub(crate) const COUNTED_SHARE: f64 = 0.03;

/// z on fitted and on held-out recordings that is sure, over stretches of time or of the score.
pub(crate) const SURE_Z: f64 = 3.0;
/// z on held-out recordings, and on fitted ones for effects that act in few moments, below which a
/// gain does not count.
pub(crate) const UNLIKELY_Z: f64 = 2.0;
/// z on the fitted recordings from which an effect may generalise together with another.
pub(crate) const PROMISING_Z: f64 = 2.5;
/// z on held-out recordings below which an effect is significantly worse than nothing.
pub(crate) const WORSE_Z: f64 = -1.0;
/// z on fitted and on held-out recordings from which an effect may be small.
pub(crate) const CERTAIN_Z: f64 = 6.0;
/// Least share of an effect with that z.
pub(crate) const LEAST_SHARE: f64 = 0.01;
/// Least share of any other effect.
pub(crate) const SHARE: f64 = 0.05;
/// Share from which an effect need not have that z: the form of a larger effect is never quite
/// right.
pub(crate) const FAIR_SHARE: f64 = 0.1;
/// Share that is most of what was left out.
pub(crate) const MOST_SHARE: f64 = 0.5;
/// Share required if z is below `SURE_Z`: drift imitates small effects.
pub(crate) const UNSURE_SHARE: f64 = 0.7;
/// Share from which an effect may rest on few moments: counts are lost now and then.
pub(crate) const NEARLY_ALL_SHARE: f64 = 0.9;
/// Part of the held-out force's mean square that such an effect takes.
pub(crate) const HALF_OF_FORCE: f64 = 0.5;
/// Part of a gain by which the lower end of its interval may be below zero without harm.
pub(crate) const HARMLESS: f64 = 0.05;
/// Factors between an effect's size on one recording and on all within which the sizes count as the
/// same.
pub(crate) const SAME_SIZE: Range<f64> = 0.75..1.33;
/// Factors within which the sizes hardly differ.
pub(crate) const HARDLY_ANOTHER_SIZE: Range<f64> = 0.85..1.18;

/// Part of the held-out force error, root mean square, that an effect must take off to be named,
/// however sure it is: the simulation is right to that part without it. A third generator lost 2 of
/// 89 right names and 2 of 16 wrong ones by it, two of three named nulls.
pub(crate) const MATERIAL: f64 = 0.05;
/// Log-odds that a name loses where the patched simulation follows the motion less well in windows
/// of half a second or less, and the factor between the errors from which it does. On machines six
/// of six wrong names did, on a generator 19 of 89 right ones: it is weighed, and takes no name.
pub(crate) const WORSE_MOTION: (f64, f64) = (1.0, 1.05);

/// z by which a rival must be behind not to share a class.
pub(crate) const BEHIND_Z: f64 = 2.0;
/// z by which a rival must lead to take an effect's place: it is then the better one with a
/// probability of 84 %.
pub(crate) const LEADS_Z: f64 = 1.0;
/// Part of the effect's gain by which a rival must be behind as well as [`BEHIND_Z`]: a smaller
/// lead comes from the form of a law, not from its name.
pub(crate) const BEHIND_PART: f64 = 0.015;
/// Nats by which a rival must be behind under coloured noise to be excluded, whatever white noise
/// gives; half of the winner's gain is needed too.
pub(crate) const BEHIND_SLOW_NATS: f64 = 30.0;
/// z that such a rival counts as behind by.
pub(crate) const BEHIND_SLOW_Z: f64 = 4.0;
/// Most effects that a class may hold.
pub(crate) const MOST_IN_CLASS: usize = 3;

/// z from which the gain of a force of any form is sure: ten forms are tried on every model.
pub(crate) const FORM_SURE_Z: f64 = 3.0;
/// Part of what a force of any form takes that an effect must take to be named, and must take
/// beyond it where it takes less. Of a force of one variable alone the rest is enough: on EMPS
/// friction by direction takes a quarter of what any force over speed takes, as real friction has
/// more to it than one law.
pub(crate) const NEARLY_ALL_OF_FORM: f64 = 0.9;
/// Part of the held-out gain of an effect that may be a constant force which a force of any form
/// must gain to deny it: the noise that both are compared under wanders as a constant does.
pub(crate) const FORM_OF_CONSTANT: f64 = 0.1;
/// Part of the innovations' mean square that a force of any form must explain to be reported.
pub(crate) const FORM_TOLD: f64 = 0.005;
/// Part of an effect's gain that physics outside the library must gain instead: a law of slightly
/// another form gains a little.
pub(crate) const OUTSIDE_PART: f64 = 0.1;
/// Share that physics outside the library must explain alone to be reported.
pub(crate) const OUTSIDE_ALONE: f64 = 0.5;

/// Parts of the force: a model that leaves less than the first has understood it, one that leaves
/// more than the second has not.
pub(crate) const UNDERSTOOD: (f64, f64) = (0.12, 0.5);
/// Part of what the refit leaves that a model between the two must stay below.
pub(crate) const MUCH_OF_REFIT: f64 = 0.65;
/// Part of the refit's mean square above which a fitted spring may well be a gap.
pub(crate) const LEAVES_MUCH: f64 = 0.3;

/// Nats under coloured noise, after the cost of freedom, below which an effect is not judged at
/// all.
pub(crate) const MIN_LOG_LIKELIHOOD_GAIN: f64 = 6.0;
/// Most of the travel, as a part of it, over which bristles bend: microns of a slide, tenths of a
/// degree of a turn.
pub(crate) const BRISTLES: f64 = 0.03;
/// The smallest part of a refit's residual at which a swing is the missing physics.
pub(crate) const DOMINANT: f64 = 0.4;

/// Residual of a model, over that of a motion read in whole counts, from which other physics
/// limits, not noise, and shares decide: it is 1.9 in the median on generated nulls and 22 on axes
/// of real machines (`docs/measured/diagnosis.md`).
pub(crate) const LIMITED_BY_PHYSICS: f64 = 3.0;
/// Most probability of a name that no share confirms where other physics limits: the gain of a law
/// says little there.
pub(crate) const SUREST_BESIDE_PHYSICS: f64 = 0.8;
/// Part of the force error, on left-out frames of the fit and on held-out recordings, from which a
/// law of the regression is named; least z of what it takes, frame by frame; and least agreement of
/// its sizes, on halves of the fit and on held-out recordings. The prototype's rule C0.
pub(crate) const NAMED_SHARE: f64 = 0.15;
pub(crate) const TAKEN_Z: f64 = 1.0;
pub(crate) const SIZES_AGREE: f64 = 0.4;
/// Part of the force error from which a mismatch is called no random one, and from which the
/// filter looks for a law of the command: a tenth of its square.
pub(crate) const FOLLOWS_SHARE: f64 = 0.05;
/// Part of its share that a rival must take, and standard errors by which it must be behind at
/// most, to join its class. The same rule.
pub(crate) const NEAR_SHARE: f64 = 0.85;
pub(crate) const NEAR_LEAD_Z: f64 = 2.0;
/// Factor on the force error below which the filter's model leaves clearly less than that of what
/// the regression names, and is taken. On 79 development cases (seed 80001) anything from 0.5 to
/// 0.9 finds the same but for one case; 1 finds one fewer and names two more falsely.
pub(crate) const CLEARLY_LESS: f64 = 0.9;
/// Log-odds of a name by shares, without a share and per share. They were set on the shares of a
/// regression that is gone (seed 52302) and were not set again: of this one's names on seed 86001
/// 34 of 34 of 0.9 or more are right or believed of the machine, and 27 of 35 between 0.8 and 0.9.
pub(crate) const SHARE_ODDS: (f64, f64) = (0.6, 4.0);
