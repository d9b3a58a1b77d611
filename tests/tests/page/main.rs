//! The page, in a real browser.

mod access;
mod body;
mod browser;
mod graphics;
mod guide;
mod layout;
mod needle;
mod patient;
mod practice;
mod views;
