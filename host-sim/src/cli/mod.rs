//! One module a command.

mod characterise;
mod class;
mod commission;
mod compensate;
mod confirm;
mod diagnose;
mod export;
mod fit_force;
mod import;
mod progress;
mod recordings;
mod run;
mod simulate;
mod streams;
mod training;

use clap::{Parser, Subcommand};
use host_sim::failure::Failure;

/// The needle insertion device on the PC: run it (virtual or real), look at it, record it, export and score recordings.
///
/// Without a command: a virtual device with a scripted venepuncture, shown at http://127.0.0.1:8710.
#[derive(Parser)]
#[command(version, after_help = examples!("Example: host-sim run --headless --fast --seconds 60 --record /tmp/a.mcap"))]
pub(crate) struct Cli {
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    Run(run::Run),
    Class(class::Class),
    Replay(recordings::Replay),
    Export(recordings::Export),
    Score(training::Score),
    Debrief(training::Debrief),
    Profiles(training::Profiles),
    Reproduce(training::Reproduce),
    Commission(commission::Commission),
    Compensate(compensate::Compensate),
    Characterise(characterise::Characterise),
    Diagnose(diagnose::Diagnose),
    Import(import::Import),
    Simulate(simulate::Simulate),
    FitForce(fit_force::FitForce),
}

impl Cli {
    pub(crate) fn run(self) -> Result<(), Failure> {
        match self.command {
            // As if `run` had been said: its defaults stand in one place.
            None => Self::parse_from(["host-sim", "run"]).run(),
            Some(Command::Run(command)) => command.run(),
            Some(Command::Class(command)) => command.run(),
            Some(Command::Replay(command)) => command.run(),
            Some(Command::Export(command)) => command.run(),
            Some(Command::Score(command)) => command.run(),
            Some(Command::Debrief(command)) => command.run(),
            Some(Command::Profiles(command)) => command.run(),
            Some(Command::Reproduce(command)) => command.run(),
            Some(Command::Commission(command)) => command.run(),
            Some(Command::Compensate(command)) => command.run(),
            Some(Command::Characterise(command)) => command.run(),
            Some(Command::Diagnose(command)) => command.run(),
            Some(Command::Import(command)) => command.run(),
            Some(Command::Simulate(command)) => command.run(),
            Some(Command::FitForce(command)) => command.run(),
        }
    }
}

/// What the parser has to say, in one line.
pub(crate) fn usage(error: &clap::Error) -> Failure {
    let drawn = error.to_string();
    let said: Vec<&str> = drawn
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"))
        .filter(|line| !line.is_empty())
        .collect();
    let said = said.join("; ");
    Failure::input(format_args!("{}; see host-sim --help", said.trim_start_matches("error: ")))
}
