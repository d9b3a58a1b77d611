//! Progress of long work: one line on a terminal, nothing in a pipe; with `--verbose` a line for
//! each stage.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Redrawn no more often than this.
const INTERVAL: Duration = Duration::from_millis(100);

/// With `--verbose`, a stage that goes on is printed again after this.
const AGAIN: Duration = Duration::from_secs(5);

/// A line that is drawn over.
pub struct Progress {
    what: &'static str,
    on: bool,
    verbose: bool,
    /// The unit or stage of the last line.
    stage: String,
    drawn: Option<Instant>,
    begun: Instant,
}

impl Progress {
    /// Quiet unless standard error is a terminal, and with `--quiet`.
    pub fn new(what: &'static str) -> Self {
        Self {
            what,
            on: std::io::stderr().is_terminal() && !crate::output::is_quiet(),
            verbose: crate::output::is_verbose(),
            stage: String::new(),
            drawn: None,
            begun: Instant::now(),
        }
    }

    /// Shows `done` of `all`, where that is known.
    pub fn show(&mut self, done: f64, all: Option<f64>, unit: &str) {
        let is_due = |interval| self.drawn.is_none_or(|drawn| drawn.elapsed() >= interval);
        let is_wanted =
            if self.verbose { self.stage != unit || is_due(AGAIN) } else { self.on && is_due(INTERVAL) };
        if !is_wanted {
            return;
        }
        unit.clone_into(&mut self.stage);
        self.drawn = Some(Instant::now());
        let line = match all {
            Some(all) => {
                let left = left(self.begun.elapsed().as_secs_f64(), done / all);
                let left = left.map_or(String::new(), |left| format!(", about {left} left"));
                format!("{}: {done:.1} of {all:.1} {unit}{left}", self.what)
            }
            None => format!("{}: {done:.1} {unit}", self.what),
        };
        // A terminal that went away is no reason to stop.
        let _ = match self.verbose {
            true => writeln!(std::io::stderr(), "{:8.1} s  {line}", self.begun.elapsed().as_secs_f64()),
            false => write!(std::io::stderr(), "\r\x1b[K{line}"),
        };
    }
}

/// The time that is left of work that took `elapsed` s for a part of it, as words; none while too
/// little is done to say it.
fn left(elapsed: f64, part: f64) -> Option<String> {
    if elapsed < 2.0 || !(0.05..1.0).contains(&part) {
        return None;
    }
    let seconds = elapsed * (1.0 - part) / part;
    Some(if seconds < 90.0 { format!("{seconds:.0} s") } else { format!("{:.0} min", seconds / 60.0) })
}

impl Drop for Progress {
    fn drop(&mut self) {
        if self.drawn.is_some() && !self.verbose {
            let _ = write!(std::io::stderr(), "\r\x1b[K");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_left_is_said_once_enough_is_done() {
        assert_eq!(left(1.0, 0.5), None);
        assert_eq!(left(10.0, 0.01), None);
        assert_eq!(left(10.0, 0.25).as_deref(), Some("30 s"));
        assert_eq!(left(60.0, 0.1).as_deref(), Some("9 min"));
    }
}
