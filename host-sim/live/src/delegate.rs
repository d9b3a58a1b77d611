//! Hands the command line to `host-sim`. Under `cargo run`, cargo builds that program first, in the
//! same profile and with the same features, so that it is never older than its source.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

/// The features that `host-sim` has too.
const FEATURES: [(&str, bool); 5] = [
    ("class", cfg!(feature = "class")),
    ("foxglove", cfg!(feature = "foxglove")),
    ("hdf5", cfg!(feature = "hdf5")),
    ("parquet", cfg!(feature = "parquet")),
    ("ros", cfg!(feature = "ros")),
];

/// Builds `host-sim` where cargo runs this program, runs it with the same arguments, and returns
/// its exit status.
pub(crate) fn run() -> ExitCode {
    let Ok(program) = std::env::current_exe().map(|own| beside(&own)) else {
        return refused("its own place is not known; start host-sim itself");
    };
    if let (Some(cargo), Some(own)) = (std::env::var_os("CARGO"), std::env::var_os("CARGO_MANIFEST_DIR")) {
        let built = build(&cargo, Path::new(&own), &program).status();
        if !built.is_ok_and(|status| status.success()) {
            return refused("host-sim, which has this command, could not be built; see cargo's lines above");
        }
    }
    let mut command = Command::new(&program);
    match become_it(command.args(std::env::args_os().skip(1))) {
        Ok(status) => status,
        Err(cause) => refused(&format!(
            "{}, which has this command, cannot be started ({cause}); build it with cargo build --release",
            program.display()
        )),
    }
}

/// Puts a program in the place of this one, so that a signal that ends this process ends it, and
/// with it a device's torque.
#[cfg(unix)]
fn become_it(command: &mut Command) -> std::io::Result<ExitCode> {
    use std::os::unix::process::CommandExt;
    Err(command.exec())
}

/// Runs a program and returns its exit status.
#[cfg(not(unix))]
fn become_it(command: &mut Command) -> std::io::Result<ExitCode> {
    let code = command.status()?.code().and_then(|code| u8::try_from(code).ok());
    Ok(ExitCode::from(code.unwrap_or(1)))
}

fn beside(own: &Path) -> PathBuf {
    own.with_file_name(format!("host-sim{}", std::env::consts::EXE_SUFFIX))
}

/// The build of `host-sim` as this program was built, whose package's folder is `own`.
fn build(cargo: &OsStr, own: &Path, program: &Path) -> Command {
    let folder = program.parent().and_then(Path::file_name).and_then(OsStr::to_str).unwrap_or("release");
    let profile = if folder == "debug" { "dev" } else { folder };
    let features: Vec<&str> = FEATURES.iter().filter(|(_, on)| *on).map(|(name, _)| *name).collect();
    let mut command = Command::new(cargo);
    command.args(["build", "--bin", "host-sim", "--profile", profile, "--features", &features.join(",")]);
    command.current_dir(own.parent().unwrap_or(own));
    command
}

fn refused(why: &str) -> ExitCode {
    eprintln!("host-sim: {why}");
    ExitCode::FAILURE
}
