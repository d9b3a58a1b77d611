//! Recordings: an MCAP file whose messages are JSON, so that any MCAP tool reads them, the needle's
//! numbers as Protobuf for programs that plot no JSON, and Foxglove's own for its 3D panel. One
//! module writes, one reads, [`stretches`] are its parts
//! without a gap.

mod foxglove;
mod mcap_repair;
pub mod messages;
pub mod protobuf;
pub mod read;
pub mod run_stats;
pub mod stretches;
pub mod version;
pub mod views;
pub mod write;
