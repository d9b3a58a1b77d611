//! `host-sim diagnose --all`: every axis of a machine, and one page for all of them.

use super::export::Exports;
use super::one_diagnosis::diagnose;
use device_sim::error::Error;
use diagnosis::Request;
use diagnosis::report::axes_page::{Row, page};
use live::say;
use std::path::{Path, PathBuf};

/// The recordings to fit and those to hold out, by their names: `holdout` begins those to hold out,
/// else the last one is; none where that leaves one of the two empty.
pub(super) fn parted(files: Vec<PathBuf>) -> Option<(Vec<PathBuf>, Vec<PathBuf>)> {
    let holds_out = |path: &PathBuf| named(path, "holdout");
    let (mut held, mut fit): (Vec<PathBuf>, Vec<PathBuf>) = files.into_iter().partition(holds_out);
    if held.is_empty() && fit.len() > 1 {
        held.extend(fit.pop());
    }
    (!held.is_empty() && !fit.is_empty()).then_some((fit, held))
}

fn named(path: &Path, begin: &str) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().starts_with(begin))
}

/// Lists a folder, by name.
fn listed(dir: &Path) -> Result<Vec<PathBuf>, Error> {
    let entries = std::fs::read_dir(dir).map_err(|cause| {
        Error::input(format_args!("{}: cannot be read ({cause}); check its path", dir.display()))
    })?;
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    Ok(paths)
}

/// The rig and the recordings of one axis, as `import` calls them.
fn request(folder: &Path, effects: Option<&PathBuf>) -> Result<Request, Error> {
    let is_recording = |path: &PathBuf| {
        path.extension().is_some_and(|ending| ending == "csv")
            && ["fit", "holdout", "recording"].iter().any(|begin| named(path, begin))
    };
    let recordings = listed(folder)?.into_iter().filter(is_recording).collect();
    let (fit, holdout) = parted(recordings).ok_or_else(|| {
        Error::input(format_args!(
            "{}: has no two recordings called fit….csv, holdout….csv or recording….csv; import it with --split 0.6",
            folder.display()
        ))
    })?;
    Ok(Request { rig: folder.join("rig.toml"), fit, holdout, effects: effects.cloned() })
}

pub(super) fn run(dir: &Path, effects: Option<PathBuf>, exports: &Exports, out: &Path) -> Result<(), Error> {
    let folders: Vec<PathBuf> =
        listed(dir)?.into_iter().filter(|path| path.join("rig.toml").is_file()).collect();
    if folders.is_empty() {
        return Err(Error::input(format_args!(
            "{}: no folder in it has a rig.toml; make them with host-sim import --axes",
            dir.display()
        )));
    }
    let mut rows = Vec::new();
    let mut failed = 0;
    for folder in &folders {
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        say!("axis {name}:");
        let done = request(folder, effects.as_ref())
            .and_then(|request| diagnose(&request, exports, &out.join(&name)));
        rows.push(match done {
            Ok(outcome) => Row::of(&name, &outcome),
            Err(cause) => {
                failed += 1;
                say!("cannot be diagnosed: {cause}");
                Row::failed(&name, &cause.to_string())
            }
        });
    }
    let index = out.join("index.html");
    let written = std::fs::create_dir_all(out).and_then(|()| std::fs::write(&index, page(&rows)));
    written.map_err(|cause| {
        Error::failed(format_args!("{}: cannot be written ({cause}); choose another --out", index.display()))
    })?;
    say!("page: {}", index.display());
    if failed > 0 {
        return Err(Error::input(format_args!(
            "{failed} of {} axes cannot be diagnosed; {} says why",
            rows.len(),
            index.display()
        )));
    }
    Ok(())
}
