//! One-dimensional searches and grids.

/// Golden-section search for the largest value.
pub fn golden(mut a: f64, mut b: f64, steps: usize, f: impl Fn(f64) -> f64) -> f64 {
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut x, mut y) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut fx, mut fy) = (f(x), f(y));
    for _ in 0..steps {
        if fx >= fy {
            (b, y, fy) = (y, x, fx);
            x = b - ratio * (b - a);
            fx = f(x);
        } else {
            (a, x, fx) = (x, y, fy);
            y = a + ratio * (b - a);
            fy = f(y);
        }
    }
    if fx >= fy { x } else { y }
}

/// `count` values from `from` to `to`, evenly spaced in their logarithm.
pub fn logarithmic(from: f64, to: f64, count: usize) -> Vec<f64> {
    if from.is_nan() || to.is_nan() || from <= 0.0 || to <= from || count < 2 {
        return if to > 0.0 { vec![to] } else { Vec::new() };
    }
    let ratio = (to / from).ln() / (count - 1) as f64;
    (0..count).map(|i| from * (ratio * i as f64).exp()).collect()
}
