//! `host-sim replay`, `export` and `score`: what can be done with a recording.

use super::run::{serve, stop_on_signals};
use clap::Args;
use host_sim::failure::Failure;
use host_sim::profile::Profile;
use host_sim::recording::export;
use host_sim::recording::read::Recording;
use host_sim::replay::Replay as Player;
use host_sim::score::{Insertion, score};
use host_sim::session::{self, Source};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Show a recording in the visualizer, again and again; Stop and Start in the page pause it, a slider under the picture moves it.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim replay session.mcap --port 8711"))]
pub(crate) struct Replay {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Port of the page on this computer; 0 takes any free one
    #[arg(long, default_value_t = 8710, value_name = "N")]
    port: u16,
    /// Play it once and end
    #[arg(long)]
    once: bool,
}

/// Write rig.toml and CSV files, which `diagnose` reads, from a recording.
///
/// One CSV file (recording.csv), or one for every stretch without a gap (recording-1.csv and so on). Older files of these
/// names are replaced.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim export session.mcap --out exported"))]
pub(crate) struct Export {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Folder to write to; made where there is none
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Print a trainee's figures: time, path, force, punctures, vessel hit, angle, for every insertion and in all.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim score session.mcap --profile adult"))]
pub(crate) struct Score {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The patient to judge by, instead of the one that was recorded
    #[arg(long, value_name = "NAME|FILE")]
    profile: Option<String>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Reads a recording and says where it is cut.
fn read(file: &Path) -> Result<Recording, Failure> {
    let recording = Recording::read(file)?;
    if let Some(why) = &recording.cut {
        eprintln!("host-sim: {} ends early ({why}); going on with what is there", recording.file);
    }
    Ok(recording)
}

impl Replay {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let recording = read(&self.file)?;
        let profile = recording.profile()?;
        let source = Source::Recording { file: recording.file.clone() };
        let scene = profile.scene(source, recording.setup.procedure.clone());
        let (session, publisher) = session::open(scene);
        let _server = serve(session, self.port)?;
        let stop = Arc::new(AtomicBool::new(false));
        stop_on_signals(&stop)?;
        let samples = Player::new(&recording, &publisher, &stop).run(!self.once);
        say!("samples={samples}");
        Ok(())
    }
}

impl Export {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let recording = read(&self.file)?;
        let exported = export::export(&recording, &self.out)?;
        say!("{}", exported.rig.display());
        for (path, rows) in exported.recordings {
            say!("{} rows={rows}", path.display());
        }
        Ok(())
    }
}

impl Score {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let recording = read(&self.file)?;
        let profile = match &self.profile {
            Some(wanted) => Profile::find(wanted)?,
            None => recording.profile()?,
        };
        let insertions = score(&recording, &profile);
        if self.json {
            let text = serde_json::to_string_pretty(&insertions).map_err(Failure::failed)?;
            say!("{text}");
            return Ok(());
        }
        say!(
            "begin_s  time_s  path_mm  depth_mm  overshoot_mm  peak_force_n  punctures  vessel  angle_deg (error)"
        );
        for one in &insertions {
            print_row(one);
        }
        print_total(&insertions);
        Ok(())
    }
}

fn print_row(one: &Insertion) {
    let optional = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
    say!(
        "{:7.2}  {:6.2}  {:7.2}  {:8.2}  {:>12}  {:12.3}  {:9}  {:>6}  {} ({})",
        one.begin_s,
        one.time_s,
        one.path_mm,
        one.depth_mm,
        optional(one.overshoot_mm),
        one.peak_force_n,
        one.punctures,
        if one.vessel { "yes" } else { "no" },
        optional(one.angle_deg),
        optional(one.angle_error_deg)
    );
}

fn print_total(all: &[Insertion]) {
    let count = all.len().max(1) as f64;
    let mean = |value: fn(&Insertion) -> f64| all.iter().map(value).sum::<f64>() / count;
    say!(
        "insertions={} mean_time_s={:.2} mean_path_mm={:.2} peak_force_n={:.3} punctures={} vessels={}",
        all.len(),
        mean(|one| one.time_s),
        mean(|one| one.path_mm),
        all.iter().map(|one| one.peak_force_n).fold(0.0, f64::max),
        all.iter().map(|one| one.punctures).sum::<u32>(),
        all.iter().filter(|one| one.vessel).count()
    );
}
