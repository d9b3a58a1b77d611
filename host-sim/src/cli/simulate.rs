//! `host-sim simulate`: the motion that a user sees, compared with the recording.

use clap::Args;
use convert::export::write;
use convert::simulated;
use device_sim::error::Error;
use diagnosis::recording::Recording;
use diagnosis::report::{motion_picture, simulation_page};
use diagnosis::rig::Rig;
use diagnosis::simulation::comparison::Comparison;
use diagnosis::simulation::replay::WINDOWS_S;
use diagnosis::simulation::value_fit;
use live::{examples, say};
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Run the nominal, refitted and patched simulation and compare them with a recording: free run,
/// windows of 0.05 to 5 s, and under the recorded reference.
///
/// Writes simulation.html, simulation.json, and a CSV and an MCAP for each recording (for Foxglove,
/// Rerun and PlotJuggler: the recording, the simulations and the residuals). Give a rig, or the
/// patched-rig.toml of a report: the nominal and refitted rigs in the same folder are simulated
/// too. With --fit the values of the last of them are fitted again to the error of its free run on
/// these recordings, which serves trajectories and is not evidence of physics.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim simulate --rig rig.toml --recording holdout.csv --out /tmp/simulated
  host-sim simulate --rig report/patched-rig.toml --recording holdout.csv --fit fit.csv --out /tmp/simulated"))]
pub(crate) struct Simulate {
    /// A rig, or the patched rig of a report
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    /// A recording to compare with; may be repeated
    #[arg(long, required = true, value_name = "FILE.csv")]
    recording: Vec<PathBuf>,
    /// A recording to fit values to the error of the free run on; may be repeated
    #[arg(long, value_name = "FILE.csv")]
    fit: Vec<PathBuf>,
    #[command(flatten)]
    export: super::export::ExportOptions,
    /// Folder for the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// Returns the rigs to simulate: with a report's patched rig, also the others in its folder.
fn models(path: &Path) -> Result<Vec<(String, Rig)>, Error> {
    let rig = Rig::read(path).map_err(Error::input)?;
    if path.file_name().is_none_or(|name| name != "patched-rig.toml") {
        return Ok(vec![("nominal".into(), rig)]);
    }
    let mut out = Vec::new();
    for name in ["nominal", "refit"] {
        let beside = path.with_file_name(format!("{name}-rig.toml"));
        if beside.exists() {
            out.push((name.to_owned(), Rig::read(&beside).map_err(Error::input)?));
        }
    }
    out.push(("patched".into(), rig));
    Ok(out)
}

/// The name of the model whose values were fitted by motion.
const MOTION_FITTED: &str = "motion-fitted";

fn file_name(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

impl Simulate {
    /// Returns the suggested next steps, with the last of the rigs called `last`.
    fn next(&self, last: &str) -> Vec<String> {
        let mut items = Vec::new();
        let (rig, out) = (self.rig.display(), self.out.display());
        let recording = self.recording.first().map(|path| path.display().to_string()).unwrap_or_default();
        if last == "nominal" {
            items.push(format!(
                "Find what the simulation leaves out: `host-sim diagnose --rig {rig} --fit FILE.csv --holdout {recording} --out report`."
            ));
        }
        if self.fit.is_empty() {
            items.push(format!(
                "Where only the trajectory matters, fit the values by motion, on recordings that do not judge: \
                 `host-sim simulate --rig {rig} --fit FILE.csv --recording {recording} --out {out}`."
            ));
        } else {
            items.push(
                "Use the values that were fitted by motion: they are in `fitted-rig.toml` next to this page."
                    .into(),
            );
        }
        if self.export.is_empty() {
            items.push(
                "Take the last of these rigs where you simulate: the same command with `--export mjcf` writes it for MuJoCo, with \
                 `--export urdf` or `--export json` for others."
                    .into(),
            );
        }
        items
    }

    pub(crate) fn run(self) -> Result<(), Error> {
        let mut models = models(&self.rig)?;
        let exports = self.export.read(models.first().map(|(_, rig)| rig))?;
        let recordings = read_all(&self.recording)?;
        let mut notes = Vec::new();
        let last = models.last().map_or_else(String::new, |(name, _)| name.clone());
        let mut fitted_rig = None;
        if let (false, Some((_, rig))) = (self.fit.is_empty(), models.last()) {
            let fitted = value_fit::fit(rig, &read_all(&self.fit)?);
            notes.extend(self.notes_on_fit(&last));
            models.push((MOTION_FITTED.into(), fitted.clone()));
            fitted_rig = Some(fitted);
        }
        let compared: Vec<Comparison> =
            recordings.iter().map(|r| Comparison::new(r, &models, &WINDOWS_S)).collect();
        for one in &compared {
            notes.extend(one.worse_for_less_force());
            notes.extend(one.worse(MOTION_FITTED, &last));
        }
        let page = simulation_page::page(&models[0].1.name, &compared, &notes, &self.next(&last));
        let mut files = files(page, &compared, &notes)?;
        files.extend(fitted_rig.map(|rig| ("fitted-rig.toml".to_owned(), rig.to_toml().into_bytes())));
        self.write(&files)?;
        if let [(_, nominal), ..] = &models[..]
            && let Some((_, last)) = models.last()
        {
            exports.write(nominal, last, None, &self.out)?;
        }
        for one in &compared {
            say!("{}.", simulation_page::sentence(one));
        }
        for text in compared.iter().flat_map(motion_picture::lines).chain(notes) {
            say!("{text}");
        }
        say!("page: {}", self.out.join("simulation.html").display());
        Ok(())
    }

    /// Returns the notes on the model whose values were fitted by motion from the one called
    /// `last`.
    fn notes_on_fit(&self, last: &str) -> Vec<String> {
        let mut notes = vec![format!(
            "The motion-fitted simulation is the {last} one with the values that bring its free run closest to {}: they serve trajectories, and are no evidence of physics",
            self.fit.iter().map(|path| file_name(path)).collect::<Vec<_>>().join(", ")
        )];
        let whole = |path: &PathBuf| path.canonicalize().ok();
        let is_fitted = |path: &&PathBuf| self.fit.iter().any(|fit| whole(fit) == whole(path));
        notes.extend(self.recording.iter().filter(is_fitted).map(|path| {
            format!(
                "{} was fitted by motion too: what the motion-fitted simulation is off there judges nothing",
                file_name(path)
            )
        }));
        notes
    }

    fn write(&self, files: &[(String, Vec<u8>)]) -> Result<(), Error> {
        std::fs::create_dir_all(&self.out).map_err(|cause| {
            Error::failed(format_args!(
                "{}: the folder cannot be made ({cause}); choose another --out",
                self.out.display()
            ))
        })?;
        files.iter().try_for_each(|(name, bytes)| write(&self.out.join(name), |out| out.write_all(bytes)))?;
        recording::views::write_beside(&self.out.join("simulation.mcap"))
    }
}

fn read_all(paths: &[PathBuf]) -> Result<Vec<Recording>, Error> {
    paths.iter().map(|path| Recording::read(path).map_err(Error::input)).collect()
}

/// Returns the names and contents of the files: the page, its figures, and a CSV and an MCAP for
/// each recording.
fn files(page: String, compared: &[Comparison], notes: &[String]) -> Result<Vec<(String, Vec<u8>)>, Error> {
    let json =
        serde_json::to_string_pretty(&motion_picture::summary(compared, notes)).map_err(Error::failed)?;
    let mut files = vec![
        ("simulation.html".to_owned(), page.into_bytes()),
        ("simulation.json".to_owned(), (json + "\n").into_bytes()),
    ];
    for (k, one) in compared.iter().enumerate() {
        let name = if compared.len() == 1 { "simulation".into() } else { format!("simulation-{}", k + 1) };
        files.push((format!("{name}.csv"), motion_picture::csv(one).into_bytes()));
        files.push((format!("{name}.mcap"), simulated::mcap(one)?));
    }
    Ok(files)
}
