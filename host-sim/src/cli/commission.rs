//! `host-sim commission`: how a device is wired and built, found out before anybody holds its
//! needle.

use super::confirm::{Consent, ConsentFlags};
use clap::Args;
use device_sim::device::Port;
use device_sim::error::Error;
use lab::characterise::mechanism::Wiring;
use lab::characterise::{self, writer};
use lab::commission::bench::{GuidedLine, Line, WireLine};
use lab::commission::mechanism::VirtualLine;
use lab::commission::{self, CommissioningOutcome, CommissioningStep, Wish};
use live::serial::SerialPort;
use live::serving::stop_on_signals;
use live::{examples, say};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Find out how a device is wired and built, and give it its part of the configuration.
///
/// Announces each step. The motor moves only in the last one, by pulses of at most 2 mN·m. A device
/// refuses to start until this has passed.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim commission
  host-sim commission --device /dev/ttyACM0 --page
  host-sim commission --device /dev/ttyACM0 --pull-mm 200 --out device.toml"))]
pub(crate) struct Commission {
    /// `virtual`, or the serial port of a device, such as /dev/ttyACM0
    #[arg(long, default_value = "virtual", value_name = "virtual|PATH")]
    device: String,
    /// Length of the paper strip that is pulled through under the roller, 10 to 1,000 mm
    #[arg(long, default_value_t = 100.0, value_name = "MM")]
    pull_mm: f64,
    /// Turns of the roller by hand, 1 to 20
    #[arg(long, default_value_t = 5, value_name = "N")]
    turns: u32,
    /// Counts per turn after quadrature, if known for the encoder
    #[arg(long, value_name = "N")]
    counts_per_turn: Option<u16>,
    #[command(flatten)]
    consent: ConsentFlags,
    /// Also write the device's part to this file
    #[arg(long, value_name = "FILE.toml")]
    out: Option<PathBuf>,
}

impl Commission {
    pub(crate) fn run(self) -> Result<(), Error> {
        let wish = self.wish()?;
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;
        let consent = self.consent.open("Commissioning", &self.device, &stop)?;
        let outcome = if self.device == "virtual" {
            self.on_virtual(&wish, &consent)
        } else {
            self.on_port(&wish, &consent, &stop)
        };
        consent.end(outcome.as_ref().map(CommissioningOutcome::lines));
        let outcome = outcome?;
        for line in outcome.lines() {
            say!("{line}");
        }
        if let Some(path) = &self.out {
            std::fs::write(path, outcome.to_toml(&self.device)?).map_err(|cause| {
                Error::input(format_args!(
                    "{}: the file cannot be written ({cause}); the device is commissioned; choose another --out",
                    path.display()
                ))
            })?;
            say!("{}", path.display());
        }
        say!("commissioned");
        Ok(())
    }

    fn wish(&self) -> Result<Wish, Error> {
        if !(10.0..=1000.0).contains(&self.pull_mm) {
            return Err(Error::input(format_args!(
                "--pull-mm is {}; it must be from 10 to 1000",
                self.pull_mm
            )));
        }
        if !(1..=20).contains(&self.turns) {
            return Err(Error::input(format_args!("--turns is {}; it must be from 1 to 20", self.turns)));
        }
        if self.counts_per_turn.is_some_and(|counts| counts < 256) {
            return Err(Error::input("--counts-per-turn must be from 256 to 65535"));
        }
        Ok(Wish { turns: self.turns, pull_mm: self.pull_mm, counts_per_turn: self.counts_per_turn })
    }

    fn on_virtual(&self, wish: &Wish, consent: &Consent) -> Result<CommissioningOutcome, Error> {
        let scale = characterise::scale(&characterise::configuration())?;
        let rig = writer::nominal_rig(&scale);
        let line = VirtualLine::new(&rig, "the nominal rig", Wiring::default(), scale.roller_radius_mm)?;
        on(line, wish, consent)
    }

    fn on_port(
        &self,
        wish: &Wish,
        consent: &Consent,
        stop: &AtomicBool,
    ) -> Result<CommissioningOutcome, Error> {
        let mut port = SerialPort::find(&self.device)?;
        consent.needle_is_out()?;
        on(WireLine::new(port.open().map_err(Error::failed)?, stop), wish, consent)
    }
}

fn on(line: impl Line, wish: &Wish, consent: &Consent) -> Result<CommissioningOutcome, Error> {
    let mut line = GuidedLine { line, guide: consent.guide() };
    commission::commission(&mut line, wish, |step: CommissioningStep| consent.ask(&step, step.moves()))
}
