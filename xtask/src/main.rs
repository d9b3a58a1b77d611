//! The project's chores, one subcommand each; `cargo xtask help` lists them. CI runs `cargo xtask
//! test` and nothing else, and each of its steps is runnable by hand under its own name.
//!
//! Built before everything else, hence no dependencies; it knows which commands to run, and nothing
//! of the crates' insides.

mod answers;
mod arrows;
mod bench;
mod beside;
mod board_test;
mod boards;
mod counts;
mod dfu;
mod dist;
mod elf;
mod firmware;
mod flash;
mod mutants;
mod python;
mod readme;
mod real_recordings;
mod rig;
mod rows;
mod setup;
mod shell;
mod site;
mod stack;
mod steps;
mod test;
mod wasm;
mod wiring;
mod words;
mod workspace_build;

use boards::Board;
use shell::Error;
use std::process::ExitCode;

const HELP: &str = "\
The project's chores.

  cargo xtask test [STEP…]      everything that passes or fails, setup included; or only the steps named:
                                fmt words arrows clippy unit firmware board wasm site browser clients fuzz
                                prove
  cargo xtask test --quick      the inner loop: format, words, arrows, warnings, the tests inside the crates; three minutes
  cargo xtask nightly [WHAT…]   what takes longer than the tests may: slow doc parquet csharp foxglove class counts soak
                                answers mutants proof
  cargo xtask firmware          builds the flash image; prints its path, flash, RAM and worst stack use
  cargo xtask flash [--dfu]     flashes it with probe-rs; --dfu: over USB, without a probe
                                both, board-test and rig take --board: discovery (default), nucleo-f429zi
  cargo xtask dist              both boards' images (ELF, BIN, DFU), the program for this PC and for Windows, and the Python wheel: target/dist
  cargo xtask wasm              builds what the page computes in the browser, into host-sim/page/js
  cargo xtask site              the whole simulator as one folder without a server: target/site
  cargo xtask wiring            draws both boards' wiring from the tables in docs/guide/hardware.md
  cargo xtask board-test        the image's hardware, on a real board; says so where there is none
  cargo xtask rig               the same on the emulated boards, and the list of faults, as a table with the times;
                                then board-test
  cargo xtask bench [ROW…]      measures, prints the table and writes target/bench.json
  cargo xtask counts            the instructions of hot paths against those written down; --renew writes them down,
                                --shares prints the source files in which they are spent
  cargo xtask answers           the diagnoses of 100 drawn recordings by this commit and by an earlier one, compared to the digit;
                                --against PROGRAM|REVISION; without it the commit of a day ago; other flags as `prove` has them
  cargo xtask mutants [CRATE…]  changes the code a thousand times and sees that the tests notice: half an hour
  cargo xtask prove [FLAGS…]    the blinded proof of the diagnosis; flags as `cargo xtask prove --help` says
  cargo xtask readme --from target/inject.json
                                writes the README's table from what `prove --inject` measured
  cargo xtask help              this text

Example: cargo xtask test fmt unit";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (command, rest) = match arguments.split_first() {
        Some((command, rest)) => (command.as_str(), rest),
        None => ("help", &[][..]),
    };
    if workspace_build::is_compiler(command) {
        return workspace_build::compile(&arguments);
    }
    let asks_for_help = rest.iter().any(|argument| argument == "--help" || argument == "-h");
    let done = match command {
        "help" | "--help" | "-h" => help(),
        "prove" => prove(rest),
        _ if asks_for_help => help(),
        "test" => test::run(rest),
        "firmware" => for_board(rest, |board| firmware::report(board, &firmware::build(board)?)),
        "flash" => flash::run(rest),
        "dist" => no_more(rest).and_then(|()| dist::run()),
        "wasm" => no_more(rest).and_then(|()| wasm::run()),
        "site" => no_more(rest).and_then(|()| site::run()),
        "nightly" => test::nightly(rest),
        "board-test" => for_board(rest, board_test::run),
        "rig" => for_board(rest, rig::run),
        "wiring" => no_more(rest).and_then(|()| wiring::run()),
        "answers" => answers::run(rest),
        "mutants" => mutants::run(rest),
        "bench" => bench::run(rest),
        "counts" => counts::run(rest),
        "readme" => readme::run(rest),
        other => {
            Err(Error::usage(format!("`{other}` is not a command of xtask; `cargo xtask help` lists them")))
        }
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(error.status)
        }
    }
}

fn help() -> Result<(), Error> {
    println!("{HELP}");
    Ok(())
}

/// Refuses arguments that a chore does not take.
fn no_more(rest: &[String]) -> Result<(), Error> {
    match rest.first() {
        None => Ok(()),
        Some(extra) => Err(Error::usage(format!("unexpected argument `{extra}`; see `cargo xtask help`"))),
    }
}

/// Does a chore that takes a board and nothing else.
fn for_board(rest: &[String], chore: impl Fn(&Board) -> Result<(), Error>) -> Result<(), Error> {
    let (board, rest) = boards::chosen(rest)?;
    no_more(&rest)?;
    chore(board)
}

fn prove(rest: &[String]) -> Result<(), Error> {
    let status = shell::cargo()
        .args([
            "run",
            "--release",
            "--ignore-rust-version",
            "--quiet",
            "-p",
            "benchmark",
            "--bin",
            "prove",
            "--",
        ])
        .args(rest)
        .status()
        .map_err(|error| Error::new(format!("cargo could not be started: {error}")))?;
    match status.code() {
        Some(0) => Ok(()),
        // The proof has said why; 2 is unusable input.
        Some(2) => Err(Error::usage("the proof did not understand its flags")),
        _ => Err(Error::new("the proof did not pass")),
    }
}
