//! One module a command.

mod characterise;
mod class;
mod commission;
mod compensate;
mod completions;
mod confirm;
mod diagnose;
mod experiment;
mod export;
mod fit_force;
mod import;
mod layers;
mod man;
pub(crate) mod output;
mod progress;
mod recordings;
mod run;
mod serving;
mod settle;
mod simulate;
mod streams;
mod training;

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Parser, Subcommand};
use device_sim::failure::Failure;

/// The PC side of the needle insertion device: run it (virtual or real), watch it, record it, export and score recordings.
///
/// Without a command: a virtual device with a scripted venepuncture, shown at http://127.0.0.1:8710.
#[derive(Parser)]
#[command(version = recording::version::version(), after_help = examples!("Example: host-sim run --headless --fast --seconds 60 --record /tmp/a.mcap"))]
pub(crate) struct Cli {
    /// Print results and errors only: no progress, no addresses, no advice
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Print each stage with its time to standard error, also where that is no terminal
    #[arg(long, short, global = true, conflicts_with = "quiet")]
    verbose: bool,
    /// Do not open a browser when serving a page
    #[arg(long, global = true)]
    no_browser: bool,
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
    Layers(layers::Layers),
    Reproduce(training::Reproduce),
    Commission(commission::Commission),
    Compensate(compensate::Compensate),
    Characterise(characterise::Characterise),
    Diagnose(diagnose::Diagnose),
    Experiment(experiment::Experiment),
    Settle(settle::Settle),
    Import(import::Import),
    Simulate(simulate::Simulate),
    FitForce(fit_force::FitForce),
    Completions(completions::Completions),
    Man(man::Man),
}

impl Cli {
    pub(crate) fn run(self) -> Result<(), Failure> {
        output::set(self.quiet, self.verbose, self.no_browser);
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
            Some(Command::Layers(command)) => command.run(),
            Some(Command::Reproduce(command)) => command.run(),
            Some(Command::Commission(command)) => command.run(),
            Some(Command::Compensate(command)) => command.run(),
            Some(Command::Characterise(command)) => command.run(),
            Some(Command::Diagnose(command)) => command.run(),
            Some(Command::Experiment(command)) => command.run(),
            Some(Command::Settle(command)) => command.run(),
            Some(Command::Import(command)) => command.run(),
            Some(Command::Simulate(command)) => command.run(),
            Some(Command::FitForce(command)) => command.run(),
            Some(Command::Completions(command)) => command.run(),
            Some(Command::Man(command)) => command.run(),
        }
    }
}

/// Returns the parser's message, in one sentence.
pub(crate) fn usage(error: &clap::Error) -> Failure {
    let drawn = error.to_string();
    // The last line of help that the parser names: of the command that was asked for.
    let help = drawn.lines().find_map(|line| line.trim().strip_prefix("Usage: ")).map_or(
        "host-sim --help".into(),
        |usage| {
            let command: Vec<&str> =
                usage.split_whitespace().take_while(|word| !word.starts_with(['-', '<', '['])).collect();
            format!("{} --help", command.join(" "))
        },
    );
    if let Some(ContextValue::Strings(missing)) =
        error.get(ContextKind::InvalidArg).filter(|_| error.kind() == ErrorKind::MissingRequiredArgument)
    {
        let (what, them) = if missing.len() == 1 { ("is", "it") } else { ("are", "them") };
        return Failure::input(format_args!(
            "{} {what} missing; add {them}, see {help}",
            missing.join(" and ")
        ));
    }
    let said: Vec<&str> = drawn
        .lines()
        .map(str::trim)
        .take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more"))
        .filter(|line| !line.is_empty())
        .map(|line| line.trim_start_matches("tip: "))
        .collect();
    let said = said.join("; ");
    Failure::input(format_args!("{}; see {help}", said.trim_start_matches("error: ")))
}
