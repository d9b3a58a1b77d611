//! The judge's arithmetic.

/// Wilson's 95 % interval of a proportion (Wilson 1927): (low, high), the whole of [0, 1] where
/// there was no trial.
pub(crate) fn wilson(hits: usize, trials: usize) -> (f64, f64) {
    if trials == 0 {
        return (0.0, 1.0);
    }
    let (n, z) = (trials as f64, 1.959_963_985_f64);
    let p = hits as f64 / n;
    let centre = p + z * z / (2.0 * n);
    let half = z * (p * (1.0 - p) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    (((centre - half) / scale).max(0.0), ((centre + half) / scale).min(1.0))
}

/// The quantile `p` in [0, 1] by linear interpolation between order statistics; `None` of nothing.
pub(crate) fn quantile(values: &[f64], p: f64) -> Option<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_by(f64::total_cmp);
    let last = sorted.len().checked_sub(1)?;
    let x = p.clamp(0.0, 1.0) * last as f64;
    let i = x as usize;
    let next = sorted[(i + 1).min(last)];
    Some(sorted[i] + (next - sorted[i]) * (x - i as f64))
}

/// Hits among trials.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Rate {
    pub(crate) hits: usize,
    pub(crate) trials: usize,
}

impl Rate {
    pub(crate) fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.trials += 1;
    }

    pub(crate) fn json(&self) -> serde_json::Value {
        let (low, high) = wilson(self.hits, self.trials);
        serde_json::json!({ "hits": self.hits, "trials": self.trials, "ci95": [low, high] })
    }

    /// "92.0 % (23/25, 75.0–97.8)".
    pub(crate) fn text(&self) -> String {
        if self.trials == 0 {
            return "no case".into();
        }
        let (low, high) = wilson(self.hits, self.trials);
        let share = 100.0 * self.hits as f64 / self.trials as f64;
        format!("{share:.1} % ({}/{}, {:.1}–{:.1})", self.hits, self.trials, 100.0 * low, 100.0 * high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_matches_published_values() {
        // Newcombe 1998, table I: 81/263, 15/148, 0/20, 1/29 (Wilson score, 95 %).
        for (hits, trials, low, high) in [
            (81, 263, 0.2553, 0.3662),
            (15, 148, 0.0624, 0.1605),
            (0, 20, 0.0, 0.1611),
            (1, 29, 0.0061, 0.1718),
        ] {
            let (l, h) = wilson(hits, trials);
            assert!((l - low).abs() < 5e-5 && (h - high).abs() < 5e-5, "{hits}/{trials}: {l} {h}");
        }
        assert_eq!(wilson(0, 0), (0.0, 1.0));
        assert_eq!(wilson(5, 5).1, 1.0);
    }

    #[test]
    fn quantiles_interpolate_and_ignore_what_is_not_a_number() {
        assert_eq!(quantile(&[4.0, 1.0, 3.0, 2.0], 0.5), Some(2.5));
        assert_eq!(quantile(&[1.0, f64::NAN], 0.1), Some(1.0));
        assert_eq!(quantile(&[0.0, 10.0], 0.1), Some(1.0));
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn a_rate_says_its_counts() {
        let mut rate = Rate::default();
        for hit in [true, true, false, true] {
            rate.add(hit);
        }
        assert_eq!(rate.text(), "75.0 % (3/4, 30.1–95.4)");
        assert_eq!(Rate::default().text(), "no case");
    }
}
