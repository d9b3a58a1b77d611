//! A line of the main table, and its figure.

use serde_json::{Value, json};

use crate::stats::{Rate, quantile};

/// A figure of a table.
#[derive(Clone, Debug)]
pub(crate) enum Figure {
    Rate(Rate),
    /// Shares of one, of which median and tenth percentile are reported.
    Shares(Vec<f64>),
    Count(usize),
}

impl Figure {
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Rate(rate) => rate.text(),
            Self::Shares(shares) => share_text(shares),
            Self::Count(count) => count.to_string(),
        }
    }

    pub(crate) fn json(&self) -> Value {
        match self {
            Self::Rate(rate) => rate.json(),
            Self::Shares(x) => {
                json!({ "median": quantile(x, 0.5), "p10": quantile(x, 0.1), "cases": x.len() })
            }
            Self::Count(count) => json!(count),
        }
    }
}

/// Median and tenth percentile as text.
pub(crate) fn share_text(shares: &[f64]) -> String {
    match (quantile(shares, 0.5), quantile(shares, 0.1)) {
        (Some(median), Some(tenth)) => {
            let percent = |x: f64| 100.0 * x;
            format!(
                "median {:.0} %, tenth percentile {:.0} % ({})",
                percent(median),
                percent(tenth),
                shares.len()
            )
        }
        _ => "no case".into(),
    }
}

/// One line of the main table.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// Its name in the JSON.
    pub(crate) key: String,
    pub(crate) measure: String,
    pub(crate) wanted: &'static str,
    pub(crate) figure: Figure,
}
