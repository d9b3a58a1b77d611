//! One module a command; those that need no diagnosis are in `live`.

mod characterise;
mod check;
mod commission;
mod compensate;
mod completions;
mod confirm;
mod demo;
mod diagnose;
mod diagnose_all;
mod experiment;
mod export;
mod fit_force;
mod fit_friction;
mod import;
mod import_page;
mod man;
mod model;
mod one_diagnosis;
mod recordings;
mod reproduce;
mod settle;
mod simulate;

use clap::{Parser, Subcommand};
use device_sim::error::Error;
use live::examples;

/// The PC side of the needle insertion device: run it (virtual or real), watch it, record it,
/// export and score recordings.
///
/// Without a command: a virtual device with a scripted venepuncture, shown at
/// http://127.0.0.1:8710.
#[derive(Parser)]
#[command(version = recording::version::version(), after_help = examples!("Example: host-sim run --headless --fast --seconds 60 --record /tmp/a.mcap"))]
pub(crate) struct Cli {
    #[command(flatten)]
    options: live::Options,
    #[command(subcommand)]
    command: Option<Command>,
}

#[derive(Subcommand)]
enum Command {
    #[command(flatten)]
    Live(live::Command),
    Export(recordings::Export),
    Reproduce(reproduce::Reproduce),
    Commission(commission::Commission),
    Compensate(compensate::Compensate),
    Characterise(characterise::Characterise),
    Demo(demo::Demo),
    Check(check::Check),
    Diagnose(diagnose::Diagnose),
    Experiment(experiment::Experiment),
    Settle(settle::Settle),
    Import(import::Import),
    Simulate(simulate::Simulate),
    FitForce(fit_force::FitForce),
    FitFriction(fit_friction::FitFriction),
    Completions(completions::Completions),
    Model(model::Model),
    Man(man::Man),
}

impl Cli {
    pub(crate) fn run(self) -> Result<(), Error> {
        self.options.apply();
        match self.command {
            None => live::Command::usual().run(),
            Some(Command::Live(command)) => command.run(),
            Some(Command::Export(command)) => command.run(),
            Some(Command::Reproduce(command)) => command.run(),
            Some(Command::Commission(command)) => command.run(),
            Some(Command::Compensate(command)) => command.run(),
            Some(Command::Characterise(command)) => command.run(),
            Some(Command::Demo(command)) => command.run(),
            Some(Command::Check(command)) => command.run(),
            Some(Command::Diagnose(command)) => command.run(),
            Some(Command::Experiment(command)) => command.run(),
            Some(Command::Settle(command)) => command.run(),
            Some(Command::Import(command)) => command.run(),
            Some(Command::Simulate(command)) => command.run(),
            Some(Command::FitForce(command)) => command.run(),
            Some(Command::FitFriction(command)) => command.run(),
            Some(Command::Completions(command)) => command.run(),
            Some(Command::Model(command)) => command.run(),
            Some(Command::Man(command)) => command.run(),
        }
    }
}
