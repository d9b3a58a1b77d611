//! `host-sim demo`: a diagnosis of recordings that come with the program.

use super::diagnose::Diagnose;
use clap::{Args, ValueEnum};
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
    fn files(self) -> [(&'static str, &'static str); 4] {
        match self {
            Self::Missing => files!("missing"),
            Self::CannotTell => files!("cannot-tell"),
        }
    }
}

/// See a diagnosis without any files of your own: find what a simulation leaves out of three
/// recordings that come with the program, and open the report.
///
/// The recordings are of a simulated rotor that shares no code with this program.
#[derive(Args)]
#[command(after_help = examples!("Example: host-sim demo cannot-tell --no-browser"))]
pub(crate) struct Demo {
    /// The recordings to diagnose
    #[arg(value_enum, default_value = "missing")]
    which: Which,
    /// Folder for the recordings and the report
    #[arg(long, value_name = "DIR", default_value = "host-sim-demo")]
    out: PathBuf,
}

impl Demo {
    pub(crate) fn run(self) -> Result<(), Error> {
        let folder = self.out.join(match self.which {
            Which::Missing => "missing",
            Which::CannotTell => "cannot-tell",
        });
        write(&folder, &self.which.files()).map_err(|cause| {
            Error::failed(format_args!(
                "{}: the recordings cannot be written ({cause}); choose another --out",
                folder.display()
            ))
        })?;
        let file = |name: &str| folder.join(name);
        let shown = |name: &str| file(name).display().to_string();
        say!("a simulation: {}", shown("rig.toml"));
        say!(
            "recordings of what it simulates: {}, {}, {}",
            shown("fit-a.csv"),
            shown("fit-b.csv"),
            shown("holdout.csv")
        );
        say!("what does the simulation leave out?");
        let diagnose = Diagnose {
            rig: Some(file("rig.toml")),
            fit: vec![file("fit-a.csv"), file("fit-b.csv")],
            holdout: vec![file("holdout.csv")],
            all: None,
            effects: None,
            out: folder.clone(),
            export: super::export::ExportOptions::default(),
        };
        diagnose.run()?;
        note!(
            "with files of your own: host-sim diagnose --rig rig.toml --fit a.csv --holdout b.csv --out DIR"
        );
        live::output::open(&shown("report.html"));
        Ok(())
    }
}

fn write(folder: &Path, files: &[(&str, &str)]) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    files.iter().try_for_each(|(name, text)| std::fs::write(folder.join(name), text))
}
