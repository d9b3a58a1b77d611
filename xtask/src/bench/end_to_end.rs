//! Measures the whole program: its build, its packages, the image, a minute of streaming, a
//! diagnosis.

use super::values::Values;
use crate::elf::Elf;
use crate::shell::{self, Error, cargo};
use crate::workspace_build::built;
use crate::{boards, firmware};
use std::collections::BTreeSet;
use std::env::consts::EXE_EXTENSION;
use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The program that has everything.
const MAIN: &str = "host-sim";
/// The program that `cargo run --release` builds.
const FIRST: &str = "needle";
/// A minute of the device, as fast as it goes.
const STREAM_SECONDS: &str = "60";

/// Time of the first command's build from nothing, in a folder of its own.
pub(crate) fn build_time() -> Result<Values, Error> {
    let folder = shell::target().join("bench-build");
    let forget = || {
        // Not there is as good.
        let _ = fs::remove_dir_all(&folder);
    };
    // What can be fetched is fetched before: the network is nobody's build time.
    shell::run(cargo().args(["fetch", "--quiet"]))?;
    forget();
    let begin = Instant::now();
    let built = shell::run(cargo().env("CARGO_TARGET_DIR", &folder).args([
        "build",
        "--release",
        "--quiet",
        "--bin",
        FIRST,
    ]));
    let seconds = begin.elapsed().as_secs_f64();
    forget();
    built.map(|()| Values::from([("build_s".into(), format!("{seconds:.1}"))]))
}

/// Packages that the main crate's build needs, itself included.
pub(crate) fn packages() -> Result<Values, Error> {
    let mut tree = cargo();
    tree.args(["tree", "--quiet", "-p", MAIN, "-e", "normal,build", "--prefix", "none", "--format", "{p}"]);
    let text = shell::output(&mut tree)?;
    let packages: BTreeSet<&str> = text.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    Ok(Values::from([("packages".into(), packages.len().to_string())]))
}

/// Bytes of the flash image.
pub(crate) fn image() -> Result<Values, Error> {
    let (_, bytes) = Elf::read(&firmware::build(boards::DEFAULT)?)?.flash_image()?;
    Ok(Values::from([("firmware_flash_bytes".into(), bytes.len().to_string())]))
}

/// The whole way of a sample: plant, control law, frame, bytes, frame again, tallies.
pub(crate) fn stream() -> Result<Values, Error> {
    let program = built(&["--bin", MAIN], MAIN)?;
    let run = |seconds| {
        let mut run = Command::new(&program);
        run.args(["run", "--headless", "--fast", "--seconds", seconds]);
        run
    };
    // Warm.
    shell::output(&mut run("1"))?;
    let begin = Instant::now();
    let text = shell::output(&mut run(STREAM_SECONDS))?;
    let seconds = begin.elapsed().as_secs_f64();
    let samples =
        text.split_whitespace().rev().find_map(|word| word.strip_prefix("samples=")?.parse::<f64>().ok());
    let samples =
        samples.ok_or_else(|| Error::new("`run --headless` did not print the number of samples"))?;
    Ok(Values::from([("stream_samples_per_s".into(), format!("{:.0}", samples / seconds))]))
}

/// About a minute of recording to fit, and another one to judge, made by the virtual device; their
/// folder.
pub(crate) fn recordings() -> Result<PathBuf, Error> {
    let folder = shell::target().join("bench-recordings");
    let program = built(&["--bin", MAIN], MAIN)?;
    shell::run(Command::new(program).arg("characterise").arg("--out").arg(&folder))?;
    Ok(folder)
}

/// Time and memory of a diagnosis.
pub(crate) fn diagnosis() -> Result<Values, Error> {
    let folder = recordings()?;
    let mut diagnose = Command::new(shell::target().join("release").join(MAIN).with_extension(EXE_EXTENSION));
    diagnose.current_dir(shell::top()).arg("diagnose").arg("--rig").arg(folder.join("rig.toml"));
    diagnose.arg("--fit").arg(folder.join("fit.csv")).arg("--holdout").arg(folder.join("holdout.csv"));
    diagnose.arg("--out").arg(folder.join("diagnosis")).stdout(Stdio::null());
    let (seconds, peak_kib) = watched(&mut diagnose)?;
    let mut values = Values::from([("diagnose_60s_s".into(), format!("{seconds:.2}"))]);
    values.extend(peak_kib.map(|kib| ("diagnose_peak_mib".into(), format!("{:.0}", kib / 1024.0))));
    Ok(values)
}

/// Runs a program to its end: its time in s, and the most memory that it had, in KiB, where the
/// system counts that.
fn watched(program: &mut Command) -> Result<(f64, Option<f64>), Error> {
    let begin = Instant::now();
    let mut child =
        program.spawn().map_err(|error| Error::new(format!("{MAIN} could not be started: {error}")))?;
    let status_file = format!("/proc/{}/status", child.id());
    let mut peak_kib = None;
    let status = loop {
        // Gone with the process; the last look counts.
        peak_kib = fs::read_to_string(&status_file).ok().as_deref().and_then(peak_of).or(peak_kib);
        match child.try_wait() {
            Ok(None) => std::thread::sleep(Duration::from_millis(20)),
            Ok(Some(status)) => break status,
            Err(error) => return Err(Error::new(format!("the diagnosis was lost: {error}"))),
        }
    };
    if status.success() {
        Ok((begin.elapsed().as_secs_f64(), peak_kib))
    } else {
        Err(Error::new(format!("the diagnosis failed ({status})")))
    }
}

/// The most memory that a process has had, in KiB, from Linux' own account of it.
fn peak_of(status: &str) -> Option<f64> {
    status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix("kB")?.trim().parse().ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_read_from_the_account() {
        assert_eq!(peak_of("Name:\tx\nVmPeak:\t   9 kB\nVmHWM:\t   51200 kB\n"), Some(51_200.0));
    }
}
