//! The measuring programs: examples, tests that print rows, and other people's solvers in Python.

use super::values::{BOARD_LINE, Values, board_lines_in, values_in};
use crate::rows::ROWS;
use crate::shell::{self, Error, cargo};
use crate::workspace_build::{BUILD, built};
use crate::{boards, firmware, setup};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// The test programs of the crate `tests`: a folder each.
const TEST_PROGRAMS: [&str; 2] = [BOARD, "page"];
const BOARD: &str = "board";

/// A file of tests, with those of the folder that has its name.
pub(crate) struct TestModule {
    program: &'static str,
    pub(crate) name: String,
    text: String,
}

/// Finds the files of tests.
pub(crate) fn test_modules() -> Result<Vec<TestModule>, Error> {
    let mut modules = vec![];
    for program in TEST_PROGRAMS {
        let folder = shell::top().join("tests/tests").join(program);
        for path in sources_in(&folder)? {
            let Some(name) = path.file_stem().and_then(|stem| stem.to_str()) else { continue };
            let mut parts = vec![path.clone()];
            if folder.join(name).is_dir() {
                parts.extend(sources_in(&folder.join(name))?);
            }
            let text = parts.iter().filter_map(|part| fs::read_to_string(part).ok()).collect();
            modules.push(TestModule { program, name: name.into(), text });
        }
    }
    modules.sort_by(|a, b| (a.program, &a.name).cmp(&(b.program, &b.name)));
    Ok(modules)
}

/// The sources in a folder, without those in its folders.
fn sources_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let unreadable = |error| Error::new(format!("{} cannot be read: {error}", folder.display()));
    let all = fs::read_dir(folder).map_err(unreadable)?.flatten().map(|entry| entry.path());
    Ok(all.filter(|path| path.extension().is_some_and(|extension| extension == "rs")).collect())
}

impl TestModule {
    /// True if the tests run the boards' flash images.
    pub(crate) fn is_of_a_board(&self) -> bool {
        self.program == BOARD
    }

    /// True if the tests print rows, of which their text names one as a word or in JSON, or lines
    /// of the board's own table.
    pub(crate) fn measures(&self, wants: impl Fn(&str) -> bool) -> bool {
        let text = &self.text;
        (text.contains(&format!("\"{BOARD_LINE}")) && wants(BOARD_LINE))
            || ROWS.iter().filter(|row| wants(row.name)).any(|row| {
                text.contains(&format!("{}=", row.name)) || text.contains(&format!("\"{}\"", row.name))
            })
    }

    /// Runs the tests of the file.
    pub(crate) fn run(&self, board_lines: &mut Vec<String>) -> Result<Values, Error> {
        let mut run = cargo();
        // As `BENCH` of the crate `tests`.
        run.env("FIRMWARE_ELF", firmware::path(boards::DEFAULT)).env("NEEDLE_BENCH", "1");
        run.arg("test").args(BUILD).args(["--quiet", "--test", self.program, "--"]);
        run.args(["--nocapture", &format!("{}::", self.name)]);
        // A test that fails its bound has printed what it measured.
        let output = run
            .stderr(Stdio::inherit())
            .output()
            .map_err(|error| Error::new(format!("cargo could not be started: {error}")))?;
        let text = String::from_utf8_lossy(&output.stdout);
        board_lines.extend(board_lines_in(&text));
        Ok(values_in(&text))
    }
}

/// Examples that measure alone, and what the rows that they give begin with.
pub(crate) const EXAMPLES: [(&str, &str); 3] =
    [("tick_host", "tick_host"), ("frame_speed", "frame_"), ("diagnosis_growth", "diagnose_growth")];

/// The variable that names the file in which `xpbd_speed` leaves its mesh for its peer.
const MESH: &str = "XPBD_MESH";

fn mesh() -> PathBuf {
    shell::target().join("xpbd-mesh.json")
}

/// Builds an example with the one build of everything, and runs it.
pub(crate) fn example(name: &str) -> Result<Values, Error> {
    let program = built(&["--example", name], &format!("examples/{name}"))?;
    shell::output(Command::new(program).env(MESH, mesh())).map(|text| values_in(&text))
}

/// Examples that measure by turns with other people's solvers of the same tasks, in Python, and
/// what the rows that they give begin with.
pub(crate) const PEERS: [(&str, &str, &str); 3] = [
    ("plant_speed", "plant.py", "plant_"),
    ("xpbd_speed", "soft_body.py", "xpbd_"),
    ("ultrasound_speed", "bmode.py", "ultrasound_"),
];
/// The Python packages that the peers need.
pub(crate) const PEERS_PACKAGES: [&str; 3] = ["numpy==2.4.6", "mujoco==4.0.0", "scipy==1.17.1"];

/// Runs one of them: it prints the row that it is next to.
pub(crate) fn peer(script: &str) -> Result<Values, Error> {
    shell::output(&mut python(script)?).map(|text| values_in(&text))
}

/// A peer's program, ready to be run where MuJoCo may leave its log; on one core, as ours.
pub(crate) fn python(script: &str) -> Result<Command, Error> {
    let mut command = Command::new(setup::python(&PEERS_PACKAGES)?);
    command.current_dir(shell::target());
    command.env("OMP_NUM_THREADS", "1").env("OPENBLAS_NUM_THREADS", "1").env(MESH, mesh());
    command.arg(shell::top().join("xtask/peers").join(script));
    Ok(command)
}

/// One, ten and thirty devices with their instructor: a build of its own, with Zenoh.
pub(crate) fn class() -> Result<Values, Error> {
    let mut test = cargo();
    test.arg("test").args(BUILD).args(["--quiet", "--features", "host-sim/class", "--test", "program", "--"]);
    test.args(["--ignored", "--nocapture", "thirty_devices_cost_little_more_than_a_core"]);
    shell::output(&mut test).map(|text| values_in(&text))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rows_of_the_board_and_the_page_have_tests() {
        let modules = test_modules().expect("the tests are there");
        let rows = [
            "tick_instructions_longest",
            "tick_to_dac_spread_us",
            "stack_high_water_bytes",
            "masked_longest_us",
            "hand_to_page_p50_ms",
            "hand_to_page_p99_ms",
            "page_first_frame_s",
            "page_mb",
        ];
        for row in rows {
            assert!(ROWS.iter().any(|one| one.name == row), "{row}");
            assert!(modules.iter().any(|module| module.measures(|rows| row.starts_with(rows))), "{row}");
        }
    }
}
