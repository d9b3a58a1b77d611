//! Frequency response and coherence by Welch's method (1967): half-overlapping segments under a
//! Hann window, their spectra averaged over segments and over bands of equal ratio.

use std::f64::consts::{PI, TAU};

/// Segments that are averaged, at least.
const SEGMENTS: usize = 8;
/// Shortest segment, rows.
const SHORTEST: usize = 32;
/// Upper over lower end of a band.
const RATIO: f64 = 1.12;

/// The response in one band.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Band {
    /// Its middle, Hz.
    pub hertz: f64,
    /// Output over input, real and imaginary part.
    pub response: [f64; 2],
    /// Part of the output's power that follows the input linearly, 0 to 1.
    pub coherence: f64,
    /// Power density of the input, its unit squared per Hz.
    pub input: f64,
}

/// Returns the response of `output` to `input`, both on even rows, in bands from low to high; none
/// where they are too short.
pub fn response(input: &[f64], output: &[f64], rate_hz: f64) -> Vec<Band> {
    let rows = input.len().min(output.len());
    let most = 2 * rows / (SEGMENTS + 1);
    if most < SHORTEST {
        return Vec::new();
    }
    let length = 1 << most.ilog2();
    let window: Vec<f64> = (0..length).map(|i| 0.5 - 0.5 * (TAU * i as f64 / length as f64).cos()).collect();
    let mut sums = vec![[0.0; 4]; length / 2];
    let mut segments = 0.0;
    for from in (0..=rows - length).step_by(length / 2) {
        let spectrum = |of: &[f64]| windowed(&of[from..from + length], &window);
        let (x, y) = (spectrum(input), spectrum(output));
        for (sum, ((a, b), (c, d))) in sums.iter_mut().zip(x.into_iter().zip(y)) {
            let parts = [a * a + b * b, a * c + b * d, a * d - b * c, c * c + d * d];
            sum.iter_mut().zip(parts).for_each(|(sum, part)| *sum += part);
        }
        segments += 1.0;
    }
    let density = 2.0 / (segments * rate_hz * window.iter().map(|w| w * w).sum::<f64>());
    in_bands(&sums, rate_hz / length as f64, density)
}

/// The spectrum of a segment without its mean.
fn windowed(values: &[f64], window: &[f64]) -> Vec<(f64, f64)> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let mut out: Vec<(f64, f64)> = values.iter().zip(window).map(|(x, w)| ((x - mean) * w, 0.0)).collect();
    transform(&mut out);
    out
}

/// The discrete Fourier transform of a power of two of values, in place (Cooley and Tukey 1965).
fn transform(values: &mut [(f64, f64)]) {
    let n = values.len();
    let bits = n.ilog2();
    for i in 0..n {
        let j = i.reverse_bits() >> (usize::BITS - bits);
        if i < j {
            values.swap(i, j);
        }
    }
    let mut half = 1;
    while half < n {
        for k in 0..half {
            let (sin, cos) = (-PI * k as f64 / half as f64).sin_cos();
            for i in (k..n).step_by(2 * half) {
                let ((a, b), (c, d)) = (values[i], values[i + half]);
                let (c, d) = (c * cos - d * sin, c * sin + d * cos);
                values[i] = (a + c, b + d);
                values[i + half] = (a - c, b - d);
            }
        }
        half *= 2;
    }
}

/// Joins the spectra to bands; the two lowest hold what a window lets through of the mean.
fn in_bands(sums: &[[f64; 4]], step_hz: f64, density: f64) -> Vec<Band> {
    let mut out = Vec::new();
    let mut from = 2;
    while from < sums.len() {
        let to = ((from as f64 * RATIO) as usize).max(from + 1).min(sums.len());
        let mut sum = [0.0; 4];
        for bin in &sums[from..to] {
            sum.iter_mut().zip(bin).for_each(|(sum, part)| *sum += part);
        }
        let [input, real, imaginary, output] = sum;
        if input > 0.0 {
            out.push(Band {
                hertz: step_hz * 0.5 * (from + to - 1) as f64,
                response: [real / input, imaginary / input],
                coherence: (real * real + imaginary * imaginary) / (input * output).max(1e-300),
                input: density * input / (to - from) as f64,
            });
        }
        from = to;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers between -1 and 1 that look like noise.
    fn noise(seed: u64, rows: usize) -> Vec<f64> {
        let mut state = seed;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as f64 / f64::from(1u32 << 30) - 1.0
        };
        (0..rows).map(|_| next()).collect()
    }

    #[test]
    fn a_filter_has_the_response_of_its_equation() {
        let (rate, part) = (500.0, 0.1);
        let input = noise(7, 40_000);
        let mut state = 0.0;
        let clean: Vec<f64> = input
            .iter()
            .map(|u| {
                state += part * (u - state);
                state
            })
            .collect();
        let bands = response(&input, &clean, rate);
        assert!(bands.len() > 30, "{}", bands.len());
        for band in &bands {
            // H(z) = part / (1 - (1 - part) z^-1), z = exp(iωT).
            let w = TAU * band.hertz / rate;
            let (re, im) = (1.0 - (1.0 - part) * w.cos(), (1.0 - part) * w.sin());
            let size = re * re + im * im;
            let wanted = [part * re / size, -part * im / size];
            let off = (0..2).map(|i| (band.response[i] - wanted[i]).powi(2)).sum::<f64>().sqrt();
            assert!(off < 0.05 * (wanted[0].hypot(wanted[1])), "{band:?} {wanted:?}");
            assert!(band.coherence > 0.99 && band.coherence < 1.0 + 1e-9, "{band:?}");
        }
        // White noise from -1 to 1 has a variance of 1/3 over half the rate.
        let mean = bands.iter().map(|band| band.input).sum::<f64>() / bands.len() as f64;
        assert!((mean / (1.0 / 3.0 / (0.5 * rate)) - 1.0).abs() < 0.1, "{mean}");
    }

    #[test]
    fn coherence_is_the_part_of_the_power_that_follows() {
        let (input, other) = (noise(1, 60_000), noise(2, 60_000));
        let half: Vec<f64> = input.iter().zip(&other).map(|(a, b)| a + b).collect();
        let mean = |bands: &[Band]| bands.iter().map(|b| b.coherence).sum::<f64>() / bands.len() as f64;
        let fine = |output: &[f64]| response(&input, output, 100.0).split_off(30);
        assert!((mean(&fine(&half)) - 0.5).abs() < 0.05, "{}", mean(&fine(&half)));
        assert!(mean(&fine(&other)) < 0.1, "{}", mean(&fine(&other)));
        assert!(response(&input[..100], &other[..100], 100.0).is_empty(), "too short");
    }
}
