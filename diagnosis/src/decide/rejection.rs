//! The reason why an effect is not named: the criterion that it does not meet, with its figures.
//! `report::text` turns it into a sentence.

use crate::laws::EffectName;
use crate::propose::free_form::Inputs;
use numerics::bootstrap::Gain;

/// The reason why an effect is not named.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Rejection {
    /// A slow disturbance explains as much.
    SlowDisturbance,
    /// Its gain is not sure on stretches of the fitted recordings that were left out of the fit,
    /// `fit_z` standard errors, and on these recordings as a filter follows them, `filter_z`. The
    /// search reads no held-out recording.
    NotSureInSearch { fit_z: f64, filter_z: f64, share: f64 },
    /// Held-out recordings are less likely with the effect.
    LessLikely { nats: f64 },
    /// The gain on held-out recordings is too few standard errors.
    UnlikelyGain { z: f64 },
    /// The interval of the gain on held-out recordings holds zero.
    MayGainNothing { gain: Gain },
    /// The gain is not sure on fitted and on held-out recordings, and the effect does not explain
    /// most.
    NotSure { fit_z: f64, holdout_z: f64, share: f64 },
    /// The gain rests on few moments of the fitted recordings.
    FewMoments { fit_z: f64, holdout_z: f64 },
    /// The effect explains too little of what the noise leaves, however sure it is.
    TooSmall { share: f64 },
    /// The effect explains less than `least` of what the noise leaves, and is not sure enough for
    /// that.
    SmallAndUnsure { share: f64, least: f64, z: f64 },
    /// The effect takes so small a part off the held-out force error that the simulation is right
    /// without it.
    Immaterial { part: f64 },
    /// The waves are not those of teeth or poles.
    NotPeriodic,
    /// A fitted value reached its limit.
    AtLimit,
    /// The interval of its size holds zero.
    NoSize,
    /// The effect would bend over this part of the travel, as only a spring that creeps does.
    Creeps { part: f64 },
    /// Something that has no name in the library explains it better.
    BetterExplanation(BetterExplanation),
    /// A larger effect in the same model is not in the library.
    BesideUnknown,
    /// More effects explain it as well than a class may hold.
    Undecided,
    /// The probability that it is right is too small.
    Improbable { probability: f64, weakness: Weakness },
    /// The recordings cannot distinguish it from a named effect.
    Indistinguishable { from: EffectName },
    /// The search finds more in others.
    LessInSearch,
    /// The force that the motion asks for, of which the recorded command holds no part, shows
    /// nothing of a law of the command.
    NotInMotion,
    /// The model that it is in leaves more of the force error than the one that is named.
    LeavesMore,
    /// Another effect explains more instead.
    Behind { winner: EffectName, z: f64 },
}

/// The better explanation of an effect's gain.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum BetterExplanation {
    /// Physics without a name in the library; a noun phrase.
    Unnamed { what: String },
    /// A force of a form that the effect cannot have: gains on left-out blocks, nats, of the form
    /// and of the effect.
    FreeForm { over: Inputs, form: f64, effect: f64 },
}

/// The piece of evidence that lowers the probability of a name most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Weakness {
    /// Its gain is few standard errors.
    UnsureGain { z: f64 },
    /// It explains a small part of what the noise leaves.
    SmallShare { share: f64 },
    /// This part of what the refit leaves beyond chance is still there with it.
    Unexplained { part: f64 },
}
