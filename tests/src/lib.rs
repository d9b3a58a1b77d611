//! The flash image on an emulated board, end to end.
//!
//! [`board`] runs the image; [`usb_host`] is the PC's end of its cable; [`pc`] is the program on
//! that PC; [`browser`] looks at its page; [`bootloader`] is the one in ROM. The tests in `tests/`
//! say what the device promises. Nothing here is part of the product, and nothing of it reaches
//! into the firmware: one image, no feature flag for tests.

pub mod board;
pub mod bootloader;
pub mod browser;
pub mod follow;
pub mod laws;
pub mod mechanism;
pub mod needle;
pub mod pc;
pub mod rig;
pub mod scenario;
pub mod start;
pub mod usb_host;

/// The variable of the environment by which `cargo xtask bench` asks a test to measure for longer
/// than it needs to pass or fail.
pub const BENCH: &str = "NEEDLE_BENCH";
