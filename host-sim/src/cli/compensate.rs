//! `host-sim compensate`: what a diagnosis found, fed forward by the device.

use super::confirm::{confirm, needle_is_out};
use super::run::stop_on_signals;
use clap::Args;
use diagnosis::rig::Rig;
use host_sim::characterise::{self, written};
use host_sim::commission::bench::{Line, WireLine};
use host_sim::commission::mechanism::VirtualLine;
use host_sim::compensate::{self, Outcome, Step, page};
use host_sim::device::Port;
use host_sim::device::part;
use host_sim::device::serial::SerialPort;
use host_sim::failure::Failure;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Take away from the hand what a diagnosis found of the device's own forces.
///
/// Cogging, friction, weight, offset, ripple and deadband of the report are stored on the device and fed forward, each below
/// 100 %. The roller turns slowly before and after; compensation.html shows what a hand would feel of the mechanism.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim characterise --device /dev/ttyACM0 --out bench
  host-sim diagnose --rig bench/rig.toml --fit bench/fit.csv --fit bench/fit2.csv --holdout bench/holdout.csv --out report
  host-sim compensate --report report --device /dev/ttyACM0 --out after
  host-sim compensate --report report --device /dev/ttyACM0 --align"))]
pub(crate) struct Compensate {
    /// The folder that `diagnose --out` wrote
    #[arg(long, value_name = "DIR")]
    report: PathBuf,
    /// `virtual`, or the serial port of a device, such as /dev/ttyACM0
    #[arg(long, default_value = "virtual", value_name = "virtual|PATH")]
    device: String,
    /// What the virtual device's mechanism really is: a rig file
    #[arg(long, value_name = "RIG.toml")]
    plant: Option<PathBuf>,
    /// Of the usual gains (0.92 of waves, weight and drive, 0.8 of friction), 0 to 1
    #[arg(long, default_value_t = 1.0, value_name = "0..1")]
    gain: f64,
    /// Only find the rotor's angle again, after a restart of a device that is compensated
    #[arg(long, conflicts_with_all = ["out", "gain"])]
    align: bool,
    /// Ask nothing: the needle is out
    #[arg(long)]
    yes: bool,
    /// Folder for compensation.html and device.toml
    #[arg(long, value_name = "DIR", required_unless_present = "align")]
    out: Option<PathBuf>,
}

impl Compensate {
    pub(crate) fn run(self) -> Result<(), Failure> {
        if !(0.0..=1.0).contains(&self.gain) {
            return Err(Failure::input(format_args!("--gain is {}; it must lie from 0 to 1", self.gain)));
        }
        let rig = compensate::read_report(&self.report)?;
        if self.device == "virtual" {
            return self.on(&mut *self.virtual_line()?, &rig, true);
        }
        if self.plant.is_some() {
            return Err(Failure::input(
                "--plant is for the virtual device: a real one has its own mechanism",
            ));
        }
        let mut port = SerialPort::find(&self.device)?;
        needle_is_out(self.yes)?;
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;
        let wire = port.open().map_err(Failure::failed)?;
        self.on(&mut WireLine::new(wire, &stop), &rig, self.yes)
    }

    fn virtual_line(&self) -> Result<Box<dyn Line>, Failure> {
        let scale = characterise::scale(&characterise::configuration())?;
        let (plant, file) = match &self.plant {
            Some(path) => (Rig::read(path).map_err(Failure::input)?, path.display().to_string()),
            None => (written::nominal_rig(&scale), "the nominal rig".to_owned()),
        };
        Ok(Box::new(VirtualLine::commissioned(&plant, &file, scale.roller_radius_mm)?))
    }

    fn on(&self, line: &mut dyn Line, rig: &Rig, yes: bool) -> Result<(), Failure> {
        if self.align {
            confirm(&Step::Before, yes)?;
            let angle = compensate::align(line, rig)?;
            say!("angle index_counts={} agreement={:.3}", angle.count, angle.agreement);
            return Ok(());
        }
        let outcome = compensate::compensate(line, rig, self.gain, |step| confirm(&step, yes))?;
        self.write(&outcome)?;
        for left_out in &outcome.left_out {
            say!("{left_out}");
        }
        let (before, after) = (&outcome.before, &outcome.after);
        let line = |what: &str, before: f64, after: f64| {
            say!("{what} before={:.1} after={:.1} mN rms", before * 1e3, after * 1e3);
        };
        line("insertion", before.insertion, after.insertion);
        line("hold", before.hold, after.hold);
        line("withdrawal", before.withdrawal, after.withdrawal);
        line("all", before.all(), after.all());
        Ok(())
    }

    fn write(&self, outcome: &Outcome) -> Result<(), Failure> {
        let Some(out) = &self.out else { return Ok(()) };
        let refuse = |cause: std::io::Error| {
            Failure::input(format_args!(
                "{}: cannot be written ({cause}); the device is compensated; choose another --out",
                out.display()
            ))
        };
        std::fs::create_dir_all(out).map_err(refuse)?;
        let device = part::to_toml(&self.device, &outcome.device)?;
        for (file, text) in [("compensation.html", page::html(outcome)), ("device.toml", device)] {
            std::fs::write(out.join(file), text).map_err(refuse)?;
            say!("{}", out.join(file).display());
        }
        Ok(())
    }
}
