//! The Python package as a wheel, which maturin makes of `diagnosis/python`.

use crate::shell::{self, Error};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Builds the wheel into a folder, which holds no other afterwards; `python` has maturin.
pub(crate) fn wheel(python: &Path, folder: &Path) -> Result<PathBuf, Error> {
    let is_wheel = |path: &PathBuf| path.extension().is_some_and(|ending| ending == "whl");
    for old in files(folder).into_iter().filter(is_wheel) {
        fs::remove_file(&old)
            .map_err(|error| Error::new(format!("{} cannot be removed: {error}", old.display())))?;
    }
    let mut build = Command::new(python);
    build.args(["-m", "maturin", "build", "--release", "--quiet", "--out"]).arg(folder);
    // The stable ABI: no interpreter has a say in it.
    build
        .arg("--manifest-path")
        .arg(shell::top().join("diagnosis/python/Cargo.toml"))
        .arg("--ignore-rust-version");
    shell::run(&mut build)?;
    files(folder)
        .into_iter()
        .find(is_wheel)
        .ok_or_else(|| Error::new(format!("maturin left no wheel in {}", folder.display())))
}

fn files(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).map(|all| all.flatten().map(|one| one.path()).collect()).unwrap_or_default()
}
