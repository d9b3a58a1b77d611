//! The law of Paper 001 that `tick_host` runs, in `f64`: speed, layers, walls, friction in a cone,
//! limits of torque, converter. Written from the equations, as the tests' twin is. It has no
//! observer of passivity and none of the watches (dead encoder, runaway, silent PC).

use control_core::Config;
use control_core::config::{FrictionLaw, Law, Parabola};

/// Ticks of the speed's window.
const WINDOW: usize = 128;
/// A layer is left so far outside its top, mm.
const EXIT_MM: f64 = 0.2;

/// `force = (travel − vertex)² / compliance + base`.
#[derive(Clone, Copy)]
struct Curve {
    vertex: f64,
    per_compliance: f64,
    base: f64,
}

impl Curve {
    fn new(curve: &Parabola) -> Self {
        Self {
            vertex: curve.vertex.0.to_num(),
            per_compliance: 1.0 / curve.compliance.0.to_num::<f64>(),
            base: curve.base.0.to_num(),
        }
    }

    fn force(&self, travel: f64) -> f64 {
        let past = travel - self.vertex;
        past * past * self.per_compliance + self.base
    }
}

#[derive(Clone, Copy)]
struct Wall {
    elastic: Curve,
    relief: Curve,
    puncture: f64,
    unload: f64,
    spring_back: f64,
}

#[derive(Clone)]
struct Layer {
    /// Along the needle, mm.
    top: f64,
    wall: Option<Wall>,
    friction: f64,
    touched: bool,
    open: bool,
    /// The distance from its top at which the wall was met, because it was carried along.
    carried: f64,
    frontier: f64,
}

/// The law with its memory.
pub(crate) struct LawF64 {
    mm_per_count: f64,
    radius: f64,
    damping: f64,
    most: f64,
    slew: f64,
    fade: f64,
    codes_per_mnm: f64,
    mid_scale: f64,
    span: f64,
    hold: f64,
    continuous: f64,
    heating: f64,
    layers: Vec<Layer>,
    window: [i32; WINDOW],
    at: usize,
    anchor: f64,
    faded: f64,
    given: f64,
    heat: f64,
    springing_back: bool,
}

impl LawF64 {
    /// The law of `config`, with a needle at `angle` to the skin, rad.
    pub(crate) fn new(config: &Config, angle: f64) -> Self {
        let (device, patient) = (&config.device, &config.patient);
        let Law::Jog(FrictionLaw::Cone { stiffness }) = &patient.law else {
            panic!("the default law has friction in a cone")
        };
        let layer = |layer: &control_core::config::Layer| Layer {
            top: layer.depth.0.to_num::<f64>() / angle.sin(),
            wall: layer.wall.map(|wall| Wall {
                elastic: Curve::new(&wall.elastic),
                relief: Curve::new(&wall.relief),
                puncture: wall.puncture_travel.0.to_num(),
                unload: wall.unload.0.to_num(),
                spring_back: wall.spring_back.to_num(),
            }),
            friction: layer.friction.0.to_num(),
            touched: false,
            open: false,
            carried: 0.0,
            frontier: 0.0,
        };
        let limits = &device.limits;
        let radius = device.roller_radius.0.to_num::<f64>();
        let span = f64::from(device.dac.span());
        Self {
            mm_per_count: std::f64::consts::TAU * radius / f64::from(device.counts_per_turn),
            radius,
            damping: device.damping.0.to_num(),
            most: limits.torque.0.to_num(),
            slew: limits.slew_per_tick.0.to_num(),
            fade: 1.0 / (f64::from(limits.fade_in_ms) * 10.0),
            codes_per_mnm: span / device.full_scale_torque.0.to_num::<f64>(),
            mid_scale: f64::from(device.dac.mid_scale()),
            span,
            hold: stiffness.0.to_num(),
            continuous: limits.continuous_torque.0.to_num(),
            heating: 1.0 / (f64::from(limits.winding_time_s) * 10_000.0),
            layers: patient.layers.iter().map(layer).collect(),
            window: [0; WINDOW],
            at: 0,
            anchor: 0.0,
            faded: 0.0,
            given: 0.0,
            heat: 0.0,
            springing_back: false,
        }
    }

    /// The converter's code at `count`.
    pub(crate) fn tick(&mut self, count: i32) -> u16 {
        let depth = f64::from(count) * self.mm_per_count;
        let before = std::mem::replace(&mut self.window[self.at], count);
        self.at = (self.at + 1) % WINDOW;
        let speed = f64::from(count - before) * self.mm_per_count * (10_000.0 / WINDOW as f64);
        self.meet(depth);
        let force = self.walls(depth) + self.friction(depth) + speed * self.damping;
        let most = self.allowed();
        let wanted = (-force * self.radius).clamp(-most, most);
        self.faded = (self.faded + self.fade).min(1.0);
        self.given = (wanted * self.faded).clamp(self.given - self.slew, self.given + self.slew);
        self.heat += (self.given * self.given - self.heat) * self.heating;
        let steps = (self.given * self.codes_per_mnm).round().clamp(-self.span, self.span);
        (self.mid_scale + steps) as u16
    }

    /// Falls from the torque limit to the continuous torque over the last fifth of the heat that is
    /// allowed.
    fn allowed(&self) -> f64 {
        let allowed = self.continuous * self.continuous;
        let share = ((allowed - self.heat) * 5.0 / allowed).clamp(0.0, 1.0);
        self.continuous + (self.most - self.continuous) * share
    }

    /// At most one layer touched or left, and one wall that gives way, in a tick.
    fn meet(&mut self, depth: f64) {
        let next = self.layers.iter_mut().find(|layer| !layer.open && layer.wall.is_some());
        if let Some(Layer { wall: Some(wall), touched: true, open, top, carried, frontier, .. }) = next {
            let travel = depth - (*top + *carried);
            if travel >= wall.puncture {
                (*open, *frontier) = (true, travel);
                self.springing_back = true;
            }
        }
        let touched = self.layers.iter().filter(|layer| layer.touched).count();
        let is_free = self.layers[..touched].iter().all(|layer| layer.open || layer.wall.is_none());
        if is_free && touched < self.layers.len() {
            let (moved, gave_way) = self.carried_along(touched);
            let place = self.layers[touched].top + moved;
            if depth >= place {
                let met = if self.springing_back { place.max(gave_way) } else { place };
                let layer = &mut self.layers[touched];
                (layer.touched, layer.open, layer.carried) = (true, false, met - layer.top);
                return;
            }
        }
        match touched.checked_sub(1) {
            Some(last) if depth < self.layers[last].top - EXIT_MM => {
                let layer = &mut self.layers[last];
                (layer.touched, layer.open, layer.carried) = (false, false, 0.0);
            }
            _ => self.springing_back = false,
        }
    }

    /// The extra depth of layer `next` where the tip comes to it, and the tip's place when the last
    /// wall gave way.
    fn carried_along(&self, next: usize) -> (f64, f64) {
        let last = self.layers.iter().rev().find(|layer| layer.open);
        let Some(Layer { wall: Some(wall), top, carried, .. }) = last else { return (0.0, f64::MIN) };
        let left = wall.spring_back * wall.puncture;
        let per_mm = left / (wall.relief.vertex - wall.puncture);
        let before_relief = top + carried + wall.relief.vertex - self.layers[next].top;
        let moved = (before_relief * per_mm / (1.0 + per_mm)).clamp(0.0, left);
        (moved, top + carried + wall.puncture)
    }

    fn walls(&mut self, depth: f64) -> f64 {
        let of = |layer: &mut Layer| {
            let Some(wall) = layer.wall else { return 0.0 };
            let travel = depth - (layer.top + layer.carried);
            if layer.open {
                layer.frontier = layer.frontier.max(travel);
                let cut = wall.relief.force(layer.frontier.min(wall.relief.vertex));
                (cut - (layer.frontier - travel) * wall.unload).max(0.0)
            } else if layer.touched && travel >= 0.0 {
                wall.elastic.force(travel)
            } else {
                0.0
            }
        };
        self.layers.iter_mut().map(of).sum()
    }

    fn friction(&mut self, depth: f64) -> f64 {
        let is_open = self.layers.iter().find(|layer| layer.wall.is_some()).is_none_or(|layer| layer.open);
        if !is_open || depth < self.layers[0].top {
            self.anchor = depth;
            return 0.0;
        }
        let touched = self.layers.iter().take_while(|layer| layer.touched).count();
        let limit: f64 = (0..touched)
            .map(|index| {
                let end = self.layers[..touched].get(index + 1).map_or(f64::INFINITY, |next| next.top);
                (depth.min(end) - self.layers[index].top).max(0.0) * self.layers[index].friction
            })
            .sum();
        let reach = limit / self.hold;
        self.anchor = self.anchor.clamp(depth - reach, depth + reach);
        (depth - self.anchor) * self.hold
    }
}
