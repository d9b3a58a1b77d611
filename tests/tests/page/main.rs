//! The page, in a real browser.

mod access;
mod board_page;
mod board_session;
mod body;
mod browser;
mod class_card;
mod editor;
mod graphics;
mod guide;
mod headset;
mod import;
mod languages;
mod layout;
mod needle;
mod patient;
mod practice;
mod report;
mod tablet;
mod update;
mod views;
