//! An effect fitted in the place of one that was found, and how far it is behind.

use crate::effects::{Effect, EffectName};
use crate::validation::rejection::Rejection;

/// A rival and how far it is behind.
#[derive(Clone, Debug)]
pub(crate) struct Rival {
    pub(crate) name: EffectName,
    /// The effect with the shape that fits best.
    pub(crate) effect: Effect,
    /// Mean lead of the winner over its standard error, over all segments.
    pub(crate) z: f64,
    /// Lead of the winner in log-likelihood, and how much of it is on held-out recordings.
    pub(crate) lead: f64,
    pub(crate) held_out_lead: f64,
    /// The reason why it may not be named although it explains as much.
    pub(crate) absence: Option<Rejection>,
}
