//! The description of an effect in a report.

use crate::laws::{Effect, EffectName};
use numerics::linear::Square;

/// A fitted effect, from which its values are reported.
pub(crate) struct Fitted<'a> {
    pub(crate) effect: &'a Effect,
    /// Coefficients with their standard deviations, per inertia.
    pub(crate) terms: Vec<(f64, f64)>,
    /// Covariance of the coefficients.
    pub(crate) covariance: Square,
    /// Inertia, kg·m² or kg, and the relative standard deviation of its scale.
    pub(crate) inertia: f64,
    pub(crate) common: f64,
    /// Gain over inertia.
    pub(crate) ratio: f64,
    /// Viscous and dry friction per inertia, by the rig's own terms or another effect's, and the
    /// rig's own dry friction.
    pub(crate) viscous: Option<f64>,
    pub(crate) dry: Option<f64>,
    pub(crate) own_dry: f64,
    /// Counts that recordings were seen to lose.
    pub(crate) lost: f64,
    /// Units of force, length and command.
    pub(crate) force: &'static str,
    pub(crate) length: &'static str,
    pub(crate) command: String,
    /// Relative standard deviation of a value of the shape.
    pub(crate) shape_sd: &'a dyn Fn(&str) -> f64,
}

/// A value of the report.
pub(crate) struct Reported {
    pub(crate) name: String,
    pub(crate) value: f64,
    pub(crate) sd: f64,
    pub(crate) unit: String,
}

impl Reported {
    pub(crate) fn new(name: impl Into<String>, (value, sd): (f64, f64), unit: impl Into<String>) -> Self {
        Self { name: name.into(), value, sd, unit: unit.into() }
    }
}

impl Fitted<'_> {
    /// A coefficient with its standard deviation, per inertia; zero where it is missing.
    pub(crate) fn term(&self, k: usize) -> (f64, f64) {
        self.terms.get(k).copied().unwrap_or((0.0, 0.0))
    }

    /// Standard deviation of a weighted sum of the coefficients, per inertia.
    pub(crate) fn sd_of(&self, weights: &[f64]) -> f64 {
        let n = weights.len().min(self.terms.len());
        let row = |i: usize| (0..n).map(|j| self.covariance.at(i, j) * weights[j]).sum::<f64>();
        (0..n).map(|i| weights[i] * row(i)).sum::<f64>().max(0.0).sqrt()
    }

    /// A force: the coefficient times the inertia, whose scale is known no better than the rig
    /// says.
    pub(crate) fn scaled(&self, (x, sd): (f64, f64)) -> (f64, f64) {
        let value = x * self.inertia;
        (value, ((sd * self.inertia).powi(2) + (value * self.common).powi(2)).sqrt())
    }

    /// A value of the shape with its standard deviation.
    pub(crate) fn shape(&self, key: &str) -> (f64, f64) {
        let value = self.effect.value(key);
        (value, value * (self.shape_sd)(key))
    }

    /// A force that is the effect's only coefficient, under a name and a unit.
    pub(crate) fn one_force(&self, name: &str, unit: String) -> Vec<Reported> {
        vec![Reported::new(name, self.scaled(self.term(0)), unit)]
    }
}

/// Root of the sum of squares of values, with its standard deviation.
pub(crate) fn sized(pairs: &[(f64, f64)]) -> (f64, f64) {
    let square: f64 = pairs.iter().map(|(x, _)| x * x).sum();
    let size = square.sqrt();
    let sd = pairs.iter().map(|(x, s)| (x * s).powi(2)).sum::<f64>().sqrt() / size.max(1e-300);
    (size, sd)
}

/// The description of an effect in a report.
pub(crate) trait EffectReport {
    /// The values that are reported.
    fn report(&self, fitted: &Fitted) -> Vec<Reported>;

    /// Relative standard deviation of a reported value for the form of the law alone: the machine's
    /// law is never quite ours, and an interval that only noise makes is too narrow.
    fn form_sd(&self, _value: &str) -> f64 {
        0.005
    }

    /// True if a reported value is a size, and does not say where or when the effect acts.
    fn is_size(&self, value: &str) -> bool {
        !value.starts_with("period")
    }

    /// The variable over which it shows: `speed`, `travel`, `angle`, `command`, `time` or `tilt`.
    fn variable(&self) -> &'static str {
        "speed"
    }

    /// Returns the recording that distinguishes it from `other`; none where `other` has one, or
    /// none is known.
    fn experiment(&self, _other: EffectName) -> Option<&'static str> {
        None
    }

    /// Returns a clause on the fault of a log that looks the same as it; none where there is none.
    fn fault_of_a_log(&self) -> Option<&'static str> {
        None
    }
}
