//! The PC's side of the needle device, as a library: plant and virtual device, serial device, recordings, the visualizer,
//! scoring. The program `host-sim` is its command line.
//!
//! It speaks to any device, virtual or not, through the same `link` bytes, and leaves force laws to `control-core`.

pub mod bedside;
mod bounded_listener;
pub mod characterise;
pub mod class;
pub mod commission;
pub mod compensate;
pub mod debrief;
pub mod device;
pub mod driver;
pub mod failure;
pub mod force_fit;
pub mod guide;
pub mod import;
pub mod library;
pub mod live_gains;
pub mod outlets;
pub mod pace;
pub mod patients;
pub mod plant;
pub mod practice;
pub mod procedure;
pub mod profile;
pub mod recording;
pub mod rehearsal;
pub mod replay;
pub mod reproduce;
pub mod score;
pub mod session;
pub mod sheet;
pub mod shell;
pub mod station;
pub mod streams;
pub mod tally;
pub mod version;
pub mod visualizer;
