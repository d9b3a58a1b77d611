//! The part of the force error that an effect takes.

use crate::effects::Effect;
use crate::thresholds::SAME_SIZE_OF_SHARE;

/// An effect with its part in the force error.
#[derive(Clone, Debug)]
pub(crate) struct Share {
    pub(crate) effect: Effect,
    /// Parts of the force error, root mean square, that it takes on stretches left out of the fit
    /// and on held-out recordings.
    pub(crate) on_fit: f64,
    pub(crate) on_holdout: f64,
    /// Its size on the held-out recordings over that on the fitted ones.
    pub(crate) size: f64,
    /// True if a coefficient is at a limit of what the effect may be.
    pub(crate) at_bound: bool,
}

impl Share {
    /// True if it is about as large on held-out recordings as on fitted ones, and is not what it is
    /// only by a limit.
    pub(crate) fn fits(&self) -> bool {
        !self.at_bound && SAME_SIZE_OF_SHARE.contains(&self.size)
    }

    /// The smaller of its shares.
    pub(crate) fn least(&self) -> f64 {
        self.on_fit.min(self.on_holdout)
    }
}
