//! Readings that are logged more often than their sensor is renewed: a value stands for some rows
//! and then jumps by the motion of all of them.

use super::Renewals;
use crate::data::recording::Recording;

/// Smallest steps of a reading in a jump that shows motion: an axis that is slower than this gives
/// the same count twice by itself.
const STEPS: f64 = 4.0;
/// Factor between jumps that follow one another within which the motion is steady.
const STEADY: f64 = 2.0;
/// Fewest jumps of steady motion that show anything.
const FEWEST: usize = 20;
/// Part of them that come after a value that stood, from which it is the log and not a lost row.
const OFTEN: f64 = 0.1;

/// Rows at which the position has a new reading; none where it has one at every row.
///
/// An axis that comes out of rest moves by little at first, so that a jump as large as the one
/// before it and the one after it cannot come after rest.
pub(super) fn renewals(recording: &Recording) -> Option<Renewals> {
    let x = &recording.position_counts;
    let changes: Vec<usize> = (1..x.len()).filter(|row| x[*row] != x[row - 1]).collect();
    let jump = |i: usize| x[changes[i]] - x[changes[i] - 1];
    let smallest = (0..changes.len()).map(|i| jump(i).abs()).fold(f64::INFINITY, f64::min);
    let is_like = |a: f64, b: f64| a * b > 0.0 && (1.0 / STEADY..=STEADY).contains(&(a / b));
    let steady = (1..changes.len().saturating_sub(1)).filter(|i| {
        let now = jump(*i);
        now.abs() >= STEPS * smallest && is_like(now, jump(i - 1)) && is_like(now, jump(i + 1))
    });
    let mut gaps: Vec<usize> = steady.map(|i| changes[i] - changes[i - 1]).collect();
    let held = gaps.iter().filter(|gap| **gap > 1).count();
    if gaps.len() < FEWEST || (held as f64) < OFTEN * gaps.len() as f64 {
        return None;
    }
    let mean = gaps.iter().sum::<usize>() as f64 / gaps.len() as f64;
    gaps.sort_unstable();
    // At rest, and in slow motion, a reading is as old as it is in motion at most.
    let oldest = gaps[gaps.len() * 9 / 10];
    let mut rows = vec![0];
    for row in 1..x.len() {
        if x[row] != x[row - 1] || row - rows[rows.len() - 1] >= oldest {
            rows.push(row);
        }
    }
    Some(Renewals { rows, rate_hz: recording.rate_hz() / mean })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten seconds at 100 Hz of a swing that is read in whole counts where `renewed` says.
    fn swing(renewed: impl Fn(usize) -> bool, counts: impl Fn(f64) -> f64) -> Recording {
        let mut out = Recording::default();
        for row in 0..1000 {
            let t = row as f64 * 0.01;
            let last = out.position_counts.last().copied();
            out.position_counts.push(last.filter(|_| !renewed(row)).unwrap_or(counts(t).round()));
            out.time_s.push(t);
            out.command.push(row as f64);
        }
        out
    }

    #[test]
    fn a_value_that_stands_in_motion_is_old() {
        let counts = |t: f64| 500.0 * (2.0 * t).sin();
        for (every, hz) in [(2, 50.0), (3, 33.3), (5, 20.0)] {
            let found = renewals(&swing(|row| row % every == 0, counts)).expect("it stands");
            assert!((found.rate_hz / hz - 1.0).abs() < 0.05, "{} of {hz}", found.rate_hz);
            assert!((found.rows.len() as f64 / (1000.0 / every as f64) - 1.0).abs() < 0.1);
        }
        let now_and_then = renewals(&swing(|row| row * 7 % 10 < 7, counts)).expect("it stands");
        assert!((now_and_then.rate_hz / 70.0 - 1.0).abs() < 0.1, "{}", now_and_then.rate_hz);
        assert!(renewals(&swing(|_| true, counts)).is_none());
    }

    #[test]
    fn slow_motion_rest_and_noise_do_not_stand() {
        assert!(renewals(&swing(|_| true, |t| 20.0 * t)).is_none(), "a count every five rows");
        let stops = |t: f64| 40.0 * (t + (6.0 * t).sin() / 6.0);
        assert!(renewals(&swing(|_| true, stops)).is_none());
        let noise = |t: f64| 100.0 * t.sin() + 3.0 * (t * 12_989.8).sin();
        assert!(renewals(&swing(|_| true, noise)).is_none());
    }
}
