//! `--export`: a rig for other simulators.

use clap::Args;
use device_sim::error::Error;
use diagnosis::Report;
use diagnosis::report::exports::{Format, export};
use diagnosis::report::mjcf_patch;
use diagnosis::rig::Rig;
use live::say;
use std::path::{Path, PathBuf};

/// The options of an export.
#[derive(Args, Clone, Default)]
pub(super) struct ExportOptions {
    /// Also write the last rig for another simulator: mjcf (MuJoCo), urdf, isaaclab or json; may be
    /// repeated
    #[arg(long, value_name = "mjcf|urdf|isaaclab|json")]
    export: Vec<String>,
    /// With --export mjcf: write into a copy of this model, THEIR-patched.xml next to it, and
    /// change nothing but one joint and its actuators; the model is taken to be the rig as it was
    /// given
    #[arg(long, value_name = "THEIR.xml", requires = "joint", requires = "export")]
    into: Option<PathBuf>,
    /// The joint in THEIR.xml
    #[arg(long, value_name = "NAME", requires = "into")]
    joint: Option<String>,
    /// With --into: also write bristles (LuGre), Stribeck friction and cogging, as motors without a
    /// winding that MuJoCo 4.0 and newer read
    #[arg(long, requires = "into")]
    dcmotor: bool,
}

/// The rig's exports.
pub(super) struct Exports {
    formats: Vec<Format>,
    /// Their model, its text, and the joint in it.
    into: Option<(PathBuf, String, String)>,
    dcmotor: bool,
}

impl ExportOptions {
    /// True if nothing is to be exported.
    pub(super) fn is_empty(&self) -> bool {
        self.export.is_empty()
    }

    /// Checks the options before any work; `nominal` is a rig of the axis.
    pub(super) fn read(&self, nominal: Option<&Rig>) -> Result<Exports, Error> {
        let find = |name: &String| {
            Format::find(name).ok_or_else(|| {
                Error::input(format_args!(
                    "--export {name}: unknown format; use mjcf, urdf, isaaclab or json"
                ))
            })
        };
        let formats = self.export.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let (Some(path), Some(joint)) = (&self.into, &self.joint) else {
            return Ok(Exports { formats, into: None, dcmotor: false });
        };
        if !formats.contains(&Format::Mjcf) {
            return Err(Error::input("--into writes a MuJoCo model; add --export mjcf"));
        }
        let nominal = nominal.ok_or_else(|| Error::input("--into takes one joint; leave out --all"))?;
        let text = std::fs::read_to_string(path).map_err(|cause| {
            Error::input(format_args!("{}: cannot be read ({cause}); check its path", path.display()))
        })?;
        mjcf_patch::patch(&text, joint, nominal, nominal, self.dcmotor).map_err(|why| refused(path, &why))?;
        let into = Some((path.clone(), text, joint.clone()));
        Ok(Exports { formats, into, dcmotor: self.dcmotor })
    }
}

fn refused(path: &Path, why: &str) -> Error {
    Error::input(format_args!("{}: {why}", path.display()))
}

impl Exports {
    /// Writes a rig in each format into a folder, and into their model; `report` has its intervals.
    pub(super) fn write(
        &self,
        nominal: &Rig,
        rig: &Rig,
        report: Option<&Report>,
        dir: &Path,
    ) -> Result<(), Error> {
        for format in &self.formats {
            match &self.into {
                Some((path, text, joint)) if *format == Format::Mjcf => {
                    let patched = mjcf_patch::patch(text, joint, nominal, rig, self.dcmotor)
                        .map_err(|why| refused(path, &why))?;
                    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
                    write(&path.with_file_name(format!("{stem}-patched.xml")), &patched)?;
                    if let Some(report) = report {
                        let ranges = mjcf_patch::ranges(rig, &report.effects);
                        let ranges = serde_json::to_string_pretty(&ranges).map_err(Error::failed)?;
                        write(&path.with_file_name(format!("{stem}-{joint}-ranges.json")), &(ranges + "\n"))?;
                    }
                }
                _ => write(&dir.join(format.file()), &export(rig, *format))?,
            }
        }
        Ok(())
    }
}

fn write(path: &Path, text: &str) -> Result<(), Error> {
    std::fs::write(path, text).map_err(|cause| {
        Error::failed(format_args!(
            "{}: cannot be written ({cause}); free some space or choose another place",
            path.display()
        ))
    })?;
    say!("export: {}", path.display());
    Ok(())
}
