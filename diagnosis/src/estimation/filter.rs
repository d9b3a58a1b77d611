//! The filter behind everything: position, velocity and a disturbance acceleration that comes and goes.
//!
//! Innovations are linear in data and inputs, so a model that is linear in its coefficients becomes ordinary least squares
//! on whitened innovations: weighted by what the sensor and the disturbance leave to be known, never differenced.
//! Because an innovation only holds what the past did not tell, a command that reacts to a disturbance is not mistaken
//! for its cause (prediction-error identification in closed loop, Ljung 1999, chapter 13).

use crate::estimation::blocked_recording::{BlockedRecording, Input, Total};
use std::ops::Range;

/// Noise of sensor and disturbance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Noise {
    /// Sensor variance as a multiple of the quantisation variance.
    pub(crate) sensor: f64,
    /// White acceleration, (rad/s²)²·s.
    pub(crate) white: f64,
    /// Variance of the slow disturbance acceleration, (rad/s²)².
    pub(crate) slow: f64,
    /// Its correlation time, s.
    pub(crate) tau: f64,
    /// White acceleration at rest, where friction is a reaction, (rad/s²)²·s.
    pub(crate) rest: f64,
}

/// Gains of the filter over one recording; they do not depend on the data.
#[derive(Debug, Clone)]
pub(crate) struct Gains {
    k: Vec<[f64; 3]>,
    /// 1/√S.
    pub(crate) weight: Vec<f64>,
    rho: Vec<f64>,
    /// −½ Σ ln S.
    pub(crate) log_det: f64,
}

/// Symmetric 3×3: qq qv qd vv vd dd.
type Sym = [f64; 6];

struct Step {
    h: f64,
    rho: f64,
    q: Sym,
}

fn step_of(track: &BlockedRecording, noise: &Noise, j: usize) -> Step {
    let h = track.span[j];
    let white = if track.rest[j] { noise.rest.max(noise.white) } else { noise.white };
    let rho = (-h / noise.tau).exp();
    let q =
        [white * h * h * h / 3.0, white * h * h / 2.0, 0.0, white * h, 0.0, noise.slow * (1.0 - rho * rho)];
    Step { h, rho, q }
}

/// Variance of the place at the start over that of one reading: as good as unknown, and far from rounding.
const DIFFUSE: f64 = 1e4;

fn initial(track: &BlockedRecording, noise: &Noise) -> Sym {
    let reach = track.z.iter().fold(0.0_f64, |m, z| m.max(z.abs())).max(1e-12);
    let duration = track.start[track.blocks() - 1].max(1e-3);
    let speed = 100.0 * reach / duration.min(1.0);
    // Where the reading's own error is the larger, the start has to be unsure against that: an estimator may count in errors
    // of one, whatever the unit of length.
    let error = DIFFUSE * noise.sensor * track.quantum[0];
    let span = track.span[0].max(1e-9);
    [(reach * reach).max(error), 0.0, 0.0, (speed * speed).max(error / (span * span)), 0.0, noise.slow]
}

/// Measurement update: innovation variance, gain, covariance after it.
fn update(p: &Sym, h1: f64, h2: f64, r: f64) -> (f64, [f64; 3], Sym) {
    let a = [p[0] + h1 * p[1] + h2 * p[2], p[1] + h1 * p[3] + h2 * p[4], p[2] + h1 * p[4] + h2 * p[5]];
    let s = a[0] + h1 * a[1] + h2 * a[2] + r;
    let k = [a[0] / s, a[1] / s, a[2] / s];
    let after = [
        p[0] - k[0] * a[0],
        p[1] - k[0] * a[1],
        p[2] - k[0] * a[2],
        p[3] - k[1] * a[1],
        p[4] - k[1] * a[2],
        p[5] - k[2] * a[2],
    ];
    (s, k, after)
}

fn predict(p: &Sym, step: &Step) -> Sym {
    let (h, rho) = (step.h, step.rho);
    let g = 0.5 * h * h;
    // Rows of F·P with F = [1 h g; 0 1 h; 0 0 rho].
    let f0 = [p[0] + h * p[1] + g * p[2], p[1] + h * p[3] + g * p[4], p[2] + h * p[4] + g * p[5]];
    let f1 = [p[1] + h * p[2], p[3] + h * p[4], p[4] + h * p[5]];
    [
        f0[0] + h * f0[1] + g * f0[2] + step.q[0],
        f0[1] + h * f0[2] + step.q[1],
        rho * f0[2] + step.q[2],
        f1[1] + h * f1[2] + step.q[3],
        rho * f1[2] + step.q[4],
        rho * rho * p[5] + step.q[5],
    ]
}

/// A stretch whose mean square innovation is above this counts by the logarithm of it: one bad stretch (an impact, a
/// transient that nothing here models) must not decide over the rest.
const ROBUST_FROM: f64 = 1.5;

/// The cost of a mean square innovation, and the weight that goes with it.
pub(crate) fn robust_loss(mean_square: f64) -> (f64, f64) {
    if mean_square <= ROBUST_FROM {
        (mean_square, 1.0)
    } else {
        (ROBUST_FROM * (1.0 + (mean_square / ROBUST_FROM).ln()), ROBUST_FROM / mean_square)
    }
}

impl Gains {
    /// Runs the covariance over a recording.
    pub(crate) fn new(track: &BlockedRecording, noise: &Noise) -> Self {
        let n = track.blocks();
        let mut gains = Self {
            k: Vec::with_capacity(n),
            weight: Vec::with_capacity(n),
            rho: Vec::with_capacity(n),
            log_det: 0.0,
        };
        let mut p = initial(track, noise);
        for j in 0..n {
            let (s, k, after) = update(&p, track.tau1[j], track.tau2[j], noise.sensor * track.quantum[j]);
            let step = step_of(track, noise, j);
            p = predict(&after, &step);
            gains.k.push(k);
            gains.weight.push(1.0 / s.sqrt());
            gains.rho.push(step.rho);
            if j >= 3 {
                gains.log_det -= 0.5 * s.ln();
            }
        }
        gains
    }

    /// Whitened innovations of the data under a model's total input.
    pub(crate) fn innovations(&self, track: &BlockedRecording, total: &Total) -> Vec<f64> {
        let n = track.blocks();
        let mut out = Vec::with_capacity(n);
        let (mut q, mut v, mut d) = (track.z[0], 0.0, 0.0);
        for j in 0..n {
            let h = track.span[j];
            let e = track.z[j] - (q + v * track.tau1[j] + d * track.tau2[j] + total.dz[j]);
            let k = &self.k[j];
            q += k[0] * e;
            v += k[1] * e;
            d += k[2] * e;
            // The first three innovations only find the initial state.
            out.push(if j < 3 { 0.0 } else { e * self.weight[j] });
            q += (v + 0.5 * d * h) * h + total.dq[j];
            v += d * h + total.dv[j];
            d *= self.rho[j];
        }
        out
    }

    /// What one unit of an input does to the whitened innovations, with the sign of a regressor.
    pub(crate) fn response(&self, track: &BlockedRecording, input: &Input) -> Vec<f64> {
        let all = 0..track.blocks();
        let free = |j: usize| !track.stuck[j];
        match input {
            Input::Held(a) => self.response_over(track, all, |j| {
                let (a, h) = (if free(j) { a[j] } else { 0.0 }, track.span[j]);
                [a * h, 0.5 * a * h * h, a * track.tau2[j]]
            }),
            Input::Rows { dv, dq, dz } => {
                self.response_over(track, all, |j| if free(j) { [dv[j], dq[j], dz[j]] } else { [0.0; 3] })
            }
            Input::Sensor(a) => self.response_over(track, all, |j| [0.0, 0.0, a[j]]),
        }
    }

    /// What a reading that jumps by one from block `over.start` on does there.
    pub(crate) fn response_to_jump(&self, track: &BlockedRecording, over: Range<usize>) -> Vec<f64> {
        self.response_over(track, over, |_| [0.0, 0.0, 1.0])
    }

    /// What a jump of speed by one within block `over.start` does there.
    pub(crate) fn response_to_impact(&self, track: &BlockedRecording, over: Range<usize>) -> Vec<f64> {
        let (at, h) = (over.start, track.span[over.start]);
        let impact = [1.0, 0.5 * h, track.tau2[at] / h];
        self.response_over(track, over, |j| if j == at { impact } else { [0.0; 3] })
    }

    /// What changes of speed, of position and of the reading in some blocks do to the innovations there.
    fn response_over(
        &self,
        track: &BlockedRecording,
        over: Range<usize>,
        input: impl Fn(usize) -> [f64; 3],
    ) -> Vec<f64> {
        let (mut q, mut v, mut d) = (0.0, 0.0, 0.0);
        let mut run = |j: usize| {
            let (h, [dv, dq, dz]) = (track.span[j], input(j));
            let e = q + v * track.tau1[j] + d * track.tau2[j] + dz;
            let k = &self.k[j];
            q -= k[0] * e;
            v -= k[1] * e;
            d -= k[2] * e;
            q += (v + 0.5 * d * h) * h + dq;
            v += d * h + dv;
            d *= self.rho[j];
            if j < 3 { 0.0 } else { e * self.weight[j] }
        };
        over.map(&mut run).collect()
    }
}

/// State at the middle of each block, smoothed over the whole recording.
#[derive(Debug, Clone)]
pub(crate) struct Smoothed {
    pub(crate) x: Vec<f64>,
    pub(crate) v: Vec<f64>,
    /// Disturbance acceleration that the inputs do not explain.
    pub(crate) d: Vec<f64>,
    /// Standard deviation of the velocity.
    pub(crate) v_sd: Vec<f64>,
}

/// Rauch–Tung–Striebel smoother with the model's input.
pub(crate) fn smooth(track: &BlockedRecording, noise: &Noise, total: &Total) -> Smoothed {
    let n = track.blocks();
    let mut after: Vec<([f64; 3], Sym)> = Vec::with_capacity(n);
    let mut p = initial(track, noise);
    let mut s = [track.z[0], 0.0, 0.0];
    for j in 0..n {
        let (h, h1, h2) = (track.span[j], track.tau1[j], track.tau2[j]);
        let e = track.z[j] - (s[0] + s[1] * h1 + s[2] * h2 + total.dz[j]);
        let (_, k, pa) = update(&p, h1, h2, noise.sensor * track.quantum[j]);
        for (s, k) in s.iter_mut().zip(k) {
            *s += k * e;
        }
        after.push((s, pa));
        let step = step_of(track, noise, j);
        s = [
            s[0] + (s[1] + 0.5 * s[2] * h) * h + total.dq[j],
            s[1] + s[2] * h + total.dv[j],
            s[2] * step.rho,
        ];
        p = predict(&pa, &step);
    }
    let mut out = Smoothed { x: vec![0.0; n], v: vec![0.0; n], d: vec![0.0; n], v_sd: vec![0.0; n] };
    let (mut later, mut later_p) = (after[n - 1].0, after[n - 1].1);
    for j in (0..n).rev() {
        let (s, pa) = &after[j];
        let (mut now, mut now_p) = (*s, *pa);
        if j + 1 < n {
            let step = step_of(track, noise, j);
            let pp = predict(pa, &step);
            let (h, rho) = (step.h, step.rho);
            let predicted =
                [s[0] + (s[1] + 0.5 * s[2] * h) * h + total.dq[j], s[1] + s[2] * h + total.dv[j], s[2] * rho];
            let g = smoother_gain(pa, h, rho, &pp);
            let delta = [later[0] - predicted[0], later[1] - predicted[1], later[2] - predicted[2]];
            for (row, now) in g.iter().zip(&mut now) {
                *now += row[0] * delta[0] + row[1] * delta[1] + row[2] * delta[2];
            }
            let mut dp = later_p;
            for (a, b) in dp.iter_mut().zip(&pp) {
                *a -= b;
            }
            let full = |m: &Sym, a: usize, b: usize| m[[[0, 1, 2], [1, 3, 4], [2, 4, 5]][a][b]];
            let places = [(0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)];
            for (place, (a, b)) in places.into_iter().enumerate() {
                let mut sum = 0.0;
                for i in 0..3 {
                    for l in 0..3 {
                        sum += g[a][i] * full(&dp, i, l) * g[b][l];
                    }
                }
                now_p[place] += sum;
            }
        }
        let half = 0.5 * track.span[j];
        let a = now[2] + total.dv[j] / track.span[j];
        out.x[j] = now[0] + (now[1] + 0.5 * a * half) * half;
        out.v[j] = now[1] + a * half;
        out.d[j] = now[2];
        out.v_sd[j] = now_p[3].max(0.0).sqrt();
        later = now;
        later_p = now_p;
    }
    out
}

/// P·Fᵀ·P⁻ of the smoother.
fn smoother_gain(p: &Sym, h: f64, rho: f64, predicted: &Sym) -> [[f64; 3]; 3] {
    let g = 0.5 * h * h;
    let row = |a: f64, b: f64, c: f64| [a + h * b + g * c, b + h * c, rho * c];
    let m = [row(p[0], p[1], p[2]), row(p[1], p[3], p[4]), row(p[2], p[4], p[5])];
    // Scaled so that the inverse is of numbers near one, whatever the units.
    let d = [predicted[0].sqrt(), predicted[3].sqrt(), predicted[5].sqrt()]
        .map(|x| if x > 0.0 { 1.0 / x } else { 0.0 });
    let [a, b, c] = [1.0 + 1e-13, predicted[1] * d[0] * d[1], predicted[2] * d[0] * d[2]];
    let [e, f, i] = [1.0 + 1e-13, predicted[4] * d[1] * d[2], 1.0 + 1e-13];
    let det = a * (e * i - f * f) - b * (b * i - f * c) + c * (b * f - e * c);
    let w = if det.abs() > 1e-300 { 1.0 / det } else { 0.0 };
    let inverse = [
        [(e * i - f * f) * w, (c * f - b * i) * w, (b * f - c * e) * w],
        [(c * f - b * i) * w, (a * i - c * c) * w, (b * c - a * f) * w],
        [(b * f - c * e) * w, (b * c - a * f) * w, (a * e - b * b) * w],
    ];
    let mut out = [[0.0; 3]; 3];
    for (out, m) in out.iter_mut().zip(&m) {
        for (col, out) in out.iter_mut().enumerate() {
            *out = (0..3).map(|l| m[l] * d[l] * inverse[l][col] * d[col]).sum();
        }
    }
    out
}
