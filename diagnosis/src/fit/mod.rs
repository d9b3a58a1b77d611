//! From recordings and a model of fixed structure to coefficients, noise and motion. Nothing here
//! chooses between effects.

pub(crate) mod band_fit;
pub(crate) mod blocked_recording;
pub(crate) mod blocks;
pub(crate) mod covariance;
pub(crate) mod effective_command;
pub(crate) mod filter;
pub(crate) mod force_residual;
pub(crate) mod input;
pub(crate) mod kept;
pub(crate) mod linear_fit;
pub(crate) mod lost_counts;
pub(crate) mod model;
pub(crate) mod noise;
pub(crate) mod nominal;
pub(crate) mod plausibility;
pub(crate) mod quasi_static;
pub(crate) mod reading_lag;
pub(crate) mod refit;
pub(crate) mod regressors;
mod seen_inertia;
pub(crate) mod skew;
pub(crate) mod skew_columns;
pub(crate) mod slices;
pub(crate) mod smoother;
pub(crate) mod whitened;
