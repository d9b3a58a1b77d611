//! A profile along the travel: Legendre polynomials over what the recordings span, shared by
//! friction and damping that follow it.

use super::definition::{Fitted, Span};
use super::law::legendre;
use super::shape::shape;
use super::{Effect, EffectName};

/// Degrees of the polynomial that a profile along the travel may have: a slope or bend, a step or
/// bump, and one that is narrow compared with the travel.
const DEGREES: [f64; 3] = [3.0, 6.0, 12.0];

shape! {
    /// The stretch that a profile spans.
    struct Shape {
        /// Its lower end, rad or m.
        low: (-1.0),
        /// Its upper end, rad or m.
        high: 1.0,
        /// Degree of the polynomial, a whole number.
        degree: 3.0,
    }
}

/// Ends of the travel, rad or m, and the degree.
#[derive(Debug, Clone)]
pub(super) struct Profile {
    pub(super) low: f64,
    pub(super) high: f64,
    degree: usize,
}

impl Profile {
    pub(super) fn new(effect: &Effect) -> Self {
        let Shape { low, high, degree } = Shape::of(effect);
        Self { low, high, degree: degree as usize }
    }

    pub(super) fn names(&self) -> Vec<String> {
        (1..=self.degree).map(|k| format!("legendre_{k}")).collect()
    }

    /// Place along the travel, −1 to 1.
    pub(super) fn along(&self, position: f64) -> f64 {
        let half = 0.5 * (self.high - self.low);
        if half > 0.0 { ((position - self.low) / half - 1.0).clamp(-1.0, 1.0) } else { 0.0 }
    }
}

pub(super) fn grid(name: EffectName, span: &Span) -> Vec<Effect> {
    if !span.rig.has_stroke {
        return Vec::new();
    }
    DEGREES
        .map(|degree| Effect::shaped(name, &[("low", span.low), ("high", span.high), ("degree", degree)]))
        .to_vec()
}

pub(super) fn degree(effect: &Effect) -> f64 {
    Shape::of(effect).degree
}

pub(super) fn freedom(effect: &Effect) -> usize {
    degree(effect) as usize
}

/// Largest less smallest of the fitted polynomial over the travel. Ends that few rows saw may
/// differ most and say least, so the interval begins at the largest lower limit of a difference
/// between two places; Scheffé's method allows for choosing them after the fit.
pub(super) fn span(fitted: &Fitted) -> (f64, f64) {
    let degree = freedom(fitted.effect);
    let places: Vec<Vec<f64>> = (0..=60)
        .map(|i| {
            let mut basis = vec![0.0; degree];
            legendre(-1.0 + f64::from(i) / 30.0, 1.0, &mut basis);
            basis
        })
        .collect();
    let values: Vec<f64> = places
        .iter()
        .map(|basis| basis.iter().enumerate().map(|(k, b)| fitted.term(k).0 * b).sum())
        .collect();
    let reach = 1.96 * widening(degree);
    let (mut span, mut least) = (0.0_f64, f64::NEG_INFINITY);
    for (a, at_a) in values.iter().zip(&places) {
        for (b, at_b) in values.iter().zip(&places).filter(|(b, _)| *b < a) {
            let between: Vec<f64> = at_a.iter().zip(at_b).map(|(a, b)| a - b).collect();
            span = span.max(a - b);
            least = least.max(a - b - reach * fitted.sd_of(&between));
        }
    }
    let sd = if least.is_finite() { (span - least) / 1.96 } else { 0.0 };
    fitted.scaled((span, sd))
}

/// The factor by which 95 % of all differences between places of a profile with `degree` values
/// hold at once, over that of one difference.
fn widening(degree: usize) -> f64 {
    let k = degree.max(1) as f64;
    // The 95 % quantile of chi square by Wilson and Hilferty.
    let part = 2.0 / (9.0 * k);
    (k * (1.0 - part + 1.645 * part.sqrt()).powi(3)).sqrt() / 1.96
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_profile_of_many_values_needs_more_to_differ_from_none() {
        // Quantiles of chi square from a table: 3.841, 9.488 and 21.026.
        for (degree, quantile) in [(1, 3.841_f64), (4, 9.488), (12, 21.026)] {
            let wanted = quantile.sqrt() / 1.96;
            assert!((widening(degree) / wanted - 1.0).abs() < 0.02, "{degree}: {}", widening(degree));
        }
    }
}
