//! A real browser for the test of the page: Debian's Chromium without a screen, driven over its
//! DevTools protocol.
//!
//! [`chromium`] starts and ends it, [`devtools`] speaks to it, [`page`] says what a test means:
//! click, drag, read; [`program`] starts what serves the page, [`processor_time`] says what a
//! picture costs. Nothing here knows what the page under test shows.

pub mod chromium;
pub mod devtools;
pub mod page;
pub mod processor_time;
pub mod program;

pub use chromium::Chromium;
pub use page::Page;
pub use processor_time::loop_time;
pub use program::{Places, Program};

use std::time::Duration;

/// Long enough for whatever a test waits for, on a machine that has little time for it; what comes
/// sooner is waited for no longer.
pub const PATIENCE: Duration = Duration::from_secs(300);

/// The browser's error, in one sentence.
pub type Error = String;

/// An error with what was seen instead, where something does not hold.
pub fn check(what: &str, holds: bool, seen: impl std::fmt::Debug) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(format!("{what}: not so, but {seen:?}")) }
}
