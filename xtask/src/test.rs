//! `cargo xtask test`: everything that passes or fails, set-up included, each step also by its own name.

use crate::boards::{self, Board};
use crate::setup::{self, Toolchain};
use crate::shell::{self, Failure, cargo};
use crate::{board_test, firmware, site, wasm};
use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::time::{Duration, Instant};

/// A run that takes longer hangs: it should take half an hour at the most, on two slow cores too.
const LIMIT: Duration = Duration::from_secs(60 * 60);
/// What a whole run writes into an empty target folder, and room to spare; a linker on a full disk dies of a bus error.
const NEEDED_MIB: u64 = 7 * 1024;
/// As much where most is built already.
const NEEDED_BY_A_STEP_MIB: u64 = 1024;
const FUZZ_SECONDS: &str = "60";
/// The emulator asks for a newer Rust than it needs.
const ANY_RUST: &str = "--ignore-rust-version";

/// One selection of packages wherever it can be: another one is another set of features, and builds most of them once more. `tests`
/// stays out, whose decoder of the firmware's log gives `serde_json` a feature that reads numbers in tagged messages as maps.
const CRATES: [&str; 3] = ["--workspace", "--exclude", "tests"];

/// A step: its name, what it shows, and what it does.
struct Step {
    name: &'static str,
    shows: &'static str,
    run: fn(&Clock) -> Result<Ended, Failure>,
}

/// How a step ended that did not fail.
enum Ended {
    Passed,
    /// It cannot run here, and why.
    Skipped(String),
}

/// In the order that finds the most for the least time.
const STEPS: [Step; 13] = [
    Step { name: "fmt", shows: "the sources are formatted", run: fmt },
    Step { name: "firmware", shows: "the boards' flash images build, without warnings, and fit", run: image },
    Step { name: "clippy", shows: "no warning from the compiler or clippy", run: clippy },
    Step { name: "doc", shows: "the documentation builds without warnings, its examples run", run: doc },
    Step { name: "unit", shows: "the crates' tests", run: unit },
    Step { name: "wasm", shows: "what the page computes is built from its sources", run: page_wasm },
    Step { name: "site", shows: "the device in a browser gives the same bits as host-sim's", run: same_bits },
    Step { name: "board", shows: "the flash images on the emulated boards", run: board },
    Step { name: "browser", shows: "the page in a real browser", run: browser },
    Step {
        name: "clients",
        shows: "streams and exported rigs as other people's programs read them",
        run: clients,
    },
    Step { name: "parquet", shows: "import reads Parquet, which the default build leaves out", run: parquet },
    Step { name: "fuzz", shows: "the frame parser, a minute of damaged frames", run: fuzz },
    Step { name: "prove", shows: "the small proof of the diagnosis", run: prove },
];

/// What this does not run, and why.
const NEVER_HERE: [(&str, &str); 3] = [
    ("hardware", "flashing and running on a real board: needs one and a person beside it"),
    ("class", "devices and instructor over Zenoh, which builds for minutes: run `cargo xtask class`"),
    ("foxglove", "Foxglove's live stream, whose build takes minutes: run `cargo xtask foxglove`"),
];

/// When the whole run has to be over.
struct Clock(Instant);

impl Clock {
    /// Runs a command, ended at the limit.
    fn run(&self, command: &mut Command) -> Result<(), Failure> {
        let said = shell::said(command);
        eprintln!("$ {said}");
        let mut child = command
            .spawn()
            .map_err(|error| Failure::new(format!("`{said}` could not be started: {error}")))?;
        loop {
            match child.try_wait() {
                Ok(Some(status)) if status.success() => return Ok(()),
                Ok(Some(status)) => return Err(Failure::new(format!("`{said}` failed ({status})"))),
                Ok(None) if Instant::now() > self.0 => {
                    // Gone already is as good.
                    let _ = child.kill();
                    let _ = child.wait();
                    let minutes = LIMIT.as_secs() / 60;
                    return Err(Failure::new(format!(
                        "`{said}` was ended: the whole run may take {minutes} minutes"
                    )));
                }
                Ok(None) => std::thread::sleep(Duration::from_millis(50)),
                Err(error) => return Err(Failure::new(format!("`{said}` was lost: {error}"))),
            }
        }
    }
}

/// Runs the steps named, or all of them, and says how each ended.
pub(crate) fn run(names: &[String]) -> Result<(), Failure> {
    if let Some(unknown) = names.iter().find(|name| STEPS.iter().all(|step| step.name != **name)) {
        let all: Vec<&str> = STEPS.iter().map(|step| step.name).collect();
        return Err(Failure::usage(format!(
            "`{unknown}` is no step of the tests; they are: {}",
            all.join(" ")
        )));
    }
    setup::disk(if names.is_empty() { NEEDED_MIB } else { NEEDED_BY_A_STEP_MIB })?;
    let clock = Clock(Instant::now() + LIMIT);
    let mut summary = vec![];
    let (mut passed, mut failed) = (0, 0);
    for step in STEPS.iter().filter(|step| names.is_empty() || names.iter().any(|name| name == step.name)) {
        eprintln!("\n== {}: {}", step.name, step.shows);
        let begin = Instant::now();
        let ended = (step.run)(&clock);
        let seconds = begin.elapsed().as_secs_f64();
        let verdict = match ended {
            Ok(Ended::Passed) => {
                passed += 1;
                "pass".to_string()
            }
            Ok(Ended::Skipped(why)) => format!("not run: {why}"),
            Err(failure) => {
                failed += 1;
                eprintln!("error: {failure}");
                format!("FAIL: {failure}")
            }
        };
        summary.push(format!("{:<9}{seconds:>7.1} s  {verdict}", step.name));
    }
    println!("\nSummary");
    summary.iter().for_each(|line| println!("  {line}"));
    NEVER_HERE.iter().for_each(|(what, why)| println!("  {what:<9}      -  not run: {why}"));
    println!("steps: {passed} passed, {failed} failed");
    if failed == 0 {
        Ok(())
    } else {
        Err(Failure::new(format!("{failed} steps of the tests failed; see the summary")))
    }
}

fn passed(done: Result<(), Failure>) -> Result<Ended, Failure> {
    done.map(|()| Ended::Passed)
}

fn fmt(clock: &Clock) -> Result<Ended, Failure> {
    passed(clock.run(cargo().args(["fmt", "--all", "--check"])))
}

fn clippy(clock: &Clock) -> Result<Ended, Failure> {
    passed(clock.run(cargo().args([
        "clippy",
        "--release",
        "--workspace",
        "--all-targets",
        ANY_RUST,
        "--",
        "-D",
        "warnings",
    ])))
}

fn doc(clock: &Clock) -> Result<Ended, Failure> {
    let mut build = cargo();
    build.env("RUSTDOCFLAGS", "-D warnings");
    clock.run(build.args(["doc", "--release", "--workspace", "--no-deps", ANY_RUST]))?;
    passed(clock.run(cargo().args(["test", "--release", "--workspace", "--doc", "--quiet", ANY_RUST])))
}

fn unit(clock: &Clock) -> Result<Ended, Failure> {
    passed(clock.run(tests().args(CRATES)))
}

/// The image of every board, and the same warnings for it as for everything else.
fn image(clock: &Clock) -> Result<Ended, Failure> {
    passed(boards::ALL.iter().try_for_each(|board| image_of(board, clock)))
}

fn image_of(board: &Board, clock: &Clock) -> Result<(), Failure> {
    firmware::report(board, &firmware::build(board)?)?;
    board_test::build(board)?;
    let toolchain = setup::toolchain()?;
    if toolchain == Toolchain::Debian {
        // Debian's compiler comes without clippy; the host's clippy has seen all but the tasks.
        return Ok(());
    }
    let mut clippy = setup::cargo_for_board(toolchain, "clippy");
    clock.run(clippy.args(firmware::arguments(board)).args(["--bin", "firmware", "--", "-D", "warnings"]))
}

fn page_wasm(_: &Clock) -> Result<Ended, Failure> {
    eprintln!("checked {}", wasm::check()?);
    Ok(Ended::Passed)
}

fn same_bits(_: &Clock) -> Result<Ended, Failure> {
    passed(site::check())
}

fn board(clock: &Clock) -> Result<Ended, Failure> {
    // The tests find the other boards' beside the default one's.
    for board in &boards::ALL {
        firmware::build(board)?;
    }
    let image = firmware::path(boards::DEFAULT);
    let names = test_programs()?.into_iter().filter(|name| !is_for_browser(name));
    passed(clock.run(tests().env("FIRMWARE_ELF", image).args(["-p", "tests", "--lib"]).args(each(names))))
}

fn browser(clock: &Clock) -> Result<Ended, Failure> {
    let names: Vec<String> = test_programs()?.into_iter().filter(|name| is_for_browser(name)).collect();
    if names.is_empty() {
        return Ok(Ended::Skipped("there is no test program for the browser in tests/tests".into()));
    }
    setup::browser()?;
    site::build()?;
    passed(clock.run(tests().args(["-p", "tests"]).args(each(names.into_iter()))))
}

/// Libraries of other people, each at the version that the check was written against.
const CLIENTS: [&str; 4] = ["pyigtl==0.3.4", "websockets==17.4", "mujoco==4.0.0", "mcap==1.6.0"];
fn clients(clock: &Clock) -> Result<Ended, Failure> {
    let python = setup::python(&CLIENTS)?;
    let top = shell::top();
    let program = built(clock, &["--bin", "host-sim"], "host-sim")?;
    clock.run(Command::new(&python).arg(top.join("tests/clients/streams.py")).arg(&program))?;
    clock.run(Command::new(&python).arg(top.join("tests/clients/recording.py")).arg(&program))?;
    setup::mono()?;
    clock.run(Command::new(&python).arg(top.join("tests/clients/documented.py")).arg(&program))?;
    passed(clock.run(Command::new(&python).arg(top.join("tests/clients/mujoco_rig.py")).arg(&program)))
}

/// Apart from `unit`: forty packages more.
fn parquet(clock: &Clock) -> Result<Ended, Failure> {
    let mut import = cargo();
    import.args(["test", "--release", "--quiet", ANY_RUST]).args(CRATES);
    passed(clock.run(import.args(["--features", "host-sim/parquet", "--test", "import"])))
}

fn fuzz(clock: &Clock) -> Result<Ended, Failure> {
    let program = built(clock, &["--example", "fuzz_frames"], "examples/fuzz_frames")?;
    passed(clock.run(Command::new(program).args(["--seconds", FUZZ_SECONDS])))
}

fn prove(clock: &Clock) -> Result<Ended, Failure> {
    let program = built(clock, &["--bin", "prove"], "prove")?;
    passed(clock.run(Command::new(program).arg("--quick").current_dir(shell::top())))
}

/// The tests of a class, which need a build of their own, and the measurement of thirty devices.
pub(crate) fn class() -> Result<(), Failure> {
    let clock = Clock(Instant::now() + LIMIT);
    let build = ["--features", "host-sim/class", ANY_RUST];
    let mut clippy = cargo();
    clippy.args(["clippy", "--release", "--all-targets"]).args(CRATES).args(build);
    clock.run(clippy.args(["--", "-D", "warnings"]))?;
    let mut test = cargo();
    test.args(["test", "--release", "--test", "class", "--test", "class_hostile"]).args(CRATES).args(build);
    // One after the other: what is measured must not share the machine.
    test.args(["--", "--include-ignored", "--nocapture", "--test-threads", "1"]);
    clock.run(&mut test)
}

/// Foxglove's client, the socket it needs, and what reads the schema of its transforms; each at the version that the check was
/// written against.
const FOXGLOVE_CLIENT: [&str; 3] = ["@foxglove/ws-protocol@0.8.0", "ws@8.23.0", "protobufjs@8.8.1"];

/// Foxglove's live stream read by Foxglove's own client; needs a build of its own.
pub(crate) fn foxglove() -> Result<(), Failure> {
    let clock = Clock(Instant::now() + LIMIT);
    let modules = setup::node_packages(&FOXGLOVE_CLIENT)?;
    clock.run(cargo().args(["build", "--release", "-p", "host-sim", "--features", "foxglove", ANY_RUST]))?;
    let mut node = Command::new("node");
    node.env("NODE_PATH", modules).arg(shell::top().join("tests/clients/foxglove.cjs"));
    clock.run(node.arg(shell::target().join("release/host-sim")))
}

/// Nextest where it is installed, else cargo's own.
fn tests() -> Command {
    let mut command = cargo();
    if shell::is_on_path("cargo-nextest") {
        command.args(["nextest", "run", "--no-fail-fast", "--status-level", "fail"]);
    } else {
        command.args(["test", "--no-fail-fast", "--quiet"]);
    }
    command.args(["--release", ANY_RUST]);
    command
}

/// Builds a program as `unit` does; where it lies below the build's folder.
fn built(clock: &Clock, which: &[&str], below: &str) -> Result<PathBuf, Failure> {
    clock.run(cargo().args(["build", "--release", "--quiet", ANY_RUST]).args(CRATES).args(which))?;
    Ok(shell::target().join("release").join(below))
}

/// The integration tests in `tests/tests`, by name.
pub(crate) fn test_programs() -> Result<Vec<String>, Failure> {
    let folder = shell::top().join("tests/tests");
    let entries = fs::read_dir(&folder)
        .map_err(|error| Failure::new(format!("{} cannot be read: {error}", folder.display())))?;
    let mut names: Vec<String> = entries
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "rs"))
        .filter_map(|path| Some(path.file_stem()?.to_str()?.to_string()))
        .collect();
    names.sort_unstable();
    Ok(names)
}

/// Whether a test program needs a browser.
pub(crate) fn is_for_browser(name: &str) -> bool {
    name.starts_with("browser") || name.starts_with("page")
}

fn each(names: impl Iterator<Item = String>) -> Vec<String> {
    names.flat_map(|name| ["--test".to_string(), name]).collect()
}
