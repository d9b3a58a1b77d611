//! A column put on the rows of another: each value holds from its own stamp to the next.

use super::rows::median_step;

/// A value and when it was stamped; the key orders values and rows alike.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stamped {
    /// The row, or the time.
    pub key: f64,
    /// s.
    pub time: f64,
    /// Holds from here on.
    pub value: f64,
}

/// A value that does not come for this many usual steps is missing, if that is also this long, s.
const HOLE_STEPS: f64 = 20.0;
const HOLE_S: f64 = 0.5;
/// Fewer values are those of a command that is logged when it changes.
const FEWEST: usize = 20;

/// The value of a column on each row, which has a key and a time. Where `drives`, it is the mean
/// until the next row, which has the same impulse, and missing (NaN) where the column stops for
/// long; else the last value holds.
pub(super) fn on(rows: &[(f64, f64)], values: &[Stamped], drives: bool) -> Vec<f64> {
    let times = |of: &mut dyn Iterator<Item = f64>| median_step(&of.collect::<Vec<_>>()).unwrap_or(0.0);
    let step = times(&mut values.iter().map(|v| v.time)).max(times(&mut rows.iter().map(|r| r.1)));
    let hole = if values.len() < FEWEST { f64::INFINITY } else { (HOLE_STEPS * step).max(HOLE_S) };
    let end = rows.last().map_or(0.0, |row| row.1);
    let mut out = Vec::with_capacity(rows.len());
    for (i, (key, time)) in rows.iter().enumerate() {
        let after = values.partition_point(|v| v.key <= *key);
        let Some(now) = after.checked_sub(1).map(|i| values[i]) else {
            out.push(f64::NAN);
            continue;
        };
        if !drives
            || now.key == *key
                && values.get(after).is_none_or(|next| rows.get(i + 1).is_none_or(|row| next.key >= row.0))
        {
            out.push(now.value);
            continue;
        }
        let until = values.get(after).map_or(end, |next| next.time);
        let is_missing = time - now.time > 1.5 * step && until - now.time > hole;
        out.push(if is_missing { f64::NAN } else { mean(now, &values[after..], *time, rows.get(i + 1)) });
    }
    out
}

/// The mean from `time` to the next row of the value that holds and those after it.
fn mean(now: Stamped, after: &[Stamped], time: f64, next: Option<&(f64, f64)>) -> f64 {
    let Some((key, end)) = next.filter(|(_, end)| *end > time) else { return now.value };
    let (mut sum, mut from, mut value) = (0.0, time, now.value);
    for later in after.iter().take_while(|later| later.key < *key) {
        let to = later.time.clamp(from, *end);
        sum += value * (to - from);
        (from, value) = (to, later.value);
    }
    (sum + value * (end - from)) / (end - time)
}
