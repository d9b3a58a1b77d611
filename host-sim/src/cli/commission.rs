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
use lab::commission::{self, CommissioningStep, WeighWish, Wish};
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
  host-sim commission --device /dev/ttyACM0 --pull-mm 200 --out device.toml
  host-sim commission --device /dev/ttyACM0 --weigh 100g --correct --out device.toml"))]
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
    /// Hang this weight, such as 100g, on the needle of a commissioned device and check that 1 N is
    /// 1 N
    #[arg(long, value_name = "WEIGHT", value_parser = grams, conflicts_with_all = ["pull_mm", "turns", "counts_per_turn"])]
    weigh: Option<f64>,
    /// With --weigh: correct the torque at full scale if it is wrong, and prove the device again
    #[arg(long, requires = "weigh")]
    correct: bool,
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
        let found = if self.device == "virtual" {
            self.on_virtual(&wish, &consent)
        } else {
            self.on_port(&wish, &consent, &stop)
        };
        consent.end(found.as_ref().map(|found| found.lines.clone()));
        let found = found?;
        for line in &found.lines {
            say!("{line}");
        }
        if let Some(path) = &self.out {
            std::fs::write(path, &found.file).map_err(|cause| {
                Error::input(format_args!(
                    "{}: the file cannot be written ({cause}); the device is commissioned; choose another --out",
                    path.display()
                ))
            })?;
            say!("{}", path.display());
        }
        say!("{}", if self.weigh.is_some() { "weighed" } else { "commissioned" });
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

    fn on_virtual(&self, wish: &Wish, consent: &Consent) -> Result<Found, Error> {
        let scale = characterise::scale(&characterise::configuration())?;
        let (rig, radius_mm) = (writer::nominal_rig(&scale), scale.roller_radius_mm);
        let name = "the nominal rig";
        let line = if self.weigh.is_some() {
            VirtualLine::commissioned(&rig, name, radius_mm)
        } else {
            VirtualLine::new(&rig, name, Wiring::default(), radius_mm)
        };
        self.on(line?, wish, consent)
    }

    fn on_port(&self, wish: &Wish, consent: &Consent, stop: &AtomicBool) -> Result<Found, Error> {
        let mut port = SerialPort::find(&self.device)?;
        if self.weigh.is_none() {
            consent.needle_is_out()?;
        }
        self.on(WireLine::new(port.open().map_err(Error::failed)?, stop), wish, consent)
    }

    fn on(&self, line: impl Line, wish: &Wish, consent: &Consent) -> Result<Found, Error> {
        let mut line = GuidedLine { line, guide: consent.guide() };
        let ask = |step: CommissioningStep| consent.ask(&step, step.moves());
        Ok(match self.weigh {
            Some(grams) => {
                let wish = WeighWish { grams, correct: self.correct };
                let outcome = commission::weigh(&mut line, &wish, ask)?;
                Found { lines: outcome.lines(), file: outcome.to_toml(&self.device)? }
            }
            None => {
                let outcome = commission::commission(&mut line, wish, ask)?;
                Found { lines: outcome.lines(), file: outcome.to_toml(&self.device)? }
            }
        })
    }
}

/// The findings as lines, and the device's part as a file.
struct Found {
    lines: Vec<String>,
    file: String,
}

/// Reads a weight with its unit, in g.
fn grams(text: &str) -> Result<f64, String> {
    let (number, unit) = match text.strip_suffix("kg") {
        Some(number) => (number, 1e3),
        None => (text.strip_suffix('g').unwrap_or_default(), 1.0),
    };
    let read = number.trim().parse::<f64>().ok().filter(|grams| grams.is_finite() && *grams > 0.0);
    read.map(|number| number * unit).ok_or_else(|| "give it with its unit, such as 100g or 0.1kg".into())
}
