//! A fit of a rig's values to a recording, ours and SciPy's by turns.

use super::end_to_end;
use super::programs;
use super::values::{Values, values_in};
use crate::shell::{self, Error};
use crate::workspace_build::built;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Rows of the recording that are fitted, at 10 kHz: 4 s. SciPy's simulation is in Python and takes
/// seconds for each of them.
const ROWS: usize = 40_000;

/// Our fit alone, for a machine on which the peer is absent.
pub(crate) fn ours() -> Result<Values, Error> {
    let (program, rig, recording) = prepared()?;
    shell::output(Command::new(program).arg(rig).arg(recording)).map(|text| values_in(&text))
}

/// Both by turns: the script runs our program itself, and prints the row, its peer, and by how much
/// the answers differ.
pub(crate) fn with_peer() -> Result<Values, Error> {
    let mut python = programs::python("parameter_fit.py")?;
    let (program, rig, recording) = prepared()?;
    let text = shell::output(python.arg(program).arg(rig).arg(recording))?;
    print!("{text}");
    Ok(values_in(&text))
}

/// Our program, the rig, and the first rows of a recording of it.
fn prepared() -> Result<(PathBuf, PathBuf, PathBuf), Error> {
    let folder = shell::target().join("bench-recordings");
    if !folder.join("fit.csv").is_file() {
        end_to_end::recordings()?;
    }
    let short = folder.join("fit-short.csv");
    shorten(&folder.join("fit.csv"), &short)?;
    let program = built(&["--example", "fit_speed"], "examples/fit_speed")?;
    Ok((program, folder.join("rig.toml"), short))
}

fn shorten(from: &Path, to: &Path) -> Result<(), Error> {
    let failed = |error| Error::new(format!("{} cannot be shortened: {error}", from.display()));
    let text = fs::read_to_string(from).map_err(failed)?;
    fs::write(to, first_rows(&text)).map_err(failed)
}

/// The head of a recording and its first [`ROWS`] rows.
fn first_rows(text: &str) -> String {
    let head = text.lines().take_while(|line| !starts_with_a_number(line)).count();
    text.lines().take(head + ROWS).fold(String::new(), |all, line| all + line + "\n")
}

fn starts_with_a_number(line: &str) -> bool {
    line.split(',').next().is_some_and(|first| first.trim().parse::<f64>().is_ok())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_cut_behind_its_first_rows() {
        let rows: Vec<String> = (0..ROWS + 5).map(|row| format!("{row}.0,1,2")).collect();
        let text = format!("# a comment\ntime_s,command,position\n{}\n", rows.join("\n"));
        let cut = first_rows(&text);
        assert_eq!(cut.lines().count(), ROWS + 2);
        assert_eq!(cut.lines().last(), Some("39999.0,1,2"));
    }
}
