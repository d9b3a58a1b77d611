//! The command line of the needle device's PC side. It parses, calls the library, prints, and turns
//! errors into one line and an exit status.

mod cli;

use std::process::ExitCode;

fn main() -> ExitCode {
    live::finish(live::parse::<cli::Cli>(), cli::Cli::run)
}
