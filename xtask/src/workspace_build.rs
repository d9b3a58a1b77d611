//! The one build of everything for the PC, as one selection of packages: another selection is another set of features, and builds
//! most of them once more.

use crate::shell::{self, Failure, cargo};
use std::path::PathBuf;

/// The emulator asks for a newer Rust than it needs.
pub(crate) const ANY_RUST: &str = "--ignore-rust-version";
/// The selection of packages and the profile.
pub(crate) const BUILD: [&str; 3] = ["--release", "--workspace", ANY_RUST];

/// Builds a program of the one build; where it lies below the build's folder.
pub(crate) fn built(which: &[&str], below: &str) -> Result<PathBuf, Failure> {
    shell::run(cargo().args(["build", "--quiet"]).args(BUILD).args(which))?;
    Ok(shell::target().join("release").join(below))
}
