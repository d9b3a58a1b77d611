//! Which effects are candidates, which shape of each is best, and how models compare on the fitted recordings. Nothing here
//! sees a held-out recording.

pub(crate) mod candidates;
pub(crate) mod context;
pub(crate) mod excitation;
pub(crate) mod free_form;
pub(crate) mod joint;
pub(crate) mod periodic;
pub(crate) mod predictive;
pub(crate) mod score_statistic;
pub(crate) mod search;
pub(crate) mod shape_search;
pub(crate) mod untested;
