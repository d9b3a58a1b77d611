//! The comparison of models with and without free forms on left-out blocks.

use super::basis::Inputs;

/// Log predictive density of each left-out unit, up to a constant of the data.
#[derive(Debug, Clone)]
pub(crate) struct Density(pub(crate) Vec<f64>);

/// Gain of one model over another on left-out units.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Gain {
    /// Sum, nats.
    pub(crate) sum: f64,
    /// Its standard error, nats.
    pub(crate) error: f64,
    /// Standard errors of the mean where each unit counts up to a limit: one with a huge gain is
    /// one witness.
    steady: f64,
}

/// Most that one unit counts, nats.
const WITNESS: f64 = 10.0;

impl Density {
    pub(crate) fn over(&self, other: &Self) -> Gain {
        let gains: Vec<f64> = self.0.iter().zip(&other.0).map(|(a, b)| a - b).collect();
        let n = gains.len().max(2) as f64;
        let moments = |x: &dyn Fn(f64) -> f64| {
            let mean = gains.iter().map(|g| x(*g)).sum::<f64>() / n;
            let variance = gains.iter().map(|g| (x(*g) - mean).powi(2)).sum::<f64>() / (n - 1.0);
            (mean * n, (variance * n).sqrt())
        };
        let (sum, error) = moments(&|g| g);
        let (steady, steady_error) = moments(&|g| g.clamp(-WITNESS, WITNESS));
        Gain { sum, error, steady: steady / steady_error.max(1e-300) }
    }
}

impl Gain {
    /// Returns the standard errors above zero, with or without a limit on what a unit counts,
    /// whichever is more.
    pub(crate) fn z(&self) -> f64 {
        (self.sum / self.error.max(1e-300)).max(self.steady)
    }
}

/// The density of a model alone, and with each form added to it.
pub(crate) struct Densities {
    pub(crate) alone: Density,
    pub(crate) with: Vec<(Inputs, Density)>,
}

/// A form and what it gains in addition to a model.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Taken {
    pub(crate) inputs: Inputs,
    pub(crate) gain: Gain,
}

impl Densities {
    /// Returns the gain of each form in addition to the model, largest first.
    pub(crate) fn taken(&self) -> Vec<Taken> {
        let taken =
            |(inputs, with): &(Inputs, Density)| Taken { inputs: *inputs, gain: with.over(&self.alone) };
        let mut all: Vec<Taken> = self.with.iter().map(taken).collect();
        all.sort_by(|a, b| b.gain.sum.total_cmp(&a.gain.sum));
        all
    }
}
