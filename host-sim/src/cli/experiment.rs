//! `host-sim experiment`: the input that best distinguishes the rivals of a diagnosis.

use clap::Args;
use device_sim::error::Error;
use experiment::{Case, design};
use live::{examples, say};
use std::path::PathBuf;

/// The longest input, s.
const MOST_S: f64 = 30.0;

/// Design the input that best tells the rivals of a diagnosis apart, within limits of travel, speed
/// and force.
///
/// Writes reference.csv for a position loop, command.csv as that loop would send it, predicted.csv
/// with the response of each rival, experiment.json, and experiment.html, which shows why this
/// input decides. Record it and diagnose again with the recording.
#[derive(Args)]
#[command(after_help = examples!("Example:
  host-sim experiment --report /tmp/report --out /tmp/experiment"))]
pub(crate) struct Experiment {
    /// The folder that `diagnose` wrote
    #[arg(long, value_name = "DIR")]
    report: PathBuf,
    /// Largest distance from where the input begins, rad or m (default: as far ahead and as far
    /// back as the report's recordings went from where they began)
    #[arg(long, value_name = "RAD|M")]
    travel: Option<f64>,
    /// Largest speed, rad/s or m/s (default: the most in the report's recordings)
    #[arg(long, value_name = "RAD/S|M/S")]
    speed: Option<f64>,
    /// Largest force of the drive, N·m or N (default: what the rig's limit of the command gives)
    #[arg(long, value_name = "NM|N")]
    force: Option<f64>,
    /// Longest input, s, up to 30
    #[arg(long, default_value_t = MOST_S, value_name = "S")]
    seconds: f64,
    /// Seed of the frequencies and speeds that are tried
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Folder for the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Experiment {
    pub(crate) fn run(self) -> Result<(), Error> {
        if !(4.0..=MOST_S).contains(&self.seconds) {
            return Err(Error::input(format_args!(
                "--seconds is {}; it must be from 4 to {MOST_S} seconds",
                self.seconds
            )));
        }
        let case = Case::read(&self.report, self.travel, self.speed, self.force).map_err(Error::input)?;
        let design = design(&case, self.seconds, self.seed).map_err(Error::input)?;
        let paths = design.write(&self.out).map_err(Error::failed)?;
        say!("{}", design.summary().trim_end());
        for path in paths {
            say!("{}", path.display());
        }
        Ok(())
    }
}
