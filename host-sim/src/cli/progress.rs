//! Progress of long work: one line on a terminal, nothing in a pipe.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Redrawn no more often than this.
const INTERVAL: Duration = Duration::from_millis(100);

/// A line that is drawn over.
pub(crate) struct Progress {
    what: &'static str,
    on: bool,
    drawn: Option<Instant>,
}

impl Progress {
    /// Quiet unless standard error is a terminal, and with `--quiet`.
    pub(crate) fn new(what: &'static str) -> Self {
        Self { what, on: std::io::stderr().is_terminal() && !super::output::is_quiet(), drawn: None }
    }

    /// Shows `done` of `all`, where that is known.
    pub(crate) fn show(&mut self, done: f64, all: Option<f64>, unit: &str) {
        if !self.on || self.drawn.is_some_and(|drawn| drawn.elapsed() < INTERVAL) {
            return;
        }
        self.drawn = Some(Instant::now());
        let line = match all {
            Some(all) => format!("{}: {done:.1} of {all:.1} {unit}", self.what),
            None => format!("{}: {done:.1} {unit}", self.what),
        };
        // A terminal that went away is no reason to stop.
        let _ = write!(std::io::stderr(), "\r\x1b[K{line}");
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.drawn.is_some() {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}
