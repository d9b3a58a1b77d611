//! `cargo xtask board-test`: the tests of `firmware/tests/board.rs` on a real board, or the plain
//! word that they did not run.

use crate::boards::Board;
use crate::shell::{self, Error};
use crate::{firmware, setup};
use std::process::Command;

/// Runs them where a debug probe is plugged in.
pub(crate) fn run(board: &Board) -> Result<(), Error> {
    if let Some(why) = missing() {
        println!("board-test: DID NOT RUN: {why}");
        println!(
            "It needs a board, {}, on a debug probe, wired as firmware/tests/board.rs says; see docs/guide/hardware.md.",
            board.title
        );
        return Ok(());
    }
    // The runner, probe-rs, flashes and resets for each test; the one in .cargo/config.toml is for
    // the default board.
    let runner = format!("probe-rs run --chip {}", board.chip);
    let mut tests = command("test", board, &["--", "--test-threads", "1"]);
    shell::run(tests.env("CARGO_TARGET_THUMBV7EM_NONE_EABIHF_RUNNER", runner))
}

/// Compiles them: what no machine without the board can do more of.
pub(crate) fn check(board: &Board) -> Result<(), Error> {
    shell::run(&mut command("check", board, &[]))
}

fn command(subcommand: &str, board: &Board, last: &[&str]) -> Command {
    let toolchain = setup::toolchain();
    let mut cargo = match toolchain {
        Ok(toolchain) => setup::cargo_for_board(toolchain, subcommand),
        Err(_) => shell::cargo(),
    };
    cargo.args(firmware::arguments(board)).args(["--test", "board"]).args(last);
    cargo
}

/// Returns the reason why they cannot run here; `None` if they can.
fn missing() -> Option<String> {
    if !shell::is_on_path("probe-rs") {
        return Some(
            "probe-rs is not on the PATH; install it with `cargo install probe-rs-tools --locked`".into(),
        );
    }
    let listed = shell::output(Command::new("probe-rs").arg("list")).unwrap_or_default();
    // Each probe has a line with its number in brackets.
    let has_probe = listed.lines().any(|line| line.trim_start().starts_with('['));
    (!has_probe).then(|| "no debug probe is plugged in".into())
}
