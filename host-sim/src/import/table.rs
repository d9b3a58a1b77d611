//! What every reader hands on: tables of numbers with named columns, whatever the file's format.

use super::units::{self, Unit};
use super::{json, log, npy, text};
use crate::failure::Failure;
use std::path::Path;

/// A column of numbers; NaN where there is none.
#[derive(Clone, Debug)]
pub(super) struct Column {
    /// As the file has it.
    pub name: String,
    /// Without its unit.
    pub plain: String,
    /// From the name, a row of units or the format itself.
    pub unit: Option<Unit>,
    /// One a row.
    pub values: Vec<f64>,
}

impl Column {
    /// A column whose unit stands in its name.
    pub(super) fn new(name: impl Into<String>, values: Vec<f64>) -> Self {
        let name = name.into();
        let (plain, unit) = units::split_name(&name);
        Self { name, plain, unit, values }
    }

    /// Whether it holds any number.
    pub(super) fn has_numbers(&self) -> bool {
        self.values.iter().any(|x| x.is_finite())
    }
}

/// Columns of the same length.
#[derive(Clone, Debug, Default)]
pub(super) struct Table {
    /// The topic or file, for messages.
    pub name: String,
    /// In the file's order.
    pub columns: Vec<Column>,
}

impl Table {
    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        self.columns.first().map_or(0, |c| c.values.len())
    }
}

/// A file's tables, and what was noticed while it was read.
#[derive(Clone, Debug, Default)]
pub(super) struct Log {
    /// The file, for messages.
    pub file: String,
    /// One, or one a topic.
    pub tables: Vec<Table>,
    /// Sentences.
    pub notes: Vec<String>,
}

impl Log {
    /// Columns of one length each into tables, one a length.
    pub(super) fn of_columns(file: &str, columns: Vec<Column>) -> Self {
        let mut log = Self { file: file.to_owned(), ..Self::default() };
        for column in columns {
            let place = log.tables.iter().position(|t| t.rows() == column.values.len());
            match place {
                Some(at) => log.tables[at].columns.push(column),
                None => log.tables.push(Table { name: file.to_owned(), columns: vec![column] }),
            }
        }
        log
    }
}

/// Reads a file of any format that is known, told by its first bytes and its name's ending.
pub(super) fn read(path: &Path) -> Result<Log, Failure> {
    let file = path.display().to_string();
    let bytes = std::fs::read(path)
        .map_err(|cause| Failure::input(format_args!("{file}: cannot be read ({cause}); check its path")))?;
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    let first = bytes.iter().find(|b| !b.is_ascii_whitespace()).copied().unwrap_or(0);
    let mut log = if bytes.starts_with(mcap::MAGIC) {
        log::read(&file, &bytes)?
    } else if bytes.starts_with(b"PK\x03\x04") || bytes.starts_with(b"\x93NUMPY") {
        npy::read(&file, bytes)?
    } else if bytes.starts_with(b"PAR1") {
        parquet(&file, bytes)?
    } else if let Some(what) = foreign(&bytes) {
        return Err(Failure::input(format_args!(
            "{file}: is {what}; save it as CSV, .npz, JSON, MCAP or Parquet first"
        )));
    } else if matches!(first, b'{' | b'[')
        && (ending.contains("json") || text::decode(&bytes).trim_end().ends_with(['}', ']']))
    {
        json::read(&file, &text::decode(&bytes))?
    } else {
        text::read(&file, &bytes)?
    };
    for table in &mut log.tables {
        table.columns.retain(Column::has_numbers);
    }
    log.tables.retain(|table| !table.columns.is_empty());
    if log.tables.is_empty() {
        return Err(Failure::input(format_args!(
            "{file}: holds no column of numbers; is it the right file?"
        )));
    }
    Ok(log)
}

/// Formats that are known by their first bytes and not read.
fn foreign(bytes: &[u8]) -> Option<&'static str> {
    [
        (&b"\x89HDF"[..], "an HDF5 file (MATLAB 7.3 files are too)"),
        (b"MATLAB 5.0", "a MATLAB .mat file"),
        (b"#ROSBAG", "a ROS 1 bag"),
        (b"SQLite format 3", "an SQLite file, as a ROS 2 bag is"),
        (b"\x1f\x8b", "compressed with gzip"),
        (b"\xd0\xcf\x11\xe0", "an old Excel file"),
        (b"ARROW1", "an Arrow or Feather file"),
    ]
    .into_iter()
    .find_map(|(magic, what)| bytes.starts_with(magic).then_some(what))
}

#[cfg(feature = "parquet")]
fn parquet(file: &str, bytes: Vec<u8>) -> Result<Log, Failure> {
    super::parquet::read(file, bytes)
}

#[cfg(not(feature = "parquet"))]
fn parquet(file: &str, _: Vec<u8>) -> Result<Log, Failure> {
    Err(Failure::input(format_args!(
        "{file}: is a Parquet file, which this build does not read; build with `--features parquet` (cargo run --release --features parquet -- import …)"
    )))
}
