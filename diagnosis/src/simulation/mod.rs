//! A rig with its effects run forward in time: what the simulator and the report run.

pub mod comparison;
mod fitted_loop;
pub mod frequency;
mod motion;
mod plant;
pub mod replay;
pub mod value_fit;

pub use fitted_loop::PositionLoop;
pub use motion::Motion;
pub use plant::{Plant, Surroundings};
