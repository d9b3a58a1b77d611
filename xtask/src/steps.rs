//! The checks of `cargo xtask test` and `cargo xtask nightly`, each a function.

use crate::boards::{self, Board};
use crate::setup::{self, Toolchain};
use crate::shell::{self, Error, cargo};
use crate::workspace_build::{ANY_RUST, BUILD, OWN_COMPILER, built};
use crate::{
    answers, arrows, board_test, counts, firmware, mutants, python, readme, real_recordings, site, wasm,
    words,
};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};
use std::thread::{self, JoinHandle};

/// The time for which damaged frames are parsed, in s.
const FUZZ_SECONDS: &str = "3";
const LONG_FUZZ_SECONDS: &str = "600";

/// A check: its name, what it shows, and what it does.
pub(crate) struct TestStep {
    pub(crate) name: &'static str,
    pub(crate) shows: &'static str,
    /// Half of the processors' time that it may take, in s, which is how long two idle cores have
    /// work with it. Where it takes more, it gets a remark and does not fail.
    pub(crate) bound_s: f64,
    pub(crate) run: fn() -> Result<(), Error>,
}

/// In the order that finds the most for the least time.
pub(crate) const STEPS: [TestStep; 13] = [
    step("fmt", "the sources are formatted", 3.0, fmt),
    step("words", "comments and documents are in plain English", 2.0, text),
    step(
        "arrows",
        "no files of a crate use each other in a circle; no function over 60 lines",
        2.0,
        arrows::check,
    ),
    step(
        "clippy",
        "no warning from the compiler or clippy, in the build that all later steps share",
        300.0,
        build,
    ),
    step("unit", "the crates' tests", 200.0, unit),
    step("firmware", "the boards' flash images build, without warnings, and fit", 60.0, image),
    step("board", "the flash images on the emulated boards", 270.0, board),
    step("wasm", "the page's WebAssembly is built from its sources", 6.0, page_wasm),
    step("site", "the device in a browser gives the same bits as host-sim's", 40.0, same_bits),
    step("browser", "the page in a real browser", 130.0, browser),
    step("clients", "streams, rigs and laws as other people's programs and Python see them", 50.0, clients),
    step("fuzz", "the frame parser, on damaged frames", 3.0, fuzz),
    step("prove", "the small proof of the diagnosis", 130.0, prove),
];

/// The inner loop.
pub(crate) const QUICK: [TestStep; 5] = [
    step("fmt", "the sources are formatted", 3.0, fmt),
    step("words", "comments and documents are in plain English", 2.0, text),
    step(
        "arrows",
        "no files of a crate use each other in a circle; no function over 60 lines",
        2.0,
        arrows::check,
    ),
    step("clippy", "no warning from the compiler or clippy", 94.0, clippy),
    step("libraries", "the tests inside the crates", 79.0, libraries),
];

/// The checks that take longer than the tests may.
pub(crate) const NIGHTLY: [TestStep; 11] = [
    step("slow", "the tests that take longest, marked `nightly`, and examples in documents", 700.0, slow),
    step("doc", "the documentation builds without warnings", 60.0, doc),
    step(
        "parquet",
        "import reads Parquet and ROS 2 bags, which the default build leaves out",
        300.0,
        parquet,
    ),
    step("csharp", "the documented C# client of a stream, with Mono", 120.0, csharp),
    step("foxglove", "Foxglove's live stream read by Foxglove's own client", 400.0, foxglove),
    step("class", "devices and their instructor over Zenoh, and thirty devices measured", 900.0, class),
    step("counts", "hot paths take no more instructions than were written down", 120.0, counts::check),
    step("soak", "the frame parser, ten minutes of damaged frames", 620.0, soak),
    step(
        "answers",
        "the diagnoses of 100 recordings are those of a day ago, to the digit",
        1500.0,
        answers::nightly,
    ),
    step("mutants", "the tests notice a thousand small changes of the code", 2400.0, mutated),
    step("proof", "the whole proof of the diagnosis", 7200.0, whole_proof),
];

const fn step(
    name: &'static str,
    shows: &'static str,
    bound_s: f64,
    run: fn() -> Result<(), Error>,
) -> TestStep {
    TestStep { name, shows, bound_s, run }
}

fn fmt() -> Result<(), Error> {
    shell::run(cargo().args(["fmt", "--all", "--check"]))
}

fn text() -> Result<(), Error> {
    words::check()?;
    readme::check()
}

/// By clippy where it is installed, which compiles as it checks.
fn build() -> Result<(), Error> {
    if std::env::var_os(OWN_COMPILER).is_none() {
        clippy()?;
    }
    shell::run(cargo().arg("build").args(BUILD).arg("--all-targets"))
}

fn clippy() -> Result<(), Error> {
    shell::run(cargo().arg("clippy").args(BUILD).args(["--all-targets", "--", "-D", "warnings"]))
}

fn doc() -> Result<(), Error> {
    let mut build = cargo();
    build.env("RUSTDOCFLAGS", "-D warnings").env_remove(OWN_COMPILER);
    shell::run(build.arg("doc").args(BUILD).arg("--no-deps"))
}

fn unit() -> Result<(), Error> {
    let absent = real_recordings::absent("unit");
    let mut tests = tests();
    if has_nextest() {
        // Built with what the other steps run, so that they find it.
        real_recordings::leave_out(&mut tests, "not (package(tests) or package(emulator))", &absent);
    } else {
        real_recordings::skip(tests.args(["--exclude", "tests", "--exclude", "emulator", "--"]), &absent);
    }
    shell::run(&mut tests)
}

fn libraries() -> Result<(), Error> {
    shell::run(tests().arg("--lib"))
}

/// The tests that say why they run at night.
fn slow() -> Result<(), Error> {
    for board in &boards::ALL {
        firmware::build(board)?;
    }
    let mut tests = tests();
    tests.env("FIRMWARE_ELF", firmware::path(boards::DEFAULT));
    let absent = real_recordings::absent("slow");
    if has_nextest() {
        real_recordings::leave_out(tests.args(["--run-ignored", "only"]), "all()", &absent);
    } else {
        real_recordings::skip(tests.args(["--", "--ignored"]), &absent);
    }
    shell::run(&mut tests)?;
    // The tests leave them out: there are none, and to look for them takes a minute.
    shell::run(cargo().arg("test").args(BUILD).args(["--doc", "--quiet"]))
}

/// Builds the images while the first steps run.
static IMAGES_AHEAD: Mutex<Option<JoinHandle<()>>> = Mutex::new(None);

/// Begins to build the images: they are linked in one piece, on one core, in a folder of their own.
/// What fails here fails again in its step, which says why.
pub(crate) fn build_images_ahead() -> Result<(), Error> {
    // Installs the target where it is missing, before cargo is busy.
    setup::toolchain()?;
    let build = || {
        let _ = boards::ALL.iter().try_for_each(firmware::build_with_own_test);
    };
    *IMAGES_AHEAD.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread::spawn(build));
    Ok(())
}

fn wait_for_images() {
    let ahead = IMAGES_AHEAD.lock().unwrap_or_else(PoisonError::into_inner).take();
    let _ = ahead.map(JoinHandle::join);
}

/// The image of every board, and the same warnings for it as for everything else.
fn image() -> Result<(), Error> {
    wait_for_images();
    boards::ALL.iter().try_for_each(image_of)
}

fn image_of(board: &Board) -> Result<(), Error> {
    firmware::report(board, &firmware::build(board)?)?;
    let toolchain = setup::toolchain()?;
    if toolchain == Toolchain::Debian {
        // Debian's compiler comes without clippy; the host's clippy has seen all but the tasks.
        return board_test::check(board);
    }
    let mut clippy = setup::cargo_for_board(toolchain, "clippy");
    clippy.args(firmware::arguments(board)).args(["--bin", "firmware", "--test", "board"]);
    shell::run(clippy.args(["--", "-D", "warnings"]))
}

fn page_wasm() -> Result<(), Error> {
    eprintln!("checked {}", wasm::check()?);
    Ok(())
}

fn same_bits() -> Result<(), Error> {
    site::check()
}

fn board() -> Result<(), Error> {
    // The tests look for the other boards' images next to the default one's, and for each board's
    // own test next to its image.
    for board in &boards::ALL {
        firmware::build_with_own_test(board)?;
    }
    if has_nextest() {
        shell::run(
            tests()
                .args(["-E", "package(emulator) or package(tests) and not (binary(page) or binary(board))"]),
        )?;
    }
    // In one process: what the emulator has translated of an image serves all tests.
    let mut tests = cargo();
    tests.env("FIRMWARE_ELF", firmware::path(boards::DEFAULT));
    tests.args(["test", "--no-fail-fast", "--quiet"]).args(BUILD);
    shell::run(tests.args(["--test", "board"]))
}

/// Checks a page for accessibility (MPL 2.0), and emulates a headset (MIT), each at the version
/// that the page was checked with. They are used by the tests only and are no part of any product.
const IN_PAGES: [&str; 2] = ["axe-core@4.14.1", "iwer@2.5.0"];

fn browser() -> Result<(), Error> {
    setup::browser()?;
    setup::node_packages(&IN_PAGES)?;
    site::build()?;
    shell::run(tests().args(["--test", "page"]))
}

/// Libraries of other people, each at the version that the check was written against.
const CLIENTS: [&str; 12] = [
    "pyigtl==0.3.4",
    "websockets==17.4",
    "mujoco==4.0.0",
    "rerun-sdk==0.41.0",
    "mcap==1.6.0",
    "mcap-protobuf-support==0.6.0",
    "foxglove-schemas-protobuf==0.4.0",
    "numpy==2.4.6",
    "scipy==1.17.1",
    "pandas==3.1.1",
    "pytest==9.2.0",
    "maturin==1.16.0",
];

fn clients() -> Result<(), Error> {
    let python = setup::python(&CLIENTS)?;
    let program = built(&["--bin", "host-sim"], "host-sim")?;
    let scripts = ["streams.py", "recording.py", "documented.py", "mujoco_rig.py"];
    let scripts = scripts.iter().map(|name| Path::new("tests/clients").join(name));
    for script in scripts.chain([PathBuf::from("tests/independent/run.py")]) {
        shell::run(Command::new(&python).arg(shell::top().join(script)).arg(&program))?;
    }
    let wheel = python::wheel(&python, &shell::target().join("wheels"))?;
    shell::run(
        Command::new(&python)
            .args(["-m", "pip", "install", "--quiet", "--force-reinstall", "--no-deps"])
            .arg(wheel),
    )?;
    let tests = shell::top().join("diagnosis/python/tests");
    shell::run(Command::new(&python).args(["-m", "pytest", "--quiet", "-p", "no:cacheprovider"]).arg(tests))
}

/// Separate from `clients`: Mono is 90 packages of Debian.
fn csharp() -> Result<(), Error> {
    let python = setup::python(&CLIENTS)?;
    setup::mono()?;
    let script = shell::top().join("tests/clients/documented.py");
    shell::run(
        Command::new(&python).arg(script).arg(built(&["--bin", "host-sim"], "host-sim")?).arg("csharp"),
    )
}

fn fuzz() -> Result<(), Error> {
    fuzz_for(FUZZ_SECONDS)
}

fn soak() -> Result<(), Error> {
    fuzz_for(LONG_FUZZ_SECONDS)
}

fn fuzz_for(seconds: &str) -> Result<(), Error> {
    let program = built(&["--example", "fuzz_frames"], "examples/fuzz_frames")?;
    shell::run(Command::new(program).args(["--seconds", seconds]))
}

fn prove() -> Result<(), Error> {
    proof(&["--quick"])
}

fn whole_proof() -> Result<(), Error> {
    proof(&[])
}

fn proof(flags: &[&str]) -> Result<(), Error> {
    let program = built(&["--bin", "prove"], "prove")?;
    shell::run(Command::new(program).args(flags).current_dir(shell::top()))
}

fn mutated() -> Result<(), Error> {
    mutants::run(&[])
}

/// Separate from `unit`: fifty packages more.
fn parquet() -> Result<(), Error> {
    let mut import = cargo();
    import.arg("test").args(BUILD).args([
        "--quiet",
        "--features",
        "host-sim/hdf5,host-sim/parquet,host-sim/ros",
        "--test",
        "program",
        "--",
        "import",
    ]);
    shell::run(&mut import)
}

/// The tests of a class, which need a build of their own, and the measurement of thirty devices.
fn class() -> Result<(), Error> {
    let features = ["--features", "host-sim/class"];
    let mut clippy = cargo();
    clippy.arg("clippy").args(BUILD).arg("--all-targets").args(features);
    shell::run(clippy.args(["--", "-D", "warnings"]))?;
    let mut test = cargo();
    test.arg("test").args(BUILD).args(features).args([
        "--test",
        "program",
        "--",
        "class::",
        "class_hostile::",
    ]);
    // One after the other: what is measured must not share the machine.
    test.args(["--include-ignored", "--nocapture", "--test-threads", "1"]);
    shell::run(&mut test)
}

/// Foxglove's client, the socket it needs, and what reads the schema of its transforms; each at the
/// version that the check was written against.
const FOXGLOVE_CLIENT: [&str; 3] = ["@foxglove/ws-protocol@0.8.0", "ws@8.23.0", "protobufjs@8.8.1"];

/// Foxglove's live stream read by Foxglove's own client; needs a build of its own.
fn foxglove() -> Result<(), Error> {
    let modules = setup::node_packages(&FOXGLOVE_CLIENT)?;
    shell::run(cargo().args(["build", "--release", "-p", "host-sim", "--features", "foxglove", ANY_RUST]))?;
    let mut node = Command::new("node");
    node.env("NODE_PATH", modules).arg(shell::top().join("tests/clients/foxglove.cjs"));
    shell::run(node.arg(shell::target().join("release/host-sim")))
}

fn has_nextest() -> bool {
    shell::is_on_path("cargo-nextest")
}

/// Runs tests of the one build: by nextest where it is installed, else by cargo's own runner.
fn tests() -> Command {
    let mut command = cargo();
    if has_nextest() {
        command.args(["nextest", "run", "--no-fail-fast", "--status-level", "fail"]);
    } else {
        command.args(["test", "--no-fail-fast", "--quiet"]);
    }
    command.args(BUILD);
    command
}
