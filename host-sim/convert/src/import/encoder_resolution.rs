//! The encoder's resolution: said, taken from a rig, or seen in the steps of the readings.

use super::role::Role;
use super::rows::Rows;
use super::units::Quantity;
use std::f64::consts::TAU;

/// Counts per rad or m where the readings have no steps: finer than any log resolves.
const FINE: f64 = 1e6;
/// Readings are multiples of a step where this part of their changes is, within a twentieth of it.
const SHARE: f64 = 0.995;
const NEAR: f64 = 0.05;

/// The conversion of positions to counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scale {
    /// Counts per rad or m; none where positions are counts already and nobody said of how many.
    pub counts_per_unit: Option<f64>,
    /// True if readings were seen to come in whole counts.
    pub whole: bool,
}

/// The step of readings that are multiples of one.
fn step(column: &[f64]) -> Option<f64> {
    let mut changes: Vec<f64> = column.windows(2).map(|w| (w[1] - w[0]).abs()).filter(|d| *d > 0.0).collect();
    if changes.len() < 20 {
        return None;
    }
    changes.sort_by(f64::total_cmp);
    let range = column.iter().fold(0.0_f64, |m, x| m.max((x - column[0]).abs()));
    // The shortest changes, but for rounding in the last digits of a float.
    let tiny = 1e-11 * range;
    let first = changes.iter().copied().find(|d| *d > tiny)?;
    // Refined by the shorter changes, which are few steps each.
    let (mut sum, mut steps) = (0.0, 0.0);
    for d in changes.iter().take_while(|d| **d < 30.0 * first).filter(|d| **d > tiny) {
        let n = (d / first).round();
        if (d / first - n).abs() < NEAR {
            sum += d;
            steps += n;
        }
    }
    let step = sum / steps;
    let good =
        changes.iter().filter(|d| **d > tiny).filter(|d| (*d / step - (*d / step).round()).abs() < NEAR);
    let shortest = changes.iter().take_while(|d| **d < 1000.0 * step).count();
    (good.take_while(|d| **d < 1000.0 * step).count() as f64 >= SHARE * shortest as f64
        && shortest >= 10
        && range / step < 1e9)
        .then_some(step)
}

/// The scale for runs of one recording session. `per_unit` is what was said, in counts per rad or
/// m.
pub(super) fn scale(runs: &[Rows], per_unit: Option<f64>, notes: &mut Vec<String>) -> Scale {
    let quantity = runs.first().map_or(Quantity::Counts, |r| r.position);
    if quantity == Quantity::Counts {
        return Scale { counts_per_unit: per_unit, whole: false };
    }
    if let Some(per_unit) = per_unit {
        return Scale { counts_per_unit: Some(per_unit), whole: false };
    }
    let steps: Option<Vec<f64>> = runs.iter().map(|run| step(&run.columns[&Role::Position])).collect();
    let finest = steps.and_then(|s| s.into_iter().min_by(f64::total_cmp));
    match finest {
        Some(step) if step * FINE > 0.999 => {
            let mut per_unit = 1.0 / step;
            let per_turn = (per_unit * TAU).round();
            if quantity == Quantity::Angle && (per_turn / TAU / per_unit - 1.0).abs() < 2e-4 {
                per_unit = per_turn / TAU;
            }
            let turn =
                if quantity == Quantity::Angle { format!(", {per_turn} a turn") } else { String::new() };
            notes.push(format!(
                "readings come in steps of {step:.3e} {}: taken as counts{turn}; --counts-per-unit says another",
                quantity.unit()
            ));
            Scale { counts_per_unit: Some(per_unit), whole: true }
        }
        _ => {
            notes.push(format!(
                "readings are finer than a step could be seen: written as {FINE:e} counts per {}",
                quantity.unit()
            ));
            Scale { counts_per_unit: Some(FINE), whole: false }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steps_of_an_encoder_are_seen_and_a_smooth_angle_has_none() {
        let angle = |i: usize| 3.0 * (i as f64 * 0.01).sin() + 0.3 * (i as f64 * 0.037).cos();
        let per_unit = 4096.0 / TAU;
        let rounded: Vec<f64> = (0..4000).map(|i| (angle(i) * per_unit).round() / per_unit).collect();
        let found = step(&rounded).expect("it has steps");
        assert!((found * per_unit - 1.0).abs() < 1e-9, "{found}");
        let smooth: Vec<f64> = (0..4000).map(angle).collect();
        assert_eq!(step(&smooth), None);
    }
}
