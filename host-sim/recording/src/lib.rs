//! Recordings: an MCAP file whose messages are JSON, so that any MCAP tool reads them, and Foxglove's own for its 3D panel. One module writes, one reads, one
//! exports to the rig and CSV of the diagnosis, [`import`] reads those of other people.

pub mod export;
mod foxglove;
pub mod import;
mod intact;
pub mod messages;
pub mod read;
pub mod shell;
pub mod simulated;
pub mod tally;
pub mod version;
pub mod write;
