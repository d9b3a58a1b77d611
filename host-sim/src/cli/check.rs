//! `host-sim check`: what recordings can and cannot show, before any fit.

use clap::Args;
use device_sim::error::Error;
use diagnosis::Request;
use live::{examples, say};
use std::path::PathBuf;

/// See in seconds what a rig's recordings can and cannot show: rate, resolution, faults of the log,
/// values and effects that cannot be distinguished, effects that cannot show, and what to record
/// for them.
#[derive(Args)]
#[command(after_help = examples!("Example:
  host-sim check --rig rig.toml --fit fit.csv --holdout holdout.csv"))]
pub(crate) struct Check {
    /// The simulation as its author believes it
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    /// A recording to fit and to choose with; may be repeated
    #[arg(long, required = true, value_name = "FILE.csv")]
    fit: Vec<PathBuf>,
    /// A recording only to judge with; may be repeated
    #[arg(long, required = true, value_name = "FILE.csv")]
    holdout: Vec<PathBuf>,
}

impl Check {
    pub(crate) fn run(self) -> Result<(), Error> {
        let request = Request { rig: self.rig, fit: self.fit, holdout: self.holdout, effects: None };
        for sentence in diagnosis::check(&request).map_err(Error::input)? {
            say!("{sentence}");
        }
        Ok(())
    }
}
