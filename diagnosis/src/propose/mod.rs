//! The candidate effects, the best shape of each, and the comparison of models on the fitted
//! recordings. Nothing here sees a held-out recording.

pub(crate) mod band_shapes;
pub(crate) mod candidates;
pub(crate) mod comb;
pub(crate) mod context;
pub(crate) mod excitation;
pub(crate) mod free_form;
pub(crate) mod more_waves;
pub(crate) mod periodic;
pub(crate) mod predictive;
pub(crate) mod score_statistic;
pub(crate) mod search;
pub(crate) mod shape_search;
pub(crate) mod two_mass;
pub(crate) mod untested;
pub(crate) mod wave_ladder;
