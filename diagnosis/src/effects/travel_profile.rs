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
    let of = |degree| Effect::shaped(name, &[("low", span.low), ("high", span.high), ("degree", degree)]);
    DEGREES.map(of).to_vec()
}

pub(super) fn degree(effect: &Effect) -> f64 {
    Shape::of(effect).degree
}

pub(super) fn freedom(effect: &Effect) -> usize {
    degree(effect) as usize
}

/// Largest less smallest of the fitted polynomial over the travel.
pub(super) fn span(fitted: &Fitted) -> (f64, f64) {
    let degree = freedom(fitted.effect);
    let c: Vec<f64> = (0..degree).map(|k| fitted.term(k).0).collect();
    let mut basis = vec![0.0; degree];
    let values: Vec<f64> = (0..=60)
        .map(|i| {
            legendre(-1.0 + f64::from(i) / 30.0, 1.0, &mut basis);
            c.iter().zip(&basis).map(|(c, b)| c * b).sum()
        })
        .collect();
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let sd = 2.0 * (0..degree).map(|k| fitted.term(k).1.powi(2)).sum::<f64>().sqrt();
    fitted.scaled((high - low, sd))
}
