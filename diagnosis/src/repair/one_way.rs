//! Motion that goes one way only: friction and a constant force are one force there.

use crate::data::recording::Recording;
use numerics::even_grid::low_pass;

/// Part of the travel that may go the other way: an axis that reverses goes back much more, and a
/// reading that trembles at rest less.
const BACK: f64 = 0.005;
/// Rows over which a reading is smoothed, so that a tremble of it is no travel.
const SMOOTHED_ROWS: f64 = 20.0;

/// The part of the travel of all recordings that goes the other way, where next to none does.
pub(super) fn back(all: &[&Recording]) -> Option<f64> {
    let mut ways = [0.0, 0.0];
    for one in all {
        let smooth = low_pass(&one.position_counts, 1.0, 1.0 / SMOOTHED_ROWS);
        for step in smooth.windows(2).map(|w| w[1] - w[0]) {
            ways[usize::from(step < 0.0)] += step.abs();
        }
    }
    let back = ways[0].min(ways[1]) / (ways[0] + ways[1]).max(f64::MIN_POSITIVE);
    (back < BACK).then_some(back)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_ways_are_two_in_different_recordings_as_well() {
        let recording = |place: fn(f64) -> f64| Recording {
            position_counts: (0..2000).map(|row| place(f64::from(row) * 2e-3).round()).collect(),
            ..Recording::default()
        };
        let trembling = recording(|t| 2000.0 * t + 3.0 * (t * 12_989.8).sin());
        assert!(back(&[&trembling, &recording(|t| 500.0 * t * t)]).is_some());
        assert!(back(&[&trembling, &recording(|t| -2000.0 * t)]).is_none());
        assert!(back(&[&recording(|t| 1000.0 * (t - 0.3).powi(2))]).is_none());
    }
}
