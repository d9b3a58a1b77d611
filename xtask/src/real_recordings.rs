//! The tests on recordings of real machines (`docs/measured/recordings.md`). The recordings are not
//! part of the repository: a test whose recordings are absent is left out, and the summary names
//! it.

use crate::shell;
use std::path::PathBuf;
use std::process::Command;

/// A test, and what it needs.
pub(crate) struct RealTest {
    /// Its name, below [`MODULE`].
    name: &'static str,
    /// The step that runs it.
    step: &'static str,
    /// Its recordings, below [`FOLDER`].
    recordings: &'static str,
}

/// The module of the tests in `diagnosis/tests/behaviour`.
const MODULE: &str = "real_recordings";
/// The folder of the recordings, from the top of the repository.
const FOLDER: &str = "../shared/recordings";

const TESTS: [RealTest; 5] = [
    RealTest { name: "emps_names_dry_friction_then_direction", step: "unit", recordings: "emps" },
    RealTest { name: "emps_names_the_same_with_its_recordings_swapped", step: "slow", recordings: "emps" },
    RealTest { name: "emps_ripple_is_seen_but_not_material", step: "slow", recordings: "emps" },
    RealTest { name: "anticogging_names_cogging", step: "slow", recordings: "anticogging" },
    RealTest { name: "a_belt_that_stretches_loses_no_counts", step: "slow", recordings: "machines/cart-B" },
];

impl RealTest {
    fn path(&self) -> String {
        format!("{MODULE}::{}", self.name)
    }

    fn folder(&self) -> PathBuf {
        PathBuf::from(FOLDER).join(self.recordings)
    }

    /// Returns the test's name and the reason why it does not run.
    pub(crate) fn not_run(&self) -> (String, String) {
        let why = format!(
            "there is no folder {}; docs/measured/recordings.md has the sources",
            self.folder().display()
        );
        (self.path(), why)
    }
}

/// Returns the tests of a step whose recordings are absent.
pub(crate) fn absent(step: &str) -> Vec<&'static RealTest> {
    TESTS.iter().filter(|test| test.step == step && !shell::top().join(test.folder()).is_dir()).collect()
}

/// Leaves tests out of those that nextest runs; `filter` chooses among all tests.
pub(crate) fn leave_out(tests: &mut Command, filter: &str, absent: &[&RealTest]) {
    let without: String = absent.iter().map(|test| format!(" and not test(={})", test.path())).collect();
    tests.args(["-E", &format!("{filter}{without}")]);
}

/// Leaves tests out of those that cargo's own runner runs, whose arguments end with its own.
pub(crate) fn skip(tests: &mut Command, absent: &[&RealTest]) {
    for test in absent {
        tests.args(["--skip", &test.path()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A test that the list does not have would fail where the recordings are absent.
    #[test]
    fn the_list_has_every_test_with_its_recordings() {
        let path = shell::top().join("diagnosis/tests/behaviour/real_recordings.rs");
        let text = std::fs::read_to_string(path).expect("it is there");
        let found: Vec<(bool, &str, &str)> = text
            .split("#[test]\n")
            .skip(1)
            .map(|test| {
                let after = |start: &str, end: &str| {
                    test.split_once(start).and_then(|(_, rest)| rest.split_once(end)).expect("a test").0
                };
                (test.starts_with("#[ignore"), after("fn ", "()"), after("recorded(\"", "\")"))
            })
            .collect();
        let listed = TESTS.map(|test| (test.step == "slow", test.name, test.recordings));
        assert_eq!(found, listed);
    }

    #[test]
    fn tests_without_recordings_are_left_out_by_name() {
        let mut command = Command::new("cargo");
        leave_out(&mut command, "not package(tests)", &[&TESTS[0], &TESTS[4]]);
        skip(&mut command, &[&TESTS[4]]);
        let arguments: Vec<_> = command.get_args().filter_map(|argument| argument.to_str()).collect();
        let filter = "not package(tests) and not test(=real_recordings::emps_names_dry_friction_then_direction) \
                      and not test(=real_recordings::a_belt_that_stretches_loses_no_counts)";
        let skipped = "real_recordings::a_belt_that_stretches_loses_no_counts";
        assert_eq!(arguments, ["-E", filter, "--skip", skipped]);
    }
}
