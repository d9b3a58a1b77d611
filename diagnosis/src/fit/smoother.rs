//! The motion of a recording under a model's input, by the filter alone or by a fixed-interval
//! smoother.

use crate::fit::covariance::{
    Covariance, FilterStep, Noise, Observed, initial, predict, product, times, update,
};
use crate::fit::input::Total;
use crate::fit::reading_lag::LagStep;

/// State at the middle of each block.
#[derive(Debug, Clone)]
pub(crate) struct Motion {
    pub(crate) x: Vec<f64>,
    pub(crate) v: Vec<f64>,
    /// Disturbance acceleration that the inputs do not explain.
    pub(crate) d: Vec<f64>,
    /// Standard deviation of the velocity.
    pub(crate) v_sd: Vec<f64>,
}

impl Motion {
    fn of(blocks: usize) -> Self {
        let none = || vec![0.0; blocks];
        Self { x: none(), v: none(), d: none(), v_sd: none() }
    }

    /// Enters the state at the start of block `j`, of which the input changes the speed by `dv`.
    fn enter(&mut self, j: usize, [q, v, d]: [f64; 3], variance: f64, dv: f64, span: f64) {
        let half = 0.5 * span;
        let a = d + dv / span;
        self.x[j] = q + (v + 0.5 * a * half) * half;
        self.v[j] = v + a * half;
        self.d[j] = d;
        self.v_sd[j] = variance.max(0.0).sqrt();
    }
}

/// The rows that an estimate of the motion in a block may use.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Knows {
    /// Every row of the recording: the fixed-interval smoother, for recordings that are fitted.
    All,
    /// The rows up to the block's own: the filter, for recordings that judge. What knows the rows
    /// to come knows the disturbance from which a force is to be found.
    Past,
}

/// The motion under the model's input.
pub(crate) fn motion(track: &Observed, noise: &Noise, total: &Total, knows: Knows) -> Motion {
    if track.reading_lag.is_empty() {
        motion_of::<3>(track, noise, total, knows)
    } else {
        motion_of::<4>(track, noise, total, knows)
    }
}

fn motion_of<const N: usize>(track: &Observed, noise: &Noise, total: &Total, knows: Knows) -> Motion {
    let filtered = filter::<N>(track, noise, total);
    if knows == Knows::All {
        return smooth(track, noise, total, &filtered);
    }
    let mut out = Motion::of(filtered.len());
    for (j, Filtered { state, covariance, .. }) in filtered.iter().enumerate() {
        let state = [state[0], state[1], state[2]];
        out.enter(j, state, covariance[1][1], total.dv[j], track.span[j]);
    }
    out
}

/// The filter's state after a block's reading.
struct Filtered<const N: usize> {
    state: [f64; N],
    covariance: Covariance<N>,
    innovation: f64,
    variance: f64,
    gain: [f64; N],
}

/// Runs the filter; returns its state after each block's reading.
fn filter<const N: usize>(track: &Observed, noise: &Noise, total: &Total) -> Vec<Filtered<N>> {
    let n = track.blocks();
    let mut filtered: Vec<Filtered<N>> = Vec::with_capacity(n);
    let mut p = initial::<N>(track, noise);
    let mut s = [0.0; N];
    s[0] = track.z[0];
    for j in 0..n {
        let step = FilterStep::<N>::new(track, noise, j);
        let (dv, dq, mut dz) = (total.dv[j], total.dq[j], total.dz[j]);
        let lag = track.reading_lag.get(j);
        if let Some(LagStep { seen, .. }) = lag {
            dz -= seen.dv * dv + seen.dq * dq;
        }
        let innovation = track.z[j] - (product(&step.seen, &s) + dz);
        let (variance, gain, covariance) = update(&p, &step.seen, noise.sensor * track.quantum[j]);
        let state = std::array::from_fn(|i| s[i] + gain[i] * innovation);
        s = times(&step.transition, &state);
        s[0] += dq;
        s[1] += dv;
        if let Some(LagStep { end, .. }) = lag {
            s[3] += end.dv * dv + end.dq * dq;
        }
        p = predict(&covariance, &step);
        filtered.push(Filtered { state, covariance, innovation, variance, gain });
    }
    filtered
}

/// Modified Bryson–Frazier form: later readings come back as an adjoint, and no covariance is
/// inverted (Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, chapter X).
fn smooth<const N: usize>(
    track: &Observed,
    noise: &Noise,
    total: &Total,
    filtered: &[Filtered<N>],
) -> Motion {
    let n = track.blocks();
    let mut out = Motion::of(n);
    // What later readings say: the adjoint and its covariance.
    let (mut adjoint, mut known) = ([0.0; N], [[0.0; N]; N]);
    for j in (0..n).rev() {
        let Filtered { state, covariance, innovation, variance, gain } = &filtered[j];
        let step = FilterStep::<N>::new(track, noise, j);
        let f = &step.transition;
        if j + 1 < n {
            adjoint = transposed_times(f, &adjoint);
            known = between(f, &known);
        }
        let back = times(covariance, &adjoint);
        let less = product(&covariance[1], &times(&known, &covariance[1]));
        let state = [0, 1, 2].map(|i| state[i] - back[i]);
        out.enter(j, state, covariance[1][1] - less, total.dv[j], track.span[j]);
        // Back over the block's own reading.
        let seen = &step.seen;
        let of_gain = product(gain, &adjoint);
        adjoint = std::array::from_fn(|i| adjoint[i] - seen[i] * (of_gain + innovation / variance));
        let mut left = [[0.0; N]; N];
        for (i, row) in left.iter_mut().enumerate() {
            *row = std::array::from_fn(|k| f64::from(u8::from(i == k)) - gain[i] * seen[k]);
        }
        known = between(&left, &known);
        for i in 0..N {
            for k in 0..N {
                known[i][k] += seen[i] * seen[k] / variance;
            }
        }
    }
    out
}

/// Mᵀ·P·M of a symmetric P.
fn between<const N: usize>(m: &[[f64; N]; N], p: &Covariance<N>) -> Covariance<N> {
    let mut out = [[0.0; N]; N];
    let columns: [[f64; N]; N] = std::array::from_fn(|i| std::array::from_fn(|k| m[k][i]));
    for i in 0..N {
        let row = times(p, &columns[i]);
        for j in i..N {
            out[i][j] = product(&row, &columns[j]);
            out[j][i] = out[i][j];
        }
    }
    out
}

fn transposed_times<const N: usize>(m: &[[f64; N]; N], x: &[f64; N]) -> [f64; N] {
    std::array::from_fn(|i| (0..N).map(|k| m[k][i] * x[k]).sum())
}
