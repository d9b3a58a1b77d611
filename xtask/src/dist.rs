//! Makes what a lab downloads: both boards' images, a program for this PC and, on Linux, one for
//! Windows, and a Python package, each with the commit it was built from.

use crate::boards::{self, Board};
use crate::elf::Elf;
use crate::shell::{self, Error};
use crate::{dfu, firmware, python, setup};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Windows on a PC, by the compiler that Debian has for it.
const WINDOWS: &str = "x86_64-pc-windows-gnu";

/// The variable that names the commit (`link/src/build.rs`).
const BUILD: &str = "NEEDLE_BUILD";

/// `cargo xtask dist`.
pub(crate) fn run() -> Result<(), Error> {
    let build = commit()?;
    let folder = shell::target().join("dist");
    fs::create_dir_all(&folder).map_err(|error| unwritable(&folder, &error))?;
    // SAFETY: no other thread runs yet, and the builds below inherit the variable.
    #[allow(unsafe_code, reason = "the environment of this process is changed once, before any thread")]
    unsafe {
        std::env::set_var(BUILD, &build);
    }
    let mut made = Vec::new();
    for board in &boards::ALL {
        made.extend(images(board, &folder)?);
    }
    made.push(program(&folder, None)?);
    if cfg!(target_os = "linux") {
        made.push(program(&folder, Some(WINDOWS))?);
    }
    made.push(wheel(&folder)?);
    println!("built from {build}:");
    for (name, bytes) in made {
        println!("  {:>9} bytes  {}", bytes, folder.join(name).display());
    }
    Ok(())
}

/// The first eight digits of the commit's hash, with a `+` if the sources differ from it.
pub(crate) fn commit() -> Result<String, Error> {
    let git = |arguments: &[&str]| {
        Command::new("git").args(arguments).current_dir(shell::top()).output().map_err(|error| {
            Error::new(format!(
                "git could not be started: {error}; install it, what is made here names its commit"
            ))
        })
    };
    let hash = git(&["rev-parse", "HEAD"])?;
    let text = String::from_utf8_lossy(&hash.stdout);
    let Some(hash) = text.get(..8).filter(|_| hash.status.success()) else {
        return Err(Error::new(
            "this is not a git checkout: clone the repository, what is made here names its commit",
        ));
    };
    let is_changed = !git(&["status", "--porcelain"])?.stdout.is_empty();
    Ok(if is_changed { format!("{hash}+") } else { hash.to_string() })
}

/// Writes the images of a board. Returns their names and sizes.
fn images(board: &Board, folder: &Path) -> Result<Vec<(String, usize)>, Error> {
    let built = firmware::build(board)?;
    let elf = fs::read(&built).map_err(|error| unreadable(&built, &error))?;
    let (start, bin) = Elf::read(&built)?.flash_image()?;
    let name = format!("needle-{}", board.name);
    let dfu = dfu::file(board.title, start, &bin);
    let files = [("elf", elf), ("bin", bin), ("dfu", dfu)];
    files.into_iter().map(|(ending, bytes)| write(folder, format!("{name}.{ending}"), &bytes)).collect()
}

/// Builds the Python package. Returns its name and size.
fn wheel(folder: &Path) -> Result<(String, usize), Error> {
    let python = setup::python(&["maturin==1.16.0"])?;
    let wheel = python::wheel(&python, folder)?;
    let bytes = fs::metadata(&wheel).map_err(|error| unreadable(&wheel, &error))?.len();
    let name = wheel.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok((name, usize::try_from(bytes).unwrap_or(usize::MAX)))
}

/// Builds the program, for this PC or for another target, and writes it without its symbols.
/// Returns its name and size.
fn program(folder: &Path, target: Option<&str>) -> Result<(String, usize), Error> {
    let ending = if target == Some(WINDOWS) { ".exe" } else { std::env::consts::EXE_SUFFIX };
    let name = format!("host-sim{ending}");
    let mut build = shell::cargo();
    build.args(["rustc", "--release", "--ignore-rust-version", "-p", "host-sim", "--bin", "host-sim"]);
    if let Some(target) = target {
        let what_for = "the program for Windows";
        setup::toolchain_for(target, what_for)?;
        if !shell::is_on_path("x86_64-w64-mingw32-gcc") {
            setup::install(&["gcc-mingw-w64-x86-64"], what_for)?;
        }
        build.args(["--target", target]);
    }
    shell::run(build.args(["--", "-C", "strip=symbols"]))?;
    let built = shell::target().join(target.unwrap_or_default()).join("release").join(&name);
    let bytes = fs::read(&built).map_err(|error| unreadable(&built, &error))?;
    let copy = folder.join(&name);
    fs::copy(&built, &copy).map_err(|error| unwritable(&copy, &error))?;
    Ok((name, bytes.len()))
}

fn write(folder: &Path, name: String, bytes: &[u8]) -> Result<(String, usize), Error> {
    let path = folder.join(&name);
    fs::write(&path, bytes).map_err(|error| unwritable(&path, &error))?;
    Ok((name, bytes.len()))
}

fn unwritable(path: &Path, error: &std::io::Error) -> Error {
    Error::new(format!("{} cannot be written: {error}", path.display()))
}

fn unreadable(path: &Path, error: &std::io::Error) -> Error {
    Error::new(format!("{} cannot be read: {error}", path.display()))
}
