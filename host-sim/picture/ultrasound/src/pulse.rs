//! The pulse and the beam as kernels, and the logarithm of what they make.

use crate::probe::Probe;
use crate::scene::SAMPLES;

/// Standard deviation of the pulse's envelope, two periods long.
pub(crate) fn pulse_sigma_mm(probe: &Probe) -> f32 {
    1.54 / probe.mhz / 2.354_82
}

/// Returns the gain that makes up for what a single echo loses when it is spread over the pulse.
pub(crate) fn pulse_gain(probe: &Probe) -> f32 {
    (pulse_sigma_mm(probe) / (probe.depth_mm / SAMPLES as f32)).max(1.0).sqrt()
}

/// Half of a bell curve whose squares, both sides together, sum to 1: it keeps the energy of noise.
pub(crate) fn bell<const TAPS: usize>(sigma: f32) -> [f32; TAPS] {
    let mut taps = [0.0; TAPS];
    for (tap, slot) in taps.iter_mut().enumerate() {
        *slot = (-0.5 * (tap as f32 / sigma.max(0.05)).powi(2)).exp();
    }
    let sum: f32 = taps.iter().enumerate().map(|(tap, w)| w * w * if tap == 0 { 1.0 } else { 2.0 }).sum();
    taps.map(|weight| weight / sum.sqrt())
}

/// Convolves a line with a symmetric kernel.
pub(crate) fn along<const TAPS: usize>(source: &[f32], out: &mut [f32], taps: &[f32; TAPS]) {
    let count = source.len();
    for (out, value) in out.iter_mut().zip(source) {
        *out = taps[0] * value;
    }
    for (tap, weight) in taps.iter().enumerate().skip(1) {
        for ((out, before), after) in out[tap..count - tap].iter_mut().zip(source).zip(&source[2 * tap..]) {
            *out += weight * (before + after);
        }
        for edge in 0..tap {
            out[edge] += weight * source[edge + tap];
            out[count - 1 - edge] += weight * source[count - 1 - edge - tap];
        }
    }
}

/// 10·log₁₀ by the exponent and a parabola in the mantissa: within 0.03 dB.
#[inline]
pub(crate) fn decibels(power: f32) -> f32 {
    let bits = power.max(1e-30).to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits((bits & 0x007F_FFFF) | 0x3F80_0000);
    let log2 = exponent as f32 + (-0.344_845 * mantissa + 2.024_658) * mantissa - 1.674_873;
    3.010_3 * log2
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quick_logarithm_is_near_the_true_one() {
        for step in 0..2_000 {
            let power = 10_f32.powf(-12.0 + 0.007 * step as f32);
            assert!((decibels(power) - 10.0 * power.log10()).abs() < 0.05, "{power}");
        }
    }

    #[test]
    fn bells_keep_the_energy_of_noise() {
        let taps = bell::<6>(2.3);
        let energy: f32 = taps[0].powi(2) + 2.0 * taps[1..].iter().map(|w| w * w).sum::<f32>();
        assert!((energy - 1.0).abs() < 1e-5);
    }
}
