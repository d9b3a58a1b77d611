//! `host-sim diagnose`: which physics the simulation leaves out.

use super::export::{ExportOptions, Exports};
use clap::Args;
use device_sim::error::Error;
use diagnosis::rig::Rig;
use diagnosis::{Made, Outcome, Request};
use live::progress::Progress;
use live::{examples, say};
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

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

/// Diagnoses, writes the report into a folder and says what was found.
pub(super) fn diagnose(request: &Request, exports: &Exports, out: &Path) -> Result<Outcome, Error> {
    let bar = Mutex::new(Progress::new("diagnosing"));
    let show = |stage: &str, done: f64| {
        if let Ok(mut bar) = bar.lock() {
            bar.show(100.0 * done, Some(100.0), &format!("% ({stage})"));
        }
    };
    let mut outcome = while_showing(&bar, || diagnosis::diagnose(request, &show)).map_err(Error::input)?;
    drop(bar);
    outcome.made = Some(made(request));
    outcome.write(out).map_err(|cause| {
        Error::failed(format_args!(
            "{}: the report cannot be written ({cause}); free some space or choose another --out",
            out.display()
        ))
    })?;
    say!("{}", outcome.summary().trim_end());
    exports.write(&outcome.nominal_rig, &outcome.patched_rig, Some(&outcome.report), out)?;
    Ok(outcome)
}

/// Does some work and meanwhile shows now and then how far it is.
fn while_showing<T>(bar: &Mutex<Progress>, work: impl FnOnce() -> T) -> T {
    let (done, is_done) = mpsc::channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            while let Err(RecvTimeoutError::Timeout) = is_done.recv_timeout(Duration::from_secs(1)) {
                if let Ok(mut bar) = bar.lock() {
                    bar.show_again();
                }
            }
        });
        let result = work();
        drop(done);
        result
    })
}

/// Describes the report's sources.
fn made(request: &Request) -> Made {
    let all =
        std::iter::once(&request.rig).chain(&request.fit).chain(&request.holdout).chain(&request.effects);
    let hash = |path: &PathBuf| {
        let bytes = std::fs::read(path).ok()?;
        let mut hash = String::new();
        for byte in Sha256::digest(bytes) {
            let _ = write!(hash, "{byte:02x}");
        }
        Some((path.display().to_string(), hash))
    };
    Made {
        program: format!("host-sim {}", env!("CARGO_PKG_VERSION")),
        date: jiff::Zoned::now().strftime("%Y-%m-%d %H:%M %Z").to_string(),
        files: all.filter_map(hash).collect(),
    }
}
