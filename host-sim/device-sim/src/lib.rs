//! The device without its hardware: plant and hand in floating point, the firmware's control core
//! on them, and what a person chooses: patient, procedure, session. [`page`] is what a page is
//! told.
//!
//! No files but those a person names, no sockets, no ports: the browser's build (`site-wasm`) takes
//! it as it is.

pub mod device;
pub mod driver;
pub mod error;
pub mod lockstep;
pub mod named_files;
pub mod page;
pub mod patients;
pub mod plant;
pub mod procedure;
pub mod profile;
pub mod session;
