//! `import`: recordings as people have them become the files that `diagnose` reads, and whatever
//! was assumed, changed or left out on the way is said. It reads tables and writes the contract's
//! files; it may not know what is done with them.

mod axes;
mod clocks;
mod column_units;
mod encoder_resolution;
mod encodings;
mod file;
mod folder;
mod gather;
#[cfg(feature = "hdf5")]
mod hdf5;
mod header;
mod in_force;
mod json;
mod layout;
mod log;
mod mat;
mod npy;
mod npy_array;
mod numbers;
#[cfg(feature = "parquet")]
mod parquet;
mod readings;
mod role;
mod roles;
#[cfg(feature = "ros")]
mod ros;
mod rows;
mod runs;
mod separate;
mod stamps;
mod suggestion;
mod table;
mod text;
mod units;
mod writer;

pub use encodings::{RoleEncoding, encoding};
pub use numbers::Decimal;
pub use role::Role;
pub use roles::{Choice, choice, clock_choice};
pub use rows::Known;
pub use runs::Keep;
pub use writer::RigValues;

use device_sim::error::Error;
use diagnosis::rig::{Kind, Rig};
use gather::Said;
use numerics::digits::in_sentence;
use rows::Rows;
use std::f64::consts::TAU;
use std::path::PathBuf;
use table::Log;
use units::Quantity;

/// The files to import, and what is known about them.
#[derive(Clone, Debug, Default)]
pub struct Request {
    /// In the order in which they were recorded.
    pub files: Vec<PathBuf>,
    /// `--column`.
    pub columns: Vec<Choice>,
    /// `--clock`.
    pub clocks: Vec<Choice>,
    /// `--encoding`.
    pub encodings: Vec<RoleEncoding>,
    /// `--decimal`.
    pub decimal: Option<Decimal>,
    /// `--rows K/N`: row K of every N, counted from 1.
    pub every: Option<(usize, usize)>,
    /// Rate or missing command.
    pub known: Known,
    /// Counts per turn of the coordinate.
    pub counts_per_turn: Option<f64>,
    /// Counts per rad or m.
    pub counts_per_unit: Option<f64>,
    /// Values for the rig.
    pub values: RigValues,
    /// A rig that exists: its resolution is used, and none is written.
    pub rig: Option<PathBuf>,
    /// The data that is not changed.
    pub keep: Keep,
    /// Each file is a run of its own, whatever clocks and names say.
    pub runs: bool,
    /// Cuts every run at this part of its length, the first for fitting, the second to hold out.
    pub split: Option<f64>,
    /// Folder to write to.
    pub out: PathBuf,
}

/// A file that was written.
#[derive(Clone, Debug)]
pub struct Written {
    /// The place.
    pub path: PathBuf,
    /// The number.
    pub rows: usize,
    /// From the first row to the last, s.
    pub seconds: f64,
}

/// The action.
#[derive(Clone, Debug)]
pub struct Imported {
    /// The rig to diagnose with.
    pub rig: PathBuf,
    /// True if values are still to be filled in there.
    pub to_fill_in: bool,
    /// One a run.
    pub recordings: Vec<Written>,
    /// The things assumed, changed or left out, a sentence each.
    pub notes: Vec<String>,
}

/// Files that are ready to be written.
struct Ready {
    rig: Option<String>,
    recordings: Vec<(String, Rows)>,
    scale: encoder_resolution::Scale,
    notes: Vec<String>,
}

/// A column of a file, as it is before it has a role.
#[derive(Clone, Debug)]
pub struct Seen {
    /// The file.
    pub file: String,
    /// Its name there.
    pub name: String,
    /// Its unit in the contract's, where the file says it: `0.01745 rad`.
    pub unit: Option<String>,
    /// The role that its name and unit suggest.
    pub role: Option<Role>,
    /// One a row; not a number where the file has none.
    pub values: Vec<f64>,
}

/// Reads files and returns their columns, in their order.
pub fn look(files: &[PathBuf]) -> Result<Vec<Seen>, Error> {
    let (logs, _) = read(&Request { files: files.to_vec(), ..Request::default() })?;
    let seen = |log: Log| {
        let columns = log.tables.into_iter().flat_map(|table| table.columns);
        columns.map(move |column| Seen {
            file: log.file.clone(),
            unit: column.unit.map(|unit| format!("{} {}", in_sentence(unit.factor), unit.quantity.unit())),
            role: suggestion::suggested(&column).map(|(role, _)| role),
            name: column.name,
            values: column.values,
        })
    };
    Ok(logs.into_iter().flat_map(seen).collect())
}

/// Reads, cleans and writes.
pub fn import(request: &Request) -> Result<Imported, Error> {
    let (logs, notes) = read(request)?;
    write(request, ready(request, &logs, notes)?)
}

/// Does the same for every axis of a machine, each into a folder of its own in `out`; the folders'
/// names. Nothing is written where one of them cannot be imported.
pub fn import_axes(request: &Request) -> Result<Vec<(String, Imported)>, Error> {
    let (logs, notes) = read(request)?;
    let mut all = Vec::new();
    for axis in axes::axes(&logs, &request.columns)? {
        let out = request.out.join(&axis.name);
        let request = Request { columns: axis.columns, out, ..request.clone() };
        let ready = ready(&request, &logs, notes.clone())
            .map_err(|cause| Error::input(format_args!("axis {}: {cause}", axis.name)))?;
        all.push((axis.name, request, ready));
    }
    all.into_iter().map(|(name, request, ready)| Ok((name, write(&request, ready)?))).collect()
}

/// Reads the files, with what was left out of each.
fn read(request: &Request) -> Result<(Vec<Log>, Vec<String>), Error> {
    let mut notes = Vec::new();
    let paths = folder::files(&request.files)?;
    let mut logs =
        paths.iter().map(|path| file::read(path, request.decimal)).collect::<Result<Vec<_>, _>>()?;
    for log in &mut logs {
        if let Some((first, step)) = request.every {
            log.keep_every(first, step);
        }
        clocks::prepare(log);
        notes.extend(log.notes.iter().map(|note| format!("{}: {note}", log.file)));
    }
    Ok((logs, notes))
}

/// Cleans the recordings of one axis.
fn ready(request: &Request, logs: &[Log], mut notes: Vec<String>) -> Result<Ready, Error> {
    let rig = match &request.rig {
        Some(path) => Some(Rig::read(path).map_err(Error::input)?),
        None => None,
    };
    roles::check(logs, &request.columns)?;
    let wholes = wholes(logs, request, &mut notes)?;
    let per_turn =
        request.counts_per_turn.or_else(|| rig.as_ref().map(|rig| rig.encoder.counts_per_unit * TAU));
    let mut all = Vec::new();
    for whole in wholes {
        all.extend(runs::runs(whole, request.keep, per_turn, &mut notes));
    }
    let Some(first) = all.first() else {
        return Err(Error::input(format_args!(
            "{}: no stretch of at least a second is left ({}); record longer, or check the time and its unit with --column time=NAME:ms",
            request.files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>().join(", "),
            notes.join("; ")
        )));
    };
    check_positions(&all, first, rig.as_ref())?;
    let per_unit = request
        .counts_per_unit
        .or(request.counts_per_turn.map(|counts| counts / TAU))
        .or_else(|| rig.as_ref().map(|rig| rig.encoder.counts_per_unit));
    let scale = encoder_resolution::scale(&all, per_unit, &mut notes);
    rate(&all, &mut notes);
    let name = request
        .files
        .first()
        .and_then(|f| f.file_stem())
        .map_or_else(String::new, |s| s.to_string_lossy().into());
    let rig = rig.is_none().then(|| writer::rig(&name, first, scale, &request.values));
    Ok(Ready { rig, recordings: named(all, request.split), scale, notes })
}

fn write(request: &Request, ready: Ready) -> Result<Imported, Error> {
    let Ready { rig, recordings, scale, notes } = ready;
    let to_fill_in = rig.as_ref().is_some_and(|text| text.contains("= nan"));
    let paths = writer::files(&request.out, rig.as_deref(), &recordings, scale)?;
    let recordings = paths
        .into_iter()
        .zip(&recordings)
        .map(|(path, (_, run))| Written { path, rows: run.time.len(), seconds: run.time[run.time.len() - 1] })
        .collect();
    let rig = request.rig.clone().unwrap_or_else(|| request.out.join("rig.toml"));
    Ok(Imported { rig, to_fill_in, recordings, notes })
}

/// The rows of the files: each file's own where each has all columns, with one that goes on where
/// another ends joined to it; else those of all files together.
fn wholes(logs: &[Log], request: &Request, notes: &mut Vec<String>) -> Result<Vec<Rows>, Error> {
    let Request { columns, clocks, encodings, known, .. } = request;
    let said = Said { columns, clocks, encodings, known: *known };
    let is_whole = |log: &Log| gather::is_whole(std::slice::from_ref(log), said);
    let one_run = logs.len() > 1 && request.columns.iter().any(|choice| choice.names_a_file(logs));
    if one_run || !logs.iter().all(is_whole) {
        return Ok(vec![gather::gather(logs, said, notes)?]);
    }
    let mut wholes = Vec::new();
    for (index, log) in logs.iter().enumerate() {
        let mut of_file = Vec::new();
        wholes.push(gather::gather(std::slice::from_ref(log), said, &mut of_file)?);
        // The same columns of further files need no further words.
        if index == 0 {
            notes.extend(of_file);
        }
    }
    if !request.runs {
        separate::check(logs, &wholes)?;
    }
    Ok(joined(wholes, notes))
}

/// Checks that all runs measure their positions as the first does, and as the rig has it.
fn check_positions(runs: &[Rows], first: &Rows, rig: Option<&Rig>) -> Result<(), Error> {
    if runs.iter().any(|run| run.position != first.position) {
        return Err(Error::input(
            "the files measure their positions in different units; import them one by one",
        ));
    }
    if let (Some(rig), false) = (rig, first.position == Quantity::Counts)
        && (rig.kind == Kind::Linear) != (first.position == Quantity::Length)
    {
        return Err(Error::input(format_args!(
            "the position is in {} and the rig {} is {}; correct one of them",
            first.position.unit(),
            rig.name,
            if rig.kind == Kind::Linear { "linear" } else { "rotary" }
        )));
    }
    Ok(())
}

/// Files whose clock goes on where the one before ended are one run.
fn joined(wholes: Vec<Rows>, notes: &mut Vec<String>) -> Vec<Rows> {
    let mut out: Vec<Rows> = Vec::new();
    for rows in wholes {
        if let Some(last) = out.last_mut() {
            let step = rows::median_step(&last.time).unwrap_or(0.0);
            // The later file's clock, counted from the earlier one's zero.
            let later = rows.origin - last.origin;
            let between =
                rows.time.first().copied().unwrap_or(0.0) + later - last.time.last().copied().unwrap_or(0.0);
            let alike = last.columns.keys().eq(rows.columns.keys()) && last.position == rows.position;
            if alike && between > 0.0 && between < 20.0 * step {
                notes.push("a file goes on where the one before ends: joined to one run".into());
                last.time.extend(rows.time.iter().map(|t| t + later));
                for (role, column) in rows.columns {
                    last.columns.entry(role).or_default().extend(column);
                }
                continue;
            }
        }
        out.push(rows);
    }
    out
}

/// A sentence on what the rate of the rows can and cannot show.
fn rate(runs: &[Rows], notes: &mut Vec<String>) {
    let steps: Vec<f64> = runs.iter().filter_map(|run| rows::median_step(&run.time)).collect();
    let Some(step) = steps.into_iter().max_by(f64::total_cmp) else { return };
    let hz = 1.0 / step;
    if !(clocks::SLOWEST_HZ..clocks::FASTEST_HZ).contains(&hz) {
        notes.push(format!("{hz:.3} rows a second, where diagnose reads 20 to 20000"));
    }
    notes.push(diagnosis::recording::shown_at(hz));
}

/// Names of the files, and the runs cut in two where that was asked for.
fn named(runs: Vec<Rows>, split: Option<f64>) -> Vec<(String, Rows)> {
    let several = runs.len() > 1;
    let mut out = Vec::new();
    for (index, run) in runs.into_iter().enumerate() {
        let tail = if several { format!("-{}", index + 1) } else { String::new() };
        let Some(part) = split else {
            out.push((format!("recording{tail}"), run));
            continue;
        };
        let length = run.time[run.time.len() - 1];
        let at = run.time.partition_point(|t| *t < part * length);
        let of = |from: usize, to: usize| {
            let zero = run.time[from];
            Rows {
                time: run.time[from..to].iter().map(|t| t - zero).collect(),
                columns: run
                    .columns
                    .iter()
                    .map(|(role, column)| (*role, column[from..to].to_vec()))
                    .collect(),
                ..run
            }
        };
        if at > 1 && at + 1 < run.time.len() {
            out.push((format!("fit{tail}"), of(0, at)));
            out.push((format!("holdout{tail}"), of(at, run.time.len())));
        }
    }
    out
}
