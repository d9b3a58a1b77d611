//! The drive of the machine: open-loop commands, motion profiles, and the loop that follows them.
//! The loop runs at the rows of the recording, on counts, so that the recorded command is exactly
//! what the drive was sent.

use std::f64::consts::TAU;

use super::plant::sign;
use crate::rng::Rng;

/// A sum of sines.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tones {
    /// (amplitude, Hz, phase).
    pub(crate) tones: Vec<(f64, f64, f64)>,
}

impl Tones {
    /// `count` tones, logarithmic in frequency, random phases, of `rms` all together.
    pub(crate) fn multisine(rng: &mut Rng, rms: f64, low_hz: f64, high_hz: f64, count: usize) -> Self {
        let each = rms * (2.0 / count as f64).sqrt();
        let ratio = (high_hz / low_hz).ln();
        let tones = (0..count)
            .map(|i| {
                let x = (i as f64 + rng.range(0.2, 0.8)) / count as f64;
                (each, low_hz * (ratio * x).exp(), rng.range(0.0, TAU))
            })
            .collect();
        Self { tones }
    }

    pub(crate) fn at(&self, t: f64) -> f64 {
        self.tones.iter().map(|&(a, hz, phase)| a * (TAU * hz * t + phase).sin()).sum()
    }
}

/// A motion: place, speed and acceleration on an even grid of [`Profile::INTERVAL`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Profile {
    q: Vec<f64>,
    v: Vec<f64>,
}

impl Profile {
    const INTERVAL: f64 = 1e-3;

    /// Follows a list of (speed, duration), changing speed at `acceleration` at most.
    pub(crate) fn from_speeds(segments: &[(f64, f64)], acceleration: f64, duration: f64) -> Self {
        let n = (duration / Self::INTERVAL).ceil() as usize + 2;
        let (mut q, mut v) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let (mut place, mut speed, mut segment, mut left) = (0.0_f64, 0.0_f64, 0_usize, 0.0_f64);
        if let Some(first) = segments.first() {
            left = first.1;
        }
        for _ in 0..n {
            q.push(place);
            v.push(speed);
            while left <= 0.0 && segment + 1 < segments.len() {
                segment += 1;
                left += segments[segment].1;
            }
            let target = if left > 0.0 { segments.get(segment).map_or(0.0, |s| s.0) } else { 0.0 };
            left -= Self::INTERVAL;
            let step = acceleration * Self::INTERVAL;
            let next = speed + (target - speed).clamp(-step, step);
            place += 0.5 * (speed + next) * Self::INTERVAL;
            speed = next;
        }
        Self { q, v }
    }

    /// A motion given as a sum of sines of place, faded in over half a second.
    pub(crate) fn from_tones(tones: &Tones, duration: f64) -> Self {
        let n = (duration / Self::INTERVAL).ceil() as usize + 2;
        let place = |t: f64| (t / 0.5).min(1.0).powi(2) * (tones.at(t) - tones.at(0.0));
        let q: Vec<f64> = (0..n).map(|i| place(i as f64 * Self::INTERVAL)).collect();
        let v = (0..n)
            .map(|i| {
                let t = i as f64 * Self::INTERVAL;
                (place(t + 5e-4) - place(t - 5e-4)) / 1e-3
            })
            .collect();
        Self { q, v }
    }

    /// Place, speed, acceleration at `t`.
    pub(crate) fn at(&self, t: f64) -> (f64, f64, f64) {
        let x = (t / Self::INTERVAL).max(0.0);
        let i = (x as usize).min(self.q.len().saturating_sub(2));
        let f = (x - i as f64).clamp(0.0, 1.0);
        let (q0, v0, v1) = (self.q[i], self.v[i], self.v[i + 1]);
        let a = (v1 - v0) / Self::INTERVAL;
        let dt = f * Self::INTERVAL;
        (q0 + v0 * dt + 0.5 * a * dt * dt, v0 + a * dt, a)
    }

    /// Smallest and largest place.
    #[cfg(test)]
    pub(crate) fn span(&self) -> (f64, f64) {
        self.q.iter().fold((f64::MAX, f64::MIN), |(low, high), &q| (low.min(q), high.max(q)))
    }
}

/// The source of the command.
#[derive(Clone, Debug, Default)]
pub(crate) struct Drive {
    /// Open loop: (level, duration) with linear change over the last field's seconds.
    pub(crate) levels: Vec<(f64, f64)>,
    /// Linear ramps between levels instead of steps.
    pub(crate) ramps: bool,
    /// Added to the command, open or closed.
    pub(crate) tones: Tones,
    /// Closed loop: the motion to follow.
    pub(crate) profile: Option<Profile>,
}

impl Drive {
    /// The open-loop command at `t`.
    pub(crate) fn command(&self, t: f64) -> f64 {
        self.level(t) + self.tones.at(t)
    }

    fn level(&self, t: f64) -> f64 {
        let mut start = 0.0;
        let mut previous = 0.0;
        for &(level, duration) in &self.levels {
            if t < start + duration {
                return if self.ramps {
                    previous + (level - previous) * (t - start) / duration
                } else {
                    level
                };
            }
            previous = level;
            start += duration;
        }
        0.0
    }

    /// Place (from the start), speed, acceleration to follow at `t`; zeros in open loop.
    pub(crate) fn reference(&self, t: f64) -> (f64, f64, f64) {
        self.profile.as_ref().map_or((0.0, 0.0, 0.0), |p| p.at(t))
    }

    /// Returns the signal that is added to a loop's command.
    pub(crate) fn injected(&self, t: f64) -> f64 {
        self.tones.at(t)
    }
}

/// A stretch of a recording with a drive and, under a loop, the loop.
#[derive(Clone, Debug, Default)]
pub(crate) struct Segment {
    /// It begins at this time, s; its own time begins at nothing.
    pub(crate) from: f64,
    /// And lasts so long, s.
    pub(crate) length: f64,
    pub(crate) drive: Drive,
    pub(crate) control: Option<Loop>,
}

impl Segment {
    /// Place (from the start of the recording), speed and acceleration to follow at `t` of the
    /// segment's own time. A loop that begins `away` from the start goes back at about `speed`
    /// while it follows.
    pub(crate) fn reference(&self, t: f64, away: f64, speed: f64) -> (f64, f64, f64) {
        let (q, v, a) = self.drive.reference(t);
        let back = (3.0 * away.abs() / speed).clamp(0.05, 0.6 * self.length.max(0.1));
        let x = (t / back).clamp(0.0, 1.0);
        (q + away * (1.0 - x * x * (3.0 - 2.0 * x)), v - away * 6.0 * x * (1.0 - x) / back, a)
    }
}

/// A digital loop on counts: proportional, derivative on a filtered difference, integral, and
/// feedforward of the nominal inertia, viscosity and dry friction where it is switched on. With a
/// small `kp` it is a velocity loop with integral action.
#[derive(Clone, Debug)]
pub(crate) struct Loop {
    pub(crate) kp: f64,
    pub(crate) kd: f64,
    pub(crate) ki: f64,
    /// Time constant of the speed filter, s.
    pub(crate) filter: f64,
    /// Command per acceleration, per speed, per direction.
    pub(crate) forward: (f64, f64, f64),
    /// Largest command of the integral part.
    pub(crate) most: f64,
    integral: f64,
    speed: f64,
    previous: Option<f64>,
    interval: f64,
}

impl Loop {
    /// A loop of the given bandwidth (rad/s) and damping for an inertia and a gain; `ki` relative
    /// to `kp · bandwidth`.
    pub(crate) fn tuned(inertia: f64, gain: f64, bandwidth: f64, damping: f64, integral: f64) -> Self {
        let kp = inertia * bandwidth * bandwidth / gain;
        Self {
            kp,
            kd: 2.0 * damping * inertia * bandwidth / gain,
            ki: integral * kp * bandwidth,
            filter: 1.0 / (6.0 * bandwidth),
            forward: (0.0, 0.0, 0.0),
            most: f64::INFINITY,
            integral: 0.0,
            speed: 0.0,
            previous: None,
            interval: 0.0,
        }
    }

    /// The command at a row, from the reading there; `next` is the time to the next row.
    pub(crate) fn command(
        &mut self,
        place: f64,
        target: f64,
        speed: f64,
        acceleration: f64,
        next: Option<f64>,
    ) -> f64 {
        if let Some(previous) = self.previous
            && self.interval > 0.0
        {
            let raw = (place - previous) / self.interval;
            self.speed += (raw - self.speed) * (self.interval / (self.interval + self.filter));
        }
        self.previous = Some(place);
        let error = target - place;
        self.interval = next.unwrap_or(self.interval);
        // The integral stops where the loop already asks for much (anti-windup).
        if self.ki == 0.0 || (self.ki * self.integral).abs() < self.most || error * self.integral < 0.0 {
            self.integral += error * self.interval;
        }
        let (fa, fv, fd) = self.forward;
        self.kp * error
            + self.kd * (speed - self.speed)
            + self.ki * self.integral
            + fa * acceleration
            + fv * speed
            + fd * sign(speed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn profile_integrates_its_speed() {
        let p = Profile::from_speeds(&[(2.0, 1.0), (-2.0, 1.0)], 1e6, 2.0);
        let (q, v, _) = p.at(0.5);
        assert!((q - 1.0).abs() < 2e-3 && (v - 2.0).abs() < 1e-9, "{q} {v}");
        assert!(p.at(2.0).0.abs() < 1e-2);
        assert!((p.span().1 - 2.0).abs() < 1e-2);
    }

    #[test]
    fn multisine_has_the_rms_asked_for() {
        let tones = Tones::multisine(&mut Rng::new(1), 0.5, 1.0, 50.0, 40);
        let n = 200_000;
        let mean_square = (0..n).map(|i| tones.at(i as f64 * 1e-3).powi(2)).sum::<f64>() / f64::from(n);
        assert!((mean_square.sqrt() - 0.5).abs() < 0.01, "{}", mean_square.sqrt());
    }
}
