//! The result of every reader: tables of numbers with named columns, whatever the file's format.

use super::units::{self, Unit};

/// A column of numbers; a missing value is NaN.
#[derive(Clone, Debug)]
pub(super) struct Column {
    /// As the file has it.
    pub name: String,
    /// Without its unit.
    pub plain: String,
    /// False where the name was made up, as the file gives none.
    pub is_named: bool,
    /// From the name, a row of units or the format itself.
    pub unit: Option<Unit>,
    /// One a row.
    pub values: Vec<f64>,
}

impl Column {
    /// A column whose unit is in its name.
    pub(super) fn new(name: impl Into<String>, values: Vec<f64>) -> Self {
        let name = name.into();
        let (plain, unit) = units::split_name(&name);
        Self { name, plain, is_named: true, unit, values }
    }

    /// A column that the file gives no name.
    pub(super) fn unnamed(name: impl Into<String>, values: Vec<f64>) -> Self {
        Self { is_named: false, ..Self::new(name, values) }
    }

    /// True if it holds any number.
    pub(super) fn has_numbers(&self) -> bool {
        self.values.iter().any(|x| x.is_finite())
    }
}

/// Columns of the same length.
#[derive(Clone, Debug, Default)]
pub(super) struct ColumnTable {
    /// The topic or file, for messages.
    pub name: String,
    /// In the file's order.
    pub columns: Vec<Column>,
}

impl ColumnTable {
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
    pub tables: Vec<ColumnTable>,
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
                None => log.tables.push(ColumnTable { name: file.to_owned(), columns: vec![column] }),
            }
        }
        log
    }

    /// The arrays of a file of some format as tables, with a note on what was read and what was
    /// left out because it holds no numbers.
    pub(super) fn of_arrays(file: &str, format: &str, columns: Vec<Column>, left_out: &[String]) -> Self {
        let mut notes = vec![format!("read as {format}: {} columns", columns.len())];
        if !left_out.is_empty() {
            notes.push(format!("{} left out: no arrays of numbers", left_out.join(", ")));
        }
        Self { notes, ..Self::of_columns(file, columns) }
    }
}

/// The name of a part within a path of names.
pub(super) fn join(path: &str, name: &str) -> String {
    if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") }
}
