//! `cargo xtask mutants`: changes the code a thousand times in small ways and sees that the tests
//! notice. By hand, for it takes about half an hour; what may survive, and why, is in
//! `tests/mutants.md`.

use crate::shell::{self, Error, cargo};
use std::fs;
use std::path::Path;

/// The crates, with the files of each that only the board can test.
const CRATES: [(&str, &[&str]); 3] = [
    ("control-core", &[]),
    ("link", &[]),
    (
        "firmware",
        &[
            "firmware/src/main.rs",
            "firmware/src/app.rs",
            "firmware/src/crash.rs",
            "firmware/src/board/**",
            "firmware/src/chip/**",
        ],
    ),
];
/// A mutant that runs longer hangs.
const LIMIT_S: &str = "30";
/// The share of the mutants that build that the tests must notice, in per cent.
const CAUGHT_AT_LEAST: usize = 90;

/// The counts of a crate's mutants by their fate.
#[derive(Default)]
struct Tally {
    caught: usize,
    unviable: usize,
    survivors: Vec<String>,
}

/// Mutates the crates named, or all of them.
pub(crate) fn run(names: &[String]) -> Result<(), Error> {
    if let Some(unknown) = names.iter().find(|name| CRATES.iter().all(|(known, _)| known != name)) {
        return Err(Error::usage(format!(
            "`{unknown}` is not mutated; these are: {}",
            CRATES.map(|(name, _)| name).join(" ")
        )));
    }
    if !shell::is_on_path("cargo-mutants") {
        return Err(Error::new(
            "cargo-mutants is not on the PATH; install it with `cargo install cargo-mutants --locked`",
        ));
    }
    let mut all = Tally::default();
    for (name, board_only) in CRATES {
        if names.is_empty() || names.iter().any(|asked| asked == name) {
            let tally = mutate(name, board_only)?;
            println!("{name:<13} {}", said(&tally));
            all.caught += tally.caught;
            all.unviable += tally.unviable;
            all.survivors.extend(tally.survivors);
        }
    }
    println!("{:<13} {}", "all", said(&all));
    judge(&all)
}

fn said(tally: &Tally) -> String {
    let Tally { caught, unviable, survivors } = tally;
    let share = 100.0 * *caught as f64 / (caught + survivors.len()).max(1) as f64;
    format!("{caught} caught, {} survived, {unviable} did not build: {share:.1} % caught", survivors.len())
}

fn mutate(name: &str, board_only: &[&str]) -> Result<Tally, Error> {
    let folder = shell::target().join("mutants").join(name);
    fs::create_dir_all(&folder)
        .map_err(|error| Error::new(format!("{} cannot be made: {error}", folder.display())))?;
    let mut command = cargo();
    command.args(["mutants", "--package", name, "--baseline", "skip"]);
    // A thousand small builds one after the other, each with tests that compute.
    command.envs([("CARGO_PROFILE_DEV_OPT_LEVEL", "1"), ("CARGO_PROFILE_DEV_DEBUG", "none")]);
    command.args(["--timeout", LIMIT_S, "--no-shuffle", "--output"]).arg(&folder);
    board_only.iter().for_each(|file| {
        command.args(["--exclude", file]);
    });
    command.args(["--", "--lib", "--tests"]);
    // Survivors are no failure of the run; the lists say what there was.
    let _ = shell::run(&mut command);
    let list = |what: &str| lines(&folder.join("mutants.out").join(what).with_extension("txt"));
    let mut survivors = list("missed")?;
    // A mutant that hangs has been noticed.
    let caught = list("caught")?.len() + list("timeout")?.len();
    survivors.iter_mut().for_each(|survivor| *survivor = without_place(survivor));
    Ok(Tally { caught, unviable: list("unviable")?.len(), survivors })
}

fn lines(path: &Path) -> Result<Vec<String>, Error> {
    let text = fs::read_to_string(path)
        .map_err(|error| Error::new(format!("{} cannot be read: {error}", path.display())))?;
    Ok(text.lines().map(str::to_string).collect())
}

/// `file.rs:12:34: what` without its line and column, which any edit above moves.
fn without_place(mutant: &str) -> String {
    let mut parts = mutant.splitn(4, ':');
    match (parts.next(), parts.nth(2)) {
        (Some(file), Some(what)) => format!("{file}:{what}"),
        _ => mutant.to_string(),
    }
}

/// Enough are caught, and every survivor has its reason.
fn judge(all: &Tally) -> Result<(), Error> {
    let reasons = lines(&shell::top().join("tests/mutants.md"))?.join("\n");
    let unexplained: Vec<&String> =
        all.survivors.iter().filter(|survivor| !reasons.contains(&format!("`{survivor}`"))).collect();
    unexplained.iter().for_each(|survivor| println!("no reason given for: {survivor}"));
    if 100 * all.caught < CAUGHT_AT_LEAST * (all.caught + all.survivors.len()) {
        return Err(Error::new(format!("fewer than {CAUGHT_AT_LEAST} % of the mutants were caught")));
    }
    if unexplained.is_empty() {
        Ok(())
    } else {
        Err(Error::new(format!("{} survivors have no reason in tests/mutants.md", unexplained.len())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mutant_is_known_by_its_file_and_change() {
        assert_eq!(
            without_place("link/src/a.rs:1:2: replace A::b -> u8 with 0"),
            "link/src/a.rs: replace A::b -> u8 with 0"
        );
    }

    /// A reason that names a function that has moved explains nothing.
    #[test]
    fn every_survivor_is_in_a_function_of_its_file() {
        let reasons = lines(&shell::top().join("tests/mutants.md")).expect("it is there");
        let listed: Vec<&str> = reasons.iter().filter_map(|line| line.strip_prefix("- `")).collect();
        assert!(listed.len() > 15, "{} survivors", listed.len());
        for survivor in listed {
            let (file, change) = survivor.split_once(": ").expect("a file and its change");
            let source =
                fs::read_to_string(shell::top().join(file)).unwrap_or_else(|why| panic!("{file}: {why}"));
            // A change outside functions has no place.
            let change = change.split('`').next().unwrap_or(change);
            let Some((_, path)) = change.split_once(" in ") else { continue };
            let function = path.rsplit("::").next().unwrap_or(path);
            let is_defined = |bracket: char| source.contains(&format!("fn {function}{bracket}"));
            assert!(is_defined('(') || is_defined('<'), "{file}: no {function}");
        }
    }
}
