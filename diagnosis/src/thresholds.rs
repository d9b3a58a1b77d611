//! Every number that admits or rejects a name, in one place, with its unit and what it means. Whatever only limits a search (steps, grids,
//! how many candidates are fitted) stands where it is used.
//!
//! Shares are parts of the refit's mean square above the noise; z is a gain over its standard error; nats are log-likelihood. Where no
//! other source is given a number was set by hand on development seeds of `cargo xtask prove`; docs/diagnosis-design.md says how that fares.

use std::ops::Range;

/// Probability: least with which an effect is named, two to one.
pub(crate) const NAMED: f64 = 2.0 / 3.0;
/// Probability of a name where more effects are as near than a class may hold.
pub(crate) const UNDECIDED: f64 = 0.5;
/// Probability: least and most that is ever claimed.
pub(crate) const CLAIMED: (f64, f64) = (0.01, 0.99);

/// Log-odds without any evidence, and what each piece adds: a logistic regression (`prove --calibrate`), rounded towards doubt, on 728
/// names of seeds 14 and 16 (whole), 13 and 1701 to 1703 (one effect, nulls), 13 and 505 (pairs) and 1501, 1601, 1711 and 1712 (physics
/// without a name), 22 of them wrong.
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
/// Share that an effect which stands out of every stretch counts with at the least: it may be small beside larger ones.
pub(crate) const CERTAIN_SHARE: f64 = 0.15;

/// Share that any other effect counts with at the least.
pub(crate) const COUNTED_SHARE: f64 = 0.03;

/// z on fitted and on held-out recordings that is sure, over stretches of time or of the score.
pub(crate) const SURE_Z: f64 = 3.0;
/// z on held-out recordings, and on fitted ones of what acts in few moments, below which a gain is none.
pub(crate) const UNLIKELY_Z: f64 = 2.0;
/// z on the fitted recordings of what may generalise beside another.
pub(crate) const PROMISING_Z: f64 = 2.5;
/// z on held-out recordings below which it is surely worse than nothing.
pub(crate) const WORSE_Z: f64 = -1.0;
/// z on fitted and on held-out recordings from which an effect may be small.
pub(crate) const CERTAIN_Z: f64 = 6.0;
/// Least share of an effect with that z.
pub(crate) const LEAST_SHARE: f64 = 0.01;
/// Least share of any other effect.
pub(crate) const SHARE: f64 = 0.05;
/// Share from which an effect need not have that z: the form of a larger effect is never quite right.
pub(crate) const FAIR_SHARE: f64 = 0.1;
/// Share that is most of what was left out.
pub(crate) const MOST_SHARE: f64 = 0.5;
/// Least share of what is hardly sure: a bias that wanders looks like many a small effect for as long as two recordings last.
pub(crate) const UNSURE_SHARE: f64 = 0.7;
/// Share of what may rest on few moments: counts are lost now and then.
pub(crate) const NEARLY_ALL_SHARE: f64 = 0.9;
/// Part of the held-out force's mean square that such an effect takes.
pub(crate) const HALF_OF_FORCE: f64 = 0.5;
/// Part of a gain by which an effect may be worse at the lower end of its interval and still harm nothing.
pub(crate) const HARMLESS: f64 = 0.05;
/// Factors between an effect's size on a recording and on all that are the same size.
pub(crate) const SAME_SIZE: Range<f64> = 0.75..1.33;
/// Factors that hardly differ.
pub(crate) const HARDLY_ANOTHER_SIZE: Range<f64> = 0.85..1.18;

/// z by which a rival must be behind not to share a class.
pub(crate) const BEHIND_Z: f64 = 2.0;
/// Nats by which it must be behind as well.
pub(crate) const BEHIND_NATS: f64 = 3.0;
/// The same as a part of what the effect gains: less is the form of a law rather than its name.
pub(crate) const BEHIND_PART: f64 = 0.015;
/// Nats under a slow disturbance by which a rival is behind whatever a white one says, if it is by half of the winner's gain there.
pub(crate) const BEHIND_SLOW_NATS: f64 = 30.0;
/// z that such a rival counts as behind by.
pub(crate) const BEHIND_SLOW_Z: f64 = 4.0;
/// Most effects that a class may hold.
pub(crate) const MOST_IN_CLASS: usize = 3;
/// Factor within which drifts of gain and of friction are one of the inertia: what is a step and fitted as a bend gives either a little of
/// the other's.
pub(crate) const ALIKE: f64 = 1.5;

/// z from which what a force of any form takes is sure: ten forms are asked of every model.
pub(crate) const FORM_SURE_Z: f64 = 3.0;
/// Part of what a force of any form takes that an effect must take to be named, and must take beyond it where it takes less. Of a force
/// of one variable alone the rest is enough: on EMPS friction by direction takes a quarter of what any force over speed takes, as real
/// friction has more to it than one law.
pub(crate) const NEARLY_ALL_OF_FORM: f64 = 0.9;
/// Part of the innovations' mean square that a force of any form must take to be told.
pub(crate) const FORM_TOLD: f64 = 0.005;
/// Part of an effect's gain that physics outside the library must gain in its place: a law of slightly another form gains a little.
pub(crate) const OUTSIDE_PART: f64 = 0.1;
/// Share that physics outside the library must take alone to be told of.
pub(crate) const OUTSIDE_ALONE: f64 = 0.5;

/// Parts of the force: a model that leaves so little has understood it, one that leaves so much has not, whatever it names.
pub(crate) const UNDERSTOOD: (f64, f64) = (0.12, 0.5);
/// Part of what the refit leaves that a model between the two must stay below.
pub(crate) const MUCH_OF_REFIT: f64 = 0.65;
/// Part of the refit's mean square that a spring leaves where it may well be a gap.
pub(crate) const LEAVES_MUCH: f64 = 0.3;

/// Nats under coloured noise, after the cost of freedom, below which an effect is not judged at all.
pub(crate) const MIN_LOG_LIKELIHOOD_GAIN: f64 = 6.0;
/// Parts of what it is at first that a dry friction may gain with time.
pub(crate) const DRIFT: Range<f64> = -0.95..3.0;
/// Part of the travel over which bristles bend at the most: microns of a slide, tenths of a degree of a turn.
pub(crate) const BRISTLES: f64 = 0.03;
/// How near, as a part of it, the end of what a value may be is to be at it.
pub(crate) const AT_END: f64 = 0.05;
/// Part of what the refit leaves that swings at a frequency of its own and that effects have taken on, from which on they stand for it.
pub(crate) const MISTAKEN: f64 = 0.2;
