//! Machines drawn at random: what they weigh, how they rub, how they are read and recorded. Sizes
//! from a hand-held needle device to a heavy ball-screw axis.

use std::f64::consts::TAU;

use super::clock::{Clock, Stamping};
use super::family::{Needs, Sizes, draw_family};
use super::plant::Plant;
use crate::rng::Rng;

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
    /// Start spread as the rig file gives it.
    pub(crate) start_spread: Option<f64>,
    pub(crate) offset_key: bool,
    pub(crate) weight_key: bool,
    /// Tilt is recorded.
    pub(crate) tilt: bool,
    pub(crate) clock: Clock,
    pub(crate) stamping: Stamping,
    /// Standard deviation of a reading beyond its rounding, counts, and whether the rig file gives
    /// it.
    pub(crate) noise_counts: f64,
    pub(crate) noise_told: bool,
    /// |command| that the recordings exceed in 2 % of their rows; the drive's limit until it is
    /// measured.
    pub(crate) peak_command: f64,
    /// Loop bandwidth, rad/s.
    pub(crate) bandwidth: f64,
    /// Disturbance rms as a share of the dry friction, before a strength asks for less.
    pub(crate) noise_share: f64,
}

impl Machine {
    /// Residual bandwidth in which strengths are defined, Hz: 100, or a twentieth of the rate where
    /// that is less.
    pub(crate) fn residual_bandwidth(&self) -> f64 {
        residual_bandwidth(self.rate)
    }

    /// Acceleration that the dry friction alone would make, u/s².
    pub(crate) fn friction_acceleration(&self) -> f64 {
        self.plant.dry.coulomb / self.plant.inertia
    }

    /// Draws a machine. `quick` makes recordings of fewer rows.
    pub(crate) fn draw(rng: &mut Rng, needs: Needs, quick: bool) -> Self {
        let rotary = needs.rotary.unwrap_or_else(|| rng.chance(0.65));
        let family = draw_family(rng, rotary, needs);
        let sizes = family.draw_sizes(rng);
        let rate = rng.pick(family.rates).min(if quick { 5000.0 } else { 20_000.0 });
        let coulomb = sizes.inertia * sizes.friction_acceleration;
        let gain = family.gain.unwrap_or_else(|| coulomb * rng.range(9.0, 22.0) / sizes.limit);
        let counts_per_unit =
            family.counts_per_unit.unwrap_or_else(|| draw_resolution(rng, rotary, rate, &sizes));
        let duration = draw_duration(rng, rate, quick);
        let turn = if rotary { TAU / sizes.gear } else { rng.range(2.0, 20.0).round() * 1e-3 };
        let travel = draw_travel(rng, rotary, needs.place, &sizes, duration);
        let tilt = needs.tilt.unwrap_or_else(|| rng.chance(0.15));
        let weight_key = tilt && needs.tilt != Some(true) && rng.chance(0.7);
        let offset_key = !needs.no_offset && rng.chance(0.75);
        let machine = Self {
            start_spread: draw_start_spread(rng, needs.place, travel, turn),
            clock: Clock::draw(rng, rate),
            stamping: Stamping::draw(rng, rate, 1.0 / (counts_per_unit * sizes.top_speed)),
            noise_counts: if rng.chance(0.3) { rng.log_range(0.2, 2.0) } else { 0.0 },
            noise_told: rng.chance(0.7),
            rotary,
            name: family.name,
            command_unit: family.unit,
            limit: sizes.limit,
            command_step: sizes.limit / family.command_steps,
            top_speed: sizes.top_speed,
            travel,
            rate,
            duration,
            turn_told: rotary || rng.chance(0.6),
            offset_key,
            weight_key,
            tilt,
            peak_command: sizes.limit,
            bandwidth: loop_bandwidth(rate, sizes.friction_acceleration, counts_per_unit),
            noise_share: rng.log_range(0.015, 0.06),
            plant: Plant::rigid(sizes.inertia, coulomb, gain, turn, counts_per_unit),
        };
        machine.with_drawn_forces(rng)
    }

    /// Draws the viscosity and, where the rig file has keys for them, the offset and the weight.
    fn with_drawn_forces(mut self, rng: &mut Rng) -> Self {
        let coulomb = self.plant.dry.coulomb;
        self.plant.viscous = rng.range(0.3, 1.2) * coulomb / self.top_speed;
        self.plant.offset = if self.offset_key { 0.1 * coulomb * rng.bounded_normal(2.0) } else { 0.0 };
        self.plant.weight = if self.weight_key { coulomb * rng.range(0.2, 0.8) } else { 0.0 };
        self
    }

    /// Row stamps in whole microseconds, as the file will carry them.
    pub(crate) fn stamps(&self, rng: &mut Rng) -> Vec<f64> {
        self.clock.stamps(self.rate, self.duration, rng)
    }
}

/// Draws the encoder's resolution, in counts per unit of travel: fine enough that whole counts make
/// 0.3–4 % of the dry friction at the residual bandwidth.
fn draw_resolution(rng: &mut Rng, rotary: bool, rate: f64, sizes: &Sizes) -> f64 {
    let bandwidth_hz = residual_bandwidth(rate);
    // White quantisation δ²/12 through d²/dt² up to B.
    let share = rng.log_range(0.003, 0.04);
    let density = 2.0 / rate * TAU.powi(4) * bandwidth_hz.powi(5) / 5.0;
    let count = share * sizes.friction_acceleration / (density / 12.0).sqrt();
    let count = count.min(sizes.top_speed / 100.0 * 0.1);
    if rotary { (TAU / count).round() / TAU } else { (1.0 / count).round() }
}

/// Draws the duration of a recording, in s.
fn draw_duration(rng: &mut Rng, rate: f64, quick: bool) -> f64 {
    let rows = if quick { 7000.0 } else { rng.range(12_000.0, 30_000.0) };
    let slowest = if quick { 20.0 } else { 60.0 };
    let shortest = if quick { 8.0 } else { 12.0 };
    f64::clamp(rows / rate, shortest, slowest)
}

/// Draws the travel that the recordings use, in u. `place`: an effect sits somewhere along it.
fn draw_travel(rng: &mut Rng, rotary: bool, place: bool, sizes: &Sizes, duration: f64) -> f64 {
    match rotary {
        true if sizes.gear > 1.0 => rng.range(0.6, 2.5),
        true if place => rng.range(1.6, 4.5) * TAU,
        true => (sizes.top_speed * duration / 6.0).max(3.0 * TAU),
        false if sizes.top_speed < 0.08 => rng.range(0.02, 0.1),
        false => rng.range(0.12, 0.4),
    }
}

/// Draws the spread of the starts that the rig file states, in u. `place`: an effect sits somewhere
/// along the travel.
fn draw_start_spread(rng: &mut Rng, place: bool, travel: f64, turn: f64) -> Option<f64> {
    if place {
        Some(travel * rng.range(0.005, 0.02))
    } else if rng.chance(0.4) {
        Some(turn * rng.range(0.02, 0.3))
    } else {
        None
    }
}

/// Returns the loop's bandwidth, in rad/s, at which the speed filter's ripple from one count stays
/// below a third of the dry friction.
fn loop_bandwidth(rate: f64, friction_acceleration: f64, counts_per_unit: f64) -> f64 {
    let by_count = (0.3 * friction_acceleration * counts_per_unit / 10.0).sqrt();
    (TAU * rate / 25.0).min(by_count).min(TAU * 12.0)
}

/// Residual bandwidth in which strengths are defined, Hz: 100, or a twentieth of the rate where
/// that is less.
fn residual_bandwidth(rate: f64) -> f64 {
    (rate / 20.0).min(100.0)
}
