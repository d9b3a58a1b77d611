//! `host-sim completions`: what a shell needs to complete commands, options and their values.

use super::Cli;
use clap::{Args, CommandFactory};
use clap_complete::Shell;
use device_sim::error::Error;
use live::{examples, say};

/// Print a script with which a shell completes commands and options.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim completions bash > ~/.local/share/bash-completion/completions/host-sim
  host-sim completions zsh > ~/.zfunc/_host-sim
  host-sim completions fish > ~/.config/fish/completions/host-sim.fish"))]
pub(crate) struct Completions {
    /// The shell
    #[arg(value_enum)]
    shell: Shell,
}

impl Completions {
    pub(crate) fn run(self) -> Result<(), Error> {
        let mut script = Vec::new();
        clap_complete::generate(self.shell, &mut Cli::command(), "host-sim", &mut script);
        // clap_complete 4.6 takes the hyphen of the program's name for the boundary of a subcommand
        // where bash looks one up.
        let script = String::from_utf8_lossy(&script).replace("host__subcmd__sim", "host__sim");
        say!("{}", script.trim_end());
        Ok(())
    }
}
