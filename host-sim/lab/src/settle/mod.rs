//! `settle`: a device records, diagnoses, designs the experiment that distinguishes the remaining
//! rivals, and records again, until one name is left or nothing distinguishes the rest. What
//! was settled is fed forward by the device, as far as it can be.

mod carried_names;
mod feed_forward;
mod name;
mod next_round;
mod page;
mod patched;
mod play;
mod repeat_testing;
mod settled;
mod subject;
mod undesigned;

pub use feed_forward::Feel;
pub use name::Name;
pub use settled::{Round, Settled};
pub use subject::Subject;

use crate::characterise::programme::{Programme, programmes};
use crate::characterise::writer;
use crate::compensate::{self, Wish};
use device_sim::error::Error;
use diagnosis::laws::EffectName;
use diagnosis::report::Report;
use diagnosis::rig::Rig;
use diagnosis::{Outcome, Request};
use experiment::{Design, Input};
use next_round::next_round;
use play::Limited;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// The most rounds, and the most motion of all rounds together, s.
pub const MOST_ROUNDS: usize = 5;
/// See [`MOST_ROUNDS`].
pub const MOST_MOTION_S: f64 = 180.0;
/// The longest input of the first round, s, which is general.
const GENERAL_S: f64 = 12.0;
/// Motion that is kept for feeding forward what was settled, s: slow turns and a hold, before and
/// after, and turns for a weight that is not known.
const FEEL_S: f64 = 55.0;

/// The source of each round's input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inputs {
    /// Designed against the rivals of the round before.
    Designed,
    /// Random multisines, for comparison.
    Multisines,
    /// The excitations of `characterise`, shortened to the motion that is allowed, in one round,
    /// for comparison.
    Characterise,
    /// The needle pushed in and drawn out as in practice, in one round, for comparison.
    Passive,
}

/// The mechanism that is concealed in the virtual device.
#[derive(Clone, Debug)]
pub struct Plant {
    /// Its rig.
    pub rig: Rig,
    /// The rig's file, for errors.
    pub file: String,
}

/// The settings of a run.
#[derive(Clone, Debug)]
pub struct Settings {
    /// The source of the inputs.
    pub inputs: Inputs,
    /// The most rounds.
    pub rounds: usize,
    /// The most motion of all rounds together, s; what is fed forward keeps 55 s of the 180.
    pub motion_s: f64,
    /// Seed of the inputs.
    pub seed: u64,
    /// True if what was settled is fed forward.
    pub compensate: bool,
    /// The device's name in its files: `virtual`, or a port.
    pub device: String,
    /// Folder for all files.
    pub out: PathBuf,
}

impl Settings {
    /// The most motion of the rounds, s: what is fed forward moves too.
    fn rounds_s(&self) -> f64 {
        let feel_s = if self.compensate { FEEL_S } else { 0.0 };
        self.motion_s.min(MOST_MOTION_S - feel_s)
    }

    /// The most rounds that inputs of this kind have.
    fn most_rounds(&self) -> usize {
        if matches!(self.inputs, Inputs::Characterise | Inputs::Passive) { 1 } else { self.rounds }
    }
}

/// News of a run.
#[derive(Clone, Debug)]
pub enum Progress<'a> {
    /// A round begins: its number, its input and why.
    Asked(usize, &'a str, &'a str),
    /// Seconds played of the round's motion.
    Played {
        /// So far, s.
        seconds: f64,
        /// The whole motion of the round, s.
        of: f64,
    },
    /// The diagnosis of all recordings so far is done to this part, 0 to 1.
    Diagnoses(f64),
    /// The diagnosis says this.
    Said(&'a str),
    /// A step of the compensation begins.
    Feeds(compensate::CompensationStep),
}

/// A round that is to be played.
struct PlannedRound {
    programmes: Vec<Programme>,
    words: String,
    why: String,
    design: Option<Box<Design>>,
}

/// Settles the diagnosis of a device whose simulation is `rig`. `progress` is called with each
/// round and each step of the compensation before the motor moves, and may end the run there.
///
/// # Errors
/// A sentence if an input is refused before it starts, a fault or a person ends a recording, or
/// files cannot be read or written.
pub fn settle(
    subject: &mut Subject,
    rig: &Rig,
    settings: &Settings,
    mut progress: impl FnMut(Progress) -> Result<(), Error> + Send,
) -> Result<Settled, Error> {
    let limited = Limited::new(rig, subject.config()?)?;
    let mut run = Run { limited, rig, settings, request: Request::default(), last: None };
    let mut settled = Settled::default();
    let outcome = run.all(subject, &mut settled, &mut progress);
    if let (Err(error), false) = (&outcome, settled.rounds.is_empty()) {
        let so_far = std::mem::take(&mut settled.conclusion);
        let so_far = if so_far.is_empty() { so_far } else { format!("{so_far}; ") };
        settled.conclusion = format!("{so_far}it ended early: {error}");
        // The error that ended the run is the one to report.
        let _ = page::write(&settled, &settings.out);
    }
    outcome?;
    page::write(&settled, &settings.out)?;
    Ok(settled)
}

/// A run over its rounds.
struct Run<'a> {
    limited: Limited,
    rig: &'a Rig,
    settings: &'a Settings,
    /// All recordings so far.
    request: Request,
    /// The diagnosis of them.
    last: Option<Outcome>,
}

impl Run<'_> {
    /// Plays the rounds, and feeds forward what they settled.
    fn all(
        &mut self,
        subject: &mut Subject,
        settled: &mut Settled,
        progress: &mut (impl FnMut(Progress) -> Result<(), Error> + Send),
    ) -> Result<(), Error> {
        let outcome = self.rounds(subject, settled, progress);
        let Some(last) = self.last.take().filter(|_| !settled.names.is_empty()) else { return outcome };
        // What is settled is kept, however the run ended.
        let found = patched::patched(&last, &settled.names);
        let written = written_rig(&self.settings.out.join("patched-rig.toml"), &found);
        outcome?;
        written?;
        if self.settings.compensate {
            let wish = Wish { motion_s: MOST_MOTION_S - settled.motion_s(), ..Wish::default() };
            let radius_mm = self.limited.radius_mm();
            settled.feel =
                Some(feed_forward::apply(subject, &found, self.settings, (radius_mm, wish), progress)?);
        }
        Ok(())
    }

    /// Plays round after round until nothing is left to ask.
    fn rounds(
        &mut self,
        subject: &mut Subject,
        settled: &mut Settled,
        progress: &mut (impl FnMut(Progress) -> Result<(), Error> + Send),
    ) -> Result<(), Error> {
        let mut asked = first(&self.limited, self.rig, self.settings)?;
        loop {
            let number = settled.rounds.len() + 1;
            let folder = self.settings.out.join(format!("round-{number}"));
            progress(Progress::Asked(number, &asked.words, &asked.why))?;
            if let Some(design) = &asked.design {
                design.write(&folder.join("experiment")).map_err(Error::failed)?;
            }
            self.record(subject, &asked.programmes, &folder, progress)?;
            progress(Progress::Diagnoses(0.0))?;
            let outcome = match diagnosed(&self.request, &folder.join("report"), progress) {
                Ok(outcome) => outcome,
                Err(error) if number == 1 => return Err(error),
                Err(error) => {
                    // The names of the round before remain valid.
                    settled.conclusion = format!("the recordings of round {number} cannot be used: {error}");
                    settled.discarded_s = asked.programmes.iter().map(Programme::seconds).sum();
                    return Ok(());
                }
            };
            let report = &self.last.insert(outcome).report;
            let before = settled.rounds.last().map_or(&[][..], |round| &round.names);
            let round = round(asked, report, before);
            settled.rounds.push(round);
            settled.count_looks(self.settings.most_rounds());
            progress(Progress::Said(&report.sentence))?;
            let folder = folder.join("report");
            match next_round(&self.limited, report, &folder, self.settings, settled)? {
                Ok(next) => asked = next,
                Err(conclusion) => {
                    settled.conclusion = conclusion;
                    return Ok(());
                }
            }
        }
    }

    /// Plays programmes and writes the recordings, which the next diagnosis reads together with
    /// those before.
    fn record(
        &mut self,
        subject: &mut Subject,
        programmes: &[Programme],
        folder: &Path,
        progress: &mut impl FnMut(Progress) -> Result<(), Error>,
    ) -> Result<(), Error> {
        let of = programmes.iter().map(Programme::seconds).sum();
        let (mut before, mut last, mut shown) = (0.0, 0.0, Ok(()));
        let tracks = subject.play(programmes, |seconds| {
            // Each recording counts from zero.
            before += if seconds < last { last } else { 0.0 };
            last = seconds;
            if shown.is_ok() {
                shown = progress(Progress::Played { seconds: before + seconds, of });
            }
        })?;
        shown?;
        let paths = writer::write_all(folder, &tracks)?;
        for path in &paths[1..] {
            let is_holdout = path.file_name().is_some_and(|name| name == "holdout.csv");
            let to = if is_holdout { &mut self.request.holdout } else { &mut self.request.fit };
            to.push(path.clone());
        }
        // Not the rig of the data sheets but the simulation as its author believes it.
        self.request.rig = paths[0].clone();
        written_rig(&self.request.rig, self.rig)
    }
}

fn written_rig(path: &Path, rig: &Rig) -> Result<(), Error> {
    std::fs::write(path, rig.to_toml()).map_err(|cause| {
        Error::failed(format_args!(
            "{}: the rig cannot be written ({cause}); free some space or choose another --out",
            path.display()
        ))
    })
}

fn first(limited: &Limited, rig: &Rig, settings: &Settings) -> Result<PlannedRound, Error> {
    match settings.inputs {
        Inputs::Designed => {
            let why = "no recording yet: speeds, reversals and frequencies of every kind";
            limited.general(why, GENERAL_S.min(0.5 * settings.rounds_s()))
        }
        Inputs::Multisines => limited.multisine(settings.seed, GENERAL_S.min(0.5 * settings.rounds_s())),
        Inputs::Passive => limited.practice(0.5 * settings.rounds_s()),
        Inputs::Characterise => limited.checked(PlannedRound {
            programmes: shortened(programmes(rig, limited.radius_mm()), settings.rounds_s()),
            words: "the excitations of characterise".into(),
            why: "the set that characterise plays".into(),
            design: None,
        }),
    }
}

/// Programmes with each step shortened so that all last `most_s` together.
fn shortened(mut all: Vec<Programme>, most_s: f64) -> Vec<Programme> {
    let whole: f64 = all.iter().map(Programme::seconds).sum();
    let part = (most_s / whole).min(1.0);
    for step in all.iter_mut().flat_map(|programme| &mut programme.steps) {
        step.excitation.duration_ms = (f64::from(step.excitation.duration_ms) * part) as u32;
    }
    all
}

fn diagnosed(
    request: &Request,
    folder: &Path,
    progress: &mut (impl FnMut(Progress) -> Result<(), Error> + Send),
) -> Result<Outcome, Error> {
    // A diagnosis cannot be ended half-way: who stops is heard before the next movement.
    let shared = Mutex::new(progress);
    let shows = |_: &str, part: f64| {
        // Its beginning has been reported.
        if let Some(mut progress) = shared.lock().ok().filter(|_| part > 0.0) {
            let _ = progress(Progress::Diagnoses(part));
        }
    };
    let outcome = diagnosis::diagnose(request, &shows).map_err(Error::failed)?;
    outcome.write(folder).map_err(|cause| {
        Error::failed(format_args!(
            "{}: the report cannot be written ({cause}); free some space or choose another --out",
            folder.display()
        ))
    })?;
    Ok(outcome)
}

/// The round of a report; `before` are the names of the round before.
fn round(asked: PlannedRound, report: &Report, before: &[Name]) -> Round {
    let name = |name: Option<EffectName>| name.map_or("none", |name| name.as_str());
    let contenders: Vec<(String, f64)> =
        report.contenders.iter().map(|c| (name(c.name).to_owned(), c.probability)).collect();
    let rivals = asked.design.iter().flat_map(|design| &design.case.rivals);
    Round {
        designed_against: rivals.map(|rival| rival.name.clone()).collect(),
        seconds: asked.programmes.iter().map(Programme::seconds).sum(),
        asked: asked.words,
        why: asked.why,
        sentence: report.sentence.clone(),
        names: carried_names::carried(before, names(report), &contenders),
        contenders,
    }
}

fn names(report: &Report) -> Vec<Name> {
    let one = |effect: &diagnosis::report::Named| Name {
        name: effect.name.to_string(),
        class: effect.class.iter().map(ToString::to_string).collect(),
        confidence: effect.confidence,
    };
    report.effects.iter().map(one).collect()
}

/// An input in words, for a rotary rig.
fn in_words(input: &Input) -> String {
    input.in_words("rad", "N·m")
}
