//! `cargo xtask counts`: the instructions of hot paths, counted by callgrind, against those of
//! `xtask/instruction-counts.txt`. A count depends on the compiler and hardly on the machine, so
//! that it shows what a time on a busy machine hides.

mod shares;

use crate::setup;
use crate::shell::{self, Error, cargo};
use crate::workspace_build::{ANY_RUST, built};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A hot path: its name for the example `hot_paths`, what is counted, and the function in which
/// counting is on.
struct HotPath {
    name: &'static str,
    what: &'static str,
    function: &'static str,
}

const fn path(name: &'static str, what: &'static str, function: &'static str) -> HotPath {
    HotPath { name, what, function }
}

const PATHS: [HotPath; 5] = [
    path("tick", "a tick of the control law on the host", "hot_paths::counted_ticks"),
    path("plant", "a tick of plant and control law", "hot_paths::counted_plant"),
    path("frame", "a full block of samples to a frame and back", "hot_paths::counted_frames"),
    path(
        "filter",
        "a pass of the diagnosis' filter over two seconds",
        "diagnosis::estimation::filter::Gains::new",
    ),
    path("tissue", "a step of the tissue picture", "hot_paths::counted_tissue"),
];

/// The part by which a count may be more than the one written down.
const MORE: f64 = 0.05;
/// The option that writes down what is counted now.
const RENEW: &str = "--renew";

/// The option that prints where the instructions go.
const SHARES: &str = "--shares";
/// Files of each path that it prints.
const PRINTED: usize = 8;

/// Counts by name.
type Counts = BTreeMap<String, f64>;

/// Counts, prints, and compares with the file, or writes it.
pub(crate) fn run(arguments: &[String]) -> Result<(), Error> {
    match arguments {
        [] => compare(&counted()?, &written()?),
        [option] if option == RENEW => {
            let file = file();
            fs::write(&file, text(&counted()?))
                .map_err(|error| Error::new(format!("{} cannot be written: {error}", file.display())))?;
            println!("written to {}", file.display());
            Ok(())
        }
        [option] if option == SHARES => print_shares(),
        [other, ..] => {
            Err(Error::usage(format!("`{other}` is not an option of counts; it takes {RENEW} or {SHARES}")))
        }
    }
}

/// The step of `cargo xtask nightly`.
pub(crate) fn check() -> Result<(), Error> {
    run(&[])
}

fn file() -> PathBuf {
    shell::top().join("xtask/instruction-counts.txt")
}

/// The example that runs the hot paths.
const EXAMPLE: [&str; 2] = ["--example", "hot_paths"];

fn valgrind() -> Result<(), Error> {
    if shell::is_on_path("valgrind") {
        Ok(())
    } else {
        setup::install(&["valgrind"], "counting instructions")
    }
}

/// Builds the example with line numbers, which the one build does not have, in a folder of its own.
fn with_lines() -> Result<PathBuf, Error> {
    let folder = shell::target().join("with-lines");
    let mut build = cargo();
    build.env("CARGO_PROFILE_RELEASE_DEBUG", "line-tables-only").env("CARGO_TARGET_DIR", &folder);
    shell::run(
        build.args(["build", "--quiet", "-p", "host-sim"]).args(["--release", ANY_RUST]).args(EXAMPLE),
    )?;
    Ok(folder.join("release/examples/hot_paths"))
}

fn counted() -> Result<Counts, Error> {
    valgrind()?;
    let program = built(&EXAMPLE, "examples/hot_paths")?;
    let mut counts = Counts::new();
    for path in &PATHS {
        let count = count(&program, path)?;
        println!("{:<8}{count:>12.0} instructions: {}", path.name, path.what);
        counts.insert(path.name.into(), count);
    }
    Ok(counts)
}

/// The files of whose code each path spends its instructions; of the diagnosis all of it, and not
/// the filter alone.
fn print_shares() -> Result<(), Error> {
    valgrind()?;
    let program = with_lines()?;
    for path in &PATHS {
        let is_own = path.function.starts_with("hot_paths::");
        let arguments: &[&str] = if is_own { &[path.name] } else { &[path.name, "whole"] };
        let (profile, _) = profiled(&program, arguments, is_own.then_some(path.function))?;
        let annotated = shell::output(
            Command::new("callgrind_annotate").args(["--auto=no", "--threshold=100"]).arg(&profile),
        )?;
        println!("{}: {}", path.name, if is_own { path.what } else { "a whole diagnosis" });
        for (file, percent) in shares::of(&annotated).iter().take(PRINTED) {
            println!("{percent:>8.1} %  {file}");
        }
    }
    Ok(())
}

/// Runs a path under callgrind, counting in one function or all over; the profile, and what the
/// program printed.
fn profiled(program: &Path, arguments: &[&str], function: Option<&str>) -> Result<(PathBuf, String), Error> {
    let profile = shell::target().join(format!("callgrind.{}", arguments.join("-")));
    let mut valgrind = Command::new("valgrind");
    valgrind.args(["--tool=callgrind", "--quiet"]);
    valgrind.args(function.map(|function| format!("--toggle-collect={function}*")));
    valgrind.arg(format!("--callgrind-out-file={}", profile.display()));
    // Threads that wait for work would only take time.
    valgrind.env("RAYON_NUM_THREADS", "1").arg(program).args(arguments);
    shell::output(&mut valgrind).map(|printed| (profile, printed))
}

/// Instructions of one time that a path is gone.
fn count(program: &Path, path: &HotPath) -> Result<f64, Error> {
    let (profile, printed) = profiled(program, &[path.name], Some(path.function))?;
    let text = fs::read_to_string(&profile)
        .map_err(|error| Error::new(format!("{} cannot be read: {error}", profile.display())))?;
    let times = times(&printed).unwrap_or_else(|| calls(&text, path.function));
    let total = total(&text).unwrap_or(0.0);
    if total > 0.0 && times > 0.0 {
        return Ok(total / times);
    }
    Err(Error::new(format!(
        "callgrind saw no call of {}: if it has another name now, write that in xtask/src/counts.rs",
        path.function
    )))
}

/// Times that a program says it has gone the path, `times=…`.
fn times(printed: &str) -> Option<f64> {
    printed.split_whitespace().find_map(|word| word.strip_prefix("times=")?.parse().ok())
}

/// All instructions of a profile of callgrind.
fn total(profile: &str) -> Option<f64> {
    profile.lines().find_map(|line| line.strip_prefix("totals:")?.trim().parse().ok())
}

/// Calls of a function in a profile, which names it once, as `cfn=(12) name`, and then by its
/// number.
fn calls(profile: &str, function: &str) -> f64 {
    let named = |line: &str| Some(line.split_once('(')?.1.split_once(") ")?.1.starts_with(function));
    let id = |line: &str| Some(line.split_once('(')?.1.split_once(')')?.0.to_string());
    let is_function = |line: &&str| line.starts_with("fn=") || line.starts_with("cfn=");
    let ids: Vec<String> =
        profile.lines().filter(is_function).filter(|line| named(line) == Some(true)).filter_map(id).collect();
    let (mut sum, mut is_it) = (0.0, false);
    for line in profile.lines() {
        if line.starts_with("cfn=") {
            is_it = id(line).is_some_and(|id| ids.contains(&id));
        } else if let (true, Some(rest)) = (is_it, line.strip_prefix("calls=")) {
            sum += rest.split_whitespace().next().and_then(|count| count.parse().ok()).unwrap_or(0.0);
            is_it = false;
        }
    }
    sum
}

/// The counts that are written down.
fn written() -> Result<Counts, Error> {
    let file = file();
    let text = fs::read_to_string(&file)
        .map_err(|error| Error::new(format!("{} cannot be read: {error}", file.display())))?;
    Ok(read(&text))
}

fn read(text: &str) -> Counts {
    let line = |line: &str| {
        let (name, count) = line.split_once(char::is_whitespace)?;
        Some((name.to_string(), count.trim().parse().ok()?))
    };
    text.lines().filter(|line| !line.starts_with('#')).filter_map(line).collect()
}

fn text(counts: &Counts) -> String {
    let head = "# Instructions of hot paths on x86-64, by `cargo xtask counts --renew`; more than 5 % over fails `cargo xtask nightly counts`.\n";
    counts.iter().fold(head.to_string(), |text, (name, count)| text + &format!("{name} {count:.0}\n"))
}

/// Fails where a count is over its own by more than [`MORE`], or is not written down.
fn compare(counted: &Counts, written: &Counts) -> Result<(), Error> {
    let mut wrong = vec![];
    for (name, now) in counted {
        match written.get(name) {
            None => wrong.push(format!("{name} is not in xtask/instruction-counts.txt")),
            Some(before) if *now > before * (1.0 + MORE) => wrong.push(format!(
                "{name} takes {now:.0} instructions, {:.1} % more than the {before:.0} written down",
                100.0 * (now / before - 1.0)
            )),
            Some(before) if *now < before * (1.0 - MORE) => {
                println!("{name}: fewer than the {before:.0} written down");
            }
            Some(_) => {}
        }
    }
    if wrong.is_empty() {
        return Ok(());
    }
    Err(Error::new(format!(
        "{}; find what it pays for, or accept it with `cargo xtask counts {RENEW}`",
        wrong.join("; ")
    )))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// As callgrind writes it: names once, costs of calls behind them.
    const PROFILE: &str = "events: Ir\nfn=(1) main\n12 5\ncfn=(2) gains::new\ncalls=3 40\n12 900\n\nfn=(3) again\ncfn=(2)\n\
                           calls=2 40\n9 600\ncfn=(4) other\ncalls=7 1\n9 70\ntotals: 1500\n";

    #[test]
    fn a_profile_gives_the_total_and_the_calls() {
        assert_eq!(total(PROFILE), Some(1_500.0));
        assert_eq!(calls(PROFILE, "gains::new"), 5.0);
        assert_eq!(calls(PROFILE, "absent"), 0.0);
        assert_eq!(times("done times=20 x"), Some(20.0));
    }

    #[test]
    fn five_percent_more_fails_and_less_does_not() {
        let counts = |count| Counts::from([("tick".to_string(), count)]);
        assert_eq!(read(&text(&counts(880.0))), counts(880.0));
        assert!(compare(&counts(924.0), &counts(880.0)).is_ok());
        assert!(compare(&counts(925.0), &counts(880.0)).is_err());
        assert!(compare(&counts(400.0), &counts(880.0)).is_ok());
        assert!(compare(&counts(880.0), &Counts::new()).is_err());
    }
}
