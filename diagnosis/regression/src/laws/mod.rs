//! The laws that may be missing: a record each that every part of the diagnosis reads, and shapes
//! and columns, by which the regression computes it.
//!
//! Every law adds columns to k·u = J·q̈ + b·q̇ + F·sgn q̇ + …; a column is what the drive has to
//! supply for a coefficient of one.

mod command;
mod motion;
mod record;
mod states;
#[cfg(test)]
mod tests;
mod two_mass;
mod waves;

pub(crate) use command::{asked_by_motion, large_of};
pub use record::{Bounds, Need, Quantity, RECORDS, Record, Subsystem, Within};
pub use states::{Scales, States};

use crate::data::Rig;

/// The signals that a law acts on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActsOn {
    /// The motion alone.
    Motion,
    /// The force that the motion asks of the drive; never the recorded command.
    Command,
}

/// One member of a law's family.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shape {
    /// Which of the law's forms.
    pub form: &'static str,
    /// The value that shapes it.
    pub value: f64,
    /// The values between which a line search may move it.
    pub range: Option<(f64, f64)>,
}

/// A law as the regression computes it.
pub struct Law {
    record: &'static Record,
    /// Its shapes on a machine; none where the recordings or the rig rule it out.
    pub shapes: fn(&Machine) -> Vec<Shape>,
    /// Its columns on one recording's grid of the laws.
    pub columns: fn(&Machine, usize, &Shape) -> Vec<Vec<f64>>,
}

impl Law {
    const fn new(
        key: &str,
        shapes: fn(&Machine) -> Vec<Shape>,
        columns: fn(&Machine, usize, &Shape) -> Vec<Vec<f64>>,
    ) -> Self {
        Self { record: record::of(key), shapes, columns }
    }
}

impl std::ops::Deref for Law {
    type Target = Record;

    fn deref(&self) -> &Record {
        self.record
    }
}

impl std::fmt::Debug for Law {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.key)
    }
}

impl PartialEq for Law {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

/// The rig and the states of all recordings, as laws see them.
pub struct Machine {
    /// The nominal simulation.
    pub rig: Rig,
    /// The states of each recording.
    pub states: Vec<States>,
    /// Scales of the fit recordings, from which shapes take their values.
    pub scales: Scales,
    /// The force that each recording's motion asks for; empty before it is known.
    pub asked: Vec<Vec<f64>>,
}

/// All laws, those of the motion first.
pub fn library() -> impl Iterator<Item = &'static Law> {
    motion::LAWS.iter().chain(&two_mass::LAWS).chain(&waves::LAWS).chain(&command::LAWS)
}

impl Shape {
    /// A shape that no line search moves.
    pub(crate) fn fixed(form: &'static str, value: f64) -> Self {
        Self { form, value, range: None }
    }

    /// Shapes at `values`, in increasing order; each may move to its neighbours.
    pub(crate) fn grid(form: &'static str, values: &[f64]) -> Vec<Self> {
        let ratio = |i: usize| match values.len() {
            0 | 1 => 2.0,
            _ if i + 1 < values.len() => values[i + 1] / values[i],
            n => values[n - 1] / values[n - 2],
        };
        let low = |i: usize| if i > 0 { values[i - 1] } else { values[i] / ratio(i) };
        let shape =
            |(i, value): (usize, &f64)| Self { form, value: *value, range: Some((low(i), value * ratio(i))) };
        values.iter().enumerate().map(shape).collect()
    }
}
