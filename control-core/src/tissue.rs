//! The layers under the needle: which are touched, which have given way, and the force they make together.

use crate::config::{MAX_LAYERS, Tissue as Kind};
use crate::event::{State, Transitions};
use crate::friction::{Anchor, Law};
use crate::jog::{self, Cut};
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
    /// Number of walls in the layers above.
    pub(crate) walls_above: usize,
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
    pub(crate) jog: jog::Wall,
}

/// The tissue ready for the tick: outermost first, each layer deeper than the one before, each wall beyond the puncture
/// of the one before. [`crate::plan`] has seen to it.
#[derive(Clone, Debug)]
pub(crate) struct Layers {
    pub(crate) layers: Vec<Layer, MAX_LAYERS>,
    walls: Vec<Wall, MAX_LAYERS>,
    /// Where each layer is touched.
    contacts: Thresholds,
    /// Where each wall gives way.
    punctures: Thresholds,
    /// The layers of the first n walls, a bit each, for every n.
    walled: [u8; MAX_LAYERS + 1],
    /// The outermost layer.
    entry: Layer,
    /// The needle is held by friction once the outermost wall has given way: 1, or 0 where there is none.
    walls_that_close: usize,
    friction: Law,
}

impl Layers {
    /// None where there is no layer.
    pub(crate) fn new(
        layers: Vec<Layer, MAX_LAYERS>,
        walls: Vec<Wall, MAX_LAYERS>,
        friction: Law,
    ) -> Option<Self> {
        let mut walled = [0; MAX_LAYERS + 1];
        for (n, set) in walled.iter_mut().enumerate() {
            *set = walls.iter().take(n).fold(0, |set, wall| set | 1 << wall.layer);
        }
        Some(Self {
            contacts: Thresholds::new(layers.iter().map(|layer| layer.contact)),
            punctures: Thresholds::new(walls.iter().map(|wall| wall.puncture)),
            entry: *layers.first()?,
            walls_that_close: walls.len().min(1),
            layers,
            walls,
            walled,
            friction,
        })
    }
}

/// Counts at which something happens on the way in, in their order.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Thresholds {
    /// The last count before each; before those that there are not, any count is.
    before: [i32; MAX_LAYERS + 1],
}

impl Thresholds {
    /// Of the first [`MAX_LAYERS`].
    fn new(counts: impl Iterator<Item = i32>) -> Self {
        let mut before = [i32::MAX; MAX_LAYERS + 1];
        before
            .iter_mut()
            .zip(counts.take(MAX_LAYERS))
            .for_each(|(place, count)| *place = count.saturating_sub(1));
        Self { before }
    }

    fn is_reached(&self, number: usize, count: Counts) -> bool {
        self.before.get(number).is_some_and(|&before| count.0 > before)
    }

    /// How many are reached: three comparisons, however many the needle jumps over in a tick.
    fn reached(&self, count: Counts) -> usize {
        const { assert!(MAX_LAYERS < 8, "three comparisons tell eight numbers apart") };
        [4, 2, 1].into_iter().fold(0, |number, step| {
            if self.is_reached(number + step - 1, count) { number + step } else { number }
        })
    }
}

/// What the needle has done to the tissue so far. The tip comes through layers and walls in their order, so that two
/// numbers say which it has touched and which have given way.
#[derive(Clone, Debug)]
pub(crate) struct Tissue {
    touched_layers: usize,
    given_walls: usize,
    /// Of each wall; of those that have not given way there is none.
    cuts: [Cut; MAX_LAYERS],
    anchor: Anchor,
}

impl Default for Tissue {
    fn default() -> Self {
        Self { touched_layers: 0, given_walls: 0, cuts: [Cut::NONE; MAX_LAYERS], anchor: Anchor::default() }
    }
}

/// What the tissue does to the needle.
#[derive(Clone, Copy, Debug, Default)]
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
    /// Negative while any still falls along its relief parabola: the bits of [`Cut::past_vertex`] of all.
    past_vertex: I16F16,
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
        transitions.puncture = self.puncture_walls(tissue, count);
        let walls = self.walls(tissue, count, depth);
        let friction = self.friction(tissue, count, depth);
        let state = match friction {
            Some(_) if speed.0 < -WITHDRAWAL_SPEED => State::Withdrawal,
            _ if walls.pressing => State::Elastic,
            Some(_) if walls.past_vertex < I16F16::ZERO => State::Puncture,
            Some(_) => State::Friction,
            None => State::Approach,
        };
        let force = walls.force.saturating_add(friction.unwrap_or_default().0);
        Response { force: Newtons(force), state, transitions }
    }

    /// Layers that the tip touches or leaves; a wall is whole again once the tip has left its layer.
    fn cross_layers(&mut self, tissue: &Layers, count: Counts) -> Transitions {
        let before = self.touched_layers;
        if tissue.contacts.is_reached(before, count) {
            // Deeper than the exit of every layer above.
            self.touched_layers = tissue.contacts.reached(count);
            return Transitions { contact: bits(before, self.touched_layers), ..Transitions::default() };
        }
        let mut touched = before;
        while let Some(last) = touched.checked_sub(1)
            && let Some(layer) = tissue.layers.get(last)
            && count.0 < layer.exit
        {
            self.heal_walls(layer.walls_above);
            touched = last;
        }
        if touched == before {
            return Transitions::default();
        }
        self.touched_layers = touched;
        Transitions { exit: bits(touched, before), ..Transitions::default() }
    }

    /// Only the first `number` walls have given way. Called for each layer that is left: at most one more is whole.
    fn heal_walls(&mut self, number: usize) {
        if self.given_walls > number
            && let Some(cut) = self.cuts.get_mut(number)
        {
            *cut = Cut::NONE;
            self.given_walls = number;
        }
    }

    /// Walls that give way, a bit for the layer of each.
    fn puncture_walls(&mut self, tissue: &Layers, count: Counts) -> u8 {
        let before = self.given_walls;
        if !tissue.punctures.is_reached(before, count) {
            return 0;
        }
        self.given_walls = tissue.punctures.reached(count);
        let layers = |walls: usize| tissue.walled.get(walls).copied().unwrap_or_default();
        layers(self.given_walls) ^ layers(before)
    }

    /// The relief of every wall that has given way, and the rise of the next one.
    fn walls(&mut self, tissue: &Layers, count: Counts, depth: Millimetres) -> Walls {
        let mut sum = Walls::default();
        let Some(given) = tissue.walls.get(..self.given_walls) else { return sum };
        let Some(cuts) = self.cuts.get_mut(..given.len()) else { return sum };
        for (wall, cut) in given.iter().zip(cuts) {
            sum.force = sum.force.saturating_add(wall.jog.relief_force(cut, depth).0);
            sum.past_vertex |= cut.past_vertex;
        }
        if let Some(next) = tissue.walls.get(self.given_walls)
            && count.0 >= next.contact
        {
            sum.force = sum.force.saturating_add(next.jog.elastic_force(depth).0);
            sum.pressing = true;
        }
        sum
    }

    /// The friction along the needle, where the tip is inside.
    fn friction(&mut self, tissue: &Layers, count: Counts, depth: Millimetres) -> Option<Newtons> {
        let entry = &tissue.entry;
        if self.given_walls < tissue.walls_that_close || count.0 < entry.contact {
            self.anchor.release(depth);
            return None;
        }
        let inserted = Millimetres(depth.0.saturating_sub(entry.top.0));
        let touched = self.touched_layers;
        let limit = || {
            let layer = innermost(tissue, touched, count).unwrap_or(entry);
            let inside = depth.0.saturating_sub(layer.top.0);
            Newtons(times(inside, layer.friction_per_mm).saturating_add(layer.friction_above.0))
        };
        Some(self.anchor.tick(&tissue.friction, depth, inserted, limit))
    }
}

/// The layer that the tip is in. A touched one may be a little deeper than the tip that draws back.
fn innermost(tissue: &Layers, touched: usize, count: Counts) -> Option<&Layer> {
    let layer = tissue.layers.get(touched.checked_sub(1)?)?;
    if count.0 >= layer.contact { Some(layer) } else { innermost_above(tissue, count) }
}

/// Out of the way, for it is seldom wanted.
#[inline(never)]
fn innermost_above(tissue: &Layers, count: Counts) -> Option<&Layer> {
    tissue.layers.iter().rev().find(|layer| count.0 >= layer.contact)
}

/// A bit for each number from `first` up to `end`, which it leaves out.
fn bits(first: usize, end: usize) -> u8 {
    ((1_u32 << end) - (1_u32 << first)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_thresholds_are_reached_as_are_not_beyond_the_tip() {
        let counts = [-3, 0, 1, 5, 5, 9];
        for number in 0..=MAX_LAYERS {
            let thresholds = Thresholds::new(counts.iter().take(number).copied());
            for count in (-5..12).chain([i32::MIN, i32::MAX]) {
                let reached = counts.iter().take(number).filter(|&&threshold| count >= threshold).count();
                assert_eq!(thresholds.reached(Counts(count)), reached, "{count} of {number}");
                for next in 0..=number {
                    assert_eq!(
                        thresholds.is_reached(next, Counts(count)),
                        next < reached,
                        "{count}, number {next}"
                    );
                }
            }
        }
    }

    #[test]
    fn bits_run_from_the_first_up_to_the_end() {
        assert_eq!(
            [bits(0, 0), bits(0, 1), bits(1, 3), bits(0, 6), bits(6, 6)],
            [0, 0b1, 0b110, 0b11_1111, 0]
        );
    }
}
