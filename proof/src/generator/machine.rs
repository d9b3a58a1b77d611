//! Machines drawn at random: what they weigh, how they rub, how they are read and recorded. Sizes from a hand-held needle
//! device to a heavy ball-screw axis.

use std::f64::consts::TAU;

use super::plant::{Dry, Plant, Train};
use crate::rng::Rng;

/// The requirements of a case on the machine.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Needs {
    /// `Some(true)`: rotary only.
    pub(crate) rotary: Option<bool>,
    /// The recordings must start at about the same place: the effect sits somewhere along the travel.
    pub(crate) place: bool,
    /// No weight, no tilt (they would hide the effect), or both wanted.
    pub(crate) tilt: Option<bool>,
    /// The nominal model has no offset key, and there is none.
    pub(crate) no_offset: bool,
    /// Only machines that turn fast.
    pub(crate) fast: bool,
    /// Only machines without a gear: a turn of the motor is a turn of the load.
    pub(crate) direct: bool,
}

/// A machine, its recorder and its range of work.
#[derive(Clone, Debug)]
pub(crate) struct Machine {
    pub(crate) rotary: bool,
    pub(crate) name: &'static str,
    pub(crate) plant: Plant,
    pub(crate) command_unit: &'static str,
    pub(crate) limit: f64,
    pub(crate) command_step: f64,
    /// Speed that the recordings reach, u/s.
    pub(crate) top_speed: f64,
    /// Travel that the recordings use, u.
    pub(crate) travel: f64,
    /// Rows a second.
    pub(crate) rate: f64,
    /// Duration of a recording, s.
    pub(crate) duration: f64,
    /// True if the rig file states the turn.
    pub(crate) turn_told: bool,
    /// Start spread as the rig file tells it.
    pub(crate) start_spread: Option<f64>,
    pub(crate) offset_key: bool,
    pub(crate) weight_key: bool,
    /// Tilt is recorded.
    pub(crate) tilt: bool,
    pub(crate) clock: Clock,
    pub(crate) stamping: Stamping,
    /// Standard deviation of a reading beyond its rounding, counts, and whether the rig file tells it.
    pub(crate) noise_counts: f64,
    pub(crate) noise_told: bool,
    /// |command| that the recordings exceed in 2 % of their rows; the drive's limit until it is measured.
    pub(crate) peak_command: f64,
    /// Loop bandwidth, rad/s.
    pub(crate) bandwidth: f64,
    /// Disturbance rms as a share of the dry friction, before a strength asks for less.
    pub(crate) noise_share: f64,
}

/// The regularity of the rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Clock {
    Even,
    /// Uniform jitter of ± this share of the interval.
    Jitter(f64),
    /// As a host's clock: normal jitter of this share, and rows missing now and then.
    Host(f64),
}

/// The way in which the time of a row is written down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stamping {
    True,
    /// Off by chance with this standard deviation, s.
    Noisy(f64),
    /// In whole steps of so many s.
    Rounded(f64),
    /// A clock that is fast by so much.
    Fast(f64),
}

impl Stamping {
    /// True if it errs independently at every row.
    pub(crate) fn by_chance(self) -> bool {
        matches!(self, Self::Noisy(_) | Self::Rounded(_))
    }

    /// Returns the times in the file, in whole microseconds, increasing.
    pub(crate) fn of(self, times: &[f64], rng: &mut Rng) -> Vec<f64> {
        let mut last = f64::NEG_INFINITY;
        times
            .iter()
            .map(|&t| {
                let written = match self {
                    Self::True => t,
                    Self::Noisy(sd) => t + sd * rng.bounded_normal(3.0),
                    Self::Rounded(step) => (t / step).round() * step,
                    Self::Fast(by) => t * (1.0 + by),
                };
                last = ((written * 1e6).round() * 1e-6).max(last + 1e-6);
                last
            })
            .collect()
    }
}

impl Machine {
    /// Residual bandwidth in which strengths are defined, Hz: 100, or a twentieth of the rate where that is less.
    pub(crate) fn residual_bandwidth(&self) -> f64 {
        (self.rate / 20.0).min(100.0)
    }

    /// Acceleration that the dry friction alone would make, u/s².
    pub(crate) fn friction_acceleration(&self) -> f64 {
        self.plant.dry.coulomb / self.plant.inertia
    }

    /// Draws a machine. `quick` makes recordings of fewer rows.
    pub(crate) fn draw(rng: &mut Rng, needs: Needs, quick: bool) -> Self {
        let rotary = needs.rotary.unwrap_or_else(|| rng.chance(0.65));
        let family = match (rotary, needs.fast) {
            (true, true) => rng.below(3),
            (true, false) if needs.direct => rng.below(4),
            (true, false) => *rng.pick(&[0, 1, 2, 3, 6, 7]),
            _ => *rng.pick(&[4, 5, 8]),
        };
        let mut cpu = 0.0;
        let mut gear = 1.0;
        let (inertia, friction_acceleration, top_speed, limit, unit, rates, name): (
            f64,
            f64,
            f64,
            f64,
            &'static str,
            &[f64],
            &'static str,
        );
        match family {
            // The needle device of the architecture page, motor and roller.
            0 | 1 => {
                cpu = 4000.0 / TAU;
                inertia = 2.4e-6 * rng.range(0.7, 1.5);
                friction_acceleration = 167.0 * rng.range(0.7, 1.6);
                top_speed = rng.range(15.0, 50.0);
                (limit, unit) = (1.2, "A");
                rates = &[500.0, 1000.0, 2000.0, 5000.0, 10_000.0, 20_000.0];
                name = "needle drive";
            }
            2 => {
                inertia = rng.log_range(1e-5, 1e-3);
                friction_acceleration = rng.log_range(50.0, 300.0);
                top_speed = rng.range(15.0, 80.0);
                (limit, unit) = (rng.range(5.0, 20.0), "A");
                rates = &[250.0, 500.0, 1000.0, 2000.0, 4000.0, 20_000.0];
                name = "servo drive";
            }
            3 => {
                inertia = rng.log_range(5e-3, 5e-2);
                friction_acceleration = rng.log_range(3.0, 20.0);
                top_speed = rng.range(2.0, 10.0);
                (limit, unit) = (rng.range(3.0, 10.0), "A");
                rates = &[50.0, 100.0, 200.0, 440.0, 1000.0];
                name = "direct drive";
            }
            4 => {
                inertia = rng.log_range(0.3, 5.0);
                friction_acceleration = rng.log_range(0.5, 4.0);
                top_speed = rng.range(0.1, 0.5);
                (limit, unit) = (rng.range(2.0, 10.0), "A");
                rates = &[500.0, 1000.0, 2000.0, 5000.0];
                name = "slide";
            }
            // A joint behind a gear: much inertia and much friction, little speed.
            6 | 7 => {
                inertia = rng.log_range(0.05, 2.0);
                friction_acceleration = rng.log_range(5.0, 60.0);
                top_speed = rng.range(0.5, 3.0);
                (limit, unit) = (rng.range(2.0, 15.0), "A");
                rates = &[50.0, 100.0, 250.0, 500.0, 1000.0];
                gear = rng.range(20.0, 160.0).round();
                name = "geared joint";
            }
            // A lead screw or a syringe: its inertia hardly matters.
            8 => {
                inertia = rng.log_range(0.5, 10.0);
                friction_acceleration = rng.log_range(3.0, 30.0);
                top_speed = rng.log_range(0.01, 0.06);
                (limit, unit) = (rng.range(1.0, 10.0), "A");
                rates = &[20.0, 50.0, 100.0, 200.0];
                name = "slow axis";
            }
            _ => {
                inertia = rng.log_range(30.0, 150.0);
                friction_acceleration = rng.log_range(0.2, 0.6);
                top_speed = rng.range(0.15, 0.4);
                (limit, unit) = (10.0, "V");
                rates = &[100.0, 250.0, 500.0, 1000.0];
                name = "ball-screw axis";
            }
        }
        let rate = rng.pick(rates).min(if quick { 5000.0 } else { 20_000.0 });
        let coulomb = inertia * friction_acceleration;
        let gain = if family < 2 { 0.0234 } else { coulomb * rng.range(9.0, 22.0) / limit };
        let bandwidth_hz = (rate / 20.0).min(100.0);
        if cpu == 0.0 {
            // Fine enough that whole counts make 0.3–4 % of the dry friction at the residual bandwidth:
            // white quantisation δ²/12 through d²/dt² up to B.
            let share = rng.log_range(0.003, 0.04);
            let density = 2.0 / rate * TAU.powi(4) * bandwidth_hz.powi(5) / 5.0;
            let count = share * friction_acceleration / (density / 12.0).sqrt();
            let count = count.min(top_speed / 100.0 * 0.1);
            cpu = if rotary { (TAU / count).round() / TAU } else { (1.0 / count).round() };
        }
        let rows = if quick { 7000.0 } else { rng.range(12_000.0, 30_000.0) };
        let slowest = if quick { 20.0 } else { 60.0 };
        let shortest = if quick { 8.0 } else { 12.0 };
        let duration = f64::clamp(rows / rate, shortest, slowest);
        let turn = if rotary { TAU / gear } else { rng.range(2.0, 20.0).round() * 1e-3 };
        let travel = if rotary {
            if gear > 1.0 {
                rng.range(0.6, 2.5)
            } else if needs.place {
                rng.range(1.6, 4.5) * TAU
            } else {
                (top_speed * duration / 6.0).max(3.0 * TAU)
            }
        } else if top_speed < 0.08 {
            rng.range(0.02, 0.1)
        } else {
            rng.range(0.12, 0.4)
        };
        // The speed filter's ripple from one count stays below a third of the dry friction.
        let by_count = (0.3 * friction_acceleration * cpu / 10.0).sqrt();
        let bandwidth = (TAU * rate / 25.0).min(by_count).min(TAU * 12.0);
        let tilt = needs.tilt.unwrap_or_else(|| rng.chance(0.15));
        let weight_key = tilt && needs.tilt != Some(true) && rng.chance(0.7);
        let offset_key = !needs.no_offset && rng.chance(0.75);
        let start_spread = if needs.place {
            Some(travel * rng.range(0.005, 0.02))
        } else if rng.chance(0.4) {
            Some(turn * rng.range(0.02, 0.3))
        } else {
            None
        };
        let clock = match rng.below(4) {
            0 | 1 => Clock::Even,
            2 => Clock::Jitter(rng.range(0.02, 0.15)),
            _ if rate <= 2000.0 => Clock::Host(rng.range(0.02, 0.08)),
            _ => Clock::Jitter(rng.range(0.02, 0.1)),
        };
        // Never so far off that the place read at top speed is more than a count or so wrong.
        let count_time = 1.0 / (cpu * top_speed);
        let stamping = match rng.below(10) {
            0 | 1 => Stamping::Noisy((rng.log_range(0.005, 0.1) / rate).min(count_time)),
            2 => Stamping::Rounded((rng.log_range(0.02, 0.2) / rate).min(2.0 * count_time).max(2e-6)),
            3 => Stamping::Fast(rng.sign() * rng.log_range(1e-5, 2e-4)),
            _ => Stamping::True,
        };
        let noise_counts = if rng.chance(0.3) { rng.log_range(0.2, 2.0) } else { 0.0 };
        Self {
            stamping,
            noise_counts,
            noise_told: rng.chance(0.7),
            rotary,
            name,
            command_unit: unit,
            limit,
            command_step: if family == 0 { limit / 2048.0 } else { limit / 32_768.0 },
            top_speed,
            travel,
            rate,
            duration,
            turn_told: rotary || rng.chance(0.6),
            start_spread,
            offset_key,
            weight_key,
            tilt,
            clock,
            peak_command: limit,
            bandwidth,
            noise_share: rng.log_range(0.015, 0.06),
            plant: Plant {
                inertia,
                viscous: rng.range(0.3, 1.2) * coulomb / top_speed,
                viscous_asymmetry: 0.0,
                dry: Dry { coulomb, ..Dry::default() },
                gain,
                offset: if offset_key { 0.1 * coulomb * rng.bounded_normal(2.0) } else { 0.0 },
                weight: if weight_key { coulomb * rng.range(0.2, 0.8) } else { 0.0 },
                turn,
                delay: 0.0,
                lag: 0.0,
                deadband: None,
                clip: None,
                gain_drift: None,
                ripple: Vec::new(),
                cogging: Vec::new(),
                imbalance: None,
                spring: None,
                damping_profile: None,
                drag: 0.0,
                train: Train::Rigid,
                eccentricity: None,
                lost: None,
                counts_per_unit: cpu,
                foreign: Vec::new(),
            },
        }
    }

    /// Row stamps in whole microseconds, as the file will carry them.
    pub(crate) fn stamps(&self, rng: &mut Rng) -> Vec<f64> {
        let interval = 1.0 / self.rate;
        let count = (self.duration * self.rate) as usize;
        let mut times: Vec<f64> = Vec::with_capacity(count);
        for i in 0..count {
            let jitter = match self.clock {
                Clock::Even => 0.0,
                Clock::Jitter(share) => share * rng.range(-1.0, 1.0),
                Clock::Host(share) => share * rng.bounded_normal(4.0),
            };
            if matches!(self.clock, Clock::Host(_)) && rng.chance(2e-4) {
                continue;
            }
            let t = (((i as f64 + 0.5 + jitter) * interval) * 1e6).round() * 1e-6;
            if times.last().is_none_or(|&last| t > last + 1.5e-6) {
                times.push(t);
            }
        }
        times
    }
}
