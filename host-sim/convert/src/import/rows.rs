//! A recording as rows of columns that have roles.

use super::role::Role;
use super::units::Quantity;
use std::collections::BTreeMap;

/// A recording in SI units; the position is in `position_unit`. All columns have the same length.
#[derive(Clone, Debug)]
pub(super) struct Rows {
    /// s since `origin`, in any order yet.
    pub time: Vec<f64>,
    /// Zero of the time, s: a date since 1970, or 0 where the clock begins with the recording.
    pub origin: f64,
    /// Every other column that was found; NaN where the file has nothing.
    pub columns: BTreeMap<Role, Vec<f64>>,
    /// The quantity of position and reference.
    pub position: Quantity,
    /// The quantity of the command, and that of the reference.
    pub command: Quantity,
    /// The quantity of the reference.
    pub reference: Quantity,
}

/// The caller's knowledge in addition to the columns.
#[derive(Clone, Copy, Debug, Default)]
pub struct Known {
    /// Rows per second, if no column gives the time.
    pub rate_hz: Option<f64>,
    /// True if nothing drives the axis: the command is zero.
    pub undriven: bool,
    /// True if a position loop ran whose command was not logged: it is reference − position.
    pub error_as_command: bool,
}

/// Median of the steps of a clock that are above zero.
pub(super) fn median_step(time: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> = time.windows(2).map(|w| w[1] - w[0]).filter(|d| *d > 0.0).collect();
    if steps.is_empty() {
        return None;
    }
    let middle = steps.len() / 2;
    let (_, median, _) = steps.select_nth_unstable_by(middle, f64::total_cmp);
    Some(*median)
}

/// The rows that are kept.
pub(super) fn pick(rows: &Rows, keep: impl Fn(usize) -> bool) -> Rows {
    let of = |column: &[f64]| column.iter().enumerate().filter(|(i, _)| keep(*i)).map(|(_, x)| *x).collect();
    Rows { time: of(&rows.time), columns: rows.columns.iter().map(|(r, c)| (*r, of(c))).collect(), ..*rows }
}

/// The rows from one to before another.
pub(super) fn slice(rows: &Rows, from: usize, to: usize) -> Rows {
    pick(rows, |i| (from..to).contains(&i))
}
