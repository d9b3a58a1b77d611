//! One diagnosis from its files to its report.

use super::export::Exports;
use device_sim::error::Error;
use diagnosis::{Made, Outcome, Request};
use live::progress::Progress;
use live::say;
use sha2::{Digest, Sha256};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::time::Duration;

/// Diagnoses, writes the report into a folder and says what was found.
pub(super) fn diagnose(request: &Request, exports: &Exports, out: &Path) -> Result<Outcome, Error> {
    let bar = Mutex::new(Progress::new("diagnosing"));
    let show = |stage: &str, done: f64| {
        if let Ok(mut bar) = bar.lock() {
            bar.show(100.0 * done, Some(100.0), &format!("% ({stage})"));
        }
    };
    let outcome = while_showing(&bar, || written(request, out, &show))?;
    drop(bar);
    say!("{}", outcome.summary().trim_end());
    exports.write(&outcome.nominal_rig, &outcome.patched_rig, Some(&outcome.report), out)?;
    Ok(outcome)
}

/// Diagnoses and writes the report into a folder; `progress` receives the stage and the fraction
/// done.
pub(super) fn written(
    request: &Request,
    out: &Path,
    progress: &(dyn Fn(&str, f64) + Sync),
) -> Result<Outcome, Error> {
    let mut outcome = diagnosis::diagnose(request, progress).map_err(Error::input)?;
    outcome.made = Some(made(request));
    outcome.write(out).map_err(|cause| {
        Error::failed(format_args!(
            "{}: the report cannot be written ({cause}); free some space or choose another --out",
            out.display()
        ))
    })?;
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
