//! The filter behind everything: position, velocity, a disturbance acceleration that comes and goes
//! and, where the rig declares a filter in the reading, how far that lags.
//!
//! Innovations are linear in data and inputs, so a model that is linear in its coefficients becomes
//! ordinary least squares on whitened innovations: weighted by the uncertainty that the sensor and
//! the disturbance leave, never differenced. Because an innovation only holds what the past did not
//! predict, a command that reacts to a disturbance is not mistaken for its cause (prediction-error
//! identification in closed loop, Ljung 1999, chapter 13).

use crate::fit::covariance::{Gain, covariances, settling};
pub(crate) use crate::fit::covariance::{Noise, Observed};
use crate::fit::input::{Input, Total};
use crate::fit::reading_lag::LagStep;
use numerics::parallel;
use std::ops::Range;
use std::sync::Arc;

/// Gains of the filter over one recording; they do not depend on the data.
#[derive(Debug, Clone)]
pub(crate) struct Gains {
    k: Arc<Vec<[f64; 4]>>,
    /// 1/√S.
    pub(crate) weight: Vec<f64>,
    rho: Arc<Vec<f64>>,
    /// −½ Σ ln S.
    pub(crate) log_det: f64,
}

/// A stretch whose mean square innovation is above this counts by the logarithm of it: one bad
/// stretch (an impact, a transient that nothing here models) must not decide over the rest.
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

/// The filter's state on its way through a recording, for `L` inputs side by side. Each step of one
/// input waits for the step before it; several keep the processor busy meanwhile, and each gives
/// the same bits as alone.
struct Walk<'a, const L: usize> {
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
    fn new(track: &'a Observed<'a>, position: f64) -> Self {
        let zero = [0.0; L];
        let position = [position; L];
        Self { track, settling: settling(track), position, speed: zero, disturbance: zero, lag: zero }
    }

    /// Returns the whitened innovations of a block with a mean reading.
    #[inline]
    fn step(&mut self, j: usize, gain: &Gain, reading: f64, change: &Change<L>) -> [f64; L] {
        let (track, h, Gain { k, weight, rho }) = (self.track, self.track.span[j], gain);
        let lag = track.reading_lag.get(j);
        let (tau1, tau2) = (track.tau1[j], track.tau2[j]);
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
        if j < self.settling { [0.0; L] } else { innovations.map(|e| e * weight) }
    }
}

/// Whitened innovations of the data under a model's total input, with −½ Σ ln S: as by [`Gains`],
/// in one pass that keeps no gains.
pub(super) fn innovations(track: &Observed, noise: &Noise, rhos: &[f64], total: &Total) -> (Vec<f64>, f64) {
    let mut innovations = Vec::with_capacity(track.blocks());
    let mut walk = Walk::<1>::new(track, track.z[0]);
    let each = |j: usize, gain: Gain| innovations.push(walk.step(j, &gain, track.z[j], &total.at(j))[0]);
    let log_det = match track.reading_lag.is_empty() {
        true => covariances::<3>(track, noise, Some(rhos), each),
        false => covariances::<4>(track, noise, Some(rhos), each),
    };
    (innovations, log_det)
}

impl Total {
    fn at(&self, j: usize) -> Change<1> {
        Change { dv: [self.dv[j]], dq: [self.dq[j]], dz: [self.dz[j]] }
    }
}

impl Gains {
    /// Runs the covariance over a recording.
    pub(crate) fn new(track: &Observed, noise: &Noise) -> Self {
        if track.reading_lag.is_empty() { Self::of::<3>(track, noise) } else { Self::of::<4>(track, noise) }
    }

    fn of<const N: usize>(track: &Observed, noise: &Noise) -> Self {
        let n = track.blocks();
        let (mut k, mut weight, mut rho) =
            (Vec::with_capacity(n), Vec::with_capacity(n), Vec::with_capacity(n));
        let log_det = covariances::<N>(track, noise, None, |_, gain| {
            k.push(gain.k);
            weight.push(gain.weight);
            rho.push(gain.rho);
        });
        Self { k: Arc::new(k), weight, rho: Arc::new(rho), log_det }
    }

    fn at(&self, j: usize) -> Gain {
        Gain { k: self.k[j], weight: self.weight[j], rho: self.rho[j] }
    }

    /// Whitened innovations of the data under a model's total input.
    pub(crate) fn innovations(&self, track: &Observed, total: &Total) -> Vec<f64> {
        let mut walk = Walk::<1>::new(track, track.z[0]);
        (0..track.blocks()).map(|j| walk.step(j, &self.at(j), track.z[j], &total.at(j))[0]).collect()
    }

    /// Returns the response of the whitened innovations to one unit of an input, with the sign of a
    /// regressor.
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
        let mut walk = Walk::new(track, 0.0);
        let mut responses = std::array::from_fn(|_| Vec::with_capacity(over.len()));
        for j in over {
            let innovations = walk.step(j, &self.at(j), 0.0, &changes(j));
            for (response, innovation) in responses.iter_mut().zip(innovations) {
                response.push(-innovation);
            }
        }
        responses
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use crate::fit::blocked_recording::BlockedRecording;
    use crate::fit::covariance::rhos;

    #[test]
    fn one_pass_gives_the_innovations_that_kept_gains_give() {
        for filter_s in [None, Some(2e-3)] {
            let time_s: Vec<f64> = (0..2001).map(|row| f64::from(row) * 1e-3).collect();
            let recording = Recording {
                command: time_s.iter().map(|t| (5.0 * t).sin()).collect(),
                position_counts: time_s.iter().map(|t| (900.0 * (4.0 * t).sin()).round()).collect(),
                time_s,
                ..Recording::default()
            };
            let mut rig = Rig::of_values(0.01, 0.0, 0.0);
            rig.encoder.filter_s = filter_s;
            let track = BlockedRecording::new(&recording, &rig);
            let noise = Noise { sensor: 1.3, white: 2.0, slow: 3.0, tau: 0.02, rest: 1.0, blur: 0.0 };
            let (observed, total) = (track.observed(), track.command_total(10.0));
            let gains = Gains::new(&observed, &noise);
            let (e, log_det) = innovations(&observed, &noise, &rhos(&observed, noise.tau), &total);
            assert_eq!(e, gains.innovations(&observed, &total));
            assert_eq!(log_det, gains.log_det);
            assert!(e.iter().any(|e| e.abs() > 0.1));
        }
    }
}
