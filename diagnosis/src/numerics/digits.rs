//! Numbers as people read them.

/// Four significant digits.
pub(crate) fn short(x: f64) -> String {
    if x == 0.0 {
        return "0".into();
    }
    let magnitude = x.abs().log10().floor();
    if (-3.0..5.0).contains(&magnitude) {
        format!("{x:.*}", (3.0 - magnitude).clamp(0.0, 6.0) as usize)
    } else {
        format!("{x:.3e}")
    }
}

/// The same, and nought where it is less than a thousandth of a range.
pub(crate) fn short_within(x: f64, range: f64) -> String {
    short(if x.abs() < 1e-3 * range { 0.0 } else { x })
}
