//! A real browser for the test of the page: Debian's Chromium without a screen, driven over its DevTools protocol.
//!
//! [`chromium`] starts and ends it, [`devtools`] speaks to it, [`page`] says what a test means: click, drag, read.
//! Nothing here knows what the page under test shows.

pub mod chromium;
pub mod devtools;
pub mod page;

pub use chromium::Chromium;
pub use page::Page;

/// What went wrong with the browser, in one sentence.
pub type Failure = String;
