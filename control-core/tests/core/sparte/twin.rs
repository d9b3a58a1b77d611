//! Paper 002's law in floating point, written from the equations.

use control_core::config::{Cutting, Law, Sparte, Wall};
use control_core::units::Newtons;
use control_core::{Config, TickOutput};

/// The twin: force from depth and the core's own speed, whatever happened before.
pub(super) struct Twin {
    sparte: Sparte,
    walls: Vec<(usize, Wall)>,
    given: usize,
    touched: usize,
    origins: Vec<f64>,
    tops: Vec<f64>,
    wall: f64,
    bristles: f64,
    last: f64,
    /// Ticks so far, and whether something happened in the last one: the movement is looked at
    /// every 16 ticks, in the tenth of them, unless there is more to do.
    ticks: u32,
    is_busy: bool,
    has_stopped: bool,
    is_turning: bool,
    /// While it rests: the smallest stretch of the wall, and for how many ticks.
    rest: Option<(f64, u32)>,
    /// Looks since the needle last went on in its direction; the furthest place; in 1, out −1, at
    /// rest 0.
    still: u32,
    furthest: f64,
    direction: f64,
    /// True if rounding has decided that a resting needle goes on: a count's time apart is seen in
    /// the force.
    pub(super) is_tied: bool,
}

/// Stretch of the wall at which a resting needle goes on, and how much of it the core rounds: a
/// wall's reach of 10 mm by 1/K in Q16. Both in mm.
const GOES_ON: (f64, f64) = (0.15, 2e-4);

impl Twin {
    pub(super) fn new(config: &Config) -> Self {
        let Law::Sparte(sparte) = config.patient.law.clone() else { panic!("the twin of sparte") };
        let layers = &config.patient.layers;
        let tops: Vec<f64> = layers.iter().map(|l| l.depth.0.to_num()).collect();
        Self {
            sparte,
            walls: layers.iter().enumerate().filter_map(|(i, l)| Some((i, l.wall?))).collect(),
            given: 0,
            touched: 0,
            origins: tops.clone(),
            tops,
            wall: 0.0,
            bristles: 0.0,
            last: 0.0,
            // One before the start.
            ticks: 1,
            is_busy: false,
            has_stopped: true,
            is_turning: false,
            rest: None,
            still: 0,
            furthest: 0.0,
            direction: 0.0,
            is_tied: false,
        }
    }

    /// A quarter of a mm is a new direction, a quarter of a second without going on a rest.
    fn follow(&mut self, x: f64) {
        let off = x - self.furthest;
        self.still += 1;
        if off * self.direction > 0.0 {
            (self.furthest, self.still) = (x, 0);
        } else if off.abs() >= 0.25 {
            (self.direction, self.furthest, self.still) = (off.signum(), x, 0);
        } else if self.still == 2_500 / 16 {
            (self.direction, self.furthest) = (0.0, x);
        }
        self.is_turning = off.abs() >= 0.1;
        self.has_stopped = self.direction == 0.0 || self.still > 200 / 16 && !self.is_turning;
    }

    pub(super) fn tick(&mut self, out: &TickOutput) -> f64 {
        let force = self.force(out);
        self.ticks += 1;
        let happened = out.transitions.contact | out.transitions.puncture | out.transitions.exit != 0;
        if self.ticks % 16 == 10 && !self.is_busy && !happened {
            self.follow(out.depth.0.to_num());
        }
        self.is_busy = happened;
        force
    }

    fn force(&mut self, out: &TickOutput) -> f64 {
        let (x, v) = (out.depth.0.to_num::<f64>(), out.speed.0.to_num::<f64>());
        let step = x - std::mem::replace(&mut self.last, x);
        let given = self.given;
        self.given += out.transitions.puncture.count_ones() as usize;
        if out.transitions.contact != 0 {
            // Late where the wall above carried it along.
            let top = self.tops[self.touched];
            self.origins[self.touched] = if x - top > 0.3 { x } else { top };
            self.touched += 1;
        }
        if out.transitions.exit != 0 {
            self.touched -= 1;
            self.given = self.given.min(self.walls.iter().filter(|(layer, _)| *layer < self.touched).count());
        }
        let elastic = self.walls.get(self.given).filter(|(layer, _)| *layer < self.touched).map_or(
            0.0,
            |(layer, w)| {
                let travel = x - self.origins[*layer];
                if travel < 0.0 { 0.0 } else { travel * travel / w.elastic.compliance.0.to_num::<f64>() }
            },
        );
        let rate = elastic * (self.sparte.wall_rate.to_num::<f64>() * v).max(-1.0);
        if self.given == 0 || x < self.tops[0] {
            (self.wall, self.bristles, self.rest) = (x, 0.0, None);
            return elastic + rate;
        }
        let innermost = self.tops[..self.touched].iter().rposition(|&top| x >= top).unwrap_or(0);
        let cut = self.sparte.cutting[innermost];
        if self.given > given {
            let left = cut.inwards.0.to_num::<f64>() * self.sparte.after_puncture.to_num::<f64>();
            self.wall = x - left / self.sparte.tracking.0.to_num::<f64>();
        }
        elastic + rate + self.track(cut, elastic, x) + self.rub(step, v)
    }

    fn track(&mut self, cut: Cutting, elastic: f64, x: f64) -> f64 {
        let stiffness = self.sparte.tracking.0.to_num::<f64>();
        let inwards = (cut.inwards.0.to_num::<f64>() - elastic).max(0.0) / stiffness;
        let outwards = cut.outwards.0.to_num::<f64>() / stiffness;
        self.wall = self.wall.max(x - inwards).min(x + outwards);
        let held = self.sparte.friction.sliding.0.to_num::<f64>() / stiffness;
        let stretch = x - self.wall;
        let (least, ticks) = self.rest.unwrap_or((f64::MAX, 0));
        let least = least.min(stretch.abs());
        let beyond = stretch.abs() - least - GOES_ON.0;
        self.is_tied |=
            self.rest.is_some() && !self.has_stopped && !self.is_turning && beyond.abs() < GOES_ON.1;
        let goes_on = self.is_turning || beyond > 0.0;
        let rests = self.has_stopped || self.rest.is_some() && !goes_on;
        self.rest = rests.then_some((least, ticks + 1));
        if rests && stretch.abs() > held {
            let pace = if (200..400).contains(&ticks) { 2.0 } else { 1.0 };
            let share = -pace * (-0.1 / f64::from(self.sparte.relax_ms)).exp_m1();
            self.wall += (stretch - held * stretch.signum()) * share;
        }
        stiffness * (x - self.wall)
    }

    fn rub(&mut self, step: f64, v: f64) -> f64 {
        let f = self.sparte.friction;
        let num = |value: Newtons| value.0.to_num::<f64>();
        let stiffness = f.stiffness.0.to_num::<f64>();
        let ratio = (v.abs() / f.speed.0.to_num::<f64>()).min(4.0);
        let level = num(f.sliding) + (num(f.sticking) - num(f.sliding)) * (-ratio * ratio).exp();
        self.bristles = (self.bristles + step) / (1.0 + stiffness * step.abs() / level);
        let held = stiffness * self.bristles;
        let rate = v - v.abs() * (held / level).clamp(-1.0, 1.0);
        held + rate * f.damping.0.to_num::<f64>() + v * f.viscous.0.to_num::<f64>()
    }
}
