//! The width of a column of numbers.

/// Returns the largest value less the smallest; minus infinity if there are no values.
pub fn spread(column: &[f64]) -> f64 {
    let low = column.iter().copied().fold(f64::INFINITY, f64::min);
    column.iter().copied().fold(f64::NEG_INFINITY, f64::max) - low
}
