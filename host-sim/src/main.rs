//! The command line of the needle device's PC side. It parses, calls the library, prints, and turns failures into one line
//! and an exit status: 1 if the request failed, 2 for unusable input.

/// Prints a line. A closed pipe is not a failure.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

/// Prints a line that is not a result, such as an address or advice, unless `--quiet` is given.
macro_rules! note {
    ($($text:tt)*) => {
        if !$crate::cli::output::is_quiet() {
            say!($($text)*);
        }
    };
}

/// Examples at the end of a help text, and how to type them without an installation.
macro_rules! examples {
    ($text:literal) => {
        concat!($text, "\n\nIn the source folder, write `cargo run --release --` instead of `host-sim`.")
    };
}

mod cli;

use clap::Parser;
use clap::error::ErrorKind;
use std::process::ExitCode;

fn main() -> ExitCode {
    let result = match cli::Cli::try_parse() {
        Ok(cli) => cli.run(),
        Err(error) if matches!(error.kind(), ErrorKind::DisplayHelp | ErrorKind::DisplayVersion) => {
            // Help may go into a closed pipe.
            let _ = error.print();
            return ExitCode::SUCCESS;
        }
        Err(error) => Err(cli::usage(&error)),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("host-sim: {failure}");
            ExitCode::from(failure.status())
        }
    }
}
