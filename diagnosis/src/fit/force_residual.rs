//! The force residual that people see: one estimator, the same for the nominal, the refitted and
//! the patched model.
//!
//! A fixed-interval smoother whose disturbance state is a random walk is a low-pass of sixth order
//! without phase, exact under uneven time stamps; its bandwidth is what the report states.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::{Noise, Observed};
use crate::fit::input::Total;
use crate::fit::smoother::{Knows, motion};
use std::f64::consts::TAU;

/// Largest bandwidth, Hz.
const WIDEST_HZ: f64 = 50.0;
const NARROWEST_HZ: f64 = 3.0;
/// Part of the force that sensor noise may be in it: more hides the missing physics.
const NOISY: f64 = 0.01;

/// The estimator for some recordings.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Estimator {
    pub(crate) bandwidth_hz: f64,
}

impl Estimator {
    /// Chooses the bandwidth at which sensor noise stays below [`NOISY`] of the acceleration
    /// `scale`.
    pub(crate) fn new(tracks: &[BlockedRecording], noise: &Noise, scale: f64) -> Self {
        let slowest = tracks.iter().map(BlockedRecording::block_rate).fold(f64::INFINITY, f64::min);
        let mut hz = WIDEST_HZ.min(0.25 * slowest);
        while hz > NARROWEST_HZ && sensor_noise(tracks, noise, hz) > NOISY * scale {
            hz *= 0.9;
        }
        Self { bandwidth_hz: hz.max(NARROWEST_HZ) }
    }

    /// Acceleration that the inputs do not explain, per block.
    pub(crate) fn residual(&self, track: &BlockedRecording, total: &Total) -> Vec<f64> {
        self.residual_of(track, &track.blocks.z, total)
    }

    /// The force of an input in the band, as an acceleration, per block: what it takes off the
    /// residual.
    pub(crate) fn response(&self, track: &BlockedRecording, input: &Total) -> Vec<f64> {
        let mut out = self.residual_of(track, &vec![0.0; track.block_count()], input);
        out.iter_mut().for_each(|x| *x = -*x);
        out
    }

    /// The same of other readings of the recording.
    fn residual_of(&self, track: &BlockedRecording, z: &[f64], total: &Total) -> Vec<f64> {
        // The same filter everywhere: neither quantisation nor rest changes it.
        let h = 1.0 / track.block_rate();
        let n = track.block_count();
        let even = Observed { z, quantum: &vec![1.0; n], any_force: &vec![false; n], ..track.observed() };
        let tau = 1e3;
        let walk = (TAU * self.bandwidth_hz).powi(6) * h;
        let noise = Noise { sensor: 1.0, white: 0.0, slow: walk * tau / 2.0, tau, rest: 0.0, blur: 0.0 };
        motion(&even, &noise, total, Knows::All).d
    }
}

/// Returns the error of an acceleration estimate of some bandwidth that the sensor alone causes,
/// root mean square.
fn sensor_noise(tracks: &[BlockedRecording], noise: &Noise, hz: f64) -> f64 {
    // ∫ ω⁴/(1 + (ω/ωc)⁶)² df over both sides = ωc⁵/(2π) · 2 · π/36 · 1/sin(5π/6)
    let integral = (TAU * hz).powi(5) / TAU * 2.0 * (std::f64::consts::PI / 36.0)
        / (5.0 * std::f64::consts::PI / 6.0).sin();
    (noise.sensor * counting_density(tracks, hz) * integral).sqrt()
}

/// Density of the error of reading whole counts at the end of a band, rad²·s or m²·s, the mean over
/// recordings.
fn counting_density(tracks: &[BlockedRecording], hz: f64) -> f64 {
    let density = |track: &BlockedRecording| {
        let mut quantum: Vec<f64> = track.blocks.quantum.clone();
        quantum.sort_by(f64::total_cmp);
        // Behind a filter of the reading the axis is known that much worse.
        let lag = track.blocks.filter_s.map_or(0.0, |s| TAU * hz * s);
        quantum[quantum.len() / 2] / track.block_rate() * (1.0 + lag * lag)
    };
    tracks.iter().map(density).sum::<f64>() / tracks.len() as f64
}

impl Estimator {
    /// Blocks that move, of which the model knows something, and that are further from rest than
    /// the estimator reaches: at rest friction is a reaction, and a low-pass would carry it over.
    pub(crate) fn moving(&self, track: &BlockedRecording) -> Vec<bool> {
        let reach = (0.4 / self.bandwidth_hz * track.block_rate()).ceil() as usize;
        let n = track.block_count();
        let mut out = vec![true; n];
        for j in 0..n {
            if track.motion.rest[j] || track.unknown[j] || track.stops_within(j) {
                out[j.saturating_sub(reach)..(j + reach + 1).min(n)].fill(false);
            }
        }
        // The ends of a recording are extrapolated.
        let end = reach.min(n / 4);
        out[..end].fill(false);
        out[n - end..].fill(false);
        if out.iter().filter(|x| **x).count() * 20 < n {
            return track
                .motion
                .rest
                .iter()
                .zip(&track.unknown)
                .map(|(rest, unknown)| !rest && !unknown)
                .collect();
        }
        out
    }

    /// Returns the residual that reading whole counts alone causes on rows that move, root mean
    /// square: the smoothed motion is read anew and goes through the estimator. Slow motion turns
    /// it into a sawtooth that no formula for white noise has.
    pub(crate) fn counting(&self, tracks: &[BlockedRecording], noise: &Noise, count: f64) -> f64 {
        let errors: Vec<Vec<f64>> = tracks
            .iter()
            .map(|track| {
                let read: Vec<f64> =
                    (0..track.block_count()).map(|j| track.counting_error(j, count)).collect();
                self.residual_of(track, &read, &Total::zero(track.block_count()))
            })
            .collect();
        self.rms(&errors, tracks) * noise.sensor.sqrt().max(1.0)
    }

    /// Returns noise under which a fit weighs forces within the band alike and those beyond it the
    /// less the faster they are.
    pub(crate) fn weighing(&self, tracks: &[BlockedRecording], noise: &Noise) -> Noise {
        let hz = self.bandwidth_hz;
        let sensor = noise.white / (counting_density(tracks, hz) * (TAU * hz).powi(4));
        Noise { blur: (sensor - noise.sensor).max(0.0), ..*noise }
    }

    /// Returns the residual that a white disturbance alone causes, as an acceleration, root mean
    /// square.
    pub(crate) fn white(&self, noise: &Noise) -> f64 {
        // ∫ 1/(1 + (f/fc)⁶)² df over both sides = 2·fc · 5/6 · (π/6)/sin(π/6)
        let sixth = std::f64::consts::PI / 6.0;
        (noise.white * 2.0 * self.bandwidth_hz * (5.0 / 6.0) * sixth / sixth.sin()).sqrt()
    }

    /// Root mean square of residuals over the rows that move.
    pub(crate) fn rms(&self, residuals: &[Vec<f64>], tracks: &[BlockedRecording]) -> f64 {
        let (mut sum, mut count) = (0.0, 0.0_f64);
        for (residual, track) in residuals.iter().zip(tracks) {
            for (x, moving) in residual.iter().zip(self.moving(track)) {
                if moving {
                    sum += x * x;
                    count += 1.0;
                }
            }
        }
        if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::recording::Recording;
    use crate::data::rig::Rig;
    use numerics::bootstrap::Random;

    #[test]
    fn a_white_disturbance_leaves_what_is_said() {
        let (dt, white) = (1e-3, 2.5e4);
        let mut random = Random::new(1);
        let mut even = || random.below(1 << 20) as f64 / f64::from(1 << 20) - 0.5;
        let (mut x, mut v) = (0.0, 0.0);
        let mut recording = Recording::default();
        for i in 0..30_000 {
            recording.time_s.push(f64::from(i) * dt);
            recording.command.push(0.0);
            recording.position_counts.push((1000.0_f64 * x).round());
            let a = (12.0 * white / dt).sqrt() * even();
            x += v * dt + 0.5 * a * dt * dt;
            v += a * dt;
        }
        let track = BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.0));
        let estimator = Estimator { bandwidth_hz: 20.0 };
        let residual = estimator.residual(&track, &Total::zero(track.block_count()));
        let inner = &residual[50..residual.len() - 50];
        let rms = (inner.iter().map(|x| x * x).sum::<f64>() / inner.len() as f64).sqrt();
        let said = estimator.white(&Noise { sensor: 1.0, white, slow: 0.0, tau: 1.0, rest: 0.0, blur: 0.0 });
        assert!((rms / said - 1.0).abs() < 0.05, "{rms} instead of {said}");
    }
}
