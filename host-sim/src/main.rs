//! The command line of the needle device's PC side. It parses, calls the library, prints, and turns failures into one line
//! and an exit status: 1 when what was asked for did not work out, 2 for unusable input.

/// Prints a line. A pipe that nobody reads any longer is no reason to fail.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

/// Prints a line that is no result: an address, advice. Not with `--quiet`.
macro_rules! note {
    ($($text:tt)*) => {
        if !$crate::cli::output::is_quiet() {
            say!($($text)*);
        }
    };
}

/// Examples at the end of a help, and how to type them where nothing is installed.
macro_rules! examples {
    ($text:literal) => {
        concat!($text, "\n\nIn the source folder `cargo run --release --` stands for `host-sim`.")
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
            // Help that goes into a closed pipe is nobody's loss.
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
