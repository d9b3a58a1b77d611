//! `cargo xtask test`: everything that passes or fails, setup included, each step also by its own
//! name; and `cargo xtask nightly`, the checks that take longer than the tests may.

use crate::beside::{self, Beside};
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
/// The cores for which the steps' times are meant.
const CORES: f64 = 2.0;
/// The first step that needs the build of everything.
const AFTER_THE_BUILD: &str = "unit";
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
            compile_by_clippy()?;
        }
    }
    let mut summary = Summary::new();
    if names.is_empty() && !quick {
        run_all(&mut summary, &chosen)?;
    } else {
        summary.run(&chosen);
    }
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

/// Runs every step: after the build of everything, some beside the others.
fn run_all(summary: &mut Summary, steps: &[&TestStep]) -> Result<(), Error> {
    let steps = || steps.iter().copied().filter(|step| !beside::STEPS.contains(&step.name));
    let before: Vec<&TestStep> = steps().take_while(|step| step.name != AFTER_THE_BUILD).collect();
    build_images_ahead()?;
    summary.run(&before);
    let beside = Beside::begin()?;
    summary.run(&steps().skip(before.len()).collect::<Vec<_>>());
    summary.add(beside.end());
    Ok(())
}

/// Runs the nightly checks named, or all of them.
pub(crate) fn nightly(arguments: &[String]) -> Result<(), Error> {
    let chosen = choose(&NIGHTLY, &arguments.iter().collect::<Vec<_>>(), "nightly check")?;
    setup::disk(NEEDED_MIB)?;
    let mut summary = Summary::new();
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
struct Summary {
    lines: Vec<String>,
    passed: usize,
    failed: usize,
    begun: Instant,
}

impl Summary {
    fn new() -> Self {
        Self { lines: Vec::new(), passed: 0, failed: 0, begun: Instant::now() }
    }

    fn run(&mut self, steps: &[&TestStep]) {
        for step in steps {
            eprintln!("\n== {}: {}", step.name, step.shows);
            let (begin, before) = (Instant::now(), processor_s());
            let ended = (step.run)();
            let seconds = begin.elapsed().as_secs_f64();
            let (used, most) = (processor_s() - before, CORES * step.bound_s);
            let verdict = self.verdict(ended, used > most);
            self.lines.push(format!(
                "{:<9}{seconds:>7.1} s, {used:>4.0} of {most:>4.0} s of processors  {verdict}",
                step.name
            ));
            for (name, why) in real_recordings::absent(step.name).iter().map(|test| test.not_run()) {
                self.not_run(&name, &why);
            }
        }
    }

    /// Adds the lines of steps that ran elsewhere.
    fn add(&mut self, lines: Vec<String>) {
        self.passed += lines.iter().filter(|line| line.contains("  pass")).count();
        self.failed += lines.iter().filter(|line| line.contains("  FAIL: ")).count();
        self.lines.extend(lines);
    }

    fn verdict(&mut self, ended: Result<(), Error>, is_late: bool) -> String {
        match ended {
            Ok(()) => {
                self.passed += 1;
                if is_late { "pass (more than it should take)".into() } else { "pass".into() }
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
        println!("{:.0} s in all, {:.0} s of processors", self.begun.elapsed().as_secs_f64(), processor_s());
        println!("steps: {} passed, {} failed", self.passed, self.failed);
        if self.failed == 0 {
            Ok(())
        } else {
            Err(Error::new(format!("{} steps failed; see the summary", self.failed)))
        }
    }
}

/// The time that processors have spent on what this process has started and seen end, in s: it does
/// not grow with what else the machine does. 0 where the system does not say.
fn processor_s() -> f64 {
    /// Linux counts for its programs in hundredths, whatever its own clock.
    const HZ: f64 = 100.0;
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    // After the name in brackets; those of ended children are fields 16 and 17 of all (proc(5)).
    let fields = stat.rsplit(')').next().unwrap_or_default().split_whitespace();
    fields.skip(13).take(2).filter_map(|ticks| ticks.parse::<f64>().ok()).sum::<f64>() / HZ
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_time_of_processors_is_that_of_what_ended() {
        let before = processor_s();
        let mut shell = std::process::Command::new("sh");
        let ended = shell.args(["-c", "i=0; while [ $i -lt 300000 ]; do i=$((i+1)); done"]).status();
        assert!(ended.is_ok_and(|status| status.success()));
        let used = processor_s() - before;
        assert!(!cfg!(target_os = "linux") || (0.05..60.0).contains(&used), "{used} s");
    }

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
        let mut summary = Summary::new();
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
