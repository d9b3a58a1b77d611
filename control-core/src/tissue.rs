//! The force of the layers that the tip has met: the jog effect of each wall and the friction between them.

use crate::anatomy::Insertion;
use crate::config::MAX_LAYERS;
use crate::event::State;
use crate::friction::{Anchor, Law};
use crate::jog::{self, Cut};
use crate::math::{scaled, times};
use crate::units::{Millimetres, MillimetresPerSecond, Newtons};
use fixed::types::{I2F30, I8F24, I16F16};
use heapless::Vec;

/// Slower than this the needle rests; faster outwards it is being withdrawn. 1 mm/s.
const WITHDRAWAL_SPEED: I16F16 = I16F16::from_bits(1 << 16);

/// The friction of one layer ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rub {
    pub(crate) per_mm: I2F30,
    /// Friction limit that the layers above have added up to with the needle straight in.
    pub(crate) above: Newtons,
}

/// The forces of the tissue ready for the tick, in the order of the [`crate::anatomy::Anatomy`] that [`crate::plan`] has
/// made with them.
#[derive(Clone, Debug)]
pub(crate) struct Forces {
    /// Of each wall.
    pub(crate) walls: Vec<jog::Wall, MAX_LAYERS>,
    /// Of each layer.
    pub(crate) rubs: Vec<Rub, MAX_LAYERS>,
    /// The needle is held by friction once the outermost wall has given way: 1, or 0 where there is none.
    pub(crate) walls_that_close: usize,
    pub(crate) friction: Law,
}

/// What the needle has done to the tissue so far, beyond where it is.
#[derive(Clone, Debug)]
pub(crate) struct Tissue {
    /// Of each wall that has given way.
    cuts: [Cut; MAX_LAYERS],
    /// How many of them count.
    given: usize,
    anchor: Anchor,
}

impl Default for Tissue {
    fn default() -> Self {
        Self { cuts: [Cut::NONE; MAX_LAYERS], given: 0, anchor: Anchor::default() }
    }
}

/// What the tissue does to the needle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Response {
    pub(crate) force: Newtons,
    pub(crate) state: State,
}

impl Response {
    /// Of no tissue.
    pub(crate) const NONE: Self = Self { force: Newtons(I16F16::ZERO), state: State::Approach };
}

/// What the walls do, all together.
#[derive(Clone, Copy, Debug, Default)]
struct Walls {
    force: I16F16,
    pressing: bool,
    /// Negative while any still falls along its relief parabola: the bits of [`Cut::past_vertex`] of all.
    past_vertex: I16F16,
}

impl Tissue {
    /// One tick with the tip at `depth` along the needle, where `met` says what it has met.
    pub(crate) fn tick(
        &mut self,
        forces: &Forces,
        met: &Insertion,
        depth: Millimetres,
        speed: MillimetresPerSecond,
    ) -> Response {
        self.heal(met.given());
        let walls = self.walls(forces, met, depth);
        let friction = self.friction(forces, met, depth);
        let state = match friction {
            Some(_) if speed.0 < -WITHDRAWAL_SPEED => State::Withdrawal,
            _ if walls.pressing => State::Elastic,
            Some(_) if walls.past_vertex < I16F16::ZERO => State::Puncture,
            Some(_) => State::Friction,
            None => State::Approach,
        };
        let force = walls.force.saturating_add(friction.unwrap_or_default().0);
        Response { force: Newtons(force), state }
    }

    /// Walls that the tip has left are whole again. It leaves one a tick.
    fn heal(&mut self, given: usize) {
        if given < self.given
            && let Some(cut) = self.cuts.get_mut(given)
        {
            *cut = Cut::NONE;
        }
        self.given = given;
    }

    /// The relief of every wall that has given way, and the rise of the next one.
    fn walls(&mut self, forces: &Forces, met: &Insertion, depth: Millimetres) -> Walls {
        let mut sum = Walls::default();
        let Some(given) = forces.walls.get(..met.given()) else { return sum };
        for (index, (wall, cut)) in given.iter().zip(&mut self.cuts).enumerate() {
            sum.force = sum.force.saturating_add(wall.relief_force(cut, met.travel(index, depth)).0);
            sum.past_vertex |= cut.past_vertex;
        }
        if let Some(next) = forces.walls.get(met.given())
            && met.presses()
        {
            let travel = met.travel(met.given(), depth);
            if travel >= I16F16::ZERO {
                sum.force = sum.force.saturating_add(next.elastic_force(travel).0);
                sum.pressing = true;
            }
        }
        sum
    }

    /// The friction along the needle, where the tip is inside.
    fn friction(&mut self, forces: &Forces, met: &Insertion, depth: Millimetres) -> Option<Newtons> {
        let entry = met.top(0);
        if met.given() < forces.walls_that_close || depth.0 < entry {
            self.anchor.release(depth);
            return None;
        }
        let inserted = Millimetres(depth.0.saturating_sub(entry));
        Some(self.anchor.tick(&forces.friction, depth, inserted, || limit(forces, met, depth)))
    }
}

/// The friction limit that the layers make at `depth`.
fn limit(forces: &Forces, met: &Insertion, depth: Millimetres) -> Newtons {
    let index = met.innermost(depth);
    let Some(rub) = forces.rubs.get(index) else { return Newtons::default() };
    let inside = depth.0.saturating_sub(met.top(index));
    Newtons(times(inside, rub.per_mm).saturating_add(stretched(rub.above.0, met.path_per_depth())))
}

/// What layers that are passed at an angle add up to, where it is known to fit: it is below the motor's force.
fn stretched(straight: I16F16, path_per_depth: I8F24) -> I16F16 {
    I16F16::from_bits(scaled(straight.to_bits(), path_per_depth.to_bits(), 24))
}
