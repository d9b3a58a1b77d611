//! The tilt, the pushes and the disturbances that act on a machine while an excitation plays.

use super::machine::Machine;
use super::series::Series;
use crate::rng::Rng;

/// A tilt that goes slowly between random inclinations, rad.
pub(crate) fn tilt_sweep(m: &Machine, rng: &mut Rng) -> Series {
    let interval = 0.01;
    let count = (m.duration / interval) as usize + 2;
    let stops = 5;
    let values: Vec<f64> = (0..=stops).map(|_| rng.range(-0.7, 0.7)).collect();
    let values = (0..count)
        .map(|i| {
            let x = i as f64 / count as f64 * f64::from(stops);
            let k = (x as usize).min(values.len() - 2);
            let s = x - k as f64;
            values[k] + (values[k + 1] - values[k]) * s * s * (3.0 - 2.0 * s)
        })
        .collect();
    Series { interval, values }
}

/// Pushes of a hand or a press: smooth bumps of either sign, of rms `size` all together.
pub(crate) fn pushes(m: &Machine, size: f64, rng: &mut Rng) -> Series {
    let interval = 0.002;
    let count = (m.duration / interval) as usize + 2;
    let bumps: Vec<(f64, f64, f64)> = (0..(m.duration / 0.7) as usize + 3)
        .map(|_| {
            let amplitude = rng.sign() * rng.range(0.5, 2.0);
            (amplitude, rng.range(0.0, m.duration), rng.range(0.08, 0.35))
        })
        .collect();
    let mut values: Vec<f64> = (0..count)
        .map(|i| {
            let t = i as f64 * interval;
            bumps.iter().map(|&(a, c, w)| a * (-0.5 * ((t - c) / w).powi(2)).exp()).sum()
        })
        .collect();
    let rms = (values.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt();
    values.iter_mut().for_each(|x| *x *= size / rms);
    Series { interval, values }
}

/// Noise and wander of the force with unit rms: band-limited noise, and a slow part at 30–60 % of
/// it.
pub(crate) fn disturbance(m: &Machine, rng: &mut Rng) -> Series {
    let interval: f64 = 5e-4;
    let count = (m.duration / interval) as usize + 2;
    let corner = rng.log_range(5e-4, 6e-3);
    let keep = (-interval / corner).exp();
    let slow_corner: f64 = rng.range(1.5, 5.0);
    let slow_keep = (-interval / slow_corner).exp();
    let slow_share = rng.range(0.3, 0.6);
    let (mut fast, mut slow, mut slower) = (0.0, 0.0, 0.0);
    let (mut fasts, mut slows) = (Vec::with_capacity(count), Vec::with_capacity(count));
    for _ in 0..count {
        fast = keep * fast + rng.normal();
        slow = slow_keep * slow + rng.normal();
        slower += (slow - slower) * (interval / (0.3 * slow_corner));
        fasts.push(fast);
        slows.push(slower);
    }
    let rms = |x: &[f64]| (x.iter().map(|v| v * v).sum::<f64>() / x.len() as f64).sqrt().max(1e-300);
    let (a, b) = (1.0 / rms(&fasts), slow_share / rms(&slows));
    let total = (1.0 + slow_share * slow_share).sqrt();
    Series { interval, values: fasts.iter().zip(&slows).map(|(f, s)| (f * a + s * b) / total).collect() }
}

/// A strong disturbance that depends on nothing recorded: noise of unit rms below a few Hz.
pub(crate) fn rough_disturbance(m: &Machine, rng: &mut Rng) -> Series {
    let interval: f64 = 1e-3;
    let count = (m.duration / interval) as usize + 2;
    let keep = (-interval / rng.log_range(0.01, 0.08)).exp();
    let mut state = 0.0;
    let mut values: Vec<f64> = (0..count)
        .map(|_| {
            state = keep * state + rng.normal();
            state
        })
        .collect();
    let rms = (values.iter().map(|x| x * x).sum::<f64>() / count as f64).sqrt();
    values.iter_mut().for_each(|x| *x /= rms);
    Series { interval, values }
}
