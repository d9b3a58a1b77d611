//! The one build of everything for the PC, as one selection of packages: another selection is
//! another set of features, and builds most of them once more.

use crate::shell::{self, Error, cargo};
use std::path::PathBuf;

/// The emulator asks for a newer Rust than it needs.
pub(crate) const ANY_RUST: &str = "--ignore-rust-version";
/// The selection of packages and the profile.
pub(crate) const BUILD: [&str; 3] = ["--release", "--workspace", ANY_RUST];

/// Cargo's variable for the compiler of the workspace's own crates.
pub(crate) const OWN_COMPILER: &str = "RUSTC_WORKSPACE_WRAPPER";

/// Has clippy compile the workspace's crates from now on, in this process and those that it
/// starts, with every warning an error: the build that the tests run is also the check, and no
/// second one reads everything again. Clippy hands the same code to the same compiler. Images and
/// what the browser runs are built as they are shipped, without it.
///
/// # Safety
///
/// No other thread may run: it sets variables of the environment.
#[allow(unsafe_code, reason = "the environment is changed, for which the caller answers")]
pub(crate) unsafe fn compile_by_clippy() {
    // Clippy's own form of `-D warnings`.
    let deny = "-D__CLIPPY_HACKERY__warnings__CLIPPY_HACKERY__";
    for (name, value) in [(OWN_COMPILER, "clippy-driver"), ("CLIPPY_ARGS", deny)] {
        // SAFETY: as the caller says.
        unsafe { std::env::set_var(name, value) };
    }
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
    fn every_selection_is_built_of_the_same_crates() {
        let everything = crates(&["--workspace"]);
        for selection in [&[][..], &["-p", "needle-diagnosis"]] {
            let own = crates(selection);
            let others: Vec<_> = own.difference(&everything).collect();
            assert!(others.is_empty(), "{selection:?}: host-sim/same-features does not cover {others:#?}");
        }
    }
}
