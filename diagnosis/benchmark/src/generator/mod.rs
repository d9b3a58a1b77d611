//! The plant that the tool has never seen, and the recordings made with it.

pub(crate) mod case;
mod case_builder;
pub(crate) mod clock;
pub(crate) mod drive;
pub(crate) mod effects;
pub(crate) mod excite;
pub(crate) mod family;
pub(crate) mod files;
mod foreign;
mod forms;
pub(crate) mod machine;
pub(crate) mod outside;
pub(crate) mod plant;
pub(crate) mod series;
pub(crate) mod simulate;
pub(crate) mod spec;
mod step;
pub(crate) mod strength;
mod surroundings;
#[cfg(test)]
mod tests;
mod truth;
