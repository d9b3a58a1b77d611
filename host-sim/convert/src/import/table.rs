//! The result of every reader: tables of numbers with named columns, whatever the file's format.

use super::units::{self, Unit, Written};

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
    /// The units that the name may mean, where it may mean more than one.
    pub unsure: Vec<String>,
    /// The column of the same table with its time stamps, where it has a clock of its own.
    pub clock: Option<usize>,
    /// The first value that is no number: its text, its line, and how many there are.
    pub unread: Option<(String, usize, usize)>,
    /// One a row.
    pub values: Vec<f64>,
}

impl Column {
    /// A column whose unit is in its name.
    pub(super) fn new(name: impl Into<String>, values: Vec<f64>) -> Self {
        let name = name.into();
        let (plain, unit) = units::split_name(&name);
        let (unsure, clock, unread) = (Vec::new(), None, None);
        let mut column = Self { name, plain, is_named: true, unit: None, unsure, clock, unread, values };
        column.set_unit(unit);
        column
    }

    /// Takes a unit as a header has it; none leaves the unit as it is.
    pub(super) fn set_unit(&mut self, unit: Option<Written>) {
        match unit {
            Some(Written::Sure(unit)) => (self.unit, self.unsure) = (Some(unit), Vec::new()),
            Some(Written::Unsure(either)) => (self.unit, self.unsure) = (None, either),
            None => {}
        }
    }

    /// A column that the file gives no name.
    pub(super) fn unnamed(name: impl Into<String>, values: Vec<f64>) -> Self {
        Self { is_named: false, ..Self::new(name, values) }
    }

    /// True if it holds nothing but 0 and 1.
    pub(super) fn is_a_switch(&self) -> bool {
        self.has_numbers() && self.values.iter().all(|x| !x.is_finite() || *x == 0.0 || *x == 1.0)
    }

    /// True if nearly every value is larger than the one before, as those of a clock.
    pub(super) fn rises(&self) -> bool {
        let finite: Vec<f64> = self.values.iter().copied().filter(|x| x.is_finite()).collect();
        let up = finite.windows(2).filter(|w| w[1] > w[0]).count();
        finite.len() > 2 && 10 * up > 9 * (finite.len() - 1)
    }

    /// True if it changes little, and never its sign, as the voltage of a supply.
    pub(super) fn is_steady(&self) -> bool {
        let finite = || self.values.iter().copied().filter(|x| x.is_finite());
        let (low, high) = finite().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
        low * high > 0.0 && high - low < 0.3 * low.abs().max(high.abs())
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

    /// Keeps row `first`, counted from 1, of every `step`.
    pub(super) fn keep_every(&mut self, first: usize, step: usize) {
        for column in self.tables.iter_mut().flat_map(|table| &mut table.columns) {
            column.values = column.values.iter().copied().skip(first - 1).step_by(step).collect();
        }
        self.notes.push(format!("row {first} of every {step} taken, as --rows says"));
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
