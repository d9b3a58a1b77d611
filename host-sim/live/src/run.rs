//! `host-sim run`: a device, virtual or on a serial port, shown and recorded.

use crate::class::ClassFlags;
use crate::demonstration;
use crate::output;
use crate::progress::Progress;
use crate::serial::SerialPort;
use crate::serving::stop_on_signals;
use crate::streams::StreamFlags;
use crate::training::without_insertion;
use clap::{Args, ValueEnum};
use control_core::{Device, TICK_HZ};
use device_sim::device::device_config::DeviceConfig;
use device_sim::device::virtual_device::VirtualDevice;
use device_sim::driver::Driver;
use device_sim::error::Error;
use device_sim::procedure::{self, Procedure};
use device_sim::profile::{Model, Profile};
use device_sim::session::{self, Session, Source, Subscription};
use recording::messages::Setup;
use recording::read::Recording;
use recording::run_stats::RunStats;
use recording::write::Recorder;
use server::outlets::Outlets;
use server::patient_manager::PatientManager;
use server::realtime_clock::RealtimeClock;
use server::run_loop::{RunLoop, RunOutcome};
use server::saved_patients::SavedPatients;
use server::visualizer;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use training::debrief;
use training::language::Language;

/// Run a virtual or real device, show it and record it.
///
/// On a virtual device a scripted hand performs the procedure until a person takes the needle on
/// the page. On a real device the torque stays off until a person presses Start there. The last
/// line on standard output summarises the run.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim run --profile firm-skin
  host-sim run --model sparte
  host-sim run --device /dev/ttyACM0 --record session.mcap
  host-sim run --headless --fast --seconds 60 --record /tmp/a.mcap"))]
pub struct Run {
    /// `virtual`, or the serial port of a device, such as /dev/ttyACM0
    #[arg(long, default_value = "virtual", value_name = "virtual|PATH")]
    device: String,
    /// Procedure of the scripted hand: venepuncture, slow, shoulder-straight, insertion-5mms-60deg
    /// …, or a TOML file like those in host-sim/procedures; without it, the one in the patient's
    /// file, and a cannulation on the page where that names none
    #[arg(long, value_name = "NAME|FILE")]
    procedure: Option<String>,
    /// The patient: adult, thin-elderly, high-body-mass, firm-skin, dorsal-hand, child, shoulder,
    /// phantom, those with a body in three dimensions (shoulder-joint, forearm, knee, hip), or a
    /// TOML file like those in host-sim/profiles; without it, adult, or the default one of --model
    #[arg(long, value_name = "NAME|FILE")]
    profile: Option<String>,
    /// The device's construction: a TOML file as commissioning writes it, or paper-001; without it,
    /// a real device keeps its own
    #[arg(long, value_name = "NAME|FILE")]
    device_config: Option<PathBuf>,
    /// The force law; the patient must use the same
    #[arg(long, value_enum)]
    model: Option<ModelName>,
    /// The scripted hand's angle to the skin on a virtual device, 5 to 90; without it, the
    /// patient's
    #[arg(long, value_name = "DEG")]
    angle: Option<f64>,
    /// On a virtual device with the law xr: count depth from the surface of the deformed tissue
    /// (Table 1 of paper 000) instead of from where it was at rest
    #[arg(long)]
    deformed: bool,
    /// Serve no page; a real device is then started at once
    #[arg(long)]
    headless: bool,
    /// With --headless: the tip is on the skin now, so set depth 0 here
    #[arg(long, requires = "headless")]
    zero: bool,
    /// With --headless: you have looked at the device and clear the fault that it reports
    #[arg(long, requires = "headless")]
    clear_fault: bool,
    /// Stop after this many seconds of samples; without it, Ctrl-C ends the run cleanly
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Run a virtual device as fast as possible
    #[arg(long)]
    fast: bool,
    /// Record to this MCAP file, replacing an existing one
    #[arg(long, value_name = "FILE.mcap")]
    record: Option<PathBuf>,
    /// Port of the page on this computer; 0 for any free port
    #[arg(long, default_value_t = PORT, value_name = "N")]
    port: u16,
    /// Show the page to other computers, tablets and phones too: an address of this one (0.0.0.0:
    /// all of them), and a port if not 8710. They need the token in the address that is printed,
    /// with its QR code. Use it in a network that you trust: whoever has the token moves the
    /// needle, and nothing is encrypted
    #[arg(long, value_name = "ADDRESS[:PORT]", value_parser = address, conflicts_with_all = ["port", "headless"])]
    listen: Option<SocketAddr>,
    #[command(flatten)]
    streams: StreamFlags,
    #[command(flatten)]
    class: ClassFlags,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ModelName {
    /// The jog effect and friction cone of the venepuncture device, Paper 001.
    Jog,
    /// Tracking walls and LuGre friction of the joint injection simulator, Paper 002.
    Sparte,
    /// The fitted force table of the layered-tissue simulator, Paper 000.
    Xr,
}

impl From<ModelName> for Model {
    fn from(name: ModelName) -> Self {
        match name {
            ModelName::Jog => Model::Jog,
            ModelName::Sparte => Model::Sparte,
            ModelName::Xr => Model::Xr,
        }
    }
}

/// The device, the patient and the procedure of a run.
struct Chosen {
    /// The device's part as its file has it.
    part: Option<DeviceConfig>,
    profile: Profile,
    /// Name or file of the procedure.
    wanted: String,
    procedure: Procedure,
}

impl Run {
    fn address(&self) -> SocketAddr {
        self.listen.unwrap_or_else(|| (Ipv4Addr::LOCALHOST, self.port).into())
    }

    pub(crate) fn run(self) -> Result<(), Error> {
        let seconds = self.check()?;
        let chosen = self.choose()?;
        let serial = if self.is_virtual() { None } else { Some(SerialPort::find(&self.device)?) };

        let setup = self.setup(&chosen);
        let (session, publisher) =
            session::open(chosen.profile.scene(self.source(), setup.procedure.clone()));
        // The port is taken before the file is made: a page that cannot be served must not cost a
        // recording.
        let _streams = self.streams.serve(&session)?;
        let _class = self.class.join(&session)?;
        let looks = (!self.headless || self.class.is_wanted()).then(|| session.subscribe());
        let _server = if self.headless { None } else { Some(serve_for_practice(session, self.address())?) };
        let recorder = self.record.as_ref().map(|path| Recorder::create(path, &setup)).transpose()?;
        self.record.iter().try_for_each(|path| recording::views::write_beside(path))?;
        let limit = seconds.map(|s| (s * f64::from(TICK_HZ)).round() as u64);
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;

        let outlets = Outlets::new(publisher, recorder, RunStats::new(limit));
        let run_loop = self.run_loop(&chosen, setup, outlets, looks, &stop);
        let outcome = self.play(run_loop, serial, chosen, seconds)?;
        self.report(&outcome);
        Ok(())
    }

    fn is_virtual(&self) -> bool {
        self.device == "virtual"
    }

    fn source(&self) -> Source {
        if self.is_virtual() { Source::Virtual } else { Source::Serial { path: self.device.clone() } }
    }

    /// Reads the device's file and finds the patient and the procedure.
    fn choose(&self) -> Result<Chosen, Error> {
        let mut part = self.device_config.as_deref().map(DeviceConfig::read).transpose()?;
        if let Some(part) = part.as_mut().filter(|_| self.is_virtual()) {
            // It is built as its file says.
            part.device.commissioned = true;
        }
        let device = part.as_ref().map_or_else(Device::commissioned_virtual, |part| part.device);
        let profile = self.find_profile(&device)?;
        let profile = match self.angle {
            Some(degrees) => profile.at_angle(degrees)?,
            None => profile,
        };
        // An angle that a person has asked for is not the one of a cannulation.
        let is_page = !self.headless && self.angle.is_none();
        let own = if is_page { procedure::of_page(&profile) } else { profile.procedure.clone() };
        let wanted = self.procedure.clone().unwrap_or(own);
        let (procedure, profile) = Procedure::entering(&wanted, profile)?;
        Ok(Chosen { part, profile, wanted, procedure })
    }

    /// Returns the description of the run that a recording begins with.
    fn setup(&self, chosen: &Chosen) -> Setup {
        Setup {
            program: recording::version::program(),
            source: if self.deformed {
                "virtual, depth from the deformed tissue".into()
            } else {
                self.device.clone()
            },
            profile_toml: chosen.profile.source.text.clone(),
            profile_origin: chosen.profile.source.origin.clone(),
            procedure: self.is_virtual().then(|| chosen.procedure.name.clone()),
            device_toml: chosen.part.as_ref().map(|part| part.source.text.clone()),
            purpose: chosen.procedure.purpose,
        }
    }

    /// Builds the loop between the device and its outlets. `looks` is what practice
    /// sees, for the page and the class.
    fn run_loop<'a>(
        &self,
        chosen: &Chosen,
        setup: Setup,
        outlets: Outlets,
        looks: Option<Subscription>,
        stop: &'a AtomicBool,
    ) -> RunLoop<'a> {
        let hand = self.is_virtual().then(|| chosen.wanted.clone());
        let patients = PatientManager::new(chosen.profile.clone(), self.source(), hand, setup)
            .saving_in(SavedPatients::new(PATIENTS));
        let driver = Driver::new(chosen.profile.config.patient.clone());
        let driver = chosen.part.iter().fold(driver, |driver, part| driver.with_device(part.command()));
        let run_loop = RunLoop::new(driver, outlets, stop).with_patients(patients);
        let run_loop = match looks {
            Some(subscription) => run_loop.with_practice(subscription, !self.is_virtual()),
            None => run_loop,
        };
        if self.is_virtual() || self.headless {
            let run_loop = if self.clear_fault { run_loop.clearing_first() } else { run_loop };
            if self.zero { run_loop.zeroing_first() } else { run_loop }
        } else {
            // A real motor comes on when somebody who sees it says so; without a page, this command
            // is what says it.
            note!("the torque is off: press Start in the page");
            run_loop.wait_for_a_person()
        }
    }

    /// Runs the device on the serial port or, without one, a virtual device.
    fn play(
        &self,
        run_loop: RunLoop<'_>,
        serial: Option<SerialPort>,
        chosen: Chosen,
        seconds: Option<f64>,
    ) -> Result<RunOutcome, Error> {
        let mut bar = Progress::new("running");
        let progress = |samples: u64| bar.show(samples as f64 / f64::from(TICK_HZ), seconds, "s");
        if let Some(mut port) = serial {
            return run_loop.run_in_real_time(&mut port, seconds, progress);
        }
        let Chosen { profile, procedure, part, .. } = chosen;
        let mut device = VirtualDevice::built(&profile, procedure, part.as_ref());
        if self.deformed {
            device = device.with_deformed(&profile)?;
        }
        if !self.fast {
            device.take_times();
        }
        let clock = if self.fast { RealtimeClock::Free } else { RealtimeClock::real_time() };
        run_loop.run_in_step(device, clock, progress)
    }

    /// Returns the requested patient, or the default one of the requested law.
    fn find_profile(&self, device: &Device) -> Result<Profile, Error> {
        let model = self.model.map(Model::from);
        let usual = model.unwrap_or(Model::Jog).patient();
        let profile = Profile::find_for(self.profile.as_deref().unwrap_or(usual), device)?;
        let its = profile.model();
        match model.filter(|model| *model != its) {
            None => Ok(profile),
            Some(model) => Err(Error::input(format_args!(
                "{}: law.model is {}, but --model is {}; omit --model, or choose a patient with that law, such as {}",
                profile.source.origin,
                its.name(),
                model.name(),
                model.patient()
            ))),
        }
    }

    /// Checks the options beyond what clap can.
    fn check(&self) -> Result<Option<f64>, Error> {
        self.streams.check()?;
        self.class.check()?;
        if self.angle.is_some() && !self.is_virtual() {
            return Err(Error::input("--angle is for the virtual device: a hand turns a real needle"));
        }
        if self.deformed && !self.is_virtual() {
            return Err(Error::input(
                "--deformed is for the virtual device: the board takes no surface from a PC that may stall",
            ));
        }
        if self.fast && !self.is_virtual() {
            return Err(Error::input("--fast is for the virtual device: a real one runs in real time"));
        }
        match self.seconds {
            Some(s) if !(s.is_finite() && (1e-4..=1e7).contains(&s)) => {
                Err(Error::input(format_args!("--seconds is {s}; it must be from 0.0001 to 10000000")))
            }
            None if self.headless && self.fast => {
                Err(Error::input("--headless --fast without --seconds would never end; add --seconds 60"))
            }
            seconds => Ok(seconds),
        }
    }

    fn report(&self, outcome: &RunOutcome) {
        if let (Some(path), Some(bytes)) = (&self.record, outcome.recorded_bytes) {
            say!("recorded {bytes} bytes to {}", path.display());
        }
        let (link, stats) = (&outcome.link, &outcome.stats);
        say!(
            "samples={} frames={} lost={} punctures={} peak_force_n={:.3} lost_samples={} garbage={} vessels={} faults={}",
            stats.samples,
            link.frames,
            link.lost_frames,
            stats.punctures,
            stats.peak_force_n,
            link.lost_samples,
            link.garbage,
            stats.vessels,
            stats.faults
        );
    }
}

/// Port of the page.
const PORT: u16 = 8710;
/// The folder of the patients that were saved in the page, in the one that the program was started
/// in.
const PATIENTS: &str = "patients";

/// Reads an address with or without a port.
fn address(text: &str) -> Result<SocketAddr, String> {
    let with_port = || text.parse::<SocketAddr>().ok();
    let without = || Some(SocketAddr::new(text.parse::<IpAddr>().ok()?, PORT));
    with_port()
        .or_else(without)
        .ok_or_else(|| "it is not an address such as 0.0.0.0 or 192.168.1.20:8710".to_owned())
}

/// Serves the page, with the debrief of what is recorded in the page.
fn serve_for_practice(session: Session, address: SocketAddr) -> Result<visualizer::Server, Error> {
    let write: visualizer::Debrief = Arc::new(|file, language| {
        let language = Language::find(language.unwrap_or("en"))?;
        let attempts = debrief::attempts(&Recording::read(file)?, None)?;
        let html = debrief::html(&attempts, &[]).ok_or_else(|| without_insertion(file))?;
        Ok(language.page(&html))
    });
    let server = visualizer::serve_with_reports(session, address, write, demonstration::page)
        .map_err(Error::failed)?;
    // A page on one address of the network is not on 127.0.0.1.
    if address.ip().is_loopback() || address.ip().is_unspecified() {
        output::page("visualizer", &server.url());
    }
    if let Some(url) = server.url_for_others() {
        output::page_for_others(&url);
    }
    Ok(server)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_may_leave_out_its_port() {
        assert_eq!(address("0.0.0.0"), Ok("0.0.0.0:8710".parse().unwrap()));
        assert_eq!(address("192.168.1.20:9000"), Ok("192.168.1.20:9000".parse().unwrap()));
        assert_eq!(address("::1"), Ok("[::1]:8710".parse().unwrap()));
        assert!(address("tablet").is_err() && address("10.0.0.1:99999").is_err());
    }
}
