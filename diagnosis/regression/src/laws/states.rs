//! The states of a recording on the coarser grid of the laws, and the scales of the fit.

use crate::data::{Part, Rig};
use crate::filters::{derivative, low_pass, quantile, second_difference, thin_by_mean};
use crate::signals::Signals;
use crate::tiles::Tiling;
use std::f64::consts::TAU;

/// States of one recording; all columns are as long as `q`.
pub struct States {
    /// Step, s.
    pub h: f64,
    /// Time from the recording's start, s.
    pub t: Vec<f64>,
    /// Travel, rad or m.
    pub q: Vec<f64>,
    /// Speed.
    pub v: Vec<f64>,
    /// Acceleration of the low-passed travel.
    pub a: Vec<f64>,
    /// Acceleration in the band in which it is good to a twentieth of the drive's.
    pub seen_a: Vec<f64>,
    /// Mean sign of the speed.
    pub direction: Vec<f64>,
    /// 1 where the axis moves, 0 at rest and near reversals.
    pub moving: Vec<f64>,
    /// Travel since the last reversal.
    pub since: Vec<f64>,
    /// The recorded force of the drive. It is the left side, and no law may read it.
    pub(crate) force: Vec<f64>,
    /// sin of the tilt.
    pub tilt: Option<Vec<f64>>,
    /// Measured external load.
    pub load: Option<Vec<f64>>,
    /// Second difference of what jumps against the motion take from the reading.
    pub jumps: Vec<f64>,
}

/// Scales of the fit recordings.
pub struct Scales {
    /// Band in which forces are compared, Hz; frequency of the lowest coefficient, Hz; lowest rate
    /// of the laws' grid, Hz.
    pub band_hz: f64,
    /// See `band_hz`.
    pub lowest_hz: f64,
    /// See `band_hz`.
    pub rate_hz: f64,
    /// Fast speed, and acceleration that 98 % of the time is not reached.
    pub fast: f64,
    /// See `fast`.
    pub hard: f64,
    /// Travel since reversal that 98 % and 90 % of the time is not reached.
    pub stroke: f64,
    /// See `stroke`.
    pub short_stroke: f64,
    /// Middle and half of the travel of all, and least and most travel of a recording.
    pub middle: f64,
    /// See `middle`.
    pub half_travel: f64,
    /// See `middle`.
    pub least_travel: f64,
    /// See `middle`.
    pub most_travel: f64,
    /// Longest recording, s.
    pub seconds: f64,
    /// Standard deviation of a reading.
    pub noise: f64,
    /// True if the drive supplies a part of the force worth mentioning.
    pub driven: bool,
    /// Force asked for that 98 % of the time is not reached; zero before it is known.
    pub large_asked: f64,
}

impl States {
    /// Thins signals to every `step`th point.
    pub(crate) fn new(s: &Signals, tiling: &Tiling, recording: usize, rig: &Rig) -> Self {
        let step = tiling.cuts[recording].law_step;
        let pick = |x: &Vec<f64>| x.iter().step_by(step).copied().collect::<Vec<f64>>();
        let h = s.h * step as f64;
        let moving: Vec<f64> = s.masked.iter().map(|m| f64::from(u8::from(!m))).collect();
        let force = thin_by_mean(&s.force, step);
        let rms = (force.iter().map(|f| f * f).sum::<f64>() / force.len() as f64).sqrt();
        // White readings have an acceleration of variance σ²·(2π)⁴·2f⁵/(5·rate).
        let error = 0.05 * (rms / rig.inertia.nominal) / (s.noise * TAU * TAU);
        let seen_hz = (error * error * 2.5 * s.rate_hz).powf(0.2);
        let seen_hz = seen_hz.min(2.0 * tiling.band_hz).max(s.narrowest_hz);
        let seen = second_difference(&low_pass(&s.q_raw, s.rate_hz, seen_hz, 4), s.h);
        let v = pick(&s.v);
        Self {
            h,
            t: (0..s.len()).step_by(step).map(|i| i as f64 * s.h).collect(),
            q: pick(&s.q),
            a: derivative(&v, h),
            seen_a: thin_by_mean(&seen, step),
            v,
            direction: thin_by_mean(&s.direction, step),
            moving: thin_by_mean(&moving, step),
            since: pick(&s.since),
            force,
            tilt: s.tilt.as_ref().map(pick),
            load: s.load.as_ref().map(pick),
            jumps: thin_by_mean(&second_difference(&jumps(s, rig), s.h), step),
        }
    }

    /// Returns `f` of every point.
    pub(crate) fn each(&self, f: impl Fn(usize) -> f64) -> Vec<f64> {
        (0..self.q.len()).map(f).collect()
    }
}

/// Counts lost so far, in rad or m: steps of a reading against the motion, as the difference of its
/// means after and before beyond what its speed on both sides makes. They have to be three counts
/// and six times what that difference usually is.
fn jumps(s: &Signals, rig: &Rig) -> Vec<f64> {
    let n = s.len();
    // Windows of 0.8 ms; counts that are lost in a row take about as long.
    let w = ((8e-4 * s.rate_hz) as usize).clamp(2, 8);
    let mut out = vec![0.0; n];
    if n < 8 * w {
        return out;
    }
    let mut sums = vec![0.0; n + 1];
    (0..n).for_each(|i| sums[i + 1] = sums[i] + s.q_raw[i]);
    let mean = |from: usize| (sums[from + w] - sums[from]) / w as f64;
    let step = |i: usize| {
        let [before, after] = [mean(i - 2 * w), mean(i + w)];
        let speeds = mean(i + 2 * w) - after + before - mean(i - 3 * w);
        after - before - 1.5 * speeds
    };
    let inside = 3 * w..n - 3 * w;
    let seen = |i: usize| inside.contains(&i) && !s.masked[i];
    let steps: Vec<f64> = (0..n).map(|i| if seen(i) { step(i) } else { 0.0 }).collect();
    let usual = quantile(steps.iter().filter(|x| **x != 0.0).map(|x| x.abs()), 0.5) / 0.674;
    let least = (3.0 / rig.counts_per_unit).max(6.0 * usual);
    let mut lost = 0.0;
    for i in 0..n {
        let near = i.saturating_sub(3 * w)..(i + 3 * w + 1).min(n);
        let against = steps[i].abs() > least && steps[i] * s.v[i] < 0.0;
        // Beside a step, where it falls between two outer windows, the difference has the other
        // sign.
        let smaller = |k: usize| {
            let (other, this) = (steps[k] * steps[i].signum(), steps[i].abs());
            other < this || (k >= i && other == this)
        };
        if against && near.clone().all(smaller) {
            lost -= steps[i];
        }
        out[i] = lost;
    }
    out
}

impl Scales {
    /// Scales of the fit recordings alone; rates are of all.
    pub(crate) fn new(signals: &[Signals], states: &[States], parts: &[Part], tiling: &Tiling) -> Self {
        let fit: Vec<usize> = (0..parts.len()).filter(|i| parts[*i] == Part::Fit).collect();
        let quantile_of = |f: fn(&States) -> &Vec<f64>, p: f64| {
            quantile(fit.iter().flat_map(|i| f(&states[*i]).iter().map(|x| x.abs())), p) + 1e-30
        };
        let bound = |p: f64| fit.iter().map(move |i| quantile(states[*i].q.iter().copied(), p));
        let low = bound(0.005).fold(f64::INFINITY, f64::min);
        let high = bound(0.995).fold(f64::NEG_INFINITY, f64::max);
        let most = |f: &dyn Fn(usize) -> f64| fit.iter().map(|i| f(*i)).fold(0.0, f64::max);
        let travels = fit.iter().map(|i| numerics::spread::spread(&states[*i].q));
        Self {
            band_hz: tiling.band_hz,
            lowest_hz: tiling.rows.iter().map(|r| r.hz).fold(f64::INFINITY, f64::min),
            rate_hz: states.iter().map(|s| 1.0 / s.h).fold(f64::INFINITY, f64::min),
            fast: most(&|i| signals[i].fast),
            hard: quantile_of(|s| &s.a, 0.98),
            stroke: quantile_of(|s| &s.since, 0.98),
            short_stroke: quantile_of(|s| &s.since, 0.9),
            middle: 0.5 * (low + high),
            half_travel: (0.5 * (high - low)).max(1e-12),
            least_travel: travels.clone().fold(f64::INFINITY, f64::min),
            most_travel: travels.fold(0.0, f64::max),
            seconds: most(&|i| signals[i].h * signals[i].len() as f64),
            noise: most(&|i| signals[i].noise),
            driven: true,
            large_asked: 0.0,
        }
    }
}
