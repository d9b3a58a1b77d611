//! `import --page`: a page to drop a log on. It asks for columns, units and the rig's values, shows
//! how far the diagnosis is, and ends with the report. Nothing leaves this computer.

use convert::import::{self, Known, Request, Role, Seen};
use device_sim::error::Error;
use diagnosis::rig::Rig;
use html_report::drawing::thinned;
use live::serving::stop_on_signals;
use serde::Deserialize;
use serde_json::{Value, json};
use server::visualizer;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Columns of a plot of a column.
const PLOTTED: usize = 150;

/// Serves the page until the program is ended; `files` are there already.
pub(super) fn serve(files: Vec<PathBuf>, out: PathBuf, port: u16) -> Result<(), Error> {
    let stop = Arc::new(AtomicBool::new(false));
    stop_on_signals(&stop)?;
    let bench = Arc::new(ImportPage { out, state: Mutex::new(State { files, ..State::default() }) });
    let answer = Arc::new(move |what: &str, body: &[u8]| bench.answer(what, body));
    let server = visualizer::serve_workbench(answer, port).map_err(Error::failed)?;
    live::output::page("drop a log on the page", &server.url());
    while !stop.load(Ordering::Relaxed) {
        std::thread::sleep(Duration::from_millis(100));
    }
    Ok(())
}

/// The files of a person so far, and what came of them.
#[derive(Default)]
struct State {
    files: Vec<PathBuf>,
    imported: Option<import::Imported>,
    /// Stage and part of a diagnosis, while one runs.
    running: Option<(String, f64)>,
    /// The page of the last diagnosis, or why there is none.
    report: Option<Result<String, String>>,
}

struct ImportPage {
    out: PathBuf,
    state: Mutex<State>,
}

/// The choices of the page.
#[derive(Deserialize)]
struct ImportChoices {
    /// As `--column` has them.
    columns: Vec<String>,
    rate_hz: Option<f64>,
    undriven: bool,
    counts_per_turn: Option<f64>,
    split: f64,
}

fn read<'a, T: Deserialize<'a>>(body: &'a [u8]) -> Result<T, Error> {
    serde_json::from_slice(body)
        .map_err(|cause| Error::input(format_args!("the page asked oddly ({cause}); load it again")))
}

impl ImportPage {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Answers one question of the page.
    fn answer(self: &Arc<Self>, what: &str, body: &[u8]) -> Result<String, Error> {
        let answer = match what.split_once('/').unwrap_or((what, "")) {
            ("file", name) => self.take(name, body)?,
            ("columns", _) => self.columns()?,
            ("forget", _) => {
                *self.state() = State::default();
                json!({})
            }
            ("read", _) => self.read(&read(body)?)?,
            ("diagnose", _) => self.diagnose(&read::<BTreeMap<String, f64>>(body)?)?,
            ("progress", _) => self.progress(),
            ("report", _) => return self.report(),
            _ => return Err(Error::input(format_args!("{what}: is no question; load the page again"))),
        };
        Ok(answer.to_string())
    }

    /// Keeps a file that was dropped, by the last part of its name.
    fn take(&self, name: &str, body: &[u8]) -> Result<Value, Error> {
        let folder = self.out.join("dropped");
        let name =
            Path::new(name).file_name().ok_or_else(|| Error::input("the file has no name; rename it"))?;
        let path = folder.join(name);
        let failed = |cause| {
            Error::failed(format_args!(
                "{}: cannot be written ({cause}); choose another --out",
                path.display()
            ))
        };
        std::fs::create_dir_all(&folder).and_then(|()| std::fs::write(&path, body)).map_err(failed)?;
        // A file that cannot be read is not kept beside those that can.
        import::look(std::slice::from_ref(&path))?;
        let mut state = self.state();
        state.files.retain(|known| *known != path);
        state.files.push(path);
        Ok(json!({}))
    }

    /// Every column with the role that it suggests and its course.
    fn columns(&self) -> Result<Value, Error> {
        let files = self.state().files.clone();
        if files.is_empty() {
            return Ok(json!({ "columns": [] }));
        }
        let several = files.len() > 1;
        let one = |seen: Seen| {
            let points: Vec<(f64, f64)> = (0..).map(f64::from).zip(seen.values.iter().copied()).collect();
            let file = Path::new(&seen.file).file_name().unwrap_or_default().to_string_lossy().into_owned();
            json!({
                "choice": if several { format!("{file}/{}", seen.name) } else { seen.name.clone() },
                "name": seen.name, "file": file, "unit": seen.unit, "role": seen.role.map(Role::name),
                "rows": seen.values.len(), "course": thinned(&points, PLOTTED),
            })
        };
        let columns: Vec<Value> = import::look(&files)?.into_iter().map(one).collect();
        Ok(json!({ "columns": columns, "roles": Role::ALL.map(Role::name) }))
    }

    /// Imports the files by what the page says of the columns; the rig as it was written.
    fn read(&self, asked: &ImportChoices) -> Result<Value, Error> {
        let columns = asked.columns.iter().map(|text| import::choice(text)).collect::<Result<_, _>>()?;
        let request = Request {
            files: self.state().files.clone(),
            columns,
            known: Known { rate_hz: asked.rate_hz, undriven: asked.undriven, ..Known::default() },
            counts_per_turn: asked.counts_per_turn,
            split: Some(asked.split.clamp(0.1, 0.9)),
            out: self.out.clone(),
            ..Request::default()
        };
        let done = import::import(&request)?;
        let rig = text(&done.rig)?;
        let answer = json!({ "notes": done.notes, "rig": rig });
        self.state().imported = Some(done);
        Ok(answer)
    }

    /// Begins a diagnosis with the rig's values.
    fn diagnose(self: &Arc<Self>, values: &BTreeMap<String, f64>) -> Result<Value, Error> {
        let mut state = self.state();
        let Some(imported) = &state.imported else { return Err(Error::input("read the columns first")) };
        if state.running.is_some() {
            return Err(Error::input("a diagnosis runs; wait for its report"));
        }
        let file = imported.rig.display().to_string();
        let filled = filled(&text(&imported.rig)?, values);
        Rig::parse(&filled, &file).map_err(Error::input)?;
        std::fs::write(&imported.rig, &filled)
            .map_err(|cause| Error::failed(format_args!("{file}: cannot be written ({cause})")))?;
        let paths = imported.recordings.iter().map(|one| one.path.clone()).collect();
        let (fit, holdout) = super::diagnose_all::parted(paths).ok_or_else(|| {
            Error::input("the log is too short to hold a part of it out; drop a longer one")
        })?;
        let request = diagnosis::Request { rig: imported.rig.clone(), fit, holdout, effects: None };
        (state.running, state.report) = (Some(("reading".into(), 0.0)), None);
        drop(state);
        let bench = self.clone();
        std::thread::spawn(move || {
            let tell = |stage: &str, part: f64| {
                if let Some(running) = &mut bench.state().running {
                    *running = (stage.to_owned(), part);
                }
            };
            let found = super::one_diagnosis::written(&request, &bench.out.join("report"), &tell);
            let mut state = bench.state();
            state.report = Some(found.map(|outcome| outcome.html()).map_err(|error| error.to_string()));
            state.running = None;
        });
        Ok(json!({}))
    }

    fn progress(&self) -> Value {
        let state = self.state();
        match (&state.running, &state.report) {
            (Some((stage, part)), _) => json!({ "stage": stage, "part": part }),
            (None, Some(Err(why))) => json!({ "failed": why }),
            (None, report) => json!({ "done": report.is_some() }),
        }
    }

    fn report(&self) -> Result<String, Error> {
        match &self.state().report {
            Some(Ok(page)) => Ok(page.clone()),
            _ => Err(Error::input("there is no report yet; diagnose first")),
        }
    }
}

fn text(path: &Path) -> Result<String, Error> {
    std::fs::read_to_string(path).map_err(|cause| {
        Error::failed(format_args!("{}: cannot be read ({cause}); drop the log again", path.display()))
    })
}

/// A rig's file with values in place of those of their keys, also of keys that are commented out.
fn filled(rig: &str, values: &BTreeMap<String, f64>) -> String {
    let mut section = "";
    let mut out = String::new();
    for line in rig.lines() {
        if let Some(name) = line.strip_prefix('[') {
            section = name.split(']').next().unwrap_or_default();
        }
        let key = line.trim_start_matches("# ").split(" = ").next().unwrap_or_default();
        match values.get(&format!("{section}.{key}")) {
            Some(value) if line.contains(" = ") => out.push_str(&format!("{key} = {value:?}")),
            _ => out.push_str(line),
        }
        out.push('\n');
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_replace_those_of_their_keys_alone() {
        let rig = "format = 1\n[model]\ninertia = nan # kg\n# viscous = 0.0    # N\n[uncertainty]\ninertia = 0.15\n";
        let values = [("model.inertia", 2.0), ("model.viscous", 1e-6)];
        let values = values.map(|(key, value)| (key.to_owned(), value)).into();
        assert_eq!(
            filled(rig, &values),
            "format = 1\n[model]\ninertia = 2.0\nviscous = 1e-6\n[uncertainty]\ninertia = 0.15\n"
        );
        assert_eq!(filled(rig, &BTreeMap::new()), rig);
    }
}
