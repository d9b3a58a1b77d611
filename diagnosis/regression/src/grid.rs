//! From time stamps to an even grid: readings by cubics, the held command by its mean under a hat,
//! which is the exact counterpart of a second difference.

/// Returns `x`, known at `stamps`, at the increasing times `at`: cubics with the slopes of
/// parabolas.
pub(crate) fn cubic(stamps: &[f64], x: &[f64], at: &[f64]) -> Vec<f64> {
    let n = stamps.len();
    let chord = |i: usize| (x[i + 1] - x[i]) / (stamps[i + 1] - stamps[i]);
    let slope = |i: usize| match i {
        0 => chord(0),
        _ if i + 1 == n => chord(n - 2),
        _ => {
            let (a, b) = (stamps[i] - stamps[i - 1], stamps[i + 1] - stamps[i]);
            (b * chord(i - 1) + a * chord(i)) / (a + b)
        }
    };
    let mut j = 0;
    let hermite = |t: &f64| {
        while j + 2 < n && stamps[j + 1] <= *t {
            j += 1;
        }
        let w = stamps[j + 1] - stamps[j];
        let s = ((t - stamps[j]) / w).clamp(0.0, 1.0);
        let (m0, m1, d) = (slope(j) * w, slope(j + 1) * w, x[j + 1] - x[j]);
        x[j] + s * (m0 + s * (3.0 * d - 2.0 * m0 - m1 + s * (m0 + m1 - 2.0 * d)))
    };
    at.iter().map(hermite).collect()
}

/// Returns `x`, known at `stamps`, at the increasing times `at`, by straight lines; ends are held.
pub(crate) fn linear(stamps: &[f64], x: &[f64], at: &[f64]) -> Vec<f64> {
    let n = stamps.len();
    let mut j = 0;
    let straight = |t: &f64| {
        while j + 2 < n && stamps[j + 1] <= *t {
            j += 1;
        }
        let s = ((t - stamps[j]) / (stamps[j + 1] - stamps[j])).clamp(0.0, 1.0);
        x[j] + s * (x[j + 1] - x[j])
    };
    at.iter().map(straight).collect()
}

/// Integral of the hat (1 − |x|/h)/h from 0 to `x`.
fn hat_area(x: f64, h: f64) -> f64 {
    let x = (x / h).clamp(-1.0, 1.0);
    x - 0.5 * x * x.abs()
}

/// Returns the mean of the command, held from each stamp to the next, under the hat of half width
/// `h` about each of the increasing times `at`.
pub(crate) fn mean_under_hat(stamps: &[f64], command: &[f64], at: &[f64], h: f64) -> Vec<f64> {
    let n = stamps.len();
    let mut first = 0;
    let mean = |t: &f64| {
        while first + 1 < n && stamps[first + 1] <= t - h {
            first += 1;
        }
        let mut sum = 0.0;
        let mut from = -h;
        for i in first..n {
            let to = if i + 1 < n { (stamps[i + 1] - t).min(h) } else { h };
            if to > from {
                sum += command[i] * (hat_area(to, h) - hat_area(from, h));
                from = to;
            }
            if to >= h {
                break;
            }
        }
        sum
    };
    at.iter().map(mean).collect()
}

/// Returns the standard deviation of a count's quantisation; zero if readings are not whole.
pub(crate) fn quantisation(counts: &[f64]) -> f64 {
    let whole = counts.iter().all(|c| (c - c.round()).abs() < 1e-6);
    if whole { 12_f64.sqrt().recip() } else { 0.0 }
}

/// Estimates the standard deviation of a reading, counts, from the highest frequencies: the eighth
/// difference, in which white noise is √12870 times larger and motion is not.
pub(crate) fn reading_noise(counts: &[f64]) -> f64 {
    const WEIGHTS: [f64; 9] = [1.0, -8.0, 28.0, -56.0, 70.0, -56.0, 28.0, -8.0, 1.0];
    const POWER: f64 = 12870.0;
    const BLOCK: usize = 64;
    let power = |w: &[f64]| {
        let d: f64 = w.iter().zip(WEIGHTS).map(|(x, w)| x * w).sum();
        d * d / POWER
    };
    let moving = counts.chunks(BLOCK).filter(|c| c.len() > 8 && c.iter().any(|x| *x != c[0]));
    let blocks = moving.map(|c| c.windows(9).map(power).sum::<f64>() / (c.len() - 8) as f64);
    crate::filters::quantile(blocks, 0.5).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A held command on a double integrator, integrated piece by piece without a grid.
    #[test]
    fn the_second_difference_is_the_mean_force_under_the_hat() {
        let stamps = [0.0_f64, 0.013, 0.021, 0.04, 0.058, 0.071, 0.1];
        let force = [2.0_f64, -3.0, 0.5, 4.0, -1.0, 1.5, 0.0];
        let h = 0.01;
        let place = |t: f64| {
            let (mut q, mut v) = (0.3, -0.2);
            for i in 0..stamps.len() {
                let end = if i + 1 < stamps.len() { stamps[i + 1].min(t) } else { t };
                let d = (end - stamps[i]).max(0.0);
                q += v * d + 0.5 * force[i] * d * d;
                v += force[i] * d;
            }
            q
        };
        let at: Vec<f64> = (1..9).map(|i| f64::from(i) * h).collect();
        let mean = mean_under_hat(&stamps, &force, &at, h);
        for (t, mean) in at.iter().zip(mean) {
            let second = (place(t + h) - 2.0 * place(*t) + place(t - h)) / (h * h);
            assert!((second - mean).abs() < 1e-9, "{t}: {second} {mean}");
        }
    }

    #[test]
    fn cubics_are_exact_on_parabolas_between_jittered_stamps() {
        let stamps: Vec<f64> = (0..20).map(|i| f64::from(i) + 0.2 * f64::from(i * i % 3)).collect();
        let f = |t: f64| 1.0 - 2.0 * t + 0.3 * t * t;
        let x: Vec<f64> = stamps.iter().map(|t| f(*t)).collect();
        let at: Vec<f64> = (35..170).map(|i| 0.1 * f64::from(i)).collect();
        cubic(&stamps, &x, &at).iter().zip(&at).for_each(|(y, t)| assert!((y - f(*t)).abs() < 1e-9));
    }

    #[test]
    fn reading_noise_is_found_under_a_motion() {
        let mut seed = 1_u64;
        let mut uniform = || {
            seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        };
        let motion = |i: usize| 4000.0 * (i as f64 * 0.01).sin();
        let noisy: Vec<f64> = (0..6400).map(|i| motion(i) + 7.0 * uniform()).collect();
        let expected = 7.0 / 12_f64.sqrt();
        assert!((reading_noise(&noisy) / expected - 1.0).abs() < 0.1, "{}", reading_noise(&noisy));
        let clean: Vec<f64> = (0..6400).map(motion).collect();
        assert!(reading_noise(&clean) < 0.01 * expected);
        assert_eq!((quantisation(&noisy), quantisation(&[1.0, 5.0])), (0.0, 12_f64.sqrt().recip()));
    }
}
