//! `host-sim demo`: a diagnosis of recordings that come with the program.

use super::diagnose::Diagnose;
use clap::{Args, ValueEnum};
use convert::import;
use device_sim::error::Error;
use live::{examples, note, say};
use std::path::{Path, PathBuf};

/// The recordings of a demonstration; `tests/independent/demo.py` makes them.
#[derive(Clone, Copy, ValueEnum)]
enum Which {
    /// A rotor whose simulation lacks one effect
    Missing,
    /// A rotor at one speed, from which nobody can tell
    CannotTell,
    /// A real ball screw under a position loop, EMPS of nonlinearbenchmark.org: its recordings are
    /// their owners', so download them and give their folder
    Emps,
}

/// The files of a folder of demonstrations, by their names.
macro_rules! files {
    ($folder:literal) => {
        [
            ("rig.toml", include_str!(concat!("../../demo/", $folder, "/rig.toml"))),
            ("fit-a.csv", include_str!(concat!("../../demo/", $folder, "/fit-a.csv"))),
            ("fit-b.csv", include_str!(concat!("../../demo/", $folder, "/fit-b.csv"))),
            ("holdout.csv", include_str!(concat!("../../demo/", $folder, "/holdout.csv"))),
        ]
    };
}

impl Which {
    fn files(self) -> Vec<(&'static str, &'static str)> {
        match self {
            Self::Missing => files!("missing").into(),
            Self::CannotTell => files!("cannot-tell").into(),
            Self::Emps => vec![("rig.toml", include_str!("../../demo/emps/rig.toml"))],
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Missing => "missing",
            Self::CannotTell => "cannot-tell",
            Self::Emps => "emps",
        }
    }
}

/// See a diagnosis without any files of your own: find what a simulation leaves out of three
/// recordings that come with the program, and open the report.
///
/// The recordings are of a simulated rotor that shares no code with this program; those of a real
/// machine (emps) are yours to download.
#[derive(Args)]
#[command(after_help = examples!("Examples:
  host-sim demo cannot-tell --no-browser
  host-sim demo emps ~/Downloads/EMPS"))]
pub(crate) struct Demo {
    /// The recordings to diagnose
    #[arg(value_enum, default_value = "missing")]
    which: Which,
    /// For emps: the folder with DATA_EMPS.mat and DATA_EMPS_PULSES.mat, as they are downloaded, or
    /// with train.csv and pulses.csv
    #[arg(value_name = "PATH", required_if_eq("which", "emps"))]
    data: Option<PathBuf>,
    /// Folder for the recordings and the report
    #[arg(long, value_name = "DIR", default_value = "host-sim-demo")]
    out: PathBuf,
}

impl Demo {
    pub(crate) fn run(self) -> Result<(), Error> {
        let folder = self.out.join(self.which.name());
        write(&folder, &self.which.files()).map_err(|cause| {
            Error::failed(format_args!(
                "{}: the recordings cannot be written ({cause}); choose another --out",
                folder.display()
            ))
        })?;
        let file = |name: &str| folder.join(name);
        let (fit, holdout) = match (self.which, &self.data) {
            (Which::Emps, Some(data)) => emps(data, &folder)?,
            (_, None) => (vec![file("fit-a.csv"), file("fit-b.csv")], vec![file("holdout.csv")]),
            (_, Some(data)) => {
                return Err(Error::input(format_args!(
                    "{}: this demonstration has recordings of its own; leave the path out, or use demo emps",
                    data.display()
                )));
            }
        };
        let listed: Vec<String> = fit.iter().chain(&holdout).map(|path| path.display().to_string()).collect();
        say!("a simulation: {}", file("rig.toml").display());
        say!("recordings of what it simulates: {}", listed.join(", "));
        say!("what does the simulation leave out?");
        let diagnose = Diagnose {
            rig: Some(file("rig.toml")),
            fit,
            holdout,
            all: None,
            effects: None,
            out: folder.clone(),
            export: super::export::ExportOptions::default(),
        };
        diagnose.run()?;
        note!(
            "with files of your own: host-sim diagnose --rig rig.toml --fit a.csv --holdout b.csv --out DIR"
        );
        live::output::open(&file("report.html").display().to_string());
        Ok(())
    }
}

/// The recordings of EMPS to fit and to hold out; MATLAB's files are imported into `folder`.
fn emps(data: &Path, folder: &Path) -> Result<(Vec<PathBuf>, Vec<PathBuf>), Error> {
    let one = |csv: &str, mat: &str| -> Result<PathBuf, Error> {
        if data.join(csv).is_file() {
            return Ok(data.join(csv));
        }
        if !data.join(mat).is_file() {
            return Err(Error::input(format_args!(
                "{}: has neither {mat} nor {csv}; download EMPS from nonlinearbenchmark.org and give its folder",
                data.display()
            )));
        }
        let columns = ["position=qm:m", "reference=qg:m", "command=vir:V"];
        let out = folder.join(csv.trim_end_matches(".csv"));
        let done = import::import(&import::Request {
            files: vec![data.join(mat)],
            columns: columns.iter().map(|text| import::choice(text)).collect::<Result<_, _>>()?,
            rig: Some(folder.join("rig.toml")),
            out,
            ..import::Request::default()
        })?;
        let longest = done.recordings.into_iter().max_by_key(|recording| recording.rows);
        Ok(longest.map(|recording| recording.path).unwrap_or_default())
    };
    Ok((vec![one("train.csv", "DATA_EMPS.mat")?], vec![one("pulses.csv", "DATA_EMPS_PULSES.mat")?]))
}

fn write(folder: &Path, files: &[(&str, &str)]) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    files.iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text))
}
