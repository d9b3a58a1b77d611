//! The share of an oracle's gain.

/// An oracle that gains less than this part of the noise's mean square has nothing to gain on the
/// recording.
pub(crate) const EXPLAINABLE: f64 = 0.15;

/// Share of what an oracle, which leaves `floor`, takes off the mean square of what `refit` leaves;
/// `None` of nothing. Two at most either way: beyond, it is a ratio of two small numbers.
pub(crate) fn share(refit: f64, left: f64, floor: f64) -> Option<f64> {
    let room = refit.powi(2) - floor.powi(2);
    let gain = refit.powi(2) - left.powi(2);
    (gain.is_finite() && room >= EXPLAINABLE * floor.powi(2)).then(|| (gain / room).clamp(-2.0, 2.0))
}
