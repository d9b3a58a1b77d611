//! The flash image on an emulated board, end to end.
//!
//! [`emulator`] runs the image; [`pc`] is the program on the PC at the other end of its cable;
//! [`browser`] looks at its page. The tests in `tests/` say what the device promises. Nothing here
//! is part of the product.

pub mod browser;
pub mod follow;
pub mod laws;
pub mod mechanism;
pub mod needle;
pub mod pc;
pub mod rig;
pub mod scenario;
pub mod start;

/// The variable of the environment by which `cargo xtask bench` asks a test to measure for longer
/// than it needs to pass or fail.
pub const BENCH: &str = "NEEDLE_BENCH";
