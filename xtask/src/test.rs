//! `cargo xtask test`: everything that passes or fails, setup included, each step also by its own
//! name; and `cargo xtask nightly`, the checks that take longer than the tests may.

use crate::real_recordings;
use crate::setup;
use crate::shell::{self, Error};
use crate::steps::{NIGHTLY, QUICK, STEPS, TestStep, build_images_ahead};
use crate::workspace_build::compile_by_clippy;
use std::time::Instant;

/// The space that a whole run writes into an empty target folder, and room to spare; a linker on a
/// full disk dies of a bus error.
const NEEDED_MIB: u64 = 7 * 1024;
/// As much where most is built already.
const NEEDED_BY_A_STEP_MIB: u64 = 1024;
/// The option that asks for the inner loop.
const QUICK_OPTION: &str = "--quick";

/// The checks that no command here runs, and why.
const NEVER_HERE: [(&str, &str); 1] = [(
    "hardware",
    "flashing and running on a real board needs one and a person beside it: `cargo xtask board-test`",
)];

/// Runs the steps named, all of them, or those of the inner loop, and reports how each ended.
pub(crate) fn run(arguments: &[String]) -> Result<(), Error> {
    let quick = arguments.iter().any(|argument| argument == QUICK_OPTION);
    let names: Vec<&String> = arguments.iter().filter(|argument| *argument != QUICK_OPTION).collect();
    if quick && !names.is_empty() {
        return Err(Error::usage(format!("{QUICK_OPTION} chooses the steps itself; do not name any")));
    }
    let all: &[TestStep] = if quick { &QUICK } else { &STEPS };
    let chosen = choose(all, &names, "step of the tests")?;
    setup::disk(if names.is_empty() && !quick { NEEDED_MIB } else { NEEDED_BY_A_STEP_MIB })?;
    if !quick && shell::is_on_path("clippy-driver") {
        // SAFETY: no other thread runs yet.
        #[allow(unsafe_code, reason = "the environment of this process is changed once, before any thread")]
        unsafe {
            compile_by_clippy();
        }
    }
    let mut summary = Summary::default();
    if names.is_empty() && !quick {
        build_images_ahead()?;
    }
    summary.run(&chosen);
    for step in &NIGHTLY {
        summary.not_run(step.name, &format!("{}: `cargo xtask nightly {}`", step.shows, step.name));
    }
    if quick {
        let left_out = STEPS.iter().filter(|step| QUICK.iter().all(|quick| quick.name != step.name));
        left_out.for_each(|step| summary.not_run(step.name, &format!("{}: `cargo xtask test`", step.shows)));
    }
    NEVER_HERE.iter().for_each(|(name, why)| summary.not_run(name, why));
    summary.print()
}

/// Runs the nightly checks named, or all of them.
pub(crate) fn nightly(arguments: &[String]) -> Result<(), Error> {
    let chosen = choose(&NIGHTLY, &arguments.iter().collect::<Vec<_>>(), "nightly check")?;
    setup::disk(NEEDED_MIB)?;
    let mut summary = Summary::default();
    summary.run(&chosen);
    summary.print()
}

/// The steps of `all` that `names` lists, in their own order; all of them where it lists none.
fn choose<'a>(all: &'a [TestStep], names: &[&String], what: &str) -> Result<Vec<&'a TestStep>, Error> {
    if let Some(unknown) = names.iter().find(|name| all.iter().all(|step| step.name != name.as_str())) {
        let known: Vec<&str> = all.iter().map(|step| step.name).collect();
        return Err(Error::usage(format!(
            "`{unknown}` is not a {what}; the known ones are: {}",
            known.join(" ")
        )));
    }
    Ok(all.iter().filter(|step| names.is_empty() || names.iter().any(|name| *name == step.name)).collect())
}

/// The results of the steps.
#[derive(Default)]
struct Summary {
    lines: Vec<String>,
    passed: usize,
    failed: usize,
    seconds: f64,
}

impl Summary {
    fn run(&mut self, steps: &[&TestStep]) {
        for step in steps {
            eprintln!("\n== {}: {}", step.name, step.shows);
            let begin = Instant::now();
            let ended = (step.run)();
            let seconds = begin.elapsed().as_secs_f64();
            self.seconds += seconds;
            let verdict = self.verdict(ended, seconds > step.bound_s);
            self.lines.push(format!("{:<9}{seconds:>7.1} s of {:>4.0}  {verdict}", step.name, step.bound_s));
            for (name, why) in real_recordings::absent(step.name).iter().map(|test| test.not_run()) {
                self.not_run(&name, &why);
            }
        }
    }

    fn verdict(&mut self, ended: Result<(), Error>, is_late: bool) -> String {
        match ended {
            Ok(()) => {
                self.passed += 1;
                if is_late { "pass (slower than two idle cores should be)".into() } else { "pass".into() }
            }
            Err(error) => {
                self.failed += 1;
                eprintln!("error: {error}");
                format!("FAIL: {error}")
            }
        }
    }

    fn not_run(&mut self, name: &str, why: &str) {
        self.lines.push(format!("{name:<9}      -          not run: {why}"));
    }

    fn print(&self) -> Result<(), Error> {
        println!("\nSummary");
        self.lines.iter().for_each(|line| println!("  {line}"));
        println!("{:.0} s in all", self.seconds);
        println!("steps: {} passed, {} failed", self.passed, self.failed);
        if self.failed == 0 {
            Ok(())
        } else {
            Err(Error::new(format!("{} steps failed; see the summary", self.failed)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_chosen_by_name_in_their_own_order() {
        let names = |wanted: &[&str]| {
            let wanted: Vec<String> = wanted.iter().map(|name| (*name).to_string()).collect();
            let chosen = choose(&STEPS, &wanted.iter().collect::<Vec<_>>(), "step");
            chosen.map(|steps| steps.iter().map(|step| step.name).collect::<Vec<_>>()).ok()
        };
        assert_eq!(names(&["unit", "fmt"]), Some(vec!["fmt", "unit"]));
        assert_eq!(names(&["units"]), None);
        assert_eq!(names(&[]).map(|all| all.len()), Some(STEPS.len()));
    }

    #[test]
    fn tests_without_recordings_are_named_below_their_step() {
        let mut summary = Summary::default();
        summary.run(&[&TestStep { name: "unit", shows: "nothing", bound_s: 1.0, run: || Ok(()) }]);
        summary.run(&[&TestStep { name: "fmt", shows: "nothing", bound_s: 1.0, run: || Ok(()) }]);
        let absent = real_recordings::absent("unit");
        assert_eq!(summary.lines.len(), 2 + absent.len());
        for (test, line) in absent.iter().zip(&summary.lines[1..]) {
            let (name, why) = test.not_run();
            assert!(line.starts_with(&name) && line.ends_with(&format!("not run: {why}")), "{line}");
        }
    }

    #[test]
    fn the_inner_loop_takes_three_minutes_at_most() {
        assert!(QUICK.iter().map(|step| step.bound_s).sum::<f64>() <= 3.0 * 60.0);
    }
}
