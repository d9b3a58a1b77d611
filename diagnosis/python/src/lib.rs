//! The diagnosis for Python. Rigs come as TOML and recordings as CSV, in the forms of
//! `docs/measured/recordings.md`, so that Python and the command line refuse the same things with
//! the same sentences; the Python side turns frames and files into them. Nothing here computes.

use convert::import;
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use diagnosis::simulation::replay::Beside;
use diagnosis::{Outcome, check_recordings, diagnose_recordings};
use lab::settle::{Inputs, Plant, Progress, Settings, Subject};
use pyo3::create_exception;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::{Mutex, PoisonError};

create_exception!(
    _native,
    InputError,
    PyValueError,
    "What cannot be used, where it is, and what to do about it."
);

/// A recording's name, and its text as CSV.
type Named = (String, String);

fn refused(why: impl std::fmt::Display) -> PyErr {
    InputError::new_err(why.to_string())
}

fn rig_of((name, text): &Named) -> PyResult<Rig> {
    Rig::parse(text, name).map_err(refused)
}

fn recordings(all: &[Named]) -> PyResult<Vec<Recording>> {
    all.iter().map(|(name, text)| Recording::parse(text, name).map_err(refused)).collect()
}

/// A finished diagnosis.
#[pyclass(frozen)]
struct Diagnosis {
    outcome: Outcome,
}

#[pymethods]
impl Diagnosis {
    /// The report as JSON, as in diagnosis.json.
    fn json(&self) -> PyResult<String> {
        serde_json::to_string(&self.outcome.report).map_err(refused)
    }

    /// The report as a page.
    fn html(&self) -> String {
        self.outcome.html()
    }

    /// The summary, as the command line prints it.
    fn summary(&self) -> String {
        self.outcome.summary()
    }

    /// The nominal, the refitted and the patched rig, as TOML.
    fn rigs(&self) -> (String, String, String) {
        let Outcome { nominal_rig, refit_rig, patched_rig, .. } = &self.outcome;
        (nominal_rig.to_toml(), refit_rig.to_toml(), patched_rig.to_toml())
    }

    /// Writes the folder that `host-sim diagnose --out` writes.
    fn save(&self, folder: PathBuf) -> PyResult<()> {
        self.outcome.write(&folder).map_err(|cause| {
            PyOSError::new_err(format!(
                "{}: the report cannot be written ({cause}); choose another folder",
                folder.display()
            ))
        })
    }
}

/// Diagnoses recordings of a rig, and searches the formulas of a file of effects too; other Python
/// threads run meanwhile, and `progress` is called with the stage and the fraction done.
#[pyfunction]
fn diagnose(
    py: Python,
    rig: Named,
    fit: Vec<Named>,
    holdout: Vec<Named>,
    effects: Option<Named>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Diagnosis> {
    py.detach(|| {
        let mut rig = rig_of(&rig)?;
        if let Some((name, text)) = &effects {
            diagnosis::search_effects(&mut rig, text, name).map_err(refused)?;
        }
        let (fit, holdout) = (recordings(&fit)?, recordings(&holdout)?);
        if fit.is_empty() || holdout.is_empty() {
            return Err(refused("at least one recording to fit and one to hold out are needed"));
        }
        let listener = Listener::new(progress);
        let outcome = diagnose_recordings(&rig, &fit, &holdout, &|stage, part| listener.tell(stage, part))
            .map_err(refused)?;
        listener.end()?;
        Ok(Diagnosis { outcome })
    })
}

/// A Python function that is told how far something is, until it raises.
struct Listener {
    function: Option<Py<PyAny>>,
    raised: Mutex<Option<PyErr>>,
}

impl Listener {
    fn new(function: Option<Py<PyAny>>) -> Self {
        Self { function, raised: Mutex::default() }
    }

    fn tell(&self, stage: &str, part: f64) {
        let Some(function) = &self.function else { return };
        let raised = || self.raised.lock().unwrap_or_else(PoisonError::into_inner);
        if raised().is_none()
            && let Err(error) = Python::attach(|py| function.call1(py, (stage, part)))
        {
            *raised() = Some(error);
        }
    }

    /// Raises what the function raised, once the work is done.
    fn end(self) -> PyResult<()> {
        self.raised.into_inner().unwrap_or_else(PoisonError::into_inner).map_or(Ok(()), Err)
    }
}

/// Designs the input that best distinguishes the rivals of a report's folder. Returns the summary
/// and the files that it wrote.
#[pyfunction(name = "experiment")]
fn design(
    py: Python,
    report: PathBuf,
    out: PathBuf,
    travel_speed_force: (Option<f64>, Option<f64>, Option<f64>),
    seconds: f64,
    seed: u64,
) -> PyResult<(String, Vec<PathBuf>)> {
    let (travel, speed, force) = travel_speed_force;
    py.detach(|| {
        let case = experiment::Case::read(&report, travel, speed, force).map_err(refused)?;
        let design = experiment::design(&case, seconds, seed).map_err(refused)?;
        Ok((design.summary(), design.write(&out).map_err(PyOSError::new_err)?))
    })
}

/// The names with their confidence, and the conclusion.
type Settled = (Vec<(Vec<String>, f64)>, String);

/// Lets a virtual device with a true mechanism settle its own diagnosis.
#[pyfunction]
fn settle(
    py: Python,
    plant: Named,
    rig: Option<Named>,
    out: PathBuf,
    rounds_motion_seed_compensate: (usize, f64, u64, bool),
    progress: Option<Py<PyAny>>,
) -> PyResult<Settled> {
    let (rounds, motion_s, seed, compensate) = rounds_motion_seed_compensate;
    py.detach(|| {
        let mechanism = Plant { rig: rig_of(&plant)?, file: plant.0 };
        let mut subject = Subject::Virtual(Box::new(mechanism));
        let rig = match &rig {
            Some(rig) => rig_of(rig)?,
            None => subject.data_sheet_rig().map_err(refused)?,
        };
        let device = "virtual".to_owned();
        let settings = Settings { inputs: Inputs::Designed, rounds, motion_s, seed, compensate, device, out };
        let listener = Listener::new(progress);
        let settled = lab::settle::settle(&mut subject, &rig, &settings, |news| {
            match news {
                Progress::Asked(number, asked, why) => {
                    listener.tell(&format!("round {number}: {asked}; why: {why}"), 0.0)
                }
                Progress::Played { seconds, of } => listener.tell("playing", seconds / of),
                Progress::Diagnoses(part) => listener.tell("diagnosing", part),
                Progress::Said(sentence) => listener.tell(sentence, 1.0),
                Progress::Feeds(step) => listener.tell(&step.to_string(), 0.0),
            }
            Ok(())
        })
        .map_err(refused)?;
        listener.end()?;
        let names = settled.names.iter().map(|name| (name.class.clone(), name.confidence)).collect();
        Ok((names, settled.conclusion))
    })
}

/// Says what recordings can and cannot show, a sentence each.
#[pyfunction]
fn check(py: Python, rig: Named, fit: Vec<Named>, holdout: Vec<Named>) -> PyResult<Vec<String>> {
    py.detach(|| {
        let rig = rig_of(&rig)?;
        check_recordings(&rig, &recordings(&fit)?, &recordings(&holdout)?).map_err(refused)
    })
}

/// Runs a rig under a recording's command: position and velocity from its first row to its last.
#[pyfunction]
fn simulate(py: Python, rig: Named, recording: Named) -> PyResult<(Vec<f64>, Vec<f64>)> {
    py.detach(|| {
        let rig = rig_of(&rig)?;
        let recording = Recording::parse(&recording.1, &recording.0).map_err(refused)?;
        let run = Beside::new(&recording, &rig).free_run(&rig);
        Ok((run.position, run.velocity))
    })
}

/// Turns files as people have them into a folder of a rig and recordings. Returns the rig's path,
/// the recordings' paths and what was assumed, changed or left out.
#[pyfunction]
fn import_recording(
    py: Python,
    files: Vec<PathBuf>,
    out: PathBuf,
    columns: Vec<String>,
    counts_per_turn: Option<f64>,
    rate_undriven_split: (Option<f64>, bool, Option<f64>),
) -> PyResult<(PathBuf, Vec<PathBuf>, Vec<String>)> {
    let (rate_hz, undriven, split) = rate_undriven_split;
    py.detach(|| {
        let columns = columns
            .iter()
            .map(|text| import::choice(text))
            .collect::<Result<Vec<_>, _>>()
            .map_err(refused)?;
        let known = import::Known { rate_hz, undriven, ..import::Known::default() };
        let request = import::Request {
            files,
            columns,
            counts_per_turn,
            out,
            known,
            split,
            ..import::Request::default()
        };
        let imported = import::import(&request).map_err(refused)?;
        let paths = imported.recordings.into_iter().map(|one| one.path).collect();
        Ok((imported.rig, paths, imported.notes))
    })
}

#[pymodule]
fn _native(module: &Bound<PyModule>) -> PyResult<()> {
    module.add("InputError", module.py().get_type::<InputError>())?;
    module.add_class::<Diagnosis>()?;
    module.add_function(wrap_pyfunction!(check, module)?)?;
    module.add_function(wrap_pyfunction!(diagnose, module)?)?;
    module.add_function(wrap_pyfunction!(design, module)?)?;
    module.add_function(wrap_pyfunction!(settle, module)?)?;
    module.add_function(wrap_pyfunction!(simulate, module)?)?;
    module.add_function(wrap_pyfunction!(import_recording, module)?)
}
