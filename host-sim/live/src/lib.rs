//! The commands that show the device and judge what it recorded, and what every command of the
//! program needs: options, output, progress, a serial port. Nothing here needs the diagnosis, so
//! that the first command has little to build.

/// Prints a line. A closed pipe is not an error.
#[macro_export]
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stdout(), $($text)*);
    }};
}

/// Prints a line that is not a result, such as an address or advice, unless `--quiet` is given.
#[macro_export]
macro_rules! note {
    ($($text:tt)*) => {
        if !$crate::output::is_quiet() {
            $crate::say!($($text)*);
        }
    };
}

/// Examples at the end of a help text, and how to type them without an installation.
#[macro_export]
macro_rules! examples {
    ($text:literal) => {
        concat!($text, "\n\nIn the source folder, write `cargo run --release --` instead of `host-sim`.")
    };
}

mod class;
mod demonstration;
mod layers;
mod outcome;
pub mod output;
pub mod progress;
pub mod replay;
mod run;
pub mod serial;
pub mod serving;
mod streams;
mod training;

use clap::{Args, Parser, Subcommand};
use device_sim::error::Error;

pub use outcome::{finish, parse};

/// Options of every command.
#[derive(Args)]
pub struct Options {
    /// Print results and errors only: no progress, no addresses, no advice
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Print each stage with its time to standard error, also where that is no terminal
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Do not open a browser
    #[arg(long, global = true)]
    no_browser: bool,
}

impl Options {
    /// Makes them hold for the rest of the program.
    pub fn apply(&self) {
        output::set(self.quiet, self.verbose, self.no_browser);
    }
}

/// The commands of this crate.
#[derive(Subcommand)]
pub enum Command {
    #[allow(missing_docs, reason = "their texts are the commands' help")]
    Run(Box<run::Run>),
    #[allow(missing_docs, reason = "as above")]
    Class(class::Class),
    #[allow(missing_docs, reason = "as above")]
    Replay(replay::Replay),
    #[allow(missing_docs, reason = "as above")]
    Score(training::Score),
    #[allow(missing_docs, reason = "as above")]
    Debrief(training::Debrief),
    #[allow(missing_docs, reason = "as above")]
    Profiles(training::Profiles),
    #[allow(missing_docs, reason = "as above")]
    Layers(layers::Layers),
}

impl Command {
    /// Returns the command if none is given: `run` with its defaults, which are defined in one
    /// place.
    pub fn usual() -> Self {
        #[derive(Parser)]
        struct Line {
            #[command(subcommand)]
            command: Command,
        }
        Line::parse_from(["host-sim", "run"]).command
    }

    /// Carries it out.
    pub fn run(self) -> Result<(), Error> {
        match self {
            Self::Run(command) => command.run(),
            Self::Class(command) => command.run(),
            Self::Replay(command) => command.run(),
            Self::Score(command) => command.run(),
            Self::Debrief(command) => command.run(),
            Self::Profiles(command) => command.run(),
            Self::Layers(command) => command.run(),
        }
    }
}
