//! `host-sim reproduce`: the papers' figures compared with ours.

use clap::Args;
use device_sim::error::Error;
use live::{examples, say};
use reproduce::{PAPERS, Paper, reproduce};
use std::path::PathBuf;

/// Run the papers' procedures on the virtual device and write a page for each, with the paper's
/// numbers and ours.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim reproduce --paper 001 --out papers"))]
pub(crate) struct Reproduce {
    /// One paper by its number: 000, 001 or 002; without it, all three
    #[arg(long, value_name = "N")]
    paper: Option<String>,
    /// Folder to write the pages and their recordings to; created if missing
    #[arg(long, value_name = "DIR", default_value = "papers")]
    out: PathBuf,
}

impl Reproduce {
    pub(crate) fn run(self) -> Result<(), Error> {
        let wanted: Vec<Paper> = match &self.paper {
            None => PAPERS.to_vec(),
            Some(number) => PAPERS.into_iter().filter(|p| p.number() == number).collect(),
        };
        if wanted.is_empty() {
            return Err(Error::input(format_args!(
                "--paper is {}; it must be 000, 001 or 002",
                self.paper.unwrap_or_default()
            )));
        }
        // One that cannot be run must not cost the others.
        let mut outcome = Ok(());
        for paper in wanted {
            match reproduce(paper, &self.out) {
                Ok(page) => say!("{}", page.display()),
                Err(why) => outcome = outcome.and(Err(why)),
            }
        }
        outcome
    }
}
