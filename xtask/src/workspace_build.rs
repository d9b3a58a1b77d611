//! The one build of everything for the PC, as one selection of packages: another selection is
//! another set of features, and builds most of them once more.

use crate::shell::{self, Error, cargo};
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// The emulator asks for a newer Rust than it needs.
pub(crate) const ANY_RUST: &str = "--ignore-rust-version";
/// The selection of packages and the profile.
pub(crate) const BUILD: [&str; 3] = ["--release", "--workspace", ANY_RUST];

/// Cargo's variable for the compiler of the workspace's own crates.
pub(crate) const OWN_COMPILER: &str = "RUSTC_WORKSPACE_WRAPPER";

/// Compiles and warns.
const CLIPPY: &str = "clippy-driver";

/// Has clippy compile the workspace's crates from now on, in this process and those that it
/// starts, with every warning an error: the build that the tests run is also the check, and no
/// second one reads everything again. Clippy hands the same code to the same compiler. Images and
/// what the browser runs are built as they are shipped, without it.
///
/// # Errors
///
/// If the path of this program, which cargo calls as the compiler, is unknown.
///
/// # Safety
///
/// No other thread may run: it sets variables of the environment.
#[allow(unsafe_code, reason = "the environment is changed, for which the caller answers")]
pub(crate) unsafe fn compile_by_clippy() -> Result<(), Error> {
    let this = std::env::current_exe().map_err(|error| Error::new(format!("where is xtask? {error}")))?;
    // Clippy's own form of `-D warnings`.
    let deny = "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__".into();
    for (name, value) in [(OWN_COMPILER, this), ("CLIPPY_ARGS", deny)] {
        // SAFETY: as the caller says.
        unsafe { std::env::set_var(name, value) };
    }
    Ok(())
}

/// True if cargo calls this program as the compiler: by the path of the one that it stands for.
pub(crate) fn is_compiler(first: &str) -> bool {
    Path::new(first).file_stem().is_some_and(|name| name == "rustc")
}

/// Compiles a crate as cargo asks for it; a library with the tests inside it is hardly optimised.
pub(crate) fn compile(call: &[String]) -> ExitCode {
    match Command::new(CLIPPY).args(asked_of_clippy(call)).status() {
        Ok(status) => status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1).into(),
        Err(error) => {
            eprintln!("error: {CLIPPY} could not be started: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The call as clippy gets it. The tests inside a library take seconds at any level, and to
/// optimise the library once more for them takes a minute.
fn asked_of_clippy(call: &[String]) -> Vec<&str> {
    let has_own_tests =
        call.iter().any(|word| word == "--test") && call.iter().any(|word| word.ends_with("src/lib.rs"));
    call.iter().map(|word| if has_own_tests { at_most_one(word) } else { word }).collect()
}

fn at_most_one(level: &str) -> &str {
    if matches!(level, "opt-level=2" | "opt-level=3") { "opt-level=1" } else { level }
}

/// Builds a program of the one build and returns its path; `below` is its place in the build's
/// folder.
pub(crate) fn built(which: &[&str], below: &str) -> Result<PathBuf, Error> {
    shell::run(cargo().args(["build", "--quiet"]).args(BUILD).args(which))?;
    Ok(shell::target().join("release").join(below))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Every crate of a selection of packages, with its features.
    fn crates(selection: &[&str]) -> BTreeSet<String> {
        let mut tree = cargo();
        tree.args(["tree", "--quiet", "-e", "normal,build", "--prefix", "none", "--format", "{p} {f}"]);
        let text = shell::output(tree.args(selection)).expect("cargo shows the crates");
        text.lines().map(|line| line.trim_end_matches(" (*)").to_owned()).collect()
    }

    #[test]
    fn only_libraries_with_tests_inside_are_hardly_optimised() {
        let level_of = |source: &str, kind: &str, level: &str| {
            let call = ["rustc", "--crate-name", "x", source, kind, "-C", level, "--cfg", "opt-level=3x"];
            let call = call.map(String::from);
            let asked = asked_of_clippy(&call);
            assert_eq!((asked.len(), asked[3], asked[8]), (call.len(), source, "opt-level=3x"));
            asked[6].to_owned()
        };
        assert_eq!(level_of("diagnosis/src/lib.rs", "--test", "opt-level=3"), "opt-level=1");
        assert_eq!(level_of("diagnosis/src/lib.rs", "--test", "opt-level=0"), "opt-level=0");
        assert_eq!(level_of("diagnosis/src/lib.rs", "--crate-type=lib", "opt-level=3"), "opt-level=3");
        assert_eq!(level_of("tests/board/main.rs", "--test", "opt-level=3"), "opt-level=3");
        assert!(is_compiler("/toolchains/stable/bin/rustc") && !is_compiler("test"));
    }

    #[test]
    fn every_selection_is_built_of_the_same_crates() {
        let everything = crates(&["--workspace"]);
        for selection in [&[][..], &["-p", "needle-diagnosis"]] {
            let own = crates(selection);
            let others: Vec<_> = own.difference(&everything).collect();
            assert!(others.is_empty(), "{selection:?}: host-sim/same-features does not cover {others:#?}");
        }
    }
}
