//! Validation of fitted models on held-out recordings: gains, alternatives, residual maps, and
//! confidence.

pub(crate) mod acceptance_criteria;
pub(crate) mod alternatives;
pub(crate) mod beside_rivals;
pub(crate) mod comparison;
pub(crate) mod confidence;
pub(crate) mod confidence_pass;
mod contradictions;
pub(crate) mod effect_evidence;
pub(crate) mod elimination;
pub(crate) mod free_form_check;
pub(crate) mod holdout_likelihood;
pub(crate) mod holdout_set;
pub(crate) mod known_travel;
pub(crate) mod material;
pub(crate) mod out_of_library;
pub(crate) mod parameters;
pub(crate) mod rejection;
pub(crate) mod repeats;
pub(crate) mod residual_maps;
pub(crate) mod residuals;
pub(crate) mod sizes;
pub(crate) mod tonal;
pub(crate) mod weighed_model;
