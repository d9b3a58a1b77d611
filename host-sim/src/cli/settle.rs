//! `host-sim settle`: the device asks itself what the recordings cannot tell.

use clap::{Args, ValueEnum};
use device_sim::failure::Failure;
use diagnosis::rig::Rig;
use lab::characterise::{self, written};
use lab::settle::{self, Inputs, MOST_MOTION_S, MOST_ROUNDS, Plant, Progress, Settings};
use std::path::PathBuf;

/// The source of each round's input.
#[derive(Clone, Copy, ValueEnum)]
enum Source {
    /// Designed against the rivals of the round before
    Designed,
    /// Random multisines, for comparison
    Multisines,
    /// The set of `characterise`, shortened to --motion, for comparison
    Characterise,
}

/// Let the virtual device settle its own diagnosis: record, diagnose, design the deciding experiment, and record again.
///
/// At most five rounds and three minutes of motion. It ends when one name is left or nothing tells the rest apart, and writes a
/// folder for each round (recordings, experiment, report), settle.json and settle.html, which say what was asked and why.
#[derive(Args)]
#[command(after_help = examples!("Example:
  host-sim settle --plant hidden.toml --out /tmp/settled"))]
pub(crate) struct Settle {
    /// The simulation as its author believes it (default: the rig of the data sheets)
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// The true mechanism of the virtual device: a rig file, with effects that the simulation does not know
    #[arg(long, value_name = "RIG.toml")]
    plant: PathBuf,
    /// The most rounds, 1 to 5
    #[arg(long, default_value_t = MOST_ROUNDS, value_name = "N")]
    rounds: usize,
    /// The most motion of all rounds together, s, 20 to 180
    #[arg(long, default_value_t = MOST_MOTION_S, value_name = "S")]
    motion: f64,
    /// The source of the inputs
    #[arg(long, value_enum, default_value = "designed")]
    inputs: Source,
    /// Seed of the inputs
    #[arg(long, default_value_t = 1, value_name = "N")]
    seed: u64,
    /// Folder for the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Settle {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if !(1..=MOST_ROUNDS).contains(&self.rounds) {
            return Err(Failure::input(format_args!("--rounds must be 1 to {MOST_ROUNDS}; correct it")));
        }
        if !(20.0..=MOST_MOTION_S).contains(&self.motion) {
            return Err(Failure::input(format_args!(
                "--motion must be 20 to {MOST_MOTION_S:.0} s; correct it"
            )));
        }
        let rig = match &self.rig {
            Some(path) => Rig::read(path).map_err(Failure::input)?,
            None => written::nominal_rig(&characterise::scale(&characterise::configuration())?),
        };
        let plant = Plant {
            rig: Rig::read(&self.plant).map_err(Failure::input)?,
            file: self.plant.display().to_string(),
        };
        let inputs = match self.inputs {
            Source::Designed => Inputs::Designed,
            Source::Multisines => Inputs::Multisines,
            Source::Characterise => Inputs::Characterise,
        };
        let Self { rounds, motion: motion_s, seed, out, .. } = self;
        let settings = Settings { inputs, rounds, motion_s, seed, out };
        let settled = settle::settle(&plant, &rig, &settings, |progress| match progress {
            Progress::Asked(number, asked, why) => {
                note!("round {number}: {asked}");
                note!("  why: {why}");
            }
            Progress::Said(sentence) => note!("  {sentence}."),
            Progress::Played(_) => {}
        })?;
        for name in &settled.names {
            say!("{} {:.2}", name.class.join(" or "), name.confidence);
        }
        say!("{}.", settled.conclusion);
        say!("report: {}", settings.out.join("settle.html").display());
        say!(
            "rounds={} motion_s={:.1} names={}",
            settled.rounds.len(),
            settled.motion_s(),
            settled.names.len()
        );
        Ok(())
    }
}
