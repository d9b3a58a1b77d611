//! `host-sim compensate`: what a diagnosis found, fed forward by the device.

use super::confirm::{Consent, ConsentFlags};
use clap::Args;
use device_sim::device::Port;
use device_sim::error::Error;
use diagnosis::rig::Rig;
use lab::characterise::{self, writer};
use lab::commission::bench::{GuidedLine, Line, WireLine};
use lab::commission::mechanism::VirtualLine;
use lab::compensate::{self, CompensationStep, Wish, files};
use live::serial::SerialPort;
use live::serving::stop_on_signals;
use live::{examples, say};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Cancel the device's own forces, as a diagnosis found them, by feedforward.
///
/// Stores cogging, friction, weight, offset, ripple and deadband of the report on the device, which
/// feeds them forward, each below 100 %. The roller turns slowly before and after; parts that a
/// hand would feel more than before are undone, and compensation.html shows the mechanism's force
/// on a hand. A weight that the report lacks is measured first.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim characterise --device /dev/ttyACM0 --out bench
  host-sim diagnose --rig bench/rig.toml --fit bench/fit.csv --fit bench/fit2.csv --holdout bench/holdout.csv --out report
  host-sim compensate --report report --device /dev/ttyACM0 --out after --page
  host-sim compensate --report report --device /dev/ttyACM0 --align"))]
pub(crate) struct Compensate {
    /// The folder that `diagnose --out` wrote
    #[arg(long, value_name = "DIR")]
    report: PathBuf,
    /// `virtual`, or the serial port of a device, such as /dev/ttyACM0
    #[arg(long, default_value = "virtual", value_name = "virtual|PATH")]
    device: String,
    /// The true mechanism of the virtual device: a rig file
    #[arg(long, value_name = "RIG.toml")]
    plant: Option<PathBuf>,
    /// Share of the usual gains (0.92 for waves, weight and drive, 0.8 for friction), 0 to 1
    #[arg(long, default_value_t = 1.0, value_name = "0..1")]
    gain: f64,
    /// Only find the rotor's angle again, after a restart of a device that is compensated
    #[arg(long, conflicts_with_all = ["out", "gain"])]
    align: bool,
    #[command(flatten)]
    consent: ConsentFlags,
    /// Folder for compensation.html and device.toml
    #[arg(long, value_name = "DIR", required_unless_present = "align")]
    out: Option<PathBuf>,
}

impl Compensate {
    pub(crate) fn run(self) -> Result<(), Error> {
        if !(0.0..=1.0).contains(&self.gain) {
            return Err(Error::input(format_args!("--gain is {}; it must be from 0 to 1", self.gain)));
        }
        let rig = compensate::read_report(&self.report)?;
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;
        let consent = self.consent.open("Compensation", &self.device, &stop)?;
        let outcome = self.on_device(&rig, &consent, &stop);
        consent.end(outcome.as_ref().map(|lines| lines.to_vec()));
        for line in outcome? {
            say!("{line}");
        }
        Ok(())
    }

    fn on_device(&self, rig: &Rig, consent: &Consent, stop: &AtomicBool) -> Result<Vec<String>, Error> {
        if self.device == "virtual" {
            return self.on(self.virtual_line()?, rig, consent);
        }
        if self.plant.is_some() {
            return Err(Error::input("--plant is for the virtual device: a real one has its own mechanism"));
        }
        let mut port = SerialPort::find(&self.device)?;
        consent.needle_is_out()?;
        self.on(WireLine::new(port.open().map_err(Error::failed)?, stop), rig, consent)
    }

    fn virtual_line(&self) -> Result<VirtualLine, Error> {
        let scale = characterise::scale(&characterise::configuration())?;
        let (plant, file) = match &self.plant {
            Some(path) => (Rig::read(path).map_err(Error::input)?, path.display().to_string()),
            None => (writer::nominal_rig(&scale), "the nominal rig".to_owned()),
        };
        VirtualLine::commissioned(&plant, &file, scale.roller_radius_mm)
    }

    /// Runs on `line` and returns the result, one line each.
    fn on(&self, line: impl Line, rig: &Rig, consent: &Consent) -> Result<Vec<String>, Error> {
        let mut line = GuidedLine { line, guide: consent.guide() };
        if self.align {
            consent.ask(&CompensationStep::Before, true)?;
            let angle = compensate::align(&mut line, rig)?;
            return Ok(vec![format!("angle index_counts={} agreement={:.3}", angle.count, angle.agreement)]);
        }
        let wish = Wish { share: self.gain, ..Wish::default() };
        let outcome = compensate::compensate(&mut line, rig, wish, |step| consent.ask(&step, step.moves()))?;
        let written = match &self.out {
            Some(out) => files::write(out, &self.device, &outcome)?,
            None => Vec::new(),
        };
        let mut lines: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
        lines.extend(outcome.lines());
        outcome.refusal().map_or(Ok(lines), Err)
    }
}
