//! `host-sim export`: from a recording to what `diagnose` reads.

use clap::Args;
use convert::export;
use device_sim::error::Error;
use live::replay::read;
use live::{examples, say};
use std::path::PathBuf;

/// Write rig.toml and CSV files, which `diagnose` reads, from a recording.
///
/// One CSV file (recording.csv), or one for every stretch without a gap (recording-1.csv and so
/// on). Existing files with these names are replaced.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim export session.mcap --out exported"))]
pub(crate) struct Export {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Folder to write to; created if missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Export {
    pub(crate) fn run(self) -> Result<(), Error> {
        let recording = read(&self.file)?;
        let exported = export::export(&recording, &self.out)?;
        say!("{}", exported.rig.display());
        for (path, rows) in exported.recordings {
            say!("{} rows={rows}", path.display());
        }
        Ok(())
    }
}
