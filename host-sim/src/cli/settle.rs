//! `host-sim settle`: further inputs to the device decide what the recordings cannot.

use super::confirm::{Consent, ConsentFlags};
use clap::{Args, ValueEnum};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use lab::settle::{
    self, Feel, Inputs, MOST_MOTION_S, MOST_ROUNDS, Plant, Progress, Settings, Settled, Subject,
};
use live::progress::Progress as Bar;
use live::serial::SerialPort;
use live::serving::stop_on_signals;
use live::{examples, note, say};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// The source of each round's input.
#[derive(Clone, Copy, ValueEnum)]
enum Source {
    /// Designed against the rivals of the round before
    Designed,
    /// Random multisines, for comparison
    Multisines,
    /// The set of `characterise`, shortened to --motion, for comparison
    Characterise,
    /// The needle in and out as in practice, all of --motion in one round, for comparison
    Passive,
}

/// Let a device settle its own diagnosis: record, diagnose, design the deciding experiment, and
/// record again.
///
/// Two to five rounds and at most three minutes of motion, of which feeding forward keeps 55 s,
/// within the device's ceilings of torque and travel. It ends when one name is left or nothing
/// distinguishes the rest. Then the device feeds forward what was settled, and what a hand feels
/// more than before is taken back. It writes a folder for each round (recordings, experiment,
/// report), settle.json, settle.html, compensation.html and device.toml.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim settle --plant hidden.toml --out /tmp/settled
  host-sim settle --device /dev/ttyACM0 --page --out settled"))]
pub(crate) struct Settle {
    /// The simulation as its author believes it (default: the rig of the data sheets)
    #[arg(long, value_name = "RIG.toml")]
    rig: Option<PathBuf>,
    /// `virtual`, or the serial port of a device, such as /dev/ttyACM0
    #[arg(long, default_value = "virtual", value_name = "virtual|PATH")]
    device: String,
    /// The true mechanism of the virtual device: a rig file, with effects that the simulation does
    /// not know
    #[arg(long, value_name = "RIG.toml", required_if_eq("device", "virtual"))]
    plant: Option<PathBuf>,
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
    /// Feed nothing forward at the end
    #[arg(long)]
    no_compensate: bool,
    #[command(flatten)]
    consent: ConsentFlags,
    /// Folder for the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

impl Settle {
    pub(crate) fn run(self) -> Result<(), Error> {
        if !(1..=MOST_ROUNDS).contains(&self.rounds) {
            return Err(Error::input(format_args!("--rounds must be 1 to {MOST_ROUNDS}; correct it")));
        }
        if !(20.0..=MOST_MOTION_S).contains(&self.motion) {
            return Err(Error::input(format_args!(
                "--motion must be 20 to {MOST_MOTION_S:.0} s; correct it"
            )));
        }
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;
        let consent = self.consent.open("Settling a diagnosis", &self.device, &stop)?;
        let outcome = self.on_device(&consent, &stop);
        let lines = outcome.as_ref().map(|settled| said(settled, &self.out));
        consent.end(lines.clone());
        if let Ok(lines) = lines {
            for line in lines {
                say!("{line}");
            }
        }
        outcome.map(drop)
    }

    fn on_device(&self, consent: &Consent, stop: &AtomicBool) -> Result<Settled, Error> {
        match &self.plant {
            Some(_) if self.device != "virtual" => {
                Err(Error::input("--plant is for the virtual device: a real one has its own mechanism"))
            }
            Some(path) => {
                let rig = Rig::read(path).map_err(Error::input)?;
                self.on(
                    &mut Subject::Virtual(Box::new(Plant { rig, file: path.display().to_string() })),
                    consent,
                    stop,
                )
            }
            None => {
                let mut port = SerialPort::find(&self.device)?;
                consent.needle_is_out()?;
                self.on(&mut Subject::Real { port: &mut port, stop }, consent, stop)
            }
        }
    }

    fn on(&self, subject: &mut Subject, consent: &Consent, stop: &AtomicBool) -> Result<Settled, Error> {
        let rig = match &self.rig {
            Some(path) => Rig::read(path).map_err(Error::input)?,
            None => subject.data_sheet_rig()?,
        };
        let mut bar: Option<Bar> = None;
        settle::settle(subject, &rig, &self.settings(), |progress| {
            if stop.load(Ordering::Relaxed) {
                return Err(Error::failed("stopped before the end; the rounds so far are in --out"));
            }
            match progress {
                Progress::Asked(number, asked, why) => {
                    bar = None;
                    consent.ask(&format_args!("round {number}: {asked}; why: {why}: hands off"), true)?;
                }
                Progress::Played { seconds, of } => {
                    bar.get_or_insert_with(|| Bar::new("playing")).show(seconds, Some(of), "s");
                    consent.tell(&format!("{seconds:.0} of {of:.0} s played"));
                }
                Progress::Diagnoses(part) => {
                    if part == 0.0 {
                        note!("  diagnosing all recordings so far");
                        bar = Some(Bar::new("diagnosing"));
                    }
                    let percent = 100.0 * part;
                    if let Some(bar) = &mut bar {
                        bar.show(percent, Some(100.0), "%");
                    }
                    consent.tell(&format!("Diagnosing all recordings so far: {percent:.0} % done."));
                }
                Progress::Said(sentence) => {
                    bar = None;
                    note!("  {sentence}.");
                    consent.tell(&format!("{sentence}."));
                }
                Progress::Feeds(step) => consent.ask(&step, step.moves())?,
            }
            Ok(())
        })
    }

    fn settings(&self) -> Settings {
        let inputs = match self.inputs {
            Source::Designed => Inputs::Designed,
            Source::Multisines => Inputs::Multisines,
            Source::Characterise => Inputs::Characterise,
            Source::Passive => Inputs::Passive,
        };
        Settings {
            inputs,
            rounds: self.rounds,
            motion_s: self.motion,
            seed: self.seed,
            compensate: !self.no_compensate,
            device: self.device.clone(),
            out: self.out.clone(),
        }
    }
}

/// The outcome, one line each; the last one counts.
fn said(settled: &Settled, out: &Path) -> Vec<String> {
    let mut lines: Vec<String> = settled
        .names
        .iter()
        .map(|name| format!("{} {:.2}", name.class.join(" or "), name.confidence))
        .collect();
    lines.push(format!("{}.", settled.conclusion));
    lines.extend(settled.unsure_in_words().map(|sentence| format!("{sentence}.")));
    match &settled.feel {
        Some(Ok(Feel { before, after, motion_s, notes })) => {
            lines.extend(notes.iter().cloned());
            let (before, after) = (1e3 * before.all(), 1e3 * after.all());
            lines.push(format!(
                "a hand feels the mechanism with {after:.1} mN rms, {before:.1} before ({motion_s:.0} s of slow motion)"
            ));
        }
        Some(Err(why)) => lines.push(why.clone()),
        None => {}
    }
    lines.push(format!("report: {}", out.join("settle.html").display()));
    lines.push(format!(
        "rounds={} motion_s={:.1} names={}",
        settled.rounds.len(),
        settled.motion_s(),
        settled.names.len()
    ));
    lines
}
