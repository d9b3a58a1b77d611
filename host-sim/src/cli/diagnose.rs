//! `host-sim diagnose`: which physics the simulation leaves out.

use super::export::ExportOptions;
use super::one_diagnosis::diagnose;
use clap::Args;
use device_sim::error::Error;
use diagnosis::Request;
use diagnosis::rig::Rig;
use live::{examples, say};
use std::path::PathBuf;

/// Find where a simulation and its recordings differ and which physics is missing, and prove it on
/// held-out recordings.
///
/// Writes diagnosis.json, report.html, patched-rig.toml and residuals.csv, and prints the same in
/// ten lines.
#[derive(Args)]
#[command(after_help = examples!("Example:
  host-sim diagnose --rig rig.toml --fit fit.csv --fit fit2.csv --holdout holdout.csv --out /tmp/report
  host-sim diagnose --all robot --out /tmp/report"))]
pub(crate) struct Diagnose {
    /// The simulation as its author believes it
    #[arg(long, required_unless_present = "all", value_name = "RIG.toml")]
    pub(super) rig: Option<PathBuf>,
    /// A recording to fit and to choose with; may be repeated
    #[arg(long, required_unless_present = "all", value_name = "FILE.csv")]
    pub(super) fit: Vec<PathBuf>,
    /// A recording only to judge with; may be repeated
    #[arg(long, required_unless_present = "all", value_name = "FILE.csv")]
    pub(super) holdout: Vec<PathBuf>,
    /// Every axis of a machine: the folders in DIR with a rig.toml, as `import --axes` writes them;
    /// a report each, and one page for all of them
    #[arg(long, value_name = "DIR", conflicts_with_all = ["rig", "fit", "holdout"])]
    pub(super) all: Option<PathBuf>,
    /// Your own formulas to search too
    #[arg(long, value_name = "F.toml")]
    pub(super) effects: Option<PathBuf>,
    /// Folder for the report
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    #[command(flatten)]
    pub(super) export: ExportOptions,
}

impl Diagnose {
    pub(crate) fn run(self) -> Result<(), Error> {
        if let Some(dir) = self.all {
            return super::diagnose_all::run(&dir, self.effects, &self.export.read(None)?, &self.out);
        }
        let rig = self.rig.unwrap_or_default();
        let nominal = Rig::read(&rig).map_err(Error::input)?;
        let exports = self.export.read(Some(&nominal))?;
        let request = Request { rig, fit: self.fit, holdout: self.holdout, effects: self.effects };
        diagnose(&request, &exports, &self.out)?;
        say!("report: {}", self.out.join("report.html").display());
        Ok(())
    }
}
