//! The steps that run beside the others, in a process of their own: a browser, a clock and one core
//! that links are waited for, and two cores are there.

use crate::shell::{self, Error};
use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};

/// Those that need nothing but the build of everything, in their own order.
pub(crate) const STEPS: [&str; 4] = ["wasm", "site", "browser", "clients"];

/// Steps under way.
pub(crate) struct Beside {
    process: Child,
    /// The file of all that they print.
    said: PathBuf,
}

impl Beside {
    /// Begins the steps.
    ///
    /// # Errors
    ///
    /// If their process cannot be started, or the file for what they print cannot be written.
    pub(crate) fn begin() -> Result<Self, Error> {
        let said = shell::target().join("beside.log");
        let cannot =
            |error| Error::new(format!("cannot run steps that print to {}: {error}", said.display()));
        let out = File::create(&said).map_err(cannot)?;
        let mut steps = Command::new(std::env::current_exe().map_err(cannot)?);
        steps.arg("test").args(STEPS).stdin(Stdio::null());
        steps.stdout(out.try_clone().map_err(cannot)?).stderr(out);
        let process = steps.spawn().map_err(cannot)?;
        Ok(Self { process, said })
    }

    /// Waits for the end of the steps, prints what they printed, and returns their lines of a
    /// summary, one or more for each step.
    pub(crate) fn end(mut self) -> Vec<String> {
        let _ = self.process.wait();
        let said = fs::read(&self.said).unwrap_or_default();
        let said = String::from_utf8_lossy(&said);
        eprint!("{said}");
        summary(&said)
    }
}

/// The lines of the steps in what they printed; a step that has none has failed.
fn summary(said: &str) -> Vec<String> {
    let lines = said.lines().skip_while(|line| *line != "Summary").filter_map(|line| line.strip_prefix("  "));
    let own: Vec<String> = lines.take_while(|line| !line.starts_with("slow ")).map(String::from).collect();
    let is_told = |step: &str| own.iter().any(|line| line.split_whitespace().next() == Some(step));
    let silent = STEPS.iter().filter(|step| !is_told(step));
    let failed =
        silent.map(|step| format!("{step:<9}      -          FAIL: its process ended before it did"));
    let failed: Vec<String> = failed.collect();
    [own, failed].concat()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_step_that_did_not_end_has_failed() {
        let said = "== site\nerror: x\n\nSummary\n  wasm   1.0 s  pass\n  site   2.0 s  FAIL: x\n  slow   -  not run: y\n3 s in all\n";
        let lines = summary(said);
        assert_eq!(lines[..2], ["wasm   1.0 s  pass", "site   2.0 s  FAIL: x"]);
        assert!(lines.len() == 4 && lines[2..].iter().all(|line| line.contains("FAIL")), "{lines:?}");
        assert_eq!(summary("killed").len(), STEPS.len());
    }
}
