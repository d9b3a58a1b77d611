//! The page: serves it from the program itself, streams to it what the device does, and passes on
//! what a person does.
//!
//! [`device_sim::page::messages`] is what is said between server and page,
//! [`device_sim::page::condense`] turns 10 kHz into what a picture needs, `server` and `connection`
//! carry it, `watched` carries a page that only looks (a class) or agrees to steps (a guide),
//! `debrief` serves what it is given for the last recording, `workbench` passes files and questions
//! on, `assets` holds the files of `host-sim/page/js`.
//!
//! This module may not touch the device, the link or a recording: it knows a
//! [`device_sim::session::Session`] and nothing behind it. A page that is slow, asleep or gone
//! costs the session nothing but its own bounded queue.

mod assets;
mod connection;
mod debrief;
mod demonstration;
mod gate;
mod read_only_page;
mod server;
mod shared;
mod workbench;

pub use debrief::Debrief;
pub use demonstration::Demonstration;
pub use read_only_page::{Said, Watch, Watches};
pub use server::{
    ServeError, Server, serve, serve_guide, serve_watched, serve_with_reports, serve_workbench,
};
pub use workbench::Workbench;

#[cfg(test)]
pub(crate) fn test_scene() -> device_sim::session::Scene {
    device_sim::session::Scene {
        source: device_sim::session::Source::Virtual,
        profile: "adult".into(),
        procedure: None,
        layers: Vec::new(),
        roller_radius_mm: 10.0,
        travel_mm: 60.0,
        largest_force_n: 2.88,
        force_scale: 1.0,
        tilt_rad: 0.5,
        skin_tilt_rad: 0.0,
        slope_deg: None,
        vessel: None,
        body: None,
        beside: Vec::new(),
        needle: device_sim::session::SceneNeedle::reaching(15.6),
        hand: true,
    }
}
