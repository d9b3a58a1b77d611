//! Rows made fit for the contract: a clock that rises, no holes, no wraps, no minutes at rest.
//! Whatever is changed or left out is said.

use super::readings;
use super::role::Role;
use super::rows::{Rows, median_step, pick, slice};
use super::units::Quantity;
use std::f64::consts::TAU;

/// The data that is left alone on request.
#[derive(Clone, Copy, Debug, Default)]
pub struct Keep {
    /// Rest at the ends and in the middle.
    pub idle: bool,
    /// Positions that jump by a turn.
    pub wraps: bool,
    /// Rows that jump away and back.
    pub outliers: bool,
}

/// A step of the clock this many times the usual one is a gap, if it is also this long, s.
const GAP_STEPS: f64 = 20.0;
const GAP_S: f64 = 0.05;
/// Rest kept at each end of a run, s, and the longest rest that is kept within one.
const REST_S: f64 = 0.5;
const LONGEST_REST_S: f64 = 10.0;
/// The shortest run that is worth a file.
const SHORTEST_S: f64 = 1.0;
const FEWEST_ROWS: usize = 20;

/// Returns the column that gives the motion.
fn motion(rows: &Rows) -> Role {
    if rows.columns.contains_key(&Role::Position) { Role::Position } else { Role::Velocity }
}

/// Runs without a gap, each with its time from zero.
pub(super) fn runs(
    rows: Rows,
    keep: Keep,
    counts_per_turn: Option<f64>,
    notes: &mut Vec<String>,
) -> Vec<Rows> {
    let rows = complete(rows, notes);
    let mut out = Vec::new();
    let whole = restarts(rows, notes);
    let enabled: Vec<Rows> = whole.into_iter().flat_map(|run| while_enabled(run, notes)).collect();
    for run in enabled {
        let run = even_clock(run, notes);
        for mut run in gaps(run, notes) {
            if !keep.wraps {
                unwrap(&mut run, counts_per_turn, true, notes);
            }
            if !keep.outliers {
                run = readings::without_outliers(run, notes);
            }
            if !keep.wraps {
                unwrap(&mut run, counts_per_turn, false, notes);
            }
            integrate(&mut run, notes);
            let cut = if keep.outliers { vec![run] } else { readings::cut_at_resets(run, notes) };
            for run in cut {
                let pieces = if keep.idle { vec![run] } else { without_rest(run, notes) };
                out.extend(pieces);
            }
        }
    }
    let worth = |run: &Rows| {
        run.time.len() >= FEWEST_ROWS && run.time[run.time.len() - 1] - run.time[0] >= SHORTEST_S
    };
    let all = out.len();
    out.retain(worth);
    if out.len() < all {
        notes.push(format!(
            "{} stretches shorter than {SHORTEST_S} s or {FEWEST_ROWS} rows left out",
            all - out.len()
        ));
    }
    for run in &mut out {
        let first = run.time[0];
        run.time.iter_mut().for_each(|t| *t -= first);
    }
    out
}

/// Rows with every column that drives; others hold their last value where one is missing. A command
/// that is missing for long leaves a gap, at which the run is cut.
fn complete(rows: Rows, notes: &mut Vec<String>) -> Rows {
    let mut begin = 0;
    let mut missing = vec![false; rows.time.len()];
    let mut rows = rows;
    for (role, column) in &mut rows.columns {
        let first = column.iter().position(|x| x.is_finite()).unwrap_or(column.len());
        begin = begin.max(first);
        let drives = matches!(role, Role::Command | Role::Force);
        let mut holes = Vec::new();
        for i in first.max(1)..column.len() {
            if !column[i].is_finite() && drives {
                missing[i] = true;
                if column[i - 1].is_finite() {
                    holes.push(i);
                }
            } else if !column[i].is_finite() {
                column[i] = column[i - 1];
            }
        }
        if let Some(at) = holes.first() {
            notes.push(format!(
                "there is no {role} for long {} times, first from {:.3} s on: cut there",
                holes.len(),
                rows.time[*at] - rows.time[0]
            ));
        }
    }
    if begin > 0 {
        notes.push(format!("{begin} rows before the first value of every column left out"));
    }
    pick(&rows, |i| i >= begin && !missing[i])
}

/// The stretches in which the drive was on.
fn while_enabled(run: Rows, notes: &mut Vec<String>) -> Vec<Rows> {
    let Some(on) =
        run.columns.get(&Role::Enabled).map(|column| column.iter().map(|x| *x != 0.0).collect::<Vec<_>>())
    else {
        return vec![run];
    };
    let off = on.iter().filter(|on| !**on).count();
    if off == 0 {
        return vec![run];
    }
    notes.push(format!("{off} rows with the drive off left out, and cut there"));
    let mut cuts: Vec<usize> = (1..on.len()).filter(|i| on[*i] != on[i - 1]).collect();
    cuts.insert(0, 0);
    cuts.push(on.len());
    cuts.windows(2).filter(|w| on[w[0]]).map(|w| slice(&run, w[0], w[1])).collect()
}

/// A clock that falls back begins another run; rows a little out of order are left out.
fn restarts(rows: Rows, notes: &mut Vec<String>) -> Vec<Rows> {
    let Some(step) = median_step(&rows.time) else { return Vec::new() };
    let mut cuts = vec![0];
    for i in 1..rows.time.len() {
        if rows.time[i] < rows.time[i - 1] - (10.0 * step).max(0.2) {
            cuts.push(i);
        }
    }
    if cuts.len() > 1 {
        notes.push(format!("the clock starts again {} times: that many runs more", cuts.len() - 1));
    }
    cuts.push(rows.time.len());
    let mut late = 0;
    let out = cuts
        .windows(2)
        .map(|w| {
            let run = slice(&rows, w[0], w[1]);
            let mut latest = f64::NEG_INFINITY;
            let in_order: Vec<bool> = run
                .time
                .iter()
                .map(|t| {
                    let good = *t >= latest;
                    latest = latest.max(*t);
                    good
                })
                .collect();
            late += in_order.iter().filter(|good| !**good).count();
            pick(&run, |i| in_order[i])
        })
        .collect();
    if late > 0 {
        notes.push(format!("{late} rows whose time falls back left out"));
    }
    out
}

/// Rows of one stamp: spread until the next stamp where the clock is coarser than the rows, else
/// the last one stays.
fn even_clock(mut run: Rows, notes: &mut Vec<String>) -> Rows {
    let n = run.time.len();
    let repeated = run.time.windows(2).filter(|w| w[1] == w[0]).count();
    if repeated == 0 {
        return run;
    }
    let column = &run.columns[&motion(&run)];
    let twins = (1..n).filter(|i| run.time[*i] == run.time[i - 1] && column[*i] == column[i - 1]).count();
    if repeated * 5 > n && twins * 2 < repeated {
        let mut i = 0;
        let mut last = median_step(&run.time).unwrap_or(1e-3);
        while i < n {
            let stamp = run.time[i];
            let next = (i..n).find(|k| run.time[*k] > stamp).unwrap_or(n);
            let length = if next < n { run.time[next] - stamp } else { last };
            // A gap after a stamp does not stretch its rows over it.
            let length = length.min(3.0 * last);
            let count = (next - i) as f64;
            for (k, time) in run.time[i..next].iter_mut().enumerate() {
                *time = stamp + length * k as f64 / count;
            }
            last = length;
            i = next;
        }
        notes.push(format!("{repeated} rows have the stamp of the row before: spread evenly until the next stamp, as a coarse clock leaves them"));
        return run;
    }
    notes.push(format!("{repeated} rows have the stamp of the row before: the last of each stamp kept"));
    let time = run.time.clone();
    pick(&run, |i| i + 1 == n || time[i + 1] > time[i])
}

fn gaps(run: Rows, notes: &mut Vec<String>) -> Vec<Rows> {
    let Some(step) = median_step(&run.time) else { return Vec::new() };
    let long = (GAP_STEPS * step).max(GAP_S);
    let mut cuts = vec![0];
    cuts.extend((1..run.time.len()).filter(|i| run.time[*i] - run.time[i - 1] > long));
    if cuts.len() > 1 {
        notes.push(format!("cut at {} gaps longer than {long:.3} s", cuts.len() - 1));
    }
    cuts.push(run.time.len());
    cuts.windows(2).map(|w| slice(&run, w[0], w[1])).collect()
}

/// Takes the jumps of a turn, or of a counter that runs over, out of positions.
fn unwrap(run: &mut Rows, counts_per_turn: Option<f64>, is_known: bool, notes: &mut Vec<String>) {
    let seen = run.columns.get(&Role::Position).filter(|_| !is_known).and_then(|column| seen_modulus(column));
    for (role, quantity) in [(Role::Position, run.position), (Role::Reference, run.reference)] {
        let Some(column) = run.columns.get_mut(&role) else { continue };
        let known = match quantity {
            Quantity::Angle => vec![TAU],
            Quantity::Counts => counts_per_turn.into_iter().chain([65536.0, 4_294_967_296.0]).collect(),
            _ => Vec::new(),
        };
        let known = if is_known { known } else { seen.into_iter().collect() };
        let Some(turn) = known_modulus(column, &known) else { continue };
        let mut count = 0;
        let (mut add, mut before) = (0.0, column[0]);
        for x in column.iter_mut() {
            let jump = *x - before;
            before = *x;
            if jump.abs() > 0.6 * turn {
                add -= turn * jump.signum();
                count += 1;
            }
            *x += add;
        }
        notes.push(format!(
            "the {role} wraps {count} times, at {turn:.6}: made continuous; --keep-wraps leaves it"
        ));
    }
}

fn span(column: &[f64]) -> f64 {
    let (low, high) =
        column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(*x), high.max(*x)));
    high - low
}

fn known_modulus(column: &[f64], known: &[f64]) -> Option<f64> {
    let span = span(column);
    let wraps = |m: f64| column.windows(2).any(|w| (w[1] - w[0]).abs() > 0.6 * m);
    known.iter().copied().find(|m| span <= 1.002 * m && span > 0.8 * m && wraps(*m))
}

/// The modulus of a column that jumps by nearly all of its range, each time by the same and against
/// the way that it moves.
fn seen_modulus(column: &[f64]) -> Option<f64> {
    let span = span(column);
    let jumps: Vec<usize> =
        (2..column.len() - 1).filter(|i| (column[*i] - column[i - 1]).abs() > 0.8 * span).collect();
    if jumps.len() < 2 {
        return None;
    }
    let size = |i: &usize| {
        let step = 0.5 * (column[i + 1] - column[*i] + column[i - 1] - column[i - 2]);
        let jump = column[*i] - column[i - 1];
        (jump.abs() - step * jump.signum(), -step * jump.signum())
    };
    let sizes: Vec<(f64, f64)> = jumps.iter().map(size).collect();
    let mean = sizes.iter().map(|s| s.0).sum::<f64>() / sizes.len() as f64;
    let step = sizes.iter().map(|s| s.1).fold(0.0, f64::max);
    let agree = sizes.iter().all(|(size, _)| (size - mean).abs() < (0.3 * step).max(0.005 * span));
    let small =
        column.windows(2).filter(|w| (0.3 * span..=0.8 * span).contains(&(w[1] - w[0]).abs())).count();
    let on = sizes.iter().filter(|s| s.1 > 0.0).count();
    let moves_on = sizes.iter().all(|s| s.1 >= 0.0) && 2 * on > sizes.len();
    (agree && moves_on && small == 0 && step < 0.2 * span && mean > 0.98 * span).then_some(mean)
}

/// Positions from speeds where only those were recorded, by the trapezoidal rule.
fn integrate(run: &mut Rows, notes: &mut Vec<String>) {
    if run.columns.contains_key(&Role::Position) {
        return;
    }
    let velocity = &run.columns[&Role::Velocity];
    let mut position = vec![0.0; velocity.len()];
    for i in 1..velocity.len() {
        position[i] =
            position[i - 1] + 0.5 * (velocity[i] + velocity[i - 1]) * (run.time[i] - run.time[i - 1]);
    }
    run.columns.insert(Role::Position, position);
    notes.push("only the speed was recorded: the position is its integral".into());
}

/// The run without rest at its ends, cut where it rests for long: at rest nothing is learnt, and it
/// costs time.
fn without_rest(run: Rows, notes: &mut Vec<String>) -> Vec<Rows> {
    let position = &run.columns[&Role::Position];
    let command = run.columns.get(&Role::Command);
    let span = |column: &[f64]| {
        column.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(*x), b.max(*x)))
    };
    let (low, high) = span(position);
    let still = 2e-4 * (high - low);
    let steady = command.map_or(0.0, |c| {
        let (low, high) = span(c);
        0.1 * (high - low)
    });
    // Moments at which something happens: the axis has moved, or the command has changed, since the
    // last of them.
    let mut anchor = (position[0], command.map_or(0.0, |c| c[0]));
    let mut busy = Vec::new();
    for i in 0..position.len() {
        let now = (position[i], command.map_or(0.0, |c| c[i]));
        if (now.0 - anchor.0).abs() > still || (now.1 - anchor.1).abs() > steady {
            anchor = now;
            busy.push(i);
        }
    }
    let (Some(&first), Some(&last)) = (busy.first(), busy.last()) else { return vec![run] };
    let time = &run.time;
    let before = |i: usize| time.partition_point(|t| *t < time[i] - REST_S);
    let after = |i: usize| time.partition_point(|t| *t <= time[i] + REST_S);
    let mut pieces = Vec::new();
    let mut from = before(first);
    for w in busy.windows(2) {
        if time[w[1]] - time[w[0]] > LONGEST_REST_S {
            pieces.push((from, after(w[0])));
            from = before(w[1]);
        }
    }
    pieces.push((from, after(last)));
    let kept: usize = pieces.iter().map(|p| p.1 - p.0).sum();
    if kept < position.len() {
        let step = (time[time.len() - 1] - time[0]) / (time.len() - 1).max(1) as f64;
        notes.push(format!(
            "{:.1} s at rest left out; --keep-idle keeps them",
            (position.len() - kept) as f64 * step
        ));
    }
    pieces.into_iter().map(|(from, to)| slice(&run, from, to)).collect()
}
