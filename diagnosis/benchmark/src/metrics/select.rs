//! The records of a category, and the rates of what they are asked.

use crate::judge::Record;
use crate::key::Category;
use crate::stats::Rate;

/// The strengths of single effects, effect over noise.
pub(crate) const STRENGTHS: [f64; 3] = [10.0, 3.0, 1.0];

/// Returns the records of some categories.
pub(super) fn of<'a>(
    records: &'a [Record],
    which: &'a [Category],
) -> impl Iterator<Item = &'a Record> + Clone {
    records.iter().filter(move |r| which.contains(&r.key.category))
}

/// Returns the share of the records for which `hit` is true.
pub(super) fn rate<'a>(records: impl Iterator<Item = &'a Record>, hit: impl Fn(&Record) -> bool) -> Rate {
    let mut rate = Rate::default();
    records.for_each(|r| rate.add(hit(r)));
    rate
}

/// Returns the place of a single effect's strength in [`STRENGTHS`].
pub(super) fn level(r: &Record) -> Option<usize> {
    STRENGTHS.iter().position(|x| *x == r.key.strength)
}

/// True if a name given with at least this confidence is wrong.
pub(super) fn confident(r: &Record, least: f64) -> bool {
    r.effects().iter().any(|e| e.confidence >= least && !r.is_true(e))
}

/// Every name of every case: its confidence, and whether it is right by class.
pub(super) fn names(records: &[Record]) -> Vec<(f64, bool)> {
    records.iter().flat_map(|r| r.effects().iter().map(|e| (e.confidence, r.is_true(e)))).collect()
}
