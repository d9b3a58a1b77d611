//! The part of the program that its tests and other crates use: the serial port, and the simulated device, handed on.

pub mod serial;

pub use device_sim::{device, driver, plant};
