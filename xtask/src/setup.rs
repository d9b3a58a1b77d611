//! The programs that a machine needs beyond Rust: named, then installed where that is allowed, else
//! the one command that does it.

use crate::shell::{self, Error};
use crate::workspace_build::OWN_COMPILER;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// True if packages of the system may be installed.
fn is_root() -> bool {
    // The effective user is the second number; no number, no root.
    fs::read_to_string("/proc/self/status")
        .ok()
        .and_then(|status| {
            let line = status.lines().find(|line| line.starts_with("Uid:"))?.to_string();
            line.split_whitespace().nth(2).map(|uid| uid == "0")
        })
        .unwrap_or(false)
}

/// Fails if the disk that cargo builds on has less than `needed_mib` left in addition to what the
/// target folder already holds. A machine without `df` passes.
pub(crate) fn disk(needed_mib: u64) -> Result<(), Error> {
    let target = shell::target();
    let folder = if target.is_dir() { target.clone() } else { shell::top() };
    let mib = |program: &str, flags: &[&str], row: usize, column: usize| -> Option<u64> {
        let said =
            Command::new(program).args(flags).arg(&folder).output().ok().filter(|it| it.status.success())?;
        String::from_utf8_lossy(&said.stdout).lines().nth(row)?.split_whitespace().nth(column)?.parse().ok()
    };
    let Some(free) = mib("df", &["-P", "-m"], 1, 3) else { return Ok(()) };
    let built = if target.is_dir() { mib("du", &["-s", "-m"], 0, 0).unwrap_or(0) } else { 0 };
    if free + built >= needed_mib {
        return Ok(());
    }
    Err(Error::new(format!(
        "{} has {free} MiB free and the tests write {needed_mib} MiB; free some, or set CARGO_TARGET_DIR to a folder on another disk",
        folder.display()
    )))
}

/// Installs Debian packages, or says the command that does.
pub(crate) fn install(packages: &[&str], what_for: &str) -> Result<(), Error> {
    let list = packages.join(" ");
    if !is_root() || !shell::is_on_path("apt-get") {
        return Err(Error::new(format!(
            "{what_for} needs {list}; install it with `sudo apt-get update && sudo apt-get install -y {list}`"
        )));
    }
    eprintln!("{what_for} needs {list}: installing");
    let apt = || {
        let mut command = Command::new("apt-get");
        command.env("DEBIAN_FRONTEND", "noninteractive");
        command
    };
    // A stale index is no reason to stop; what it lacks shows at once.
    let _ = shell::run(apt().args(["update", "-q"]));
    shell::run(apt().args(["install", "-y", "-q", "--no-install-recommends"]).args(packages))
}

/// The browser that the page is tested in.
pub(crate) fn browser() -> Result<(), Error> {
    if ["chromium", "chromium-browser", "google-chrome"].into_iter().any(shell::is_on_path) {
        return Ok(());
    }
    install(&["chromium"], "the browser test")
}

/// Returns the interpreter of a Python of our own in `target/`, with exactly these packages
/// (`name==version`) in addition to what it already has.
pub(crate) fn python(packages: &[&str]) -> Result<PathBuf, Error> {
    let folder = shell::target().join("python");
    let interpreter = folder.join("bin/python");
    if !interpreter.exists() {
        if !shell::is_on_path("python3") {
            install(&["python3", "python3-venv"], "the test of other programs' formats")?;
        }
        let made = shell::run(Command::new("python3").args(["-m", "venv"]).arg(&folder));
        if made.is_err() {
            // Debian's python3 comes without the module.
            install(&["python3-venv"], "the test of other programs' formats")?;
            shell::run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))?;
        }
    }
    let mut listed = Command::new(&interpreter);
    let listed = shell::output(listed.args(["-m", "pip", "list", "--format=freeze"]))?;
    let missing: Vec<&&str> =
        packages.iter().filter(|name| !listed.lines().any(|line| line == **name)).collect();
    if !missing.is_empty() {
        let mut pip = Command::new(&interpreter);
        shell::run(
            pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(missing),
        )?;
    }
    Ok(interpreter)
}

/// Packages for node in `target/node`, exactly these (`name@version`) and what they need; the
/// folder for `NODE_PATH`.
pub(crate) fn node_packages(packages: &[&str]) -> Result<PathBuf, Error> {
    node()?;
    let folder = shell::target().join("node");
    let modules = folder.join("node_modules");
    let is_there = |package: &&str| {
        let (name, version) = package.rsplit_once('@').unwrap_or((*package, ""));
        fs::read_to_string(modules.join(name).join("package.json"))
            .is_ok_and(|text| text.contains(&format!("\"version\": \"{version}\"")))
    };
    if !packages.iter().all(is_there) {
        if !shell::is_on_path("npm") {
            install(&["npm"], "the test of other programs' clients")?;
        }
        // Not the scripts that packages bring: none of these needs one.
        let mut npm = Command::new("npm");
        npm.args(["install", "--no-save", "--ignore-scripts", "--no-audit", "--no-fund", "--prefix"]);
        shell::run(npm.arg(&folder).args(packages))?;
    }
    Ok(modules)
}

/// Makes sure of Node.js, which runs WebAssembly without a browser.
pub(crate) fn node() -> Result<(), Error> {
    if shell::is_on_path("node") {
        Ok(())
    } else {
        install(&["nodejs"], "the test of the device in a browser")
    }
}

/// Makes sure of Mono, which compiles and runs C#: Debian has it, and no registry that CI reaches
/// has .NET.
pub(crate) fn mono() -> Result<(), Error> {
    if ["mcs", "mono"].into_iter().all(shell::is_on_path) {
        return Ok(());
    }
    let packages =
        ["mono-mcs", "mono-runtime", "libmono-system-runtime-serialization4.0-cil", "libmono-system4.0-cil"];
    install(&packages, "the test of the documented C# client")
}

/// The way in which this machine builds the image for the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Toolchain {
    /// The toolchain at hand has the target.
    Installed,
    /// Debian's own compiler builds the core library along, from its sources.
    Debian,
}

/// The board's target.
pub(crate) const TARGET: &str = "thumbv7em-none-eabihf";
/// Debian's compiler, cargo, sources of the core library, and the names under which the compiler
/// finds its linker; all newer than its release.
const DEBIAN_PACKAGES: [&str; 4] = ["rustc-web", "cargo-web", "rust-web-src", "rust-web-llvm"];
/// The linker for the board, a link to the package of its version.
const DEBIAN_LINKER: &str = "/usr/bin/rust-lld";

/// Finds a way to build for the board: the target at hand, else added by rustup, else Debian's
/// compiler.
pub(crate) fn toolchain() -> Result<Toolchain, Error> {
    toolchain_for(TARGET, "the image for the board")
}

/// The same for any `target`; `what_for` says who needs it.
pub(crate) fn toolchain_for(target: &str, what_for: &str) -> Result<Toolchain, Error> {
    if has_target(target) {
        return Ok(Toolchain::Installed);
    }
    if shell::is_on_path("rustup") {
        eprintln!("{what_for} needs the Rust target {target}: installing");
        let added =
            shell::run(Command::new("rustup").current_dir(shell::top()).args(["target", "add", target]));
        if added.is_ok() && has_target(target) {
            return Ok(Toolchain::Installed);
        }
        eprintln!("rustup could not add it; trying Debian's compiler, which builds the core library itself");
    }
    if !has_debian_compiler() {
        install(&DEBIAN_PACKAGES, what_for)?;
    }
    if let Some(package) = missing_debian_linker() {
        install(&[&package], what_for)?;
    }
    if has_debian_compiler() {
        Ok(Toolchain::Debian)
    } else {
        Err(Error::new(format!(
            "there is no way to build {what_for} on this machine; install the target with `rustup target add {target}`"
        )))
    }
}

/// Cargo as `toolchain` wants it, for a command such as `build`.
/// Never incrementally: that makes another image, with other times.
pub(crate) fn cargo_for_board(toolchain: Toolchain, subcommand: &str) -> Command {
    let mut cargo = cargo_with(toolchain, subcommand, "core");
    cargo.env("CARGO_INCREMENTAL", "0");
    cargo
}

/// The same where the crates of the standard library in `library` are needed; by the compiler
/// alone, as it is shipped.
pub(crate) fn cargo_with(toolchain: Toolchain, subcommand: &str, library: &str) -> Command {
    match toolchain {
        Toolchain::Installed => {
            let mut cargo = shell::cargo();
            cargo.arg(subcommand).env_remove(OWN_COMPILER);
            cargo
        }
        Toolchain::Debian => {
            let mut cargo = Command::new("/usr/bin/cargo");
            cargo.current_dir(shell::top());
            // `-Z` on a stable compiler: only the library is built with it, from the compiler's own
            // sources.
            cargo.env("RUSTC", "/usr/bin/rustc").env("RUSTC_BOOTSTRAP", "1").env_remove("RUSTUP_TOOLCHAIN");
            cargo.env_remove(OWN_COMPILER);
            cargo.arg(subcommand).arg(format!("-Zbuild-std={library}"));
            cargo
        }
    }
}

/// True if the compiler at hand has the core library of `target`.
pub(crate) fn has_target(target: &str) -> bool {
    let mut rustc = Command::new("rustc");
    rustc.current_dir(shell::top()).args(["--print", "target-libdir", "--target", target]);
    shell::output(&mut rustc).is_ok_and(|folder| {
        fs::read_dir(folder.trim()).is_ok_and(|entries| {
            entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("libcore-"))
        })
    })
}

/// The package, named as the program that the link leads to, where that is not there.
fn missing_debian_linker() -> Option<String> {
    let program = fs::read_link(DEBIAN_LINKER).ok()?;
    let is_there = Path::new("/usr/bin").join(&program).exists();
    if is_there { None } else { Some(program.file_name()?.to_str()?.to_string()) }
}

fn has_debian_compiler() -> bool {
    let has_sources = Path::new("/usr/lib/rustlib/src/rust/library/core").is_dir()
        || fs::read_dir("/usr/src").is_ok_and(|entries| {
            entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("rustc-"))
        });
    Path::new("/usr/bin/rustc").is_file() && Path::new("/usr/bin/cargo").is_file() && has_sources
}
