//! Progress of long work: one line on a terminal, a line now and then in a pipe; with `--verbose` a
//! line for each stage.

use std::io::{IsTerminal, Write};
use std::time::{Duration, Instant};

/// Redrawn no more often than this.
const INTERVAL: Duration = Duration::from_millis(100);

/// With `--verbose`, a stage that goes on is printed again after this.
const AGAIN: Duration = Duration::from_secs(5);

/// In a pipe, work that takes long is told after this, and again after this.
const IN_A_PIPE: Duration = Duration::from_secs(15);

/// A line that is drawn over.
pub struct Progress {
    what: &'static str,
    quiet: bool,
    is_terminal: bool,
    verbose: bool,
    /// The unit or stage of the last line.
    stage: String,
    /// The last `done` and `all` that were shown.
    shown: Option<(f64, Option<f64>)>,
    drawn: Option<Instant>,
    begun: Instant,
}

impl Progress {
    /// Says nothing with `--quiet`, and little unless standard error is a terminal.
    pub fn new(what: &'static str) -> Self {
        Self {
            what,
            quiet: crate::output::is_quiet(),
            is_terminal: std::io::stderr().is_terminal(),
            verbose: crate::output::is_verbose(),
            stage: String::new(),
            shown: None,
            drawn: None,
            begun: Instant::now(),
        }
    }

    /// Shows `done` of `all`, where that is known.
    pub fn show(&mut self, done: f64, all: Option<f64>, unit: &str) {
        let is_due = |interval| self.drawn.is_none_or(|drawn| drawn.elapsed() >= interval);
        let is_wanted = match (self.verbose, self.is_terminal) {
            (true, _) => self.stage != unit || is_due(AGAIN),
            (false, true) => !self.quiet && is_due(INTERVAL),
            (false, false) => !self.quiet && self.begun.elapsed() >= IN_A_PIPE && is_due(IN_A_PIPE),
        };
        if self.stage != unit {
            unit.clone_into(&mut self.stage);
        }
        self.shown = Some((done, all));
        if !is_wanted {
            return;
        }
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
        let _ = match self.verbose || !self.is_terminal {
            true => writeln!(std::io::stderr(), "{:8.1} s  {line}", self.begun.elapsed().as_secs_f64()),
            false => write!(std::io::stderr(), "\r\x1b[K{line}"),
        };
    }

    /// Shows again what was shown last, where that is due: a stage may take minutes.
    pub fn show_again(&mut self) {
        if let Some((done, all)) = self.shown {
            let stage = self.stage.clone();
            self.show(done, all, &stage);
        }
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
        if self.drawn.is_some() && !self.verbose && self.is_terminal {
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
