//! `host-sim characterise`: recordings that distinguish one physical effect from another.

use super::confirm::needle_is_out;
use clap::Args;
use device_sim::error::Error;
use diagnosis::rig::Rig;
use lab::characterise::mechanism::BareDevice;
use lab::characterise::{self, News, programme, writer};
use live::progress::Progress;
use live::serial::SerialPort;
use live::serving::stop_on_signals;
use live::{examples, say};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Make the device run its excitations, with no hand on the needle, and record them at 10 kHz.
///
/// Writes rig.toml (the nominal simulation), fit.csv, fit2.csv and holdout.csv, which `diagnose`
/// reads.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim characterise --out /tmp/bench3
  host-sim characterise --device /dev/ttyACM0 --out /tmp/bench3
  host-sim diagnose --rig /tmp/bench3/rig.toml --fit /tmp/bench3/fit.csv --fit /tmp/bench3/fit2.csv \\
    --holdout /tmp/bench3/holdout.csv --out /tmp/report"))]
pub(crate) struct Characterise {
    /// `virtual`, or the serial port of a device, such as /dev/ttyACM0
    #[arg(long, default_value = "virtual", value_name = "virtual|PATH")]
    device: String,
    /// The true mechanism of the virtual device: a rig file, with effects that the written rig.toml
    /// does not know
    #[arg(long, value_name = "RIG.toml")]
    plant: Option<PathBuf>,
    /// The needle is out: do not ask
    #[arg(long)]
    yes: bool,
    /// Folder for the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Characterise {
    pub(crate) fn run(self) -> Result<(), Error> {
        let config = characterise::configuration();
        let hello = characterise::scale(&config)?;
        let nominal = writer::nominal_rig(&hello);
        let programmes = programme::programmes(&nominal, hello.roller_radius_mm);
        characterise::check(&config, &programmes)?;
        let mut bar = Progress::new("playing");
        let mut whole = None;
        let is_virtual = self.device == "virtual";
        let news = |news: News| match news {
            News::Recording(programme) => whole = Some(programme.seconds()),
            // The virtual device tilts itself.
            News::Prompt(_) if is_virtual => {}
            News::Prompt(prompt) => eprintln!("{prompt}"),
            News::Played(seconds) => bar.show(seconds, whole, "s"),
        };
        let tracks = if is_virtual {
            let (truth, file) = match &self.plant {
                Some(path) => (Rig::read(path).map_err(Error::input)?, path.display().to_string()),
                None => (nominal, "the nominal rig".to_owned()),
            };
            characterise::on_virtual(&mut BareDevice::new(&truth, &file)?, &programmes, news)?
        } else {
            if self.plant.is_some() {
                return Err(Error::input(
                    "--plant is for the virtual device: a real one has its own mechanism",
                ));
            }
            let stop = Arc::new(AtomicBool::new(false));
            stop_on_signals(&stop)?;
            let mut port = SerialPort::find(&self.device)?;
            needle_is_out(self.yes, &stop)?;
            characterise::on_port(&mut port, &programmes, &stop, news)?
        };
        drop(bar);
        for path in writer::write_all(&self.out, &tracks)? {
            say!("{}", path.display());
        }
        for track in &tracks {
            say!("{} rows={}", track.file, track.samples.len());
        }
        Ok(())
    }
}
