//! `host-sim fit-friction`.

use clap::Args;
use convert::export::write;
use device_sim::error::Error;
use lab::friction_fit;
use live::{examples, say};
use std::io::Write as _;
use std::path::PathBuf;

/// Fit the LuGre friction of Paper 002 to a needle that goes to and fro in one block.
///
/// Reads a recording of this program (MCAP), or CSV with the columns time_s, depth_mm and force_n,
/// in which the needle turns round at least four times and moves slowly and fast; of several
/// stretches of a recording it takes the longest. Writes the
/// `[law.friction]` of a profile, each value with its 95 % interval.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim fit-friction gum.csv --out friction.toml"))]
pub(crate) struct FitFriction {
    /// Recording of the periodic penetration
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// The friction, as TOML
    #[arg(long, value_name = "F.toml")]
    out: PathBuf,
}

impl FitFriction {
    pub(crate) fn run(self) -> Result<(), Error> {
        let fit = friction_fit::fit(&self.file)?;
        write(&self.out, |out| out.write_all(friction_fit::toml(&fit).as_bytes()))?;
        say!("{}", self.out.display());
        say!("reversals={} force_n={:.4} left_n={:.4}", fit.turns, fit.force_n, fit.left_n);
        Ok(())
    }
}
