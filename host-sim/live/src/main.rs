//! The program of the first command, `cargo run --release`: it has what shows a device, and hands
//! every other command to `host-sim`, which has them all and takes longer to build.

mod delegate;

use clap::error::ErrorKind;
use clap::{Parser, Subcommand};
use live::{Command, Options};
use std::ffi::OsString;
use std::process::ExitCode;

#[derive(Parser)]
#[command(name = "host-sim", bin_name = "host-sim", version = recording::version::version())]
struct Line {
    #[command(flatten)]
    options: Options,
    #[command(subcommand)]
    command: Option<CommandLine>,
}

#[derive(Subcommand)]
enum CommandLine {
    #[command(flatten)]
    Live(Command),
    #[command(external_subcommand)]
    #[expect(dead_code, reason = "the whole line is handed over")]
    Other(Vec<OsString>),
}

fn main() -> ExitCode {
    let parsed = live::parse::<Line>();
    let is_for_the_whole = match &parsed {
        Ok(line) => matches!(line.command, Some(CommandLine::Other(_))),
        // The help of all commands; that of one of ours is here.
        Err(error) => error.kind() == ErrorKind::DisplayHelp && !names_one_of_ours(),
    };
    if is_for_the_whole {
        return delegate::run();
    }
    live::finish(parsed, |line| {
        line.options.apply();
        match line.command {
            Some(CommandLine::Live(command)) => command.run(),
            _ => Command::usual().run(),
        }
    })
}

/// Returns true if the first word that is no option is a command of this program.
fn names_one_of_ours() -> bool {
    let word = std::env::args().skip(1).find(|word| !word.starts_with('-'));
    word.is_some_and(|word| Command::has_subcommand(&word))
}
