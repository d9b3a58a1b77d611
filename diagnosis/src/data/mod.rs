//! Files in and the shape of the report: rigs, recordings, their checks and `diagnosis.json`.
//! Nothing here fits anything.

pub(crate) mod error;
mod known_keys;
pub mod recording;
pub mod rig;
pub(crate) mod schema;
pub(crate) mod sets;
pub(crate) mod sufficiency;
