//! One orthonormal lapped transform for every column: coefficients have a frame and a frequency and
//! are one degree of freedom each.

use crate::constants::{
    BAND, BAND_HZ, BAND_WIDEST, FOLDS, FRAME_PERIODS, FRAME_S, FRAMES, LAW_RATE, STRETCHES, THINNED,
};
use crate::data::Part;
use crate::filters::low_pass;
use crate::signals::Signals;
use std::f64::consts::PI;

/// The modified discrete cosine transform with a sine window, frames of `m` (a power of two).
pub(crate) struct Lapped {
    m: usize,
    window: Vec<f64>,
    twiddle: Vec<(f64, f64)>,
    roots: Vec<(f64, f64)>,
}

fn multiply(a: (f64, f64), b: (f64, f64)) -> (f64, f64) {
    (a.0 * b.0 - a.1 * b.1, a.0 * b.1 + a.1 * b.0)
}

impl Lapped {
    /// Prepares a transform of frames of `m` points, a power of two of at least 4.
    pub(crate) fn new(m: usize) -> Self {
        let unit = |angle: f64| (angle.cos(), angle.sin());
        let window = (0..2 * m).map(|n| (PI * (n as f64 + 0.5) / (2 * m) as f64).sin()).collect();
        let twiddle = (0..m / 2).map(|n| unit(-PI * (8 * n + 1) as f64 / (8 * m) as f64)).collect();
        let roots = (0..m / 4).map(|n| unit(-4.0 * PI * n as f64 / m as f64)).collect();
        Self { m, window, twiddle, roots }
    }

    /// Fourier transform of m/2 complex values in place.
    fn fourier(&self, x: &mut [(f64, f64)]) {
        let n = x.len();
        let bits = n.trailing_zeros();
        for i in 0..n {
            let j = i.reverse_bits() >> (usize::BITS - bits.max(1));
            if bits > 0 && i < j {
                x.swap(i, j);
            }
        }
        let mut half = 1;
        while half < n {
            let stride = n / (2 * half);
            for start in (0..n).step_by(2 * half) {
                for k in 0..half {
                    let (a, b) = (x[start + k], multiply(x[start + k + half], self.roots[k * stride]));
                    x[start + k] = (a.0 + b.0, a.1 + b.1);
                    x[start + k + half] = (a.0 - b.0, a.1 - b.1);
                }
            }
            half *= 2;
        }
    }

    /// Appends the first `kept` coefficients of the frame of 2m points `x`.
    pub(crate) fn frame(&self, x: &[f64], kept: usize, out: &mut Vec<f64>) {
        let (m, half) = (self.m, self.m / 2);
        let windowed = |n: usize| x[n] * self.window[n];
        let folded = |n: usize| match n < half {
            true => -windowed(3 * half - 1 - n) - windowed(3 * half + n),
            false => windowed(n - half) - windowed(3 * half - 1 - n),
        };
        let start = |n: usize| multiply((folded(2 * n), folded(m - 1 - 2 * n)), self.twiddle[n]);
        let mut z: Vec<(f64, f64)> = (0..half).map(start).collect();
        self.fourier(&mut z);
        let scale = (2.0 / m as f64).sqrt();
        let coefficient = |k: usize| match k % 2 {
            0 => scale * multiply(z[k / 2], self.twiddle[k / 2]).0,
            _ => -scale * multiply(z[(m - 1 - k) / 2], self.twiddle[(m - 1 - k) / 2]).1,
        };
        out.extend((0..kept).map(coefficient));
    }
}

/// The frames of one recording.
pub(crate) struct Cut {
    /// Points of the grid for one of the laws' (odd), and for one of the transform's.
    pub(crate) law_step: usize,
    pub(crate) stride: usize,
    edge: usize,
    frames: usize,
    kept: usize,
    lapped: Lapped,
}

/// One row of the regression.
#[derive(Clone, Copy)]
pub(crate) struct Row {
    pub(crate) recording: usize,
    /// Counted over all recordings.
    pub(crate) frame: usize,
    pub(crate) fold: usize,
    pub(crate) hz: f64,
}

/// The cuts of all recordings, and the rows that result: those of the fit come first.
pub(crate) struct Tiling {
    /// Band in which forces are compared, Hz.
    pub(crate) band_hz: f64,
    pub(crate) cuts: Vec<Cut>,
    pub(crate) rows: Vec<Row>,
    pub(crate) fit_rows: usize,
    pub(crate) fit_frames: usize,
    pub(crate) frames: usize,
}

impl Tiling {
    /// Cuts recordings, the fit's first. The band follows from sampling rates alone.
    pub(crate) fn new(signals: &[Signals], parts: &[Part]) -> Self {
        let rate = signals.iter().map(|s| s.rate_hz).fold(f64::INFINITY, f64::min);
        let band_hz = (BAND * rate).max(BAND_HZ.0).min(BAND_WIDEST * rate).min(BAND_HZ.1);
        let of_fit = signals.iter().zip(parts).filter(|(_, part)| **part == Part::Fit);
        let seconds: f64 = of_fit.map(|(s, _)| s.h * s.len() as f64).sum();
        let frame_s = (seconds / FRAMES).min(FRAME_S).max(FRAME_PERIODS / band_hz);
        let cuts: Vec<Cut> = signals.iter().map(|s| Cut::new(s, band_hz, frame_s)).collect();
        let mut tiling = Self { band_hz, cuts, rows: Vec::new(), fit_rows: 0, fit_frames: 0, frames: 0 };
        for (recording, part) in parts.iter().enumerate() {
            let cut = &tiling.cuts[recording];
            let stretches = STRETCHES.min(cut.frames).max(1);
            for frame in 0..cut.frames {
                let fold = frame * stretches / cut.frames % FOLDS;
                let rate = signals[recording].rate_hz / cut.stride as f64;
                let hz = |k: usize| (k as f64 + 0.5) * rate / (2 * cut.lapped.m) as f64;
                let frame = tiling.frames + frame;
                tiling.rows.extend((0..cut.kept).map(|k| Row { recording, frame, fold, hz: hz(k) }));
            }
            tiling.frames += cut.frames;
            if *part == Part::Fit {
                (tiling.fit_rows, tiling.fit_frames) = (tiling.rows.len(), tiling.frames);
            }
        }
        tiling
    }

    /// Appends the coefficients of a column that has every `step`th point of the grid (1, or the
    /// cut's `law_step`).
    pub(crate) fn transform(
        &self,
        recording: usize,
        rate_hz: f64,
        x: &[f64],
        step: usize,
        out: &mut Vec<f64>,
    ) {
        let cut = &self.cuts[recording];
        let smooth = low_pass(x, rate_hz / step as f64, self.band_hz, 4);
        let m = cut.lapped.m;
        let last = smooth.len().saturating_sub(1);
        let places = (0..(cut.frames + 1) * m).map(|i| (cut.edge + i * cut.stride) / step);
        let thinned: Vec<f64> =
            places.map(|i| smooth.get(i).or(smooth.get(last)).copied().unwrap_or(0.0)).collect();
        for frame in 0..cut.frames {
            cut.lapped.frame(&thinned[frame * m..(frame + 2) * m], cut.kept, out);
        }
    }
}

impl Cut {
    fn new(signals: &Signals, band_hz: f64, frame_s: f64) -> Self {
        let (rate, n) = (signals.rate_hz, signals.len());
        let law_step = ((rate / (LAW_RATE * band_hz)) as usize).max(1);
        let law_step = law_step - (law_step + 1) % 2;
        let stride = law_step * ((rate / (THINNED * band_hz) / law_step as f64) as usize).max(1);
        let edge = ((rate / band_hz) as usize).min(n / STRETCHES);
        let edge = edge - edge % law_step;
        let thinned = (n - 2 * edge).div_ceil(stride);
        let wanted = frame_s * rate / stride as f64;
        // A short recording still has a handful of frames.
        let most = (thinned / FOLDS).max(4) as f64;
        let m = 1 << (wanted.min(most).max(4.0).log2().round() as usize).max(2);
        let thinned_rate = rate / stride as f64;
        let kept = (0.95 * band_hz * (2 * m) as f64 / thinned_rate - 0.5).ceil().max(1.0) as usize;
        let frames = (thinned / m).saturating_sub(1);
        Self { law_step, stride, edge, frames, kept: kept.min(m), lapped: Lapped::new(m) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The transform by its definition.
    fn direct(x: &[f64], m: usize, k: usize) -> f64 {
        let term = |n: usize| {
            let angle = PI / m as f64 * (n as f64 + 0.5 + m as f64 / 2.0) * (k as f64 + 0.5);
            x[n] * angle.cos() * (PI * (n as f64 + 0.5) / (2 * m) as f64).sin()
        };
        (2.0 / m as f64).sqrt() * (0..2 * m).map(term).sum::<f64>()
    }

    #[test]
    fn the_fast_transform_is_the_definition() {
        for m in [4, 8, 64] {
            let x: Vec<f64> = (0..2 * m).map(|i| ((i * i) as f64 * 0.37).sin()).collect();
            let mut fast = Vec::new();
            Lapped::new(m).frame(&x, m, &mut fast);
            for (k, fast) in fast.iter().enumerate() {
                assert!((fast - direct(&x, m, k)).abs() < 1e-12, "m {m}, k {k}: {fast}");
            }
        }
    }

    #[test]
    fn frames_of_the_transform_are_orthonormal_and_lap_to_the_whole() {
        let (m, frames) = (16, 6);
        let lapped = Lapped::new(m);
        let rows = |n: usize| -> Vec<f64> {
            let mut x = vec![0.0; (frames + 1) * m];
            x[n] = 1.0;
            let mut out = Vec::new();
            (0..frames).for_each(|j| lapped.frame(&x[j * m..(j + 2) * m], m, &mut out));
            out
        };
        // Unit impulses away from the two outer half frames keep their inner products.
        for a in m..frames * m {
            for b in [a, a + 1, a + m / 2, a + m].into_iter().filter(|b| *b < frames * m) {
                let product: f64 = rows(a).iter().zip(rows(b)).map(|(x, y)| x * y).sum();
                let expected = if a == b { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-12, "{a} {b}: {product}");
            }
        }
    }
}
