//! Combs: waves along the travel whose orders are those of teeth or poles.

use crate::laws::Effect;
use std::f64::consts::TAU;

/// Longest run of neighbouring orders that teeth or poles make.
const LONGEST_RUN: usize = 4;
/// Distance from a whole number within which an order counts as whole.
const MULTIPLE: f64 = 0.1;
/// Part of the strongest amplitude that an order must have to count in a run.
const STANDS: f64 = 0.2;

/// True if the waves found are those of teeth or poles. A well or a bump at one place needs all
/// orders up to its width, one after the other, and repeats only because so little of the travel is
/// seen. Orders count from the turn where it is known, otherwise from the longest wave.
pub(crate) fn is_comb(effect: &Effect, amplitudes: &[f64]) -> bool {
    if !effect.name.definition().is_periodic() {
        return true;
    }
    let strongest = amplitudes.iter().copied().fold(0.0, f64::max);
    let mut waves: Vec<f64> = effect
        .waves()
        .iter()
        .zip(amplitudes)
        .filter(|(_, amplitude)| **amplitude >= STANDS * strongest)
        .map(|((_, wave), _)| *wave)
        .collect();
    waves.sort_by(f64::total_cmp);
    let Some(longest_wave) = waves.first() else { return true };
    let first = effect.turn().map_or(*longest_wave, |turn| TAU / turn);
    // If no turn is known, waves may be closer together than teeth can be, given the longest wave.
    let orders: Vec<f64> = waves.iter().map(|wave| (wave / first).round()).collect();
    let mut run = 1;
    let mut longest = 1;
    for pair in orders.windows(2) {
        run = if pair[1] - pair[0] <= 1.0 { run + 1 } else { 1 };
        longest = longest.max(run);
    }
    // Waves that run on and are no multiples of the longest are irregular.
    let regular = effect.turn().is_some()
        || waves.iter().zip(&orders).all(|(wave, order)| (wave / first - order).abs() < MULTIPLE);
    longest <= if regular { LONGEST_RUN } else { LONGEST_RUN - 1 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::laws::EffectName as N;

    fn cogging(orders: &[f64]) -> Effect {
        let keys: Vec<String> = orders.iter().map(|order| format!("order_{order}")).collect();
        let mut shape: Vec<(&str, f64)> =
            keys.iter().map(String::as_str).zip(orders.iter().copied()).collect();
        shape.push(("turn", TAU));
        Effect::shaped(N::Cogging, &shape)
    }

    #[test]
    fn teeth_and_poles_leave_gaps_between_their_orders() {
        assert!(is_comb(&cogging(&[7.0, 12.0, 14.0, 21.0, 28.0]), &[1.0; 5]));
        assert!(is_comb(&cogging(&[1.0, 2.0, 3.0, 4.0]), &[1.0; 4]));
        assert!(!is_comb(&cogging(&[2.0, 3.0, 4.0, 5.0, 6.0]), &[1.0; 5]));
        // Where no turn is known, orders count from the longest wave.
        let free = |periods: &[f64]| {
            let keys: Vec<String> = (1..=periods.len()).map(|i| format!("period_{i}")).collect();
            let shape: Vec<(&str, f64)> =
                keys.iter().map(String::as_str).zip(periods.iter().copied()).collect();
            Effect::shaped(N::Cogging, &shape)
        };
        assert!(!is_comb(&free(&[0.1, 0.048, 0.031, 0.025, 0.022, 0.0195, 0.016]), &[1.0; 7]));
        assert!(!is_comb(&free(&[0.13, 0.091, 0.059, 0.047, 0.039, 0.034]), &[1.1, 0.5, 1.4, 0.3, 0.4, 0.7]));
        assert!(is_comb(&free(&[2.5e-3, 1.25e-3, 0.83e-3]), &[1.0; 3]));
        assert!(is_comb(&free(&[2.5e-3, 1.25e-3, 0.83e-3, 0.625e-3]), &[1.0; 4]));
        assert!(!is_comb(&free(&[0.0754, 0.0522, 0.0456, 0.0370]), &[0.79, 1.07, 0.56, 0.35]));
        // A wave that is weak compared with the strongest does not close a gap.
        assert!(is_comb(&cogging(&[2.0, 3.0, 4.0, 5.0, 6.0]), &[1.0, 1.0, 0.1, 1.0, 1.0]));
    }
}
