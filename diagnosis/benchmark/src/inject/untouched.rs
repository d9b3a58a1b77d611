//! Caches the diagnosis of each unmodified machine: it sets the scale of what is concealed and the
//! names to ignore later.

use std::path::{Path, PathBuf};

use super::carrier::Place;
use crate::tool::{self, Answer, Tool};

/// The tool's answer for an untouched machine.
#[derive(Clone, Debug)]
pub(crate) struct Untouched {
    pub(crate) answer: Answer,
    /// Rms that the tool's own model leaves on the recordings to fit on, N·m or N.
    pub(crate) left: f64,
}

/// A number that changes with the tool and with the files.
fn stamp(place: &Place, tool: &str) -> String {
    // FNV-1a.
    let mut hash = 0xCBF2_9CE4_8422_2325_u64;
    let mut eat = |bytes: &[u8]| {
        bytes.iter().for_each(|b| hash = (hash ^ u64::from(*b)).wrapping_mul(0x0100_0000_01B3));
    };
    eat(tool.as_bytes());
    let files = std::iter::once(&place.paths.rig).chain(&place.paths.fit).chain(&place.paths.holdout);
    // A file that cannot be read fails where it is used.
    files.for_each(|f| eat(&std::fs::read(f).unwrap_or_default()));
    format!("{hash:016x}")
}

/// Returns an identification of the tool for the stamp: its command line, or the program itself.
pub(crate) fn tool_mark(line: Option<&str>) -> String {
    if let Some(line) = line {
        return line.into();
    }
    std::env::current_exe().map(|exe| tool::mark(&exe)).unwrap_or_default()
}

/// Asks the tool about the carrier, or reads what it said before. `fixed`: reports that count
/// whatever made them.
///
/// # Errors
/// Why there is no fit.
pub(crate) fn ask(
    place: &Place,
    tool: &dyn Tool,
    mark: &str,
    work: &Path,
    fixed: bool,
) -> Result<Untouched, String> {
    let out: PathBuf = work.join(&place.id);
    let (file, report) = (out.join("stamp"), out.join("diagnosis.json"));
    let now = stamp(place, mark);
    let kept = report.is_file() && (fixed || std::fs::read_to_string(&file).is_ok_and(|old| old == now));
    let answer = if kept {
        tool::ask(&tool::Finished, &place.paths, &out)?
    } else {
        tool::ask(tool, &place.paths, &out)?
    };
    if !kept {
        std::fs::write(&file, now).map_err(|e| format!("cannot write {}: {e}", file.display()))?;
    }
    let text = std::fs::read_to_string(&report).map_err(|e| format!("{}: {e}", report.display()))?;
    let value: serde_json::Value = serde_json::from_str(&text).map_err(|e| e.to_string())?;
    let left = value["fit"]["patched"]["fit"].as_f64().unwrap_or(0.0);
    if left > 0.0 && answer.bandwidth_hz > 0.0 {
        Ok(Untouched { answer, left })
    } else {
        Err("no fit".into())
    }
}
