//! The outputs and inputs of a running session: the page, other programs' streams, a class, recordings.

pub mod bedside;
mod bounded_listener;
pub mod class;
pub mod guide;
pub mod live_gains;
pub mod outlets;
pub mod pace;
pub mod rehearsal;
pub mod replay;
pub mod saved_patients;
pub mod station;
pub mod streams;
pub mod visualizer;
