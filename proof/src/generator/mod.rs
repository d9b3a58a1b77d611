//! The plant that the tool has never seen, and the recordings made with it.

pub(crate) mod case;
mod case_builder;
pub(crate) mod drive;
pub(crate) mod effects;
pub(crate) mod excite;
pub(crate) mod files;
pub(crate) mod machine;
pub(crate) mod outside;
pub(crate) mod plant;
pub(crate) mod simulate;
pub(crate) mod spec;
pub(crate) mod strength;
#[cfg(test)]
mod tests;
