//! `host-sim score`, `debrief` and `profiles`: what a teacher asks for.

use crate::replay::read;
use clap::Args;
use device_sim::error::Error;
use device_sim::patients;
use device_sim::profile::{BUILT_IN, Profile};
use std::path::{Path, PathBuf};
use training::debrief;
use training::language::Language;
use training::score::{Insertion, score};
use training::xapi::statements;

/// Print a trainee's figures for every insertion and in total: time, path, force, vessel, angle,
/// smoothness.
///
/// docs/guide/training.md explains each figure.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim score session.mcap --profile adult"))]
pub struct Score {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The patient to judge by, instead of the recorded one
    #[arg(long, value_name = "NAME|FILE")]
    profile: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
    /// Print xAPI statements for a learning record store, as a JSON array
    #[arg(long, conflicts_with = "json", requires = "actor")]
    xapi: bool,
    /// The trainee's e-mail address or a pseudonym, for --xapi
    #[arg(long, value_name = "E-MAIL|NAME", requires = "xapi")]
    actor: Option<String>,
}

/// Write a page to print: the gesture over the anatomy, force against depth, the figures, the first
/// and the last attempt compared.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim debrief monday.mcap friday.mcap --out debrief"))]
pub struct Debrief {
    /// Recordings, in the order of the attempts
    #[arg(value_name = "FILE.mcap", required = true)]
    files: Vec<PathBuf>,
    /// The patient to judge by, instead of the recorded one
    #[arg(long, value_name = "NAME|FILE")]
    profile: Option<String>,
    /// An expert's recording: the last attempt is compared with the best insertion in it
    #[arg(long, value_name = "FILE.mcap")]
    expert: Option<PathBuf>,
    /// The language of the page: en, de or fr
    #[arg(long, value_name = "TAG", default_value = "en")]
    language: String,
    /// Folder to write debrief.html to; created if missing
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// List the patients, each with a picture of its layers to scale.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim profiles my-patient.toml"))]
pub struct Profiles {
    /// Patients to show, by name or as files; without any, all built-in ones
    #[arg(value_name = "NAME|FILE")]
    wanted: Vec<String>,
}

impl Score {
    pub(crate) fn run(self) -> Result<(), Error> {
        let recording = read(&self.file)?;
        let profile = self.profile.as_deref().map(Profile::find).transpose()?;
        let scored = score(&recording, profile.as_ref())?;
        if let Some(actor) = self.actor.as_ref().filter(|_| self.xapi) {
            check(&scored.insertions, &self.file)?;
            let statements = statements(&recording, profile.as_ref(), actor)?;
            say!("{}", serde_json::to_string_pretty(&statements).map_err(Error::failed)?);
            return Ok(());
        }
        if self.json {
            let text = serde_json::to_string_pretty(&scored).map_err(Error::failed)?;
            say!("{text}");
            return check(&scored.insertions, &self.file);
        }
        check(&scored.insertions, &self.file)?;
        say!(
            "begin_s  time_s  lumen_s  path_mm  depth_mm  overshoot_mm  peak_force_n  punctures  vessel   passes  angle_deg (error, rms)  smoothness"
        );
        for one in &scored.insertions {
            print_row(one);
        }
        print_total(&scored.insertions);
        Ok(())
    }
}

/// Refuses a recording without an insertion.
fn check(insertions: &[Insertion], file: &Path) -> Result<(), Error> {
    if insertions.is_empty() { Err(without_insertion(file)) } else { Ok(()) }
}

pub(crate) fn without_insertion(file: &Path) -> Error {
    Error::input(format_args!(
        "{}: it has no insertion: the needle never touched the skin; record one first",
        file.display()
    ))
}

fn print_row(one: &Insertion) {
    let optional = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
    let vessel = match (one.through_far_wall, one.vessel) {
        (true, _) => "through",
        (false, true) => "yes",
        (false, false) => "no",
    };
    say!(
        "{:7.2}  {:6.2}  {:7.2}  {:7.2}  {:8.2}  {:>12}  {:12.3}  {:9}  {:>7}  {:>6}  {} ({}, {})  {}",
        one.begin_s,
        one.time_s,
        one.in_lumen_s,
        one.path_mm,
        one.depth_mm,
        optional(one.overshoot_mm),
        one.peak_force_n,
        one.punctures,
        vessel,
        format!("{}+{}", one.passes, one.redirections),
        optional(one.angle_deg),
        optional(one.angle_error_deg),
        optional(one.angle_rms_error_deg),
        optional(one.smoothness)
    );
    say!("         {}: {}", one.verdict.goal, one.verdict.in_words());
}

fn print_total(all: &[Insertion]) {
    let count = all.len().max(1) as f64;
    let errors = |critical| all.iter().map(|one| one.verdict.errors(critical)).sum::<usize>();
    let mean = |value: fn(&Insertion) -> f64| all.iter().map(value).sum::<f64>() / count;
    say!(
        "insertions={} mean_time_s={:.2} mean_path_mm={:.2} peak_force_n={:.3} punctures={} vessels={} mean_in_lumen_s={:.2} through_far_wall={} redirections={} barriers={} spared_hits={} passed={} critical_errors={} non_critical_errors={}",
        all.len(),
        mean(|one| one.time_s),
        mean(|one| one.path_mm),
        all.iter().map(|one| one.peak_force_n).fold(0.0, f64::max),
        all.iter().map(|one| one.punctures).sum::<u32>(),
        all.iter().filter(|one| one.vessel).count(),
        mean(|one| one.in_lumen_s),
        all.iter().filter(|one| one.through_far_wall).count(),
        all.iter().map(|one| one.redirections).sum::<u32>(),
        all.iter().map(|one| one.barriers).sum::<u32>(),
        all.iter().map(|one| one.spared_hits).sum::<u32>(),
        all.iter().filter(|one| one.verdict.passed).count(),
        errors(true),
        errors(false)
    );
}

impl Debrief {
    pub(crate) fn run(self) -> Result<(), Error> {
        let language = Language::find(&self.language)?;
        let given = self.profile.as_deref().map(Profile::find).transpose()?;
        let mut attempts = Vec::new();
        for file in &self.files {
            attempts.extend(debrief::attempts(&read(file)?, given.as_ref())?);
        }
        let expert = match &self.expert {
            Some(file) => debrief::attempts(&read(file)?, given.as_ref())?,
            None => Vec::new(),
        };
        if let Some(file) = self.expert.as_ref().filter(|_| expert.is_empty()) {
            return Err(without_insertion(file));
        }
        let Some(html) = debrief::html(&attempts, &expert) else {
            return Err(without_insertion(&self.files[0]));
        };
        std::fs::create_dir_all(&self.out).map_err(|cause| {
            Error::input(format_args!(
                "{}: the folder cannot be made ({cause}); choose another --out",
                self.out.display()
            ))
        })?;
        let page = self.out.join("debrief.html");
        std::fs::write(&page, language.page(&html)).map_err(|cause| {
            Error::failed(format_args!(
                "{}: cannot be written ({cause}); choose another --out",
                page.display()
            ))
        })?;
        say!("{} insertions={}", page.display(), attempts.len());
        Ok(())
    }
}

impl Profiles {
    pub(crate) fn run(self) -> Result<(), Error> {
        let wanted: Vec<String> = match self.wanted {
            none if none.is_empty() => BUILT_IN.iter().map(|(name, _)| (*name).to_owned()).collect(),
            some => some,
        };
        let profiles = wanted.iter().map(|name| Profile::find(name)).collect::<Result<Vec<_>, _>>()?;
        for profile in &profiles {
            say!("{}", patients::picture(profile));
        }
        Ok(())
    }
}
