//! `report.html`.

use crate::outcome::Outcome;

/// The page.
pub(crate) fn page(outcome: &Outcome) -> String {
    format!("<!doctype html><meta charset=utf-8><title>Diagnosis</title><p>{}</p>", outcome.report.sentence)
}
