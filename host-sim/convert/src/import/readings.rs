//! Readings that the axis cannot have made: values that stand for a failure, rows that jump away
//! and back, counters that begin again, two axes in one column. They are left out or cut, with a
//! note.

use super::role::Role;
use super::rows::{Rows, pick, slice};
use device_sim::error::Error;

/// Values by which programs say that there is none.
const SENTINELS: [f64; 17] = [
    999.0,
    9_999.0,
    99_999.0,
    999_999.0,
    -999.0,
    -9_999.0,
    -99_999.0,
    -999_999.0,
    32_767.0,
    -32_768.0,
    65_535.0,
    2_147_483_647.0,
    -2_147_483_648.0,
    4_294_967_295.0,
    3.402_823_466_385_288_6e38,
    -3.402_823_466_385_288_6e38,
    1e30,
];
/// Larger than anything a sensor says.
const LARGEST: f64 = 1e15;
/// A row is off if it is this many times farther from its neighbours than nearly all rows are.
const FAR: f64 = 12.0;
/// The axis cannot have made a jump that is this many times as long as nearly all steps.
const JUMP: f64 = 10.0;
/// A command is off if it is this many times as far from the others as they are from each other.
const SPIKE: f64 = 8.0;
/// The most rows of a stretch that jumps away and back.
const LONGEST: usize = 20;
/// More of the rows than this part are no outliers.
const MOST_OUTLIERS: f64 = 0.02;

/// Makes values that stand for none missing (NaN), with a note.
pub(super) fn without_sentinels(role: Role, values: &[f64], notes: &mut Vec<String>) -> Vec<f64> {
    let is_one = |x: f64| x.abs() > LARGEST || SENTINELS.iter().any(|s| (x - s).abs() < 1e-9 * s.abs());
    let rest = values.iter().copied().filter(|x| !is_one(*x));
    let (low, high) = rest.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(x), h.max(x)));
    let span = high - low;
    let is_far = |x: f64| x < low - 3.0 * span || x > high + 3.0 * span;
    let is_bad = |x: &f64| span > 0.0 && is_one(*x) && is_far(*x);
    let count = values.iter().filter(|x| is_bad(x)).count();
    let Some((row, first)) =
        values.iter().enumerate().find(|(_, x)| is_bad(x)).filter(|_| 2 * count < values.len())
    else {
        return values.to_vec();
    };
    notes.push(format!(
        "{count} rows whose {role} is {first:e}, as programs write for none, left out, the first of them row {}",
        row + 1
    ));
    values.iter().map(|x| if is_bad(x) { f64::NAN } else { *x }).collect()
}

/// The least correlation of a target with the position that follows it, and the range of the slope.
const FOLLOWS: f64 = 0.97;
const SLOPE: std::ops::Range<f64> = 0.85..1.15;

/// True if a column has the values of another, but for a little.
pub(super) fn follows(a: &[f64], b: &[f64]) -> bool {
    let both = || a.iter().zip(b).filter(|(a, b)| a.is_finite() && b.is_finite());
    let n = both().count() as f64;
    let mean = |of: &dyn Fn((&f64, &f64)) -> f64| both().map(of).sum::<f64>() / n;
    let (ma, mb) = (mean(&|(a, _)| *a), mean(&|(_, b)| *b));
    let product = mean(&|(a, b)| (a - ma) * (b - mb));
    let (va, vb) = (mean(&|(a, _)| (a - ma).powi(2)), mean(&|(_, b)| (b - mb).powi(2)));
    va > 0.0 && vb > 0.0 && product / (va * vb).sqrt() > FOLLOWS && SLOPE.contains(&(product / vb))
}

/// Refuses a position that alternates between two places or more: axes in one column.
pub(super) fn refuse_mixed_axes(rows: &Rows) -> Result<(), Error> {
    let Some(x) = rows.columns.get(&Role::Position).filter(|x| x.len() > 50) else { return Ok(()) };
    let mean = |k: usize| x.windows(k + 1).map(|w| (w[k] - w[0]).abs()).sum::<f64>() / (x.len() - k) as f64;
    let next = mean(1);
    if let Some(k) = (2..=8).find(|k| 3.0 * mean(*k) < next) {
        return Err(Error::input(format_args!(
            "the position alternates between axes with a period of {k} rows, as where several publishers write one column; give --rows 1/{k} for the first of them or --rows 2/{k} for the next, or write each to a file of its own"
        )));
    }
    if alternates(x, next) {
        return Err(Error::input(
            "the position alternates between two axes, as where two publishers write one column; write each to a file of its own",
        ));
    }
    Ok(())
}

/// True if rows go to and fro between two smooth tracks in no even order.
fn alternates(x: &[f64], next: f64) -> bool {
    let Some(second) = (1..x.len()).find(|i| (x[*i] - x[i - 1]).abs() > next) else { return false };
    let mut last = [x[second - 1], x[second]];
    let (mut travel, mut apart, mut switches, mut on, mut counts) = (0.0, 0.0, 0, 1, [0, 0]);
    for value in &x[second + 1..] {
        let near = usize::from((value - last[1]).abs() < (value - last[0]).abs());
        travel += (value - last[near]).abs();
        switches += usize::from(near != on);
        counts[near] += 1;
        (last[near], on) = (*value, near);
        apart += (last[0] - last[1]).abs();
    }
    let rows = x.len() - second;
    let all: f64 = x.windows(2).map(|w| (w[1] - w[0]).abs()).sum();
    // Readings between two counts alternate too.
    let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let are_apart = apart > 0.1 * (high - low) * rows as f64 && high - low > 20.0 * smallest(x);
    are_apart && 5 * switches > rows && counts.iter().all(|n| 10 * n > rows) && 4.0 * travel < all
}

/// The size that a part of the values, the largest ones, exceeds.
fn quantile(mut values: Vec<f64>, part: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = (((values.len() - 1) as f64) * part) as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}

/// Leaves rows out whose command is far from all others for one row.
fn without_spikes(run: Rows, notes: &mut Vec<String>) -> Rows {
    let Some(u) = run.columns.get(&Role::Command).filter(|u| u.len() > 50) else { return run };
    let (low, high) = (quantile(u.clone(), 0.002), quantile(u.clone(), 0.998));
    let far = SPIKE * (high - low);
    let is_far = |i: usize| u[i] < low - far || u[i] > high + far;
    let n = u.len();
    let alone = |i: &usize| is_far(*i) && (*i == 0 || !is_far(i - 1)) && (i + 1 == n || !is_far(i + 1));
    let found: Vec<usize> = (0..n).filter(alone).collect();
    let Some(first) = found.first().filter(|_| far > 0.0 && found.len() * 500 <= n.max(500)) else {
        return run;
    };
    notes.push(format!(
        "{} rows whose command is far from all others left out, the first at {:.4} s ({}); --keep-outliers keeps them",
        found.len(),
        run.time[*first],
        u[*first]
    ));
    pick(&run, |i| !found.contains(&i))
}

/// Leaves rows out in which the position jumps away and back, or the command is far from all
/// others.
pub(super) fn without_outliers(run: Rows, notes: &mut Vec<String>) -> Rows {
    let run = without_spikes(run, notes);
    let Some(x) = run.columns.get(&Role::Position).filter(|x| x.len() > 50) else { return run };
    let n = x.len();
    let off = |i: usize| (x[i] - 0.5 * (x[i - 1] + x[i + 1])).abs();
    let step = |i: usize| (x[i] - x[i - 1]).abs();
    let usual_off = quantile((1..n - 1).map(off).collect(), 0.99);
    let usual_step = quantile((1..n).map(step).collect(), 0.99);
    if usual_step == 0.0 {
        return run;
    }
    let mut bad = vec![false; n];
    let far = FAR * usual_off.max(0.5 * smallest(x));
    // One row: it is far from its neighbours, which agree.
    for i in 1..n - 1 {
        bad[i] = off(i) > far && (x[i + 1] - x[i - 1]).abs() < 0.5 * off(i);
    }
    // Several rows: a jump away, and one back to where the axis was.
    let jumps: Vec<usize> = (1..n).filter(|i| step(*i) > JUMP * usual_step).collect();
    for w in jumps.windows(2).filter(|w| w[1] - w[0] <= LONGEST) {
        let away = x[w[0]] - x[w[0] - 1];
        let rows = (w[1] - w[0]) as f64;
        if (x[w[1]] - x[w[0] - 1]).abs() < 0.3 * away.abs() + rows * usual_step
            && (x[w[1]] - x[w[1] - 1]) * away < 0.0
        {
            bad[w[0]..w[1]].fill(true);
        }
    }
    let found: Vec<usize> = (0..n).filter(|i| bad[*i]).collect();
    let Some(first) = found.first().filter(|_| (found.len() as f64) < MOST_OUTLIERS * n as f64) else {
        return run;
    };
    notes.push(format!(
        "{} rows whose position jumps away and back left out, the first at {:.4} s ({} between {} and {}); --keep-outliers keeps them",
        found.len(),
        run.time[*first],
        x[*first],
        x[first.saturating_sub(1)],
        x[(first + 1).min(n - 1)]
    ));
    pick(&run, |i| !bad[i])
}

/// The smallest change of a column.
fn smallest(x: &[f64]) -> f64 {
    x.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 0.0).fold(f64::INFINITY, f64::min)
}

/// Cuts a run where the position falls back to zero, or to where it began, in one row.
pub(super) fn cut_at_resets(run: Rows, notes: &mut Vec<String>) -> Vec<Rows> {
    let Some(x) = run.columns.get(&Role::Position).filter(|x| x.len() > 50) else { return vec![run] };
    let n = x.len();
    let step = |i: usize| (x[i] - x[i - 1]).abs();
    let usual = quantile((1..n).map(step).collect(), 0.99);
    let near = |a: f64, b: f64| (a - b).abs() <= 2.0 * usual;
    let is_reset =
        |i: &usize| usual > 0.0 && step(*i) > JUMP * usual && (near(x[*i], 0.0) || near(x[*i], x[0]));
    let mut cuts: Vec<usize> = (1..n).filter(is_reset).collect();
    if cuts.is_empty() || cuts.len() * 100 > n {
        return vec![run];
    }
    notes.push(format!(
        "the position begins again at {} in one row, at {:.4} s: cut there{}",
        x[cuts[0]],
        run.time[cuts[0]],
        if cuts.len() > 1 { format!(", and at {} more", cuts.len() - 1) } else { String::new() }
    ));
    cuts.insert(0, 0);
    cuts.push(n);
    cuts.windows(2).map(|w| slice(&run, w[0], w[1])).collect()
}
