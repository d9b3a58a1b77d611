//! The page, in a real browser.

mod browser;
mod graphics;
mod guide;
mod patient;
mod views;
