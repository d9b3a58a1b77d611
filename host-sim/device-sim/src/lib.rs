//! The device without its hardware: plant and hand in floating point, the firmware's control core
//! on them, and what a person chooses: patient, procedure, session. [`page`] has the messages to a
//! page.
//!
//! It opens no sockets, no ports, and no files except those that a person names, so that the
//! browser's build (`simulator-wasm`) uses it unchanged.

pub mod device;
pub mod driver;
pub mod error;
pub mod lockstep;
pub mod named_files;
pub mod needle;
pub mod page;
pub mod patients;
pub mod plant;
pub mod procedure;
pub mod profile;
pub mod session;
