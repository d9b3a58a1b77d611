//! The law of Paper 001: the jog effect of each wall and the friction between them.

use super::{ForceLimits, LayerHit, Motion, Response, follow_share};
use crate::anatomy::{Insertion, SMALLEST_ANGLE};
use crate::event::State;
use crate::friction::{Hold, PreparedFriction};
use crate::kinematics::Direction;
use crate::math::{reciprocal, saturating_product, saturating_times, sine, truncating_product};
use crate::passivity::Elements;
use crate::refusal::{Field, Refusal, milli, within};
use crate::tissue::{MAX_LAYERS, Wall};
use crate::units::{Millimetres, Newtons, Stiffness};
use crate::wall::{self, Cut};
use fixed::types::{I2F30, I8F24, I16F16};
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The law of friction inside tissue (Paper 001, eq. 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum FrictionLaw {
    /// Equation 2 as printed. It lets go of a resting needle within a second.
    Paper {
        /// S_f1: depth in tissue over which the friction level grows by e.
        level_length: Millimetres,
        /// Largest friction level L_f, 1–32.
        level_cap: I16F16,
        /// Time constant τ of the anchor, 5–1,000 ms: `S_f2 = 1 − e^{−T/τ}`.
        anchor_ms: u16,
        /// K_f: force for each mm between needle and anchor at level 1.
        stiffness: Stiffness,
        /// T_f_max, against a needle that goes in.
        limit: Newtons,
        /// −T_f_min, against a needle that is drawn back: a magnitude.
        limit_out: Newtons,
    },
    /// A clamped proxy: holds a resting needle, slips at the friction limit.
    Cone {
        /// Stiffness of the hold below the limit.
        stiffness: Stiffness,
    },
    /// The same with a static and a dynamic level: a needle at rest is held up to the friction
    /// limit, and a sliding one is rubbed with a share of it.
    StickSlip {
        /// Stiffness of the hold below the limit.
        stiffness: Stiffness,
        /// Dynamic level as a share of the static one, 0.2–1.
        sliding: I16F16,
    },
}

/// The friction of one layer ready for the tick.
#[derive(Clone, Copy, Debug)]
struct Rub {
    per_mm: I2F30,
    /// Friction limit in N that the layers above have added up to with the needle straight in. No
    /// motor that is accepted gives 128 N.
    above: I8F24,
}

/// The forces of the tissue ready for the tick, in the order of the [`crate::anatomy::Anatomy`]
/// that [`crate::plan`] has made with them.
#[derive(Clone, Debug)]
pub(crate) struct PreparedJog {
    /// One entry for each wall.
    walls: Vec<wall::Wall, MAX_LAYERS>,
    /// One entry for each layer.
    rubs: Vec<Rub, MAX_LAYERS>,
    /// The needle is held by friction once the outermost wall has given way: 1, or 0 where there is
    /// none.
    walls_that_close: usize,
    friction: PreparedFriction,
}

impl FrictionLaw {
    /// The steepest slope of friction.
    pub(crate) fn hold(&self) -> I16F16 {
        match *self {
            FrictionLaw::Paper { stiffness, level_cap, .. } => stiffness.0.saturating_mul(level_cap),
            FrictionLaw::Cone { stiffness } | FrictionLaw::StickSlip { stiffness, .. } => stiffness.0,
        }
    }

    /// Every wall that has given way falls or lets go, the next one rises, and friction changes
    /// with the thickness of each layer. A needle that sticks jumps where friction lets go of it.
    pub(crate) fn steepest(
        &self,
        layers: &[LayerHit],
        (given, next): (&[Wall], Option<&Wall>),
    ) -> Option<I16F16> {
        let rising = next.map_or(I16F16::ZERO, wall::steepest_rise);
        let walls = given.iter().map(wall::steepest_fall).fold(rising, I16F16::saturating_add);
        match *self {
            FrictionLaw::Paper { level_length, limit, limit_out, .. } => {
                Some(walls.saturating_add(limit.0.max(limit_out.0).saturating_div(level_length.0)))
            }
            FrictionLaw::Cone { .. } => {
                let twice = |met: &LayerHit| met.layer.friction.0.saturating_mul_int(2);
                Some(layers.iter().map(twice).fold(walls, I16F16::saturating_add))
            }
            FrictionLaw::StickSlip { .. } => None,
        }
    }
}

impl PreparedJog {
    /// Checks the law of friction and all the walls with it, at whatever angle they are met.
    pub(crate) fn new(friction: &FrictionLaw, limits: &ForceLimits) -> Result<Self, Refusal> {
        check_friction(friction, limits)?;
        check_along(limits)?;
        let rub = |met: &LayerHit| Rub {
            per_mm: I2F30::saturating_from_num(met.layer.friction.0),
            above: I8F24::ZERO,
        };
        let walls = wall::all(limits.layers.iter().map(|met| &met.layer));
        let mut prepared = Self {
            walls_that_close: walls.len().min(1),
            walls,
            rubs: limits.layers.iter().map(rub).collect(),
            friction: prepare_friction(friction),
        };
        let depths: Vec<I16F16, MAX_LAYERS> = limits.layers.iter().map(|met| met.layer.depth.0).collect();
        for index in 0..depths.len() {
            prepared.place(&depths, index);
        }
        Ok(prepared)
    }

    /// Adds up the friction of the layers above layer `index`, where layers are met at `depths`.
    pub(crate) fn place(&mut self, depths: &[I16F16], index: usize) {
        let Some((thickness, last)) = index.checked_sub(1).and_then(|last| {
            let thickness = depths.get(index)?.saturating_sub(*depths.get(last)?);
            Some((thickness, self.rubs.get(last)?))
        }) else {
            return;
        };
        let rubbed = saturating_product(thickness.to_bits(), last.per_mm.to_bits(), 22);
        let rubbed = last.above.saturating_add(I8F24::from_bits(rubbed));
        if let Some(rub) = self.rubs.get_mut(index) {
            rub.above = rubbed;
        }
    }
}

/// The needle's effect on the tissue so far, beyond its present place.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    /// One entry for each wall that has given way.
    cuts: [Cut; MAX_LAYERS],
    /// The number of them that are used.
    given: usize,
    hold: Hold,
}

impl Default for Memory {
    fn default() -> Self {
        Self { cuts: [Cut::NONE; MAX_LAYERS], given: 0, hold: Hold::default() }
    }
}

/// The force of all walls together.
#[derive(Clone, Copy, Debug, Default)]
struct Walls {
    force: I16F16,
    pressing: bool,
    /// Negative while any still falls along its relief parabola: the bits of [`Cut::past_vertex`]
    /// of all.
    past_vertex: I16F16,
}

impl Memory {
    /// One tick with a needle that moves so, where `met` says what it has met.
    pub(crate) fn tick(
        &mut self,
        _: &FrictionLaw,
        forces: &PreparedJog,
        met: &Insertion,
        Motion { depth, movement, .. }: Motion,
    ) -> Response {
        self.heal(met.given());
        let walls = self.walls(forces, met, depth);
        let friction = self.friction(forces, met, depth);
        let state = match friction {
            Some(_) if movement.direction() == Direction::Out => State::Withdrawal,
            _ if walls.pressing => State::Elastic,
            Some(_) if walls.past_vertex < I16F16::ZERO => State::Puncture,
            Some(_) => State::Friction,
            None => State::Approach,
        };
        let force = Elements { walls: Newtons(walls.force), friction: friction.unwrap_or_default() };
        Response { force, state, ..Response::NONE }
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
    fn walls(&mut self, forces: &PreparedJog, met: &Insertion, depth: Millimetres) -> Walls {
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
    fn friction(&mut self, forces: &PreparedJog, met: &Insertion, depth: Millimetres) -> Option<Newtons> {
        let entry = met.top(0);
        if met.given() < forces.walls_that_close || depth.0 < entry {
            self.hold = Hold::at(depth);
            return None;
        }
        let inserted = Millimetres(depth.0.saturating_sub(entry));
        Some(forces.friction.tick(&mut self.hold, depth, inserted, || limit(forces, met, depth)))
    }
}

/// The friction limit that the layers make at `depth`.
fn limit(forces: &PreparedJog, met: &Insertion, depth: Millimetres) -> Newtons {
    let index = met.innermost(depth);
    let Some(rub) = forces.rubs.get(index) else { return Newtons::default() };
    let inside = depth.0.saturating_sub(met.top(index));
    Newtons(saturating_times(inside, rub.per_mm).saturating_add(stretched(rub.above, met.path_per_depth())))
}

/// Returns the sum of the friction of layers that are passed at an angle, in N.
fn stretched(straight: I8F24, path_per_depth: I8F24) -> I16F16 {
    I16F16::from_bits(saturating_product(straight.to_bits(), path_per_depth.to_bits(), 32))
}

fn check_friction(law: &FrictionLaw, limits: &ForceLimits) -> Result<(), Refusal> {
    let layer = limits.configured as u8;
    let limit = limits.stiffest;
    match *law {
        FrictionLaw::Paper { level_length, level_cap, anchor_ms, stiffness, limit: force, limit_out } => {
            within(Field::LevelLength, level_length.0, milli(1_000), milli(1_000_000))?;
            within(Field::LevelCap, level_cap, milli(1_000), milli(32_000))?;
            within(Field::AnchorMs, I16F16::from_num(anchor_ms.min(30_000)), milli(5_000), milli(1_000_000))?;
            within(Field::FrictionStiffness, stiffness.0, milli(1), limit)?;
            within(Field::FrictionLimit, force.0, milli(1), limits.largest)?;
            within(Field::FrictionLimitOut, limit_out.0, milli(1), limits.largest)?;
            let slope = law.hold();
            if slope > limit { Err(Refusal::TooStiff { layer, slope, limit }) } else { Ok(()) }
        }
        FrictionLaw::Cone { stiffness } => within(Field::FrictionStiffness, stiffness.0, milli(50), limit),
        FrictionLaw::StickSlip { stiffness, sliding } => {
            within(Field::FrictionStiffness, stiffness.0, milli(50), limit)?;
            within(Field::SlidingShare, sliding, milli(200), I16F16::ONE)
        }
    }
}

fn prepare_friction(law: &FrictionLaw) -> PreparedFriction {
    match *law {
        FrictionLaw::Paper { level_length, level_cap, anchor_ms, stiffness, limit, limit_out } => {
            PreparedFriction::Paper {
                per_level_length: I2F30::saturating_from_num(I2F30::ONE.wide_div(level_length.0)),
                level_cap,
                follow: follow_share(anchor_ms),
                stiffness,
                limit,
                least: Newtons(limit_out.0.saturating_neg()),
            }
        }
        FrictionLaw::Cone { stiffness } => {
            PreparedFriction::Cone { stiffness, inverse_stiffness: I16F16::ONE.saturating_div(stiffness.0) }
        }
        FrictionLaw::StickSlip { stiffness, sliding } => PreparedFriction::StickSlip {
            stiffness,
            inverse_stiffness: I16F16::ONE.saturating_div(stiffness.0),
            sliding,
        },
    }
}

/// At whatever angle: each wall with the friction up to it, and friction at the end of the travel.
/// The flatter the needle, the longer its way through each layer, and the force is largest where
/// the next layer is just out of reach.
pub(super) fn check_along(limits: &ForceLimits) -> Result<(), Refusal> {
    let travel = limits.travel;
    let flattest = reciprocal(sine(SMALLEST_ANGLE));
    let just_reached = limits.layers.iter().map(|met| reaching(travel, met.layer.depth.0).min(flattest));
    let peak = |met: &LayerHit| met.layer.wall.as_ref().map_or(I16F16::ZERO, wall::peak);
    let peaks: Vec<I16F16, MAX_LAYERS> = limits.layers.iter().map(peak).collect();
    for stretch in just_reached.chain([I8F24::ONE, flattest]) {
        check_at(limits, &peaks, stretch)?;
    }
    Ok(())
}

/// Returns the stretch, at least 1, at which the needle reaches `depth` after `travel`.
fn reaching(travel: I16F16, depth: I16F16) -> I8F24 {
    let wide = (i64::from(travel.to_bits()) << 24) / i64::from(depth.to_bits().max(1));
    I8F24::saturating_from_num(fixed::types::I40F24::from_bits(wide)).max(I8F24::ONE)
}

/// The same with layers met at `stretch` times their depth, whose walls give way at `peaks`.
fn check_at(limits: &ForceLimits, peaks: &[I16F16], stretch: I8F24) -> Result<(), Refusal> {
    let (travel, limit) = (limits.travel, limits.largest);
    let along = |depth: I16F16| I16F16::from_bits(truncating_product(depth.to_bits(), stretch.to_bits(), 24));
    let (mut friction, mut at, mut per_mm, mut deepest) = (I16F16::ZERO, I16F16::ZERO, I16F16::ZERO, 0);
    for (LayerHit { number, layer }, &peak) in limits.layers.iter().zip(peaks) {
        let top = along(layer.depth.0);
        if top > travel {
            break;
        }
        friction = friction.saturating_add(top.saturating_sub(at).saturating_mul(per_mm));
        (at, per_mm, deepest) = (top, layer.friction.0, *number);
        let force = friction.saturating_add(peak);
        if force > limit {
            return Err(Refusal::TooStrong { layer: *number, force, limit });
        }
    }
    let force = friction.saturating_add(travel.saturating_sub(at).saturating_mul(per_mm));
    if force > limit { Err(Refusal::TooStrong { layer: deepest, force, limit }) } else { Ok(()) }
}
