//! Signals on an even grid.

/// A slow or noisy signal on an even grid, held between its points.
#[derive(Clone, Debug, Default)]
pub(crate) struct Series {
    pub(crate) interval: f64,
    pub(crate) values: Vec<f64>,
}

impl Series {
    /// The value at time `t`; zero where the series is empty, its last value beyond the end.
    pub(crate) fn at(&self, t: f64) -> f64 {
        if self.values.is_empty() {
            return 0.0;
        }
        let x = (t / self.interval).max(0.0);
        let i = (x as usize).min(self.values.len() - 1);
        let next = self.values[(i + 1).min(self.values.len() - 1)];
        self.values[i] + (next - self.values[i]) * (x - i as f64).clamp(0.0, 1.0)
    }
}
