//! What held-out recordings say of fitted models: gains, alternatives, residual maps, and how sure each effect is.

pub(crate) mod alternatives;
pub(crate) mod assess;
pub(crate) mod comparison;
pub(crate) mod confidence;
pub(crate) mod elimination;
pub(crate) mod evidence;
pub(crate) mod held_out;
pub(crate) mod holdout;
pub(crate) mod judge;
pub(crate) mod known_travel;
pub(crate) mod opponent;
pub(crate) mod out_of_library;
pub(crate) mod parameters;
pub(crate) mod rejection;
pub(crate) mod repeats;
pub(crate) mod residual_maps;
pub(crate) mod residuals;
pub(crate) mod sizes;
pub(crate) mod tonal;
