//! The covariance of the filter's state and the gains that follow from it: they depend on the noise
//! and on when rows were read, and on no reading.

use crate::fit::reading_lag::LagStep;

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
    /// Variance that a fit adds to the sensor's, as a multiple too: it hides what is faster than a
    /// band.
    pub(crate) blur: f64,
}

impl Noise {
    /// Variance of a reading as a fit assumes it, as a multiple of the quantisation variance.
    fn reading(&self) -> f64 {
        self.sensor + self.blur
    }
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
    /// Blocks in which any force may act, and those where the axis is stuck.
    pub(crate) any_force: &'a [bool],
    pub(crate) stuck: &'a [bool],
}

impl Observed<'_> {
    pub(super) fn blocks(&self) -> usize {
        self.span.len()
    }
}

/// Gain of the filter at one block.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gain {
    pub(super) k: [f64; 4],
    /// 1/√S.
    pub(super) weight: f64,
    /// The part of the disturbance that is left after the block.
    pub(super) rho: f64,
}

/// A covariance of the states position, speed, disturbance and, as the fourth where the rig
/// declares a filter in the reading, the lag of the reading.
pub(super) type Covariance<const N: usize> = [[f64; N]; N];

/// One block: what the state becomes over it, what of the state its mean reading shows, and the
/// noise that it adds.
pub(super) struct FilterStep<const N: usize> {
    pub(super) transition: [[f64; N]; N],
    pub(super) seen: [f64; N],
    noise: Covariance<N>,
}

impl<const N: usize> FilterStep<N> {
    pub(super) fn new(track: &Observed, noise: &Noise, j: usize) -> Self {
        Self::with_rho(track, noise, j, (-track.span[j] / noise.tau).exp())
    }

    /// The same where the part of the disturbance that is left after the block is known.
    fn with_rho(track: &Observed, noise: &Noise, j: usize, rho: f64) -> Self {
        let h = track.span[j];
        let white = if track.any_force[j] { noise.rest.max(noise.white) } else { noise.white };
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

/// Variance of the position at the start over that of one reading: practically unknown, and far
/// from rounding errors.
const DIFFUSE: f64 = 1e4;

pub(super) fn initial<const N: usize>(track: &Observed, noise: &Noise) -> Covariance<N> {
    let reach = track.z.iter().fold(0.0_f64, |m, z| m.max(z.abs())).max(1e-12);
    let duration = track.start[track.blocks() - 1].max(1e-3);
    let speed = 100.0 * reach / duration.min(1.0);
    // Where the reading's own error is the larger, the start has to be unsure against that: an
    // estimator may count in errors of one, whatever the unit of length.
    let error = DIFFUSE * noise.reading() * track.quantum[0];
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

pub(super) fn predict<const N: usize>(p: &Covariance<N>, step: &FilterStep<N>) -> Covariance<N> {
    let f = &step.transition;
    let mut out = step.noise;
    if N == 3 {
        // The same digits without the zeros and ones of the transition.
        let (h, half, rho) = (f[0][1], f[0][2], f[2][2]);
        let place = |m: usize| p[m][0] + p[m][1] * h + p[m][2] * half;
        let rate = |m: usize| p[m][1] + p[m][2] * h;
        let (place, rate) = ([place(0), place(1), place(2)], [rate(1), rate(2)]);
        out[0][0] += place[0] + place[1] * h + place[2] * half;
        out[0][1] += place[1] + place[2] * h;
        out[0][2] += place[2] * rho;
        out[1][1] += rate[0] + rate[1] * h;
        out[1][2] += rate[1] * rho;
        out[2][2] += p[2][2] * rho * rho;
        (out[1][0], out[2][0], out[2][1]) = (out[0][1], out[0][2], out[1][2]);
        return out;
    }
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

/// Innovations at the start that only find the state.
pub(super) fn settling(track: &Observed) -> usize {
    if track.reading_lag.is_empty() { 3 } else { 4 }
}

/// Runs the covariance over a recording and hands on the gain at each block; returns −½ Σ ln S.
/// `rhos` are the parts of the disturbance that are left after each block, where they are known.
pub(super) fn covariances<const N: usize>(
    track: &Observed,
    noise: &Noise,
    rhos: Option<&[f64]>,
    mut each: impl FnMut(usize, Gain),
) -> f64 {
    let mut log_det = 0.0;
    let mut p = initial::<N>(track, noise);
    let settling = settling(track);
    for j in 0..track.blocks() {
        let step = match rhos {
            Some(rhos) => FilterStep::<N>::with_rho(track, noise, j, rhos[j]),
            None => FilterStep::<N>::new(track, noise, j),
        };
        let (s, own, after) = update(&p, &step.seen, noise.reading() * track.quantum[j]);
        p = predict(&after, &step);
        let mut k = [0.0; 4];
        k[..N].copy_from_slice(&own);
        each(j, Gain { k, weight: 1.0 / s.sqrt(), rho: step.transition[2][2] });
        if j >= settling {
            log_det -= 0.5 * s.ln();
        }
    }
    log_det
}

/// Returns the part of the disturbance that is left after each block if it lasts for `tau`, s.
pub(super) fn rhos(track: &Observed, tau: f64) -> Vec<f64> {
    track.span.iter().map(|h| (-h / tau).exp()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_prediction_is_the_product_of_transition_and_covariance() {
        let p = [[2.0, 0.3, -0.1], [0.3, 1.5, 0.2], [-0.1, 0.2, 0.7]];
        let transition = [[1.0, 0.4, 0.08], [0.0, 1.0, 0.4], [0.0, 0.0, 0.9]];
        let noise = [[0.01, 0.02, 0.0], [0.02, 0.03, 0.0], [0.0, 0.0, 0.04]];
        let step = FilterStep::<3> { transition, seen: [1.0, 0.2, 0.03], noise };
        let predicted = predict(&p, &step);
        for i in 0..3 {
            for j in 0..3 {
                let sum: f64 =
                    (0..9).map(|k| transition[i][k / 3] * p[k / 3][k % 3] * transition[j][k % 3]).sum();
                assert!((predicted[i][j] - sum - noise[i][j]).abs() < 1e-12, "{i} {j}");
            }
        }
    }
}
