//! Rows of a recording on an even grid: readings between the stamps by a cubic, commands as they
//! were held; derivatives and a low-pass on that grid.

/// Cubic Hermite interpolation with slopes of the parabola through three neighbours, uneven stamps.
pub fn cubic(stamps: &[f64], values: &[f64], at: &[f64]) -> Vec<f64> {
    let n = stamps.len();
    let chord = |i: usize| (values[i + 1] - values[i]) / (stamps[i + 1] - stamps[i]);
    let slope = |i: usize| {
        if i == 0 || i + 1 == n {
            return chord(i.min(n - 2));
        }
        let (a, b) = (stamps[i] - stamps[i - 1], stamps[i + 1] - stamps[i]);
        (b * chord(i - 1) + a * chord(i)) / (a + b)
    };
    let mut j = 0;
    let one = |t: &f64| {
        while j + 2 < n && stamps[j + 1] <= *t {
            j += 1;
        }
        let w = stamps[j + 1] - stamps[j];
        let x = ((t - stamps[j]) / w).clamp(0.0, 1.0);
        let (m0, m1) = (slope(j) * w, slope(j + 1) * w);
        let (a, b) = (values[j], values[j + 1]);
        let (c, d) = (-3.0 * a + 3.0 * b - 2.0 * m0 - m1, 2.0 * a - 2.0 * b + m0 + m1);
        a + x * (m0 + x * (c + x * d))
    };
    at.iter().map(one).collect()
}

/// The mean of a held signal over the cell of width `h` about each grid point.
pub fn cells(stamps: &[f64], values: &[f64], at: &[f64], h: f64) -> Vec<f64> {
    let n = stamps.len();
    let mut sum = vec![0.0; n];
    for i in 1..n {
        sum[i] = sum[i - 1] + values[i - 1] * (stamps[i] - stamps[i - 1]);
    }
    let mut j = 0;
    let mut until = |t: f64| {
        while j + 1 < n && stamps[j + 1] <= t {
            j += 1;
        }
        sum[j] + values[j] * (t - stamps[j])
    };
    let mut before = until(at[0] - 0.5 * h);
    let one = |t: &f64| {
        let now = until(t + 0.5 * h);
        let mean = (now - before) / h;
        before = now;
        mean
    };
    at.iter().map(one).collect()
}

/// Mean of the sign over the cell about each row, of a signal that goes straight from row to row.
pub fn directions(speed: &[f64]) -> Vec<f64> {
    let half = |inner: f64, outer: f64| {
        // From the row to the middle between the rows.
        let middle = 0.5 * (inner + outer);
        if inner * middle >= 0.0 {
            if inner == 0.0 { middle.signum() } else { inner.signum() }
        } else {
            inner.signum() * (2.0 * inner / (inner - middle) - 1.0)
        }
    };
    let last = speed.len() - 1;
    let of = |i: usize| {
        0.5 * (half(speed[i], speed[i.saturating_sub(1)]) + half(speed[i], speed[(i + 1).min(last)]))
    };
    (0..speed.len()).map(of).collect()
}

/// First derivative, fourth order inside.
pub fn first(x: &[f64], h: f64) -> Vec<f64> {
    let n = x.len();
    let of = |i: usize| {
        if i >= 2 && i + 2 < n {
            (8.0 * (x[i + 1] - x[i - 1]) - (x[i + 2] - x[i - 2])) / (12.0 * h)
        } else {
            let (low, high) = (i.saturating_sub(1), (i + 1).min(n - 1));
            (x[high] - x[low]) / (h * (high - low).max(1) as f64)
        }
    };
    (0..n).map(of).collect()
}

/// Second derivative, fourth order inside, nothing at the ends.
pub fn second(x: &[f64], h: f64) -> Vec<f64> {
    let n = x.len();
    let of = |i: usize| {
        if i < 2 || i + 2 >= n {
            return 0.0;
        }
        (16.0 * (x[i + 1] + x[i - 1]) - x[i + 2] - x[i - 2] - 30.0 * x[i]) / (12.0 * h * h)
    };
    (0..n).map(of).collect()
}

/// Second-order Butterworth low-pass, forwards and backwards, so that nothing is late; started
/// settled. A corner beyond 0.45 of the rate passes everything.
pub fn low_pass(x: &[f64], rate: f64, corner_hz: f64) -> Vec<f64> {
    if x.is_empty() || corner_hz >= 0.45 * rate {
        return x.to_vec();
    }
    // Bilinear transform, prewarped.
    let k = (std::f64::consts::PI * corner_hz / rate).tan();
    let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
    let b = k * k * norm;
    let a = [2.0 * (k * k - 1.0) * norm, (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm];
    let pass = |input: &mut dyn Iterator<Item = f64>| -> Vec<f64> {
        let mut state: Option<[f64; 4]> = None;
        let next = |value: f64| {
            let [x1, x2, y1, y2] = state.unwrap_or([value; 4]);
            let y = b * (value + 2.0 * x1 + x2) - a[0] * y1 - a[1] * y2;
            state = Some([value, x1, y, y1]);
            y
        };
        input.map(next).collect()
    };
    let forwards = pass(&mut x.iter().copied());
    let mut backwards = pass(&mut forwards.iter().rev().copied());
    backwards.reverse();
    backwards
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reversal_counts_by_its_place_between_the_rows() {
        // The sign changes a tenth of a row after the third.
        let d = directions(&[2.1, 1.1, 0.1, -0.9, -1.9]);
        assert_eq!((d[0], d[1], d[4]), (1.0, 1.0, -1.0));
        assert!((d[2] - 0.2).abs() < 1e-12 && (d[3] + 1.0).abs() < 1e-12, "{d:?}");
    }

    #[test]
    fn uneven_stamps_give_derivatives_and_the_mean_of_held_commands() {
        let stamps: Vec<f64> =
            (0..4000).map(|i| (f64::from(i) + 0.3 * f64::from(i * 7 % 10) / 10.0) * 1e-3).collect();
        let grid: Vec<f64> = (0..3990).map(|i| f64::from(i) * 1e-3).collect();
        let read: Vec<f64> = stamps.iter().map(|t| (20.0 * t).sin()).collect();
        let held: Vec<f64> = stamps.iter().map(|t| (5.0 * t).sin()).collect();
        let even = cubic(&stamps, &read, &grid);
        let (speed, bend) = (first(&even, 1e-3), second(&low_pass(&even, 1e3, 100.0), 1e-3));
        let command = cells(&stamps, &held, &grid, 1e-3);
        for i in (100..3900).step_by(97) {
            let t = grid[i];
            assert!((speed[i] - 20.0 * (20.0 * t).cos()).abs() < 0.05, "{}", speed[i]);
            assert!((bend[i] + 400.0 * (20.0 * t).sin()).abs() < 4.0, "{}", bend[i]);
            // Held from its stamp on: half a row late and more.
            assert!((command[i] - (5.0 * (t - 5e-4)).sin()).abs() < 3e-3, "{}", command[i]);
        }
    }
}
