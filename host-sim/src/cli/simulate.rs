//! `host-sim simulate`: the motion that a user sees, beside the recording.

use clap::Args;
use diagnosis::recording::Recording;
use diagnosis::report::motion_picture;
use diagnosis::rig::Rig;
use diagnosis::simulation::comparison::Comparison;
use diagnosis::simulation::replay::WINDOWS_S;
use diagnosis::simulation::value_fit;
use host_sim::failure::Failure;
use std::path::{Path, PathBuf};

/// Run the nominal, refitted and patched simulation beside a recording: free run, windows of 0.05 to 5 s, and under the recorded
/// reference.
///
/// Writes simulation.html, simulation.json and a CSV for each recording. Give a rig, or the patched-rig.toml of a report: the
/// nominal and refitted rigs beside it are simulated too. With --fit the values of the last of them are fitted once more, by
/// what its free run is off on these recordings, which serves trajectories and is no evidence of physics.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim simulate --rig rig.toml --recording holdout.csv --out /tmp/simulated
  host-sim simulate --rig report/patched-rig.toml --recording holdout.csv --fit fit.csv --out /tmp/simulated"))]
pub(crate) struct Simulate {
    /// A rig, or the patched rig of a report
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    /// A recording to simulate beside; again for more
    #[arg(long, required = true, value_name = "FILE.csv")]
    recording: Vec<PathBuf>,
    /// A recording on which values are fitted by what the free run is off; again for more
    #[arg(long, value_name = "FILE.csv")]
    fit: Vec<PathBuf>,
    /// Write the last of the rigs for another simulator too: mjcf (MuJoCo), urdf or json; again for more
    #[arg(long, value_name = "mjcf|urdf|json")]
    export: Vec<String>,
    /// Folder for the files
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

/// The rigs to simulate: of a report's patched rig those beside it too.
fn models(path: &Path) -> Result<Vec<(String, Rig)>, Failure> {
    let rig = Rig::read(path).map_err(Failure::input)?;
    if path.file_name().is_none_or(|name| name != "patched-rig.toml") {
        return Ok(vec![("nominal".into(), rig)]);
    }
    let mut out = Vec::new();
    for name in ["nominal", "refit"] {
        let beside = path.with_file_name(format!("{name}-rig.toml"));
        if beside.exists() {
            out.push((name.to_owned(), Rig::read(&beside).map_err(Failure::input)?));
        }
    }
    out.push(("patched".into(), rig));
    Ok(out)
}

impl Simulate {
    pub(crate) fn run(self) -> Result<(), Failure> {
        let formats = super::export::formats(&self.export)?;
        let mut models = models(&self.rig)?;
        let read = |paths: &[PathBuf]| -> Result<Vec<Recording>, Failure> {
            paths.iter().map(|path| Recording::read(path).map_err(Failure::input)).collect()
        };
        let recordings = read(&self.recording)?;
        let mut notes = Vec::new();
        let mut fitted_rig = None;
        if !self.fit.is_empty() {
            let (name, last) = &models[models.len() - 1];
            let fitted = value_fit::fit(last, &read(&self.fit)?);
            let files: Vec<String> = self.fit.iter().map(|p| p.display().to_string()).collect();
            notes.push(format!(
                "\"{name}, fitted by motion\" has the values that bring its free run closest to {}: they serve trajectories, and are no evidence of physics",
                files.join(", ")
            ));
            models.push((format!("{name}, fitted by motion"), fitted.clone()));
            fitted_rig = Some(fitted);
        }
        let compared: Vec<Comparison> =
            recordings.iter().map(|r| Comparison::new(r, &models, &WINDOWS_S)).collect();
        for one in &compared {
            notes.extend(one.worse("patched", "refit").or_else(|| one.worse("patched", "nominal")));
        }
        let json = serde_json::to_string_pretty(&motion_picture::summary(&compared, &notes))
            .map_err(Failure::failed)?;
        let mut files = vec![
            ("simulation.html".to_owned(), motion_picture::page(&models[0].1.name, &notes, &compared)),
            ("simulation.json".to_owned(), json + "\n"),
        ];
        for (k, one) in compared.iter().enumerate() {
            let name = if compared.len() == 1 {
                "simulation.csv".into()
            } else {
                format!("simulation-{}.csv", k + 1)
            };
            files.push((name, motion_picture::csv(one)));
        }
        files.extend(fitted_rig.map(|rig| ("fitted-rig.toml".to_owned(), rig.to_toml())));
        let write = || {
            std::fs::create_dir_all(&self.out)?;
            files.iter().try_for_each(|(name, text)| std::fs::write(self.out.join(name), text))
        };
        write().map_err(|cause| {
            Failure::failed(format_args!(
                "{}: cannot be written ({cause}); free some space or choose another --out",
                self.out.display()
            ))
        })?;
        if let Some((_, last)) = models.last() {
            super::export::write(last, &formats, &self.out)?;
        }
        for text in compared.iter().flat_map(motion_picture::lines).chain(notes) {
            say!("{text}");
        }
        say!("page: {}", self.out.join("simulation.html").display());
        Ok(())
    }
}
