//! `host-sim man`: manual pages of the program and of each of its commands.

use super::Cli;
use clap::{Args, CommandFactory};
use device_sim::error::Error;
use live::{examples, say};
use std::path::PathBuf;

/// Write a manual page for the program and for each of its commands.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim man --out ~/.local/share/man/man1; man host-sim-diagnose"))]
pub(crate) struct Man {
    /// Folder to write to
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Man {
    pub(crate) fn run(self) -> Result<(), Error> {
        let write = || {
            std::fs::create_dir_all(&self.out)?;
            clap_mangen::generate_to(Cli::command().disable_help_subcommand(true), &self.out)
        };
        write().map_err(|cause| {
            Error::failed(format_args!(
                "{}: the pages cannot be written ({cause}); free some space or choose another --out",
                self.out.display()
            ))
        })?;
        say!("pages: {}", self.out.display());
        Ok(())
    }
}
