//! The feedforward in floating point, written from the equations.

use control_core::compensation::{Compensation, Gain, Wave};
use control_core::config::Device;
use std::f64::consts::TAU;

/// The twin: what a device asks its drive for, in mN·m, from the equations.
pub(super) struct Twin {
    found: Compensation,
    counts_per_turn: f64,
    radius_mm: f64,
    index: i32,
    waves: f64,
    ripple: f64,
    steady: f64,
    rubbing: f64,
}

impl Twin {
    pub(super) fn new(device: &Device, index: i32) -> Self {
        Self {
            found: device.compensation,
            counts_per_turn: f64::from(device.counts_per_turn),
            radius_mm: device.roller_radius.0.to_num(),
            index,
            waves: 0.0,
            ripple: 0.0,
            steady: 0.0,
            rubbing: 0.0,
        }
    }

    fn sum(&self, waves: &[Wave], count: i32) -> f64 {
        let angle = TAU * f64::from(count - self.index) / self.counts_per_turn;
        let wave = |wave: &Wave| {
            let phase = TAU * f64::from(wave.phase) / 65_536.0;
            wave.amplitude.to_num::<f64>() * (f64::from(wave.order) * angle + phase).sin()
        };
        waves.iter().take_while(|wave| wave.order != 0).map(wave).sum()
    }

    /// A tick once the gains are those asked for; `number` counts from 1.
    pub(super) fn tick(&mut self, number: u32, count: i32, speed: f64, tilt: i16) -> f64 {
        let gain = |gain: Gain| f64::from(gain.0) / 256.0;
        let (found, gains) = (&self.found, &self.found.gains);
        match number % 16 {
            1 => {
                let weight = found.weight.0.to_num::<f64>() * (f64::from(tilt) * 1e-3).sin();
                let offset = found.offset.0.to_num::<f64>();
                self.steady = -gain(gains.weight) * weight - gain(gains.drive) * offset;
            }
            turn if turn % 2 == 0 => self.waves = -gain(gains.angle) * self.sum(&found.angle, count),
            _ => self.ripple = gain(gains.drive) * self.sum(&found.ripple, count),
        }
        let friction = if speed < 0.0 { found.outwards } else { found.inwards };
        let (rest, full) = (found.rest_speed.0.to_num::<f64>(), found.full_speed.0.to_num::<f64>());
        let t = ((speed.abs() - rest) / (full - rest)).clamp(0.0, 1.0);
        let viscous = friction.viscous.0.to_num::<f64>() * self.radius_mm;
        let rubbing = (friction.dry.0.to_num::<f64>() + viscous * speed.abs()) * t * t * (3.0 - 2.0 * t);
        let wanted = rubbing.copysign(speed);
        let has_turned = t > 0.0 && speed * self.rubbing < 0.0;
        let follows = has_turned || wanted.abs() >= self.rubbing.abs();
        // Below the rest speed what was found is the dry part.
        let there = friction.dry.0.to_num::<f64>() + if t > 0.0 { viscous * speed.abs() } else { 0.0 };
        let less = ((self.rubbing.abs() * 32.0).floor() + 1.0) / 65_536.0;
        let left = (self.rubbing.abs() - less).min(there).copysign(self.rubbing);
        self.rubbing = if follows { wanted } else { left };
        let asked = self.waves + gain(gains.friction) * self.rubbing + self.steady;
        let straight = asked * (1.0 - self.ripple);
        let deadband = found.deadband.0.to_num::<f64>();
        let over =
            if deadband > 0.0 { deadband * (straight / (2.0 * deadband)).clamp(-1.0, 1.0) } else { 0.0 };
        straight + gain(gains.drive) * over
    }
}
