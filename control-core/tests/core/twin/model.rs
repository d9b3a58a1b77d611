//! The floating-point twin of the whole tick, written from the equations (Paper 001 and the force
//! laws of the design), not from the fixed-point code. It takes the configuration's own quantised
//! values as exact.

use control_core::TickOutput;
use control_core::config::{Config, FrictionLaw, Law, Parabola, SpeedMethod};
use control_core::event::{State, Transitions};

/// The largest error of fixed-point lengths along a slanted needle, in mm: within it, the twin
/// takes the core's word for which side of a threshold the tip is.
const LENGTH_DOUBT_MM: f64 = 3e-4;
/// The tip has left a layer when it is this far outside, in mm.
const EXIT_MM: f64 = 13_107.0 / 65_536.0;

/// True if a tip that is this far past a threshold (mm) is past it for the core, too.
fn is(margin: f64, told: bool) -> bool {
    if margin.abs() < LENGTH_DOUBT_MM { told } else { margin >= 0.0 }
}

/// The twin's memory from tick to tick.
pub(crate) struct Twin {
    config: Config,
    mm_per_count: f64,
    layers: Vec<LayerState>,
    anchor: f64,
    given: f64,
    heat: f64,
    /// Sum of the squared torques of up to eight ticks that have not warmed the winding yet.
    squared: f64,
    /// The largest torque that the heat allowed when it was last asked.
    allowed: f64,
    /// The last change of the torque that is allowed, where the core may not have asked for it yet;
    /// zero elsewhere.
    unasked: f64,
    /// Tick of the last contact, puncture or exit.
    transition: u32,
    /// The error of the heat by rounded forces: half of the last place of each wall, of friction
    /// and of damping.
    heat_doubt: f64,
    /// A wall gave way in this tick, or in one since which a layer was touched in each.
    springing_back: bool,
    ticks: u32,
    counts: Vec<i32>,
    edges: Vec<(usize, i32)>,
    last_edge: (usize, i32),
}

/// The state of one layer; the next one is met only once its wall has given way.
#[derive(Clone, Copy, Default)]
struct LayerState {
    touched: bool,
    open: bool,
    /// The distance from its top at which the wall was met, because it was carried along.
    carried: f64,
    frontier: f64,
}

fn force(p: &Parabola, travel: f64) -> f64 {
    let from_vertex = travel - p.vertex.0.to_num::<f64>();
    from_vertex * from_vertex / p.compliance.0.to_num::<f64>() + p.base.0.to_num::<f64>()
}

impl Twin {
    pub(crate) fn new(config: &Config, mm_per_count: f64) -> Self {
        let layers = vec![LayerState::default(); config.patient.layers.len()];
        let config = config.clone();
        Self {
            config,
            mm_per_count,
            layers,
            anchor: 0.0,
            given: 0.0,
            heat: 0.0,
            squared: 0.0,
            allowed: f64::MAX,
            unasked: 0.0,
            transition: 0,
            heat_doubt: 0.0,
            springing_back: false,
            ticks: 0,
            counts: Vec::new(),
            edges: vec![(0, 0)],
            last_edge: (0, 0),
        }
    }

    /// DAC steps away from mid-scale, before rounding, with the amplifier on since the first call.
    /// The tip's path that the core reports (`told`) is checked against the anatomy.
    pub(crate) fn tick(&mut self, count: i32, told: &TickOutput) -> f64 {
        let depth = f64::from(count) * self.mm_per_count;
        let speed = self.speed(count);
        let stretch = 1.0 / (f64::from(told.angle.0) * 1e-3).sin();
        self.meet(depth, stretch, told.transitions);
        let rubs = matches!(
            State::from_code(told.sample.state),
            Some(State::Puncture | State::Friction | State::Withdrawal)
        );
        let force = self.walls(depth, stretch) + self.friction(depth, stretch, rubs);
        let force = force + speed * self.config.device.damping.0.to_num::<f64>();
        let device = self.config.device;
        let limits = self.config.device.limits;
        let largest = self.allowed.min(self.config.device.limits.torque.0.to_num());
        let wanted = (-force * device.roller_radius.0.to_num::<f64>()).clamp(-largest, largest);
        self.ticks += 1;
        if told.transitions != Transitions::default() {
            self.transition = self.ticks;
        }
        let faded = wanted * (f64::from(self.ticks) / (f64::from(limits.fade_in_ms) * 10.0)).min(1.0);
        let slew = limits.slew_per_tick.0.to_num::<f64>();
        self.given = faded.clamp(self.given - slew, self.given + slew);
        let seconds = f64::from(limits.winding_time_s);
        // The winding warms in one tick of eight, and is asked what it allows in one of sixteen, as
        // in the controller.
        self.squared += self.given * self.given;
        match self.ticks % 16 {
            0 | 8 => {
                let mean = std::mem::take(&mut self.squared) / 8.0;
                self.heat += (mean - self.heat) * 8.0 / (seconds * 10_000.0);
            }
            2 => self.ask_what_is_allowed(),
            _ => {}
        }
        let lost = 0.5 / 65_536.0 * (self.layers.len() + 2) as f64 * device.roller_radius.0.to_num::<f64>();
        self.heat_doubt += (2.0 * self.given.abs() * lost - self.heat_doubt) / (seconds * 10_000.0);
        let span = f64::from(device.dac.span());
        let furthest = span - f64::from(device.dac_zero.abs());
        (self.given * span / device.full_scale_torque.0.to_num::<f64>()).clamp(-furthest, furthest)
    }

    /// A tick in which the core meets a layer or leaves it has no time to ask, and the next
    /// occasion is sixteen ticks later.
    fn ask_what_is_allowed(&mut self) {
        let most = self.config.device.limits.torque.0.to_num::<f64>();
        let before = self.allowed.min(most);
        self.allowed = self.largest_torque();
        let is_busy = self.transition > 0 && self.ticks - self.transition < 32;
        self.unasked = if is_busy { (before - self.allowed).abs() } else { 0.0 };
    }

    /// DAC steps that the torque limit may be off by for [`Twin::heat_doubt`]; none before heat
    /// limits. The limit falls over a fifth of the heat, so that where a weak motor hangs on a
    /// strong amplifier the last places of long ago show.
    pub(crate) fn steps_of_heat(&self) -> f64 {
        let (most, largest) = (self.config.device.limits.torque.0.to_num::<f64>(), self.allowed);
        if largest >= most && self.unasked == 0.0 {
            return 0.0;
        }
        let continuous = self.config.device.limits.continuous_torque.0.to_num::<f64>();
        let device = self.config.device;
        let steps = f64::from(device.dac.span()) / device.full_scale_torque.0.to_num::<f64>();
        (self.heat_doubt * (most - continuous) / (continuous * continuous / 5.0) + self.unasked) * steps
    }

    /// Falls from the torque limit to the continuous torque over the last fifth of the heat that is
    /// allowed.
    fn largest_torque(&self) -> f64 {
        let most = self.config.device.limits.torque.0.to_num::<f64>();
        let continuous = self.config.device.limits.continuous_torque.0.to_num::<f64>().min(most);
        let allowed = continuous * continuous;
        continuous + (most - continuous) * ((allowed - self.heat) / (allowed / 5.0)).clamp(0.0, 1.0)
    }

    /// Returns the depth of layer `index` along the needle.
    fn top(&self, index: usize, stretch: f64) -> f64 {
        self.config
            .patient
            .layers
            .get(index)
            .map_or(f64::INFINITY, |layer| layer.depth.0.to_num::<f64>() * stretch)
    }

    /// Returns the depth at which the tip began to push in the wall of layer `index`.
    fn origin(&self, index: usize, stretch: f64) -> f64 {
        self.top(index, stretch) + self.layers[index].carried
    }

    /// At most one layer touched or left, and one wall that gives way, in a tick.
    fn meet(&mut self, depth: f64, stretch: f64, told: Transitions) {
        let bit = |index: usize| 1_u8 << index;
        let mut puncture = 0;
        let next = self
            .layers
            .iter()
            .zip(&self.config.patient.layers)
            .position(|(s, l)| !s.open && l.wall.is_some());
        if let Some(next) = next
            && self.layers[next].touched
        {
            let wall = self.config.patient.layers[next].wall.expect("it has one");
            let travel = depth - self.origin(next, stretch);
            if is(travel - wall.puncture_travel.0.to_num::<f64>(), told.puncture != 0) {
                puncture = bit(next);
                self.layers[next].open = true;
                self.springing_back = true;
                self.layers[next].frontier = travel;
            }
        }
        assert_eq!(puncture, told.puncture, "at {depth} mm");
        let touched = self.layers.iter().filter(|layer| layer.touched).count();
        let is_free = self.layers[..touched]
            .iter()
            .zip(&self.config.patient.layers)
            .all(|(s, l)| s.open || l.wall.is_none());
        let place = self.top(touched, stretch) + self.carried_along(touched, stretch);
        let last = touched.checked_sub(1);
        let outside = last.map_or(-1.0, |last| self.top(last, stretch) - EXIT_MM - depth);
        let (mut contact, mut exit) = (0, 0);
        if is_free && is(depth - place, told.contact != 0) {
            contact = bit(touched);
            let met = if self.springing_back { place.max(self.gave_way(stretch)) } else { place };
            let carried = met - self.top(touched, stretch);
            self.layers[touched] = LayerState { touched: true, carried, ..LayerState::default() };
        } else if let Some(last) = last
            && is(outside, told.exit != 0)
        {
            exit = bit(last);
            self.layers[last] = LayerState::default();
        } else {
            self.springing_back = false;
        }
        assert_eq!((contact, exit), (told.contact, told.exit), "at {depth} mm");
    }

    /// Returns the extra depth of layer `next` where the tip comes to it: there, the remaining
    /// indentation of the wall that gave way last is as long as the tip is past the layer's place
    /// at rest.
    fn carried_along(&self, next: usize, stretch: f64) -> f64 {
        let Some(last) = self.layers.iter().rposition(|layer| layer.open) else { return 0.0 };
        let wall = self.config.patient.layers[last].wall.expect("it has given way");
        let (puncture, relieved) =
            (wall.puncture_travel.0.to_num::<f64>(), wall.relief.vertex.0.to_num::<f64>());
        let left = wall.spring_back.to_num::<f64>() * puncture;
        let per_mm = left / (relieved - puncture);
        let before_relief = self.origin(last, stretch) + relieved - self.top(next, stretch);
        (before_relief * per_mm / (1.0 + per_mm)).clamp(0.0, left)
    }

    /// Returns the tip's place when the last wall gave way.
    fn gave_way(&self, stretch: f64) -> f64 {
        let last = self.layers.iter().rposition(|layer| layer.open).expect("one has");
        let wall = self.config.patient.layers[last].wall.expect("it has given way");
        self.origin(last, stretch) + wall.puncture_travel.0.to_num::<f64>()
    }

    fn walls(&mut self, depth: f64, stretch: f64) -> f64 {
        let mut sum = 0.0;
        for index in 0..self.layers.len() {
            let travel = depth - self.origin(index, stretch);
            let state = &mut self.layers[index];
            let Some(wall) = self.config.patient.layers[index].wall else { continue };
            if state.open {
                state.frontier = state.frontier.max(travel);
                let cut = force(&wall.relief, state.frontier.min(wall.relief.vertex.0.to_num()));
                let drawn_back = state.frontier - travel;
                sum += (cut - drawn_back * wall.unload.0.to_num::<f64>()).max(0.0);
            } else if state.touched && travel >= 0.0 {
                sum += force(&wall.elastic, travel);
            }
        }
        sum
    }

    /// `rubs`: the core has reported friction.
    fn friction(&mut self, depth: f64, stretch: f64, rubs: bool) -> f64 {
        let layers = &self.config.patient.layers;
        let first_wall = layers.iter().position(|l| l.wall.is_some());
        let open = first_wall.is_none_or(|i| self.layers[i].open);
        let entry = self.top(0, stretch);
        if !open || !is(depth - entry, rubs) {
            self.anchor = depth;
            return 0.0;
        }
        let Law::Jog(friction) = self.config.patient.law else { panic!("the jog law's twin") };
        match friction {
            FrictionLaw::Paper { level_length, level_cap, anchor_ms, stiffness, limit, limit_out } => {
                let follow = 1.0 - (-0.1 / f64::from(anchor_ms)).exp();
                self.anchor += (depth - self.anchor) * follow;
                let level = ((depth - entry) / level_length.0.to_num::<f64>()).exp().min(level_cap.to_num());
                let [most, least] = [limit.0.to_num::<f64>(), -limit_out.0.to_num::<f64>()];
                ((depth - self.anchor) * level * stiffness.0.to_num::<f64>()).clamp(least, most)
            }
            FrictionLaw::StickSlip { .. } => {
                panic!("`laws.rs` tests it: when a needle slips is a matter of a last place")
            }
            FrictionLaw::Cone { stiffness } => {
                let mut limit = 0.0;
                // Only of layers that were touched: on what is carried along nothing rubs yet.
                for (index, layer) in layers.iter().enumerate() {
                    if !self.layers[index].touched {
                        break;
                    }
                    let next = self.layers.get(index + 1).is_some_and(|next| next.touched);
                    let end = if next { self.top(index + 1, stretch) } else { f64::INFINITY };
                    let inside = (depth.min(end) - self.top(index, stretch)).max(0.0);
                    limit += inside * layer.friction.0.to_num::<f64>();
                }
                let stiffness = stiffness.0.to_num::<f64>();
                self.anchor = self.anchor.clamp(depth - limit / stiffness, depth + limit / stiffness);
                (depth - self.anchor) * stiffness
            }
        }
    }

    fn speed(&mut self, count: i32) -> f64 {
        self.counts.push(count);
        let speed = match self.config.device.speed {
            SpeedMethod::Window => self.speed_over_window(count),
            SpeedMethod::EdgeTiming => self.speed_between_edges(count),
        };
        // The documented range of the type: 33 m/s, which no needle reaches.
        speed.clamp(-32_768.0, 32_768.0)
    }

    fn speed_over_window(&self, count: i32) -> f64 {
        let before = self.counts.len().checked_sub(129).map_or(0, |i| self.counts[i]);
        f64::from(count - before) * self.mm_per_count * 10_000.0 / 128.0
    }

    fn speed_between_edges(&mut self, count: i32) -> f64 {
        let now = self.counts.len();
        if count != self.last_edge.1 {
            self.last_edge = (now, count);
            if now - self.edges[self.edges.len() - 1].0 >= 16 {
                self.edges.push(self.last_edge);
            }
        }
        let silent = now - self.last_edge.0;
        if silent > 1000 {
            return 0.0;
        }
        let age = |e: &&(usize, i32)| self.last_edge.0 - e.0;
        let remembered = &self.edges[self.edges.len().saturating_sub(8)..];
        let inside = remembered.iter().filter(|e| (1..=128).contains(&age(e))).max_by_key(age);
        let before = remembered.iter().filter(|e| age(e) > 128 && age(e) <= 1000).min_by_key(age);
        let first = *inside.or(before).unwrap_or(&self.last_edge);
        let (counts, ticks) =
            (f64::from(self.last_edge.1 - first.1), (self.last_edge.0 - first.0).max(1) as f64);
        let since = silent as f64;
        let per_tick = if since * counts.abs() > ticks { counts.signum() / since } else { counts / ticks };
        per_tick * self.mm_per_count * 10_000.0
    }
}
