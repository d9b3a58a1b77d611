//! Measurements of fitted models on fitted and on held-out recordings: gains, residuals, their
//! maps, repeats, and a rig run forward. Nothing here decides on a name.

pub(crate) mod beside_rivals;
pub(crate) mod check;
pub(crate) mod comparison;
pub(crate) mod effect_evidence;
pub(crate) mod holdout_likelihood;
pub(crate) mod holdout_set;
pub(crate) mod known_travel;
pub(crate) mod law_band;
pub(crate) mod parameters;
pub(crate) mod prepared;
pub(crate) mod repeats;
pub(crate) mod residual_maps;
pub(crate) mod residuals;
pub(crate) mod run_forward;
pub(crate) mod sizes;
pub(crate) mod tonal;
