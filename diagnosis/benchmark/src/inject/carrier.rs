//! A carrier: a case of a real machine in whose recordings an effect is concealed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::rig_file::RigFile;
use crate::dynamics::recording::Recording;
use crate::expected_answer::ExpectedAnswer;
use crate::folder;
use crate::tool::Paths;

/// The location of a carrier.
#[derive(Clone, Debug)]
pub(crate) struct Place {
    /// Name of the case's folder.
    pub(crate) id: String,
    /// The machine: the name up to its first hyphen.
    pub(crate) machine: String,
    pub(crate) paths: Paths,
    /// The names that are believed of the machine as it is, where somebody wrote them down.
    pub(crate) believed: Option<ExpectedAnswer>,
}

/// A carrier that has been read.
#[derive(Clone, Debug)]
pub(crate) struct Carrier {
    pub(crate) rig: RigFile,
    pub(crate) fits: Vec<Recording>,
    pub(crate) holdouts: Vec<Recording>,
}

/// Finds the cases of the folders, in the order of their names. A folder that is a case itself
/// counts.
///
/// # Errors
/// One sentence: what cannot be read, and where.
pub(crate) fn find(tops: &[PathBuf]) -> Result<Vec<Place>, String> {
    let mut list: Vec<Place> = Vec::new();
    for top in tops {
        let beliefs = folder::beliefs(top)?;
        let inner = top.join("cases");
        let dir = if inner.is_dir() { inner } else { top.clone() };
        let entries =
            std::fs::read_dir(&dir).map_err(|e| format!("cannot read the folder {}: {e}", dir.display()))?;
        let mut folders: Vec<PathBuf> = entries.flatten().map(|e| e.path()).collect();
        folders.push(dir);
        folders.sort();
        for folder in folders.iter().filter(|f| f.join("rig.toml").is_file()) {
            list.push(place(folder, &beliefs)?);
        }
    }
    if list.is_empty() {
        return Err(
            "--inject found no case: a case is a folder with rig.toml, fit*.csv and holdout*.csv".into()
        );
    }
    Ok(list)
}

fn place(folder: &Path, beliefs: &BTreeMap<String, ExpectedAnswer>) -> Result<Place, String> {
    let full = folder.canonicalize().map_err(|e| format!("cannot read {}: {e}", folder.display()))?;
    let id = full.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let machine = id.split('-').next().unwrap_or(&id).to_string();
    Ok(Place { paths: folder::paths(folder)?, believed: beliefs.get(&id).cloned(), id, machine })
}

impl Carrier {
    /// Reads rig and recordings.
    ///
    /// # Errors
    /// One sentence: what is missing, and in which file.
    pub(crate) fn read(paths: &Paths) -> Result<Self, String> {
        let text = std::fs::read_to_string(&paths.rig)
            .map_err(|e| format!("cannot read {}: {e}", paths.rig.display()))?;
        let rig = RigFile::parse(&text).map_err(|e| format!("{}: {e}", paths.rig.display()))?;
        let all = |list: &[PathBuf]| list.iter().map(|p| Recording::read(p)).collect::<Result<Vec<_>, _>>();
        Ok(Self { rig, fits: all(&paths.fit)?, holdouts: all(&paths.holdout)? })
    }

    /// All recordings, those to fit on first.
    pub(crate) fn recordings(&self) -> impl Iterator<Item = &Recording> {
        self.fits.iter().chain(&self.holdouts)
    }
}

/// Writes the recording `from` to `to` with other commands and counts, every other column as it is.
///
/// # Errors
/// One sentence: what cannot be read or written.
pub(crate) fn write(from: &Path, to: &Path, command: &[f64], counts: &[f64]) -> Result<(), String> {
    let text = std::fs::read_to_string(from).map_err(|e| format!("cannot read {}: {e}", from.display()))?;
    let mut lines = text.lines();
    let head = lines.next().unwrap_or("");
    let names: Vec<&str> = head.split(',').map(str::trim).collect();
    let column = |name: &str| names.iter().position(|n| *n == name);
    let (u, c) = (column("command"), column("position_counts"));
    let mut out = String::with_capacity(text.len() + 16 * command.len());
    out += head;
    out.push('\n');
    let rows = lines.filter(|line| !line.trim().is_empty());
    for ((line, command), counts) in rows.zip(command).zip(counts) {
        for (i, field) in line.split(',').enumerate() {
            if i > 0 {
                out.push(',');
            }
            if Some(i) == u {
                out += &command.to_string();
            } else if Some(i) == c {
                out += &counts.to_string();
            } else {
                out += field;
            }
        }
        out.push('\n');
    }
    std::fs::write(to, out).map_err(|e| format!("cannot write {}: {e}", to.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_command_and_counts_change_in_a_file() {
        let dir = std::env::temp_dir().join(format!("proof-carrier-{}", std::process::id()));
        std::fs::create_dir_all(&dir).unwrap();
        let (from, to) = (dir.join("a.csv"), dir.join("b.csv"));
        std::fs::write(&from, "time_s,position_counts,note,command\n0.5,7,x,1\n0.6,9,y,2\n").unwrap();
        write(&from, &to, &[-1.5, 0.25], &[8.0, 10.5]).unwrap();
        let text = std::fs::read_to_string(&to).unwrap();
        assert_eq!(text, "time_s,position_counts,note,command\n0.5,8,x,-1.5\n0.6,10.5,y,0.25\n");
        std::fs::remove_dir_all(&dir).unwrap();
    }
}
