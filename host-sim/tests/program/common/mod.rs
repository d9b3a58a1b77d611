//! The shared parts of the command line's tests: the program, a separate folder, its output.
#![allow(dead_code, reason = "each test file uses some of it")]

pub(crate) mod axis;
pub(crate) mod paced;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The program with these arguments, not yet started.
pub(crate) fn host_sim(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host-sim"));
    command.args(arguments);
    command
}

/// Runs it to its end.
pub(crate) fn run(arguments: &[&str]) -> Output {
    host_sim(arguments).output().expect("the program starts")
}

/// Runs it to its end, which must be good; standard output.
pub(crate) fn run_well(arguments: &[&str]) -> String {
    let output = run(arguments);
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {:?}: {said}", output.status);
    String::from_utf8(output.stdout).expect("text")
}

/// Checks that it ends with `status` and says one clear line on standard error that contains every
/// hint; the line.
pub(crate) fn refused(output: &Output, status: i32, hints: &[&str]) -> String {
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(status), "{said}");
    assert_eq!(said.lines().count(), 1, "one line, not: {said}");
    assert!(said.starts_with("host-sim: "), "{said}");
    for hint in hints {
        assert!(said.contains(hint), "\"{hint}\" is not in: {said}");
    }
    said
}

/// An empty folder for the test of this name.
pub(crate) fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    // Left over from an earlier run.
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("the target folder can be written");
    folder
}

/// A path as an argument.
pub(crate) fn text(path: &Path) -> &str {
    path.to_str().expect("the target folder has a plain name")
}

/// The number behind `key=` on the last line.
pub(crate) fn figure(stdout: &str, key: &str) -> f64 {
    let last = stdout.lines().last().expect("there is a last line");
    let found = last.split(' ').find_map(|field| field.strip_prefix(key)?.strip_prefix('='));
    found.unwrap_or_else(|| panic!("{key} is not in: {last}")).parse().expect("a number")
}
