//! A run over a folder of cases that somebody else made.

use std::path::Path;
use std::time::Instant;

use crate::baselines;
use crate::dynamics::JudgeDynamics;
use crate::evidence;
use crate::folder::{self, ExternalCase, Truth};
use crate::judge::Record;
use crate::key::{Category, Key};
use crate::machines::Machine;
use crate::options::Options;
use crate::pool;
use crate::report_residuals;
use crate::scratch::Scratch;
use crate::tool::{self, Tool, ask};

/// The contents of a folder, with the answers.
#[derive(Debug, Default)]
pub(crate) struct Judged {
    pub(crate) records: Vec<Record>,
    pub(crate) machines: Vec<Machine>,
    /// Cases of the folder that were asked for, with or without time for them.
    pub(crate) planned: usize,
}

/// Shows every case of `top` to the tool; reports stay in `options.keep` where that is given.
///
/// # Errors
/// One sentence: what could not be read, written or run.
pub(crate) fn run(options: &Options, top: &Path, tool: &dyn Tool) -> Result<Judged, String> {
    let mut cases = folder::find(top)?;
    if let Some(text) = &options.only {
        cases.retain(|case| asked_for(case, text));
    }
    let scratch = Scratch::new()?;
    let label = format!("judging {}", top.display());
    let done = pool::map(options.jobs, options.budget(), &label, &cases, |case| {
        run_case(case, options, tool, &scratch.0)
    });
    let planned = cases.len();
    let mut judged = Judged { planned, ..Judged::default() };
    for (case, record) in cases.into_iter().zip(done) {
        let Some(record) = record.transpose()? else { continue };
        match case.truth {
            Truth::Known(_) => judged.records.push(record),
            Truth::Believed(belief) => judged.machines.push(Machine { record, belief }),
        }
    }
    Ok(judged)
}

fn asked_for(case: &ExternalCase, text: &str) -> bool {
    let hidden = match &case.truth {
        Truth::Known(key) => {
            key.category.matches(text)
                || key.unknown.iter().chain(&key.effects).any(|name| name.contains(text))
        }
        Truth::Believed(_) => false,
    };
    hidden || case.id.contains(text)
}

fn run_case(
    case: &ExternalCase,
    options: &Options,
    tool: &dyn Tool,
    scratch: &Path,
) -> Result<Record, String> {
    let dir = scratch.join(&case.id);
    let out = match options.reports.as_ref().or(options.keep.as_ref()) {
        Some(reports) => reports.join(&case.id),
        None => dir.join("out"),
    };
    // The tool sees the files in a folder of their own, so that no key is next to them.
    let paths = case.paths.copied(&dir)?;
    let start = Instant::now();
    let answer = ask(tool, &paths, &out);
    let seconds = start.elapsed().as_secs_f64();
    let rig = std::fs::read_to_string(&paths.rig).unwrap_or_default();
    let key = match &case.truth {
        Truth::Known(key) => key.clone(),
        Truth::Believed(_) => Key::of(Category::Null),
    };
    evidence::collect(options, [&case.id, &case.id], &key.effects, &out)?;
    let bench = JudgeDynamics::new(&paths, &key);
    let left = report_residuals::judged(&bench, &out);
    let reported = report_residuals::reported(&paths, &out, &key);
    let record = Record {
        id: case.id.clone(),
        opinions: baselines::known_structure(&bench, &key).into_iter().collect(),
        key,
        answer,
        left,
        reported,
        seconds,
        nominal_gain: tool::actuator_gain(&rig).unwrap_or(f64::NAN),
    };
    std::fs::remove_dir_all(&dir).map_err(|e| format!("cannot remove {}: {e}", dir.display()))?;
    Ok(record)
}
