//! The layers under the needle: which are touched, which have given way, and the force they make together.

use crate::config::{MAX_LAYERS, Tissue as Kind};
use crate::event::{State, Transitions};
use crate::friction::{Anchor, Law};
use crate::jog::Wall;
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
    pub(crate) wall: Option<(i32, Wall)>,
    pub(crate) friction_per_mm: I2F30,
    /// Friction limit that the layers above have added up to.
    pub(crate) friction_above: Newtons,
}

/// The tissue ready for the tick.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    pub(crate) layers: Vec<Layer, MAX_LAYERS>,
    pub(crate) friction: Law,
}

#[derive(Clone, Copy, Debug, Default)]
struct LayerState {
    touched: bool,
    given: bool,
    frontier: Millimetres,
}

/// What the needle has done to the tissue so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tissue {
    states: [LayerState; MAX_LAYERS],
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
    transitions: Transitions,
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
        Response { force: Newtons(force), state, transitions: walls.transitions }
    }

    fn walls(&mut self, tissue: &Layers, count: Counts, depth: Millimetres) -> Walls {
        let mut sum = Walls::default();
        for (index, (layer, state)) in tissue.layers.iter().zip(self.states.iter_mut()).enumerate() {
            let bit = 1_u8 << index;
            let travel = Millimetres(depth.0.saturating_sub(layer.top.0));
            if count.0 >= layer.contact && !state.touched {
                state.touched = true;
                sum.transitions.contact |= bit;
            } else if count.0 < layer.exit && state.touched {
                *state = LayerState::default();
                sum.transitions.exit |= bit;
            }
            let Some((puncture, wall)) = &layer.wall else { continue };
            if count.0 >= *puncture && !state.given {
                state.given = true;
                state.frontier = travel;
                sum.transitions.puncture |= bit;
            }
            if state.given {
                state.frontier = state.frontier.max(travel);
                sum.force = sum.force.saturating_add(wall.relief_force(travel, state.frontier).0);
                sum.relieving |= wall.is_relieving(state.frontier);
            } else if count.0 >= layer.contact {
                sum.force = sum.force.saturating_add(wall.elastic.force(travel).0);
                sum.pressing = true;
            }
        }
        sum
    }

    /// The friction along the needle, where the tip is inside.
    fn friction(&mut self, tissue: &Layers, count: Counts, depth: Millimetres) -> Option<Newtons> {
        let entry = tissue.layers.first()?;
        if !self.is_open(tissue) || count.0 < entry.contact {
            self.anchor.release(depth);
            return None;
        }
        let layer = tissue.layers.iter().rev().find(|l| l.top.0 <= depth.0).unwrap_or(entry);
        let inside = depth.0.saturating_sub(layer.top.0);
        let limit = times(inside, layer.friction_per_mm).saturating_add(layer.friction_above.0);
        let inserted = Millimetres(depth.0.saturating_sub(entry.top.0));
        Some(self.anchor.tick(&tissue.friction, depth, inserted, Newtons(limit)))
    }

    /// The needle is held by friction once the outermost wall has given way.
    fn is_open(&self, tissue: &Layers) -> bool {
        tissue
            .layers
            .iter()
            .zip(&self.states)
            .find(|(layer, _)| layer.wall.is_some())
            .is_none_or(|(_, s)| s.given)
    }
}
