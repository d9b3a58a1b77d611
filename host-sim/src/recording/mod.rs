//! Recordings: an MCAP file whose messages are JSON, so that any MCAP tool reads them. One module writes, one reads, one
//! exports to the rig and CSV of the diagnosis.

pub mod export;
mod intact;
pub mod messages;
pub mod read;
pub mod simulated;
pub mod write;
