//! A rig with its effects run forward in time: what the simulator and the report run.

mod plant;

pub use plant::{Plant, Surroundings};
