//! Confidence against truth.

use serde_json::{Value, json};

use crate::stats::Rate;

/// Names given with this or more are the ones that a reader believes.
pub(crate) const BELIEVED: f64 = 0.9;

/// A bin of the reliability table.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Bin {
    /// Sum of the confidences given.
    confidence: f64,
    pub(crate) right: Rate,
}

impl Bin {
    /// Mean confidence of the names in it; `None` of none.
    pub(crate) fn mean(&self) -> Option<f64> {
        (self.right.trials > 0).then(|| self.confidence / self.right.trials as f64)
    }
}

/// Confidence against truth, over all names of all categories.
#[derive(Clone, Debug, Default)]
pub(crate) struct Reliability {
    /// Tenths of confidence; 1.0 is in the last.
    pub(crate) bins: [Bin; 10],
    /// Expected calibration error and Brier score; `None` where nothing was named.
    pub(crate) errors: Option<(f64, f64)>,
    /// The rate of right names among those given with [`BELIEVED`] or more.
    pub(crate) believed: Rate,
}

impl Reliability {
    /// From (confidence, right).
    pub(crate) fn of(names: &[(f64, bool)]) -> Self {
        let mut metrics = Self::default();
        let mut brier = 0.0;
        for &(confidence, right) in names {
            let bin = &mut metrics.bins[((confidence * 10.0).max(0.0) as usize).min(9)];
            bin.confidence += confidence;
            bin.right.add(right);
            brier += (confidence - f64::from(u8::from(right))).powi(2);
            if confidence >= BELIEVED {
                metrics.believed.add(right);
            }
        }
        if !names.is_empty() {
            let n = names.len() as f64;
            let off = metrics.bins.iter().map(|b| (b.confidence - b.right.hits as f64).abs()).sum::<f64>();
            metrics.errors = Some((off / n, brier / n));
        }
        metrics
    }

    pub(crate) fn json(&self) -> Value {
        let bins: Vec<Value> = self
            .bins
            .iter()
            .enumerate()
            .map(|(i, b)| json!({ "from": i as f64 / 10.0, "mean_confidence": b.mean(), "right": b.right.json() }))
            .collect();
        json!({
            "bins": bins, "expected_calibration_error": self.errors.map(|e| e.0), "brier": self.errors.map(|e| e.1),
            "believed": self.believed.json(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reliability_is_the_mean_gap_of_the_bins() {
        let r = Reliability::of(&[(0.95, true), (0.95, false), (1.0, true), (0.2, false)]);
        // The last bin: 2.9 given, 2 right; the third: 0.2 given, none.
        let (error, brier) = r.errors.unwrap();
        assert!((error - (0.9 + 0.2) / 4.0).abs() < 1e-12, "{error}");
        assert!((brier - (0.0025 + 0.9025 + 0.04) / 4.0).abs() < 1e-12, "{brier}");
        assert_eq!(r.believed, Rate { hits: 2, trials: 3 });
        assert!(Reliability::of(&[]).errors.is_none());
    }
}
