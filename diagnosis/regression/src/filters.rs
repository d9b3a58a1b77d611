//! Zero-phase low-pass filters, differences and means on an even grid.

use std::f64::consts::PI;

/// A second-order section, b over a with a₀ = 1.
struct Section {
    b: [f64; 3],
    a: [f64; 2],
}

/// The sections of a Butterworth low-pass of even order.
fn butterworth(order: usize, corner_hz: f64, rate_hz: f64) -> Vec<Section> {
    let k = (PI * corner_hz / rate_hz).tan();
    (0..order / 2)
        .map(|i| {
            let damping = (PI * (2 * i + 1) as f64 / (2 * order) as f64).sin();
            let norm = 1.0 / (1.0 + 2.0 * damping * k + k * k);
            let b = k * k * norm;
            let a = [2.0 * (k * k - 1.0) * norm, (1.0 - 2.0 * damping * k + k * k) * norm];
            Section { b: [b, 2.0 * b, b], a }
        })
        .collect()
}

/// Filters in place, started as if the first value had always been there.
fn run(sections: &[Section], x: &mut [f64]) {
    for Section { b, a } in sections {
        let first = x[0];
        let (mut s1, mut s2) = (first * (1.0 - b[0]), first * (b[2] - a[1]));
        for x in x.iter_mut() {
            let y = b[0] * *x + s1;
            s1 = b[1] * *x - a[0] * y + s2;
            s2 = b[2] * *x - a[1] * y;
            *x = y;
        }
    }
}

/// Returns `x` low-passed forward and backward by a Butterworth filter of even `order`; ends are
/// continued oddly. A corner near half of the rate leaves `x` as it is.
pub(crate) fn low_pass(x: &[f64], rate_hz: f64, corner_hz: f64, order: usize) -> Vec<f64> {
    let n = x.len();
    if corner_hz >= 0.45 * rate_hz || n < 3 {
        return x.to_vec();
    }
    let pad = (n - 1).min((3.0 * rate_hz / corner_hz) as usize);
    let mut y = Vec::with_capacity(n + 2 * pad);
    y.extend((1..=pad).rev().map(|i| 2.0 * x[0] - x[i]));
    y.extend_from_slice(x);
    y.extend((1..=pad).map(|i| 2.0 * x[n - 1] - x[n - 1 - i]));
    let sections = butterworth(order, corner_hz, rate_hz);
    run(&sections, &mut y);
    y.reverse();
    run(&sections, &mut y);
    y.reverse();
    y[pad..pad + n].to_vec()
}

/// Returns `x` behind a first-order lag, exact for straight pieces; it starts settled.
pub(crate) fn first_order(x: &[f64], h: f64, lag_s: f64) -> Vec<f64> {
    if lag_s <= 0.0 {
        return x.to_vec();
    }
    let keep = (-h / lag_s).exp();
    let slope = (1.0 - keep) * lag_s / h;
    let mut last = (x[0], x[0]);
    let next = |x: &f64| {
        let y = keep * last.1 + (1.0 - slope) * x + (slope - keep) * last.0;
        last = (*x, y);
        y
    };
    x.iter().map(next).collect()
}

/// Returns the derivative by differences of fourth order, lower at the ends.
pub(crate) fn derivative(x: &[f64], h: f64) -> Vec<f64> {
    let n = x.len();
    let difference = |i: usize| match i {
        0 => (x[1] - x[0]) / h,
        _ if i + 1 == n => (x[i] - x[i - 1]) / h,
        _ if i < 2 || i + 2 >= n => (x[i + 1] - x[i - 1]) / (2.0 * h),
        _ => (8.0 * (x[i + 1] - x[i - 1]) - (x[i + 2] - x[i - 2])) / (12.0 * h),
    };
    if n < 2 { vec![0.0; n] } else { (0..n).map(difference).collect() }
}

/// Returns the second difference over h², repeated at the ends.
pub(crate) fn second_difference(x: &[f64], h: f64) -> Vec<f64> {
    let n = x.len();
    let curvature = |i: usize| {
        let i = i.clamp(1, n - 2);
        (x[i + 1] - 2.0 * x[i] + x[i - 1]) / (h * h)
    };
    if n < 3 { vec![0.0; n] } else { (0..n).map(curvature).collect() }
}

/// Returns the mean of `x` under the hat of half width h, as if straight between points curved by
/// their second difference: (1, 10, 1)/12.
pub(crate) fn under_hat(x: &[f64]) -> Vec<f64> {
    let mut y = x.to_vec();
    for i in 1..x.len().saturating_sub(1) {
        y[i] = (x[i - 1] + 10.0 * x[i] + x[i + 1]) / 12.0;
    }
    y
}

/// Returns the mean over `width` (odd) points about every `width`th point.
pub(crate) fn thin_by_mean(x: &[f64], width: usize) -> Vec<f64> {
    if width == 1 {
        return x.to_vec();
    }
    let half = width / 2;
    let mean = |i: usize| {
        let part = &x[i.saturating_sub(half)..(i + half + 1).min(x.len())];
        part.iter().sum::<f64>() / part.len() as f64
    };
    (0..x.len()).step_by(width).map(mean).collect()
}

/// Returns the quantile `p` (0 to 1) of `x`; zero if there is nothing.
pub(crate) fn quantile(x: impl IntoIterator<Item = f64>, p: f64) -> f64 {
    let mut x: Vec<f64> = x.into_iter().collect();
    if x.is_empty() {
        return 0.0;
    }
    let k = ((x.len() - 1) as f64 * p).round() as usize;
    *x.select_nth_unstable_by(k, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_follows_a_ramp_by_its_time_constant() {
        let (h, lag) = (0.01_f64, 0.03_f64);
        let ramp: Vec<f64> = (0..20).map(|i| f64::from(i) * h).collect();
        for (t, y) in ramp.iter().zip(first_order(&ramp, h, lag)) {
            assert!((y - (t - lag + lag * (-t / lag).exp())).abs() < 1e-12, "{y} at {t}");
        }
    }
}
