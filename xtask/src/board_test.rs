//! `cargo xtask board-test`: the tests of `firmware/tests/board.rs` on a real board, or the plain word that they did not run.

use crate::setup::{self, TARGET};
use crate::shell::{self, Failure};
use std::process::Command;

/// Runs them where a debug probe is plugged in.
pub(crate) fn run() -> Result<(), Failure> {
    if let Some(why) = missing() {
        println!("board-test: DID NOT RUN: {why}");
        println!(
            "It needs an STM32F4DISCOVERY on a debug probe, wired as firmware/tests/board.rs says; see docs/hardware.md."
        );
        return Ok(());
    }
    // The runner in .cargo/config.toml is probe-rs, which flashes and resets for each test.
    shell::run(&mut command(&["--", "--test-threads", "1"]))
}

/// Builds them: what no machine without the board can do more of.
pub(crate) fn build() -> Result<(), Failure> {
    shell::run(&mut command(&["--no-run"]))
}

fn command(last: &[&str]) -> Command {
    let toolchain = setup::toolchain();
    let mut cargo = match toolchain {
        Ok(toolchain) => setup::cargo_for_board(toolchain, "test"),
        Err(_) => shell::cargo(),
    };
    cargo.args(["-p", "firmware", "--test", "board", "--profile", "firmware", "--target", TARGET]).args(last);
    cargo
}

/// Why they cannot run here.
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
