//! The layers under the needle: which are touched, which have given way, and the force they make together.

use crate::config::{MAX_LAYERS, Tissue as Kind};
use crate::event::{State, Transitions};
use crate::friction::{Anchor, Law};
use crate::jog;
use crate::math::times;
use crate::units::{Counts, Millimetres, MillimetresPerSecond, Newtons};
use fixed::types::{I2F30, I16F16};
use heapless::Vec;

/// Slower than this the needle rests; faster outwards it is being withdrawn. 1 mm/s.
const WITHDRAWAL_SPEED: I16F16 = I16F16::from_bits(1 << 16);

/// One layer ready for the tick. Thresholds are counts, so that they are exact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer {
    pub(crate) tissue: Kind,
    pub(crate) top: Millimetres,
    pub(crate) contact: i32,
    /// Below this the tip has left the layer: a little outside contact, so that a tremor does not heal a wall.
    pub(crate) exit: i32,
    pub(crate) friction_per_mm: I2F30,
    /// Friction limit that the layers above have added up to.
    pub(crate) friction_above: Newtons,
}

/// The wall of a layer ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    /// Which layer it is of.
    pub(crate) layer: u8,
    pub(crate) contact: i32,
    pub(crate) puncture: i32,
    pub(crate) exit: i32,
    pub(crate) jog: jog::Wall,
}

/// The tissue ready for the tick: outermost first, each layer deeper than the one before, each wall beyond the puncture
/// of the one before. [`crate::plan`] has seen to it.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    pub(crate) layers: Vec<Layer, MAX_LAYERS>,
    pub(crate) walls: Vec<Wall, MAX_LAYERS>,
    pub(crate) friction: Law,
}

/// What the needle has done to the tissue so far. The tip comes through layers and walls in their order, so that two
/// numbers say which it has touched and which have given way.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tissue {
    touched_layers: usize,
    given_walls: usize,
    /// The furthest depth since each wall gave way.
    frontiers: [Millimetres; MAX_LAYERS],
    anchor: Anchor,
}

/// What the tissue does to the needle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Response {
    pub(crate) force: Newtons,
    pub(crate) state: State,
    pub(crate) transitions: Transitions,
}

/// What the walls do, all together.
#[derive(Clone, Copy, Debug, Default)]
struct Walls {
    force: I16F16,
    pressing: bool,
    relieving: bool,
}

impl Tissue {
    /// One tick with the tip at `count`, which is `depth`.
    pub(crate) fn tick(
        &mut self,
        tissue: &Layers,
        count: Counts,
        depth: Millimetres,
        speed: MillimetresPerSecond,
    ) -> Response {
        let mut transitions = self.cross_layers(tissue, count);
        transitions.puncture = self.cross_walls(tissue, count, depth);
        let walls = self.walls(tissue, count, depth);
        let friction = self.friction(tissue, count, depth);
        let state = match friction {
            Some(_) if speed.0 < -WITHDRAWAL_SPEED => State::Withdrawal,
            _ if walls.pressing => State::Elastic,
            Some(_) if walls.relieving => State::Puncture,
            Some(_) => State::Friction,
            None => State::Approach,
        };
        let force = walls.force.saturating_add(friction.unwrap_or_default().0);
        Response { force: Newtons(force), state, transitions }
    }

    /// Layers that the tip touches or leaves.
    fn cross_layers(&mut self, tissue: &Layers, count: Counts) -> Transitions {
        let mut crossed = Transitions::default();
        while let Some(next) = tissue.layers.get(self.touched_layers)
            && count.0 >= next.contact
        {
            crossed.contact |= 1 << self.touched_layers;
            self.touched_layers += 1;
        }
        while let Some(last) = self.touched_layers.checked_sub(1)
            && tissue.layers.get(last).is_some_and(|layer| count.0 < layer.exit)
        {
            crossed.exit |= 1 << last;
            self.touched_layers = last;
        }
        crossed
    }

    /// Walls that give way, a bit for the layer of each; those that the tip has left are whole again.
    fn cross_walls(&mut self, tissue: &Layers, count: Counts, depth: Millimetres) -> u8 {
        let mut punctures = 0;
        while let Some(next) = tissue.walls.get(self.given_walls)
            && count.0 >= next.puncture
            && let Some(frontier) = self.frontiers.get_mut(self.given_walls)
        {
            *frontier = depth;
            punctures |= 1 << next.layer;
            self.given_walls += 1;
        }
        while let Some(last) = self.given_walls.checked_sub(1)
            && tissue.walls.get(last).is_some_and(|wall| count.0 < wall.exit)
        {
            self.given_walls = last;
        }
        punctures
    }

    /// The relief of every wall that has given way, and the rise of the next one.
    fn walls(&mut self, tissue: &Layers, count: Counts, depth: Millimetres) -> Walls {
        let mut sum = Walls::default();
        for (wall, frontier) in tissue.walls.iter().zip(&mut self.frontiers).take(self.given_walls) {
            frontier.0 = frontier.0.max(depth.0);
            sum.force = sum.force.saturating_add(wall.jog.relief_force(depth, *frontier).0);
            sum.relieving |= wall.jog.is_relieving(*frontier);
        }
        if let Some(next) = tissue.walls.get(self.given_walls)
            && count.0 >= next.contact
        {
            sum.force = sum.force.saturating_add(next.jog.elastic.force(depth).0);
            sum.pressing = true;
        }
        sum
    }

    /// The friction along the needle, where the tip is inside.
    fn friction(&mut self, tissue: &Layers, count: Counts, depth: Millimetres) -> Option<Newtons> {
        let entry = tissue.layers.first()?;
        // The needle is held by friction once the outermost wall has given way.
        let is_open = self.given_walls > 0 || tissue.walls.is_empty();
        if !is_open || count.0 < entry.contact {
            self.anchor.release(depth);
            return None;
        }
        // A touched layer may be a little deeper than the tip that draws back.
        let touched = tissue.layers.iter().take(self.touched_layers);
        let layer = touched.rev().find(|layer| count.0 >= layer.contact).unwrap_or(entry);
        let inside = depth.0.saturating_sub(layer.top.0);
        let limit = times(inside, layer.friction_per_mm).saturating_add(layer.friction_above.0);
        let inserted = Millimetres(depth.0.saturating_sub(entry.top.0));
        Some(self.anchor.tick(&tissue.friction, depth, inserted, Newtons(limit)))
    }
}
