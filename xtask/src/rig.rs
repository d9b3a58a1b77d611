//! `cargo xtask rig`: the board's own test and the list of faults, on the emulated boards, as one
//! table of what was found and within which time; then the board's own test on a real one, or the
//! plain word that it did not run.

use crate::bench::board_lines_in;
use crate::boards::Board;
use crate::shell::{self, Error, cargo};
use crate::workspace_build::BUILD;
use crate::{board_test, boards, firmware};

/// The files of `tests/tests/board` that ask a board for what a person asks a real one for.
const QUESTIONS: [&str; 6] =
    ["own_test::", "start_up::", "option_bytes::", "faults::", "runaway::", "crash::"];

/// Asks the emulated boards, then `board`.
pub(crate) fn run(board: &Board) -> Result<(), Error> {
    boards::ALL.iter().try_for_each(firmware::build_with_own_test)?;
    let mut tests = cargo();
    tests.env("FIRMWARE_ELF", firmware::path(boards::DEFAULT)).arg("test").args(BUILD);
    tests.args(["--quiet", "--test", "board", "--", "--nocapture"]).args(QUESTIONS);
    let said = shell::output(&mut tests)?;
    println!("| the emulated boards | found, within |\n| --- | --- |");
    board_lines_in(&said).for_each(|line| println!("{line}"));
    board_test::run(board)
}
