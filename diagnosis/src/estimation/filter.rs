//! The filter behind everything: position, velocity, a disturbance acceleration that comes and goes and, where the rig declares
//! a filter in the reading, how far that lags.
//!
//! Innovations are linear in data and inputs, so a model that is linear in its coefficients becomes ordinary least squares
//! on whitened innovations: weighted by what the sensor and the disturbance leave to be known, never differenced.
//! Because an innovation only holds what the past did not tell, a command that reacts to a disturbance is not mistaken
//! for its cause (prediction-error identification in closed loop, Ljung 1999, chapter 13).

use crate::estimation::input::{Input, Total};
use crate::estimation::reading_lag::LagStep;
use crate::numerics::parallel;
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

/// A view of a recording for the filter, block by block.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Observed<'a> {
    /// Start and length of each block, s.
    pub(crate) start: &'a [f64],
    pub(crate) span: &'a [f64],
    /// Mean over the rows of the time since the block's start, s, and of half its square, s².
    pub(crate) tau1: &'a [f64],
    pub(crate) tau2: &'a [f64],
    /// The lag of the reading, if the rig declares a filter in it.
    pub(crate) reading_lag: &'a [LagStep],
    /// Mean reading, and its variance from quantisation alone.
    pub(crate) z: &'a [f64],
    pub(crate) quantum: &'a [f64],
    /// Blocks where the axis rests, and where it is stuck.
    pub(crate) rest: &'a [bool],
    pub(crate) stuck: &'a [bool],
}

impl Observed<'_> {
    pub(super) fn blocks(&self) -> usize {
        self.span.len()
    }
}

/// Gains of the filter over one recording; they do not depend on the data.
#[derive(Debug, Clone)]
pub(crate) struct Gains {
    k: Vec<[f64; 4]>,
    /// 1/√S.
    pub(crate) weight: Vec<f64>,
    rho: Vec<f64>,
    /// −½ Σ ln S.
    pub(crate) log_det: f64,
}

/// A covariance of the states position, speed, disturbance and, as the fourth where the rig declares a filter in the
/// reading, the lag of the reading.
pub(super) type Covariance<const N: usize> = [[f64; N]; N];

/// One block: what the state becomes over it, what of the state its mean reading shows, and the noise that it adds.
pub(super) struct Step<const N: usize> {
    pub(super) transition: [[f64; N]; N],
    pub(super) seen: [f64; N],
    noise: Covariance<N>,
}

impl<const N: usize> Step<N> {
    pub(super) fn new(track: &Observed, noise: &Noise, j: usize) -> Self {
        let h = track.span[j];
        let white = if track.rest[j] { noise.rest.max(noise.white) } else { noise.white };
        let rho = (-h / noise.tau).exp();
        let mut step = Self { transition: [[0.0; N]; N], seen: [0.0; N], noise: [[0.0; N]; N] };
        step.transition[0][..3].copy_from_slice(&[1.0, h, 0.5 * h * h]);
        step.transition[1][..3].copy_from_slice(&[0.0, 1.0, h]);
        step.transition[2][2] = rho;
        step.seen[..3].copy_from_slice(&[1.0, track.tau1[j], track.tau2[j]]);
        step.noise[0][..2].copy_from_slice(&[white * h * h * h / 3.0, white * h * h / 2.0]);
        step.noise[1][..2].copy_from_slice(&[white * h * h / 2.0, white * h]);
        step.noise[2][2] = noise.slow * (1.0 - rho * rho);
        if let (4, Some(lag)) = (N, track.reading_lag.get(j)) {
            let LagStep { end, seen, white: by_white } = lag;
            step.transition[3].copy_from_slice(&[0.0, end.speed, end.acceleration, end.lag]);
            step.seen[1] -= seen.speed;
            step.seen[2] -= seen.acceleration;
            step.seen[3] = -seen.lag;
            for (other, unit) in [0, 1, 3].into_iter().zip(by_white) {
                step.noise[3][other] = white * unit;
                step.noise[other][3] = white * unit;
            }
        }
        step
    }
}

/// Variance of the position at the start over that of one reading: practically unknown, and far from rounding errors.
const DIFFUSE: f64 = 1e4;

pub(super) fn initial<const N: usize>(track: &Observed, noise: &Noise) -> Covariance<N> {
    let reach = track.z.iter().fold(0.0_f64, |m, z| m.max(z.abs())).max(1e-12);
    let duration = track.start[track.blocks() - 1].max(1e-3);
    let speed = 100.0 * reach / duration.min(1.0);
    // Where the reading's own error is the larger, the start has to be unsure against that: an estimator may count in errors
    // of one, whatever the unit of length.
    let error = DIFFUSE * noise.sensor * track.quantum[0];
    let span = track.span[0].max(1e-9);
    let mut p = [[0.0; N]; N];
    p[0][0] = (reach * reach).max(error);
    p[1][1] = (speed * speed).max(error / (span * span));
    p[2][2] = noise.slow;
    if N == 4 {
        // Same variance as the position it is differenced from.
        p[3][3] = p[0][0];
    }
    p
}

/// Measurement update: innovation variance, gain, covariance after it.
pub(super) fn update<const N: usize>(
    p: &Covariance<N>,
    seen: &[f64; N],
    r: f64,
) -> (f64, [f64; N], Covariance<N>) {
    let a = times(p, seen);
    let s = product(seen, &a) + r;
    let k = a.map(|a| a / s);
    let mut after = *p;
    for i in 0..N {
        for j in i..N {
            after[i][j] -= k[i] * a[j];
            after[j][i] = after[i][j];
        }
    }
    (s, k, after)
}

pub(super) fn predict<const N: usize>(p: &Covariance<N>, step: &Step<N>) -> Covariance<N> {
    let f = &step.transition;
    let mut out = step.noise;
    for i in 0..N {
        // Row of F·P, for P is symmetric.
        let row = times(p, &f[i]);
        for j in i..N {
            out[i][j] += product(&row, &f[j]);
            out[j][i] = out[i][j];
        }
    }
    out
}

pub(super) fn product<const N: usize>(a: &[f64; N], b: &[f64; N]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

pub(super) fn times<const N: usize>(m: &[[f64; N]; N], x: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| product(&m[i], x))
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

/// Inputs that go through the filter together.
const SIDE_BY_SIDE: usize = 4;

/// Innovations at the start that only find the state.
fn settling(track: &Observed) -> usize {
    if track.reading_lag.is_empty() { 3 } else { 4 }
}

/// The filter's state on its way through a recording, for `L` inputs side by side. Each step of one input waits for the step
/// before it; several keep the processor busy meanwhile, and each gives the same bits as alone.
struct Walk<'a, const L: usize> {
    gains: &'a Gains,
    track: &'a Observed<'a>,
    settling: usize,
    position: [f64; L],
    speed: [f64; L],
    disturbance: [f64; L],
    lag: [f64; L],
}

/// The effect of inputs over a block: changes of speed, of position and of the reading.
struct Change<const L: usize> {
    dv: [f64; L],
    dq: [f64; L],
    dz: [f64; L],
}

impl<'a, const L: usize> Walk<'a, L> {
    fn new(gains: &'a Gains, track: &'a Observed<'a>, position: f64) -> Self {
        let zero = [0.0; L];
        let position = [position; L];
        Self { gains, track, settling: settling(track), position, speed: zero, disturbance: zero, lag: zero }
    }

    /// Returns the whitened innovations of a block with a mean reading.
    fn step(&mut self, j: usize, reading: f64, change: &Change<L>) -> [f64; L] {
        let (track, h, k) = (self.track, self.track.span[j], &self.gains.k[j]);
        let lag = track.reading_lag.get(j);
        let (tau1, tau2, rho) = (track.tau1[j], track.tau2[j], self.gains.rho[j]);
        let mut innovations = [0.0; L];
        for (i, innovation) in innovations.iter_mut().enumerate() {
            let (v, d) = (self.speed[i], self.disturbance[i]);
            let (dv, dq, dz) = (change.dv[i], change.dq[i], change.dz[i]);
            let behind = lag.map_or(0.0, |LagStep { seen, .. }| {
                seen.lag * self.lag[i] + seen.speed * v + seen.acceleration * d + seen.dv * dv + seen.dq * dq
            });
            let e = reading - (self.position[i] + v * tau1 + d * tau2 + dz - behind);
            let (q, v, d) = (self.position[i] + k[0] * e, v + k[1] * e, d + k[2] * e);
            if let Some(LagStep { end, .. }) = lag {
                let own = end.lag * (self.lag[i] + k[3] * e);
                self.lag[i] = own + end.speed * v + end.acceleration * d + end.dv * dv + end.dq * dq;
            }
            self.position[i] = q + (v + 0.5 * d * h) * h + dq;
            self.speed[i] = v + d * h + dv;
            self.disturbance[i] = d * rho;
            *innovation = e;
        }
        if j < self.settling { [0.0; L] } else { innovations.map(|e| e * self.gains.weight[j]) }
    }
}

impl Gains {
    /// Runs the covariance over a recording.
    pub(crate) fn new(track: &Observed, noise: &Noise) -> Self {
        if track.reading_lag.is_empty() { Self::of::<3>(track, noise) } else { Self::of::<4>(track, noise) }
    }

    fn of<const N: usize>(track: &Observed, noise: &Noise) -> Self {
        let n = track.blocks();
        let mut gains = Self {
            k: Vec::with_capacity(n),
            weight: Vec::with_capacity(n),
            rho: Vec::with_capacity(n),
            log_det: 0.0,
        };
        let mut p = initial::<N>(track, noise);
        let settling = settling(track);
        for j in 0..n {
            let step = Step::<N>::new(track, noise, j);
            let (s, k, after) = update(&p, &step.seen, noise.sensor * track.quantum[j]);
            p = predict(&after, &step);
            let mut of_all = [0.0; 4];
            of_all[..N].copy_from_slice(&k);
            gains.k.push(of_all);
            gains.weight.push(1.0 / s.sqrt());
            gains.rho.push(step.transition[2][2]);
            if j >= settling {
                gains.log_det -= 0.5 * s.ln();
            }
        }
        gains
    }

    /// Whitened innovations of the data under a model's total input.
    pub(crate) fn innovations(&self, track: &Observed, total: &Total) -> Vec<f64> {
        let mut walk = Walk::<1>::new(self, track, track.z[0]);
        (0..track.blocks())
            .map(|j| {
                let change = Change { dv: [total.dv[j]], dq: [total.dq[j]], dz: [total.dz[j]] };
                walk.step(j, track.z[j], &change)[0]
            })
            .collect()
    }

    /// Returns the response of the whitened innovations to one unit of an input, with the sign of a regressor.
    pub(crate) fn response(&self, track: &Observed, input: &Input) -> Vec<f64> {
        let [response] = self.responses_of(track, [input]);
        response
    }

    /// Returns the same for each of several inputs, in less time than one by one.
    pub(crate) fn responses(&self, track: &Observed, inputs: &[&Input]) -> Vec<Vec<f64>> {
        let mut responses = Vec::with_capacity(inputs.len());
        for some in inputs.chunks(SIDE_BY_SIDE) {
            match *some {
                [a] => responses.extend(self.responses_of(track, [a])),
                [a, b] => responses.extend(self.responses_of(track, [a, b])),
                [a, b, c] => responses.extend(self.responses_of(track, [a, b, c])),
                [a, b, c, d] => responses.extend(self.responses_of(track, [a, b, c, d])),
                _ => unreachable!("chunks of one to four"),
            }
        }
        responses
    }

    /// Returns the same, shared by several cores.
    pub(crate) fn all_responses(&self, track: &Observed, inputs: &[&Input]) -> Vec<Vec<f64>> {
        let some: Vec<&[&Input]> = inputs.chunks(SIDE_BY_SIDE).collect();
        parallel::map_all(&some, |some| self.responses(track, some)).into_iter().flatten().collect()
    }

    fn responses_of<const L: usize>(&self, track: &Observed, inputs: [&Input; L]) -> [Vec<f64>; L] {
        self.responses_over(track, 0..track.blocks(), |j| {
            let (free, h) = (!track.stuck[j], track.span[j]);
            let mut change = Change { dv: [0.0; L], dq: [0.0; L], dz: [0.0; L] };
            for (i, input) in inputs.iter().enumerate() {
                let of_input = match input {
                    Input::Held(a) => {
                        let a = if free { a[j] } else { 0.0 };
                        [a * h, 0.5 * a * h * h, a * track.tau2[j]]
                    }
                    Input::Rows { dv, dq, dz } if free => [dv[j], dq[j], dz[j]],
                    Input::Rows { .. } => [0.0; 3],
                    Input::Sensor(a) => [0.0, 0.0, a[j]],
                };
                [change.dv[i], change.dq[i], change.dz[i]] = of_input;
            }
            change
        })
    }

    /// Returns the response to a reading that jumps by one from block `over.start` on.
    pub(crate) fn response_to_jump(&self, track: &Observed, over: Range<usize>) -> Vec<f64> {
        let [response] = self.responses_over(track, over, |_| Change { dv: [0.0], dq: [0.0], dz: [1.0] });
        response
    }

    /// Returns the response to a jump of speed by one within block `over.start`.
    pub(crate) fn response_to_impact(&self, track: &Observed, over: Range<usize>) -> Vec<f64> {
        let (at, h) = (over.start, track.span[over.start]);
        let impact = [1.0, 0.5 * h, track.tau2[at] / h];
        let [response] = self.responses_over(track, over, |j| {
            let [dv, dq, dz] = if j == at { impact } else { [0.0; 3] };
            Change { dv: [dv], dq: [dq], dz: [dz] }
        });
        response
    }

    /// Returns the responses to changes of speed, of position and of the reading in some blocks.
    fn responses_over<const L: usize>(
        &self,
        track: &Observed,
        over: Range<usize>,
        changes: impl Fn(usize) -> Change<L>,
    ) -> [Vec<f64>; L] {
        let mut walk = Walk::new(self, track, 0.0);
        let mut responses = std::array::from_fn(|_| Vec::with_capacity(over.len()));
        for j in over {
            let innovations = walk.step(j, 0.0, &changes(j));
            for (response, innovation) in responses.iter_mut().zip(innovations) {
                response.push(-innovation);
            }
        }
        responses
    }
}
