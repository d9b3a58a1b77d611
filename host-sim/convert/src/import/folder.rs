//! Folders that hold a recording: a ROS 2 bag, or a LeRobot dataset.

use device_sim::error::Error;
use std::path::{Path, PathBuf};

/// The files of what was given: files as they are, and those in a folder of a kind that is known.
pub(super) fn files(given: &[PathBuf]) -> Result<Vec<PathBuf>, Error> {
    let mut out = Vec::new();
    for path in given {
        if !path.is_dir() {
            out.push(path.clone());
            continue;
        }
        let (inside, endings) = if path.join("metadata.yaml").is_file() {
            (path.clone(), ["mcap", "db3"])
        } else if path.join("meta/info.json").is_file() {
            (path.join("data"), ["parquet", "parquet"])
        } else {
            return Err(Error::input(format_args!(
                "{}: is a folder, and neither a ROS 2 bag (metadata.yaml) nor a LeRobot dataset (meta/info.json); give the files in it",
                path.display()
            )));
        };
        let mut found = Vec::new();
        collect(&inside, &endings, 0, &mut found);
        if found.is_empty() {
            return Err(Error::input(format_args!(
                "{}: has no file that ends in .{}; is it complete?",
                inside.display(),
                endings[0]
            )));
        }
        found.sort();
        out.extend(found);
    }
    Ok(out)
}

fn collect(folder: &Path, endings: &[&str], depth: usize, out: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else { return };
    for path in entries.flatten().map(|entry| entry.path()) {
        if path.is_dir() && depth < 3 {
            collect(&path, endings, depth + 1, out);
        } else if path.extension().is_some_and(|e| endings.iter().any(|ending| e == *ending)) {
            out.push(path);
        }
    }
}
