//! The outputs and inputs of a running session: the page, other programs' streams, a class,
//! recordings.

mod bounded_listener;
pub mod class;
pub mod guide;
pub(crate) mod live_gains;
pub mod outlets;
pub mod patient_manager;
pub mod realtime_clock;
pub mod replay;
pub mod run_loop;
pub mod saved_patients;
pub mod streams;
pub mod virtual_run;
pub mod visualizer;
