//! The law of seed 000: `F(depth, speed, angle)` from a table that was fitted to insertions at constant speed and angle, linear
//! between its knots and level beyond them. The paper says nothing of a needle that rests or is drawn back: there the force is
//! held by a clamped proxy, `F = K·(x − w)` within what the table gives inwards and a share of it outwards.

use super::{Ground, Motion, Response, reach};
use crate::anatomy::{Insertion, SMALLEST_ANGLE};
use crate::event::State;
use crate::math::{saturating_multiply, truncating_product};
use crate::passivity::Elements;
use crate::proxy::Anchor;
use crate::refusal::{Field, Refusal, count, milli, within};
use crate::units::{Millimetres, MillimetresPerSecond, Milliradians, Newtons, Stiffness};
use fixed::types::I16F16;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// The most knots of a force table: of depth, of speed, of angle.
pub const MAX_DEPTHS: usize = 16;
/// See [`MAX_DEPTHS`].
pub const MAX_SPEEDS: usize = 3;
/// See [`MAX_DEPTHS`].
pub const MAX_ANGLES: usize = 3;

/// The force of an insertion over depth, speed along the needle and angle to the skin; linear between its knots, level beyond
/// them.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ForceTable {
    /// From one depth to the next, 0.05–100 mm; the first is the skin. Depth is perpendicular to it, as the layers' are, so that
    /// a layer is met at the same knot whatever the angle.
    pub depth_step: Millimetres,
    /// Rising.
    pub speeds: Vec<MillimetresPerSecond, MAX_SPEEDS>,
    /// To the skin, rising.
    pub angles: Vec<Milliradians, MAX_ANGLES>,
    /// In mN, one for each depth, speed and angle: angles side by side, then speeds, then depths.
    pub forces: Vec<i16, { MAX_DEPTHS * MAX_SPEEDS * MAX_ANGLES }>,
    /// A bit for each speed and angle that was measured: bit `speed · angles + angle`. The others hold an estimate, the
    /// product of what speed and angle do each by itself, and are told as one.
    pub measured: u16,
    /// K of the proxy that holds the needle at rest; no steeper slope is felt.
    pub stiffness: Stiffness,
    /// Share of the force inwards that holds the needle against withdrawal, 0–1.
    pub withdrawal: I16F16,
}

/// What the tick needs beside the table.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// Depths of the table.
    depths: usize,
    /// One over the step of depth, Q24.
    per_depth: i32,
    /// One over the gap from each knot to the next, Q24.
    per_speed: [i32; MAX_SPEEDS],
    per_angle: [i32; MAX_ANGLES],
    inverse_stiffness: I16F16,
    walls_that_close: usize,
}

/// Between knot `index` and the next, and how far: Q16.
#[derive(Clone, Copy, Debug)]
struct Place {
    index: usize,
    next: usize,
    share: i32,
}

/// One over the gaps between `knots` in Q16. The last knot's gap does not matter: nothing lies beyond it.
fn per_gap<const N: usize>(knots: impl Iterator<Item = i32> + Clone) -> [i32; N] {
    let mut gaps = [0; N];
    for (gap, (from, to)) in gaps.iter_mut().zip(knots.clone().zip(knots.skip(1))) {
        *gap = ((1_i64 << 40) / i64::from((to - from).max(1))) as i32;
    }
    gaps
}

/// Where `at` lies among `knots` in Q16.
fn place(knots: impl Iterator<Item = i32>, per_gap: &[i32], at: i32) -> Place {
    let mut place = Place { index: 0, next: 0, share: 0 };
    let mut count = 0;
    for (knot, per_gap) in knots.zip(per_gap) {
        count += 1;
        if at < knot {
            break;
        }
        let share = ((i64::from(at) - i64::from(knot)) * i64::from(*per_gap)) >> 24;
        place = Place { index: count - 1, next: 0, share: share.min(1 << 16) as i32 };
    }
    // The walk ends at the knot beyond, where there is one.
    Place { next: (place.index + 1).min(count - 1), ..place }
}

impl ForceTable {
    /// The table has its walls in it.
    pub(crate) fn hold(&self) -> I16F16 {
        I16F16::ZERO
    }

    /// Speeds and angles together.
    fn cells(&self) -> usize {
        self.speeds.len() * self.angles.len()
    }

    fn speed_knots(&self) -> impl Iterator<Item = i32> + Clone {
        self.speeds.iter().map(|speed| speed.0.to_bits())
    }

    fn angle_knots(&self) -> impl Iterator<Item = i32> + Clone {
        self.angles.iter().map(|angle| i32::from(angle.0) << 16)
    }
}

impl Plan {
    /// Checks the table against what the motor gives and the stiffness that holds the needle.
    pub(crate) fn new(table: &ForceTable, ground: &Ground) -> Result<Self, Refusal> {
        check(table, ground)?;
        let has_wall = ground.layers.iter().any(|met| met.layer.wall.is_some());
        Ok(Self {
            depths: table.forces.len() / table.cells().max(1),
            // At least 0.05 mm: at most 20.
            per_depth: ((1_i64 << 40) / i64::from(table.depth_step.0.to_bits().max(1))) as i32,
            per_speed: per_gap(table.speed_knots()),
            per_angle: per_gap(table.angle_knots()),
            inverse_stiffness: I16F16::ONE.saturating_div(table.stiffness.0),
            walls_that_close: usize::from(has_wall),
        })
    }

    /// Where a depth below the skin lies among the table's, which are evenly apart.
    fn depth(&self, depth: i32) -> Place {
        // At most 500 mm, 20 knots in each.
        let knots = truncating_product(depth, self.per_depth, 24);
        let (index, last) = ((knots >> 16) as usize, self.depths.saturating_sub(1));
        if index >= last {
            return Place { index: last, next: last, share: 0 };
        }
        Place { index, next: index + 1, share: knots & 0xFFFF }
    }

    /// The table's force, and whether all that it comes from was measured. Depth in mm, speed in mm/s, angle in mrad, Q16.
    fn force(&self, table: &ForceTable, depth: i32, speed: i32, angle: i32) -> (I16F16, bool) {
        let depth = self.depth(depth);
        let speed = place(table.speed_knots(), &self.per_speed, speed);
        let angle = place(table.angle_knots(), &self.per_angle, angle);
        let (angles, cells) = (table.angles.len(), table.cells());
        let mut measured = true;
        // mN in Q12: along depth, then angle, then speed.
        let mut along = |speed: usize, angle: usize, counts: bool| {
            let cell = speed * angles + angle;
            measured &= !counts || table.measured >> cell & 1 == 1;
            let at =
                |depth: usize| i32::from(table.forces.get(depth * cells + cell).copied().unwrap_or(0)) << 12;
            between(at(depth.index), at(depth.next), depth.share)
        };
        let mut across = |speed: usize, counts: bool| {
            let flat = along(speed, angle.index, counts);
            let steep = along(speed, angle.next, counts && angle.share > 0);
            between(flat, steep, angle.share)
        };
        let (slow, fast) = (across(speed.index, true), across(speed.next, speed.share > 0));
        // mN in Q12 to N in Q16: by 16/1000, 0.016 in Q26.
        (I16F16::from_bits(truncating_product(between(slow, fast, speed.share), 1_073_742, 26)), measured)
    }
}

fn between(from: i32, to: i32, share_q16: i32) -> i32 {
    from + truncating_product(to - from, share_q16, 16)
}

/// What the needle has done so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// w.
    anchor: Anchor,
}

impl Memory {
    /// One tick with the tip at `depth` along the needle.
    pub(crate) fn tick(
        &mut self,
        table: &ForceTable,
        plan: &Plan,
        met: &Insertion,
        Motion { depth, speed, withdraws }: Motion,
    ) -> Response {
        if depth.0 < met.top(0) {
            self.anchor.release(depth);
            return Response::NONE;
        }
        let inside = depth.0.saturating_sub(met.top(0)).to_bits();
        let inside = truncating_product(inside, met.depth_per_path().to_bits(), 30);
        let angle = i32::from(met.angle().0) << 16;
        let (most, measured) = plan.force(table, inside, speed.0.saturating_abs().to_bits(), angle);
        let is_inside = met.given() >= plan.walls_that_close;
        // A wall that has not given way pushes back and does not hold.
        let share = if is_inside { table.withdrawal } else { I16F16::ZERO };
        let least = I16F16::from_bits(truncating_product(most.to_bits(), share.to_bits(), 16));
        self.anchor.drag(depth, reach(most, plan.inverse_stiffness), reach(least, plan.inverse_stiffness));
        let force = saturating_multiply(self.anchor.stretch(depth), table.stiffness.0);
        let state = if is_inside && withdraws {
            State::Withdrawal
        } else if met.presses() {
            State::Elastic
        } else if is_inside {
            State::Friction
        } else {
            State::Approach
        };
        let force = if is_inside {
            Elements { friction: Newtons(force), ..Elements::NONE }
        } else {
            Elements { walls: Newtons(force), ..Elements::NONE }
        };
        Response { force, state, estimated: !measured, ..Response::NONE }
    }
}

fn check(table: &ForceTable, ground: &Ground) -> Result<(), Refusal> {
    let (stiff, largest) = (ground.stiffest, ground.largest);
    within(Field::FrictionStiffness, table.stiffness.0, milli(50), stiff)?;
    within(Field::Withdrawal, table.withdrawal, I16F16::ZERO, I16F16::ONE)?;
    let knots = |field, low: I16F16, high: I16F16, knots: &mut dyn Iterator<Item = I16F16>| {
        let mut from = low;
        let mut count = 0;
        for knot in knots {
            // At least a hundredth apart: the slopes between them are computed.
            let least = if count == 0 { low } else { from.saturating_add(milli(10)) };
            within(field, knot, least, high)?;
            (from, count) = (knot, count + 1);
        }
        if count == 0 { Err(Refusal::Count { field, found: 0, wanted: 1 }) } else { Ok(()) }
    };
    let angles = || table.angles.iter().map(|angle| I16F16::from_num(angle.0));
    within(Field::TableDepth, table.depth_step.0, milli(50), milli(100_000))?;
    knots(Field::TableSpeed, I16F16::ZERO, milli(1_000_000), &mut table.speeds.iter().map(|speed| speed.0))?;
    knots(Field::TableAngle, I16F16::from_num(SMALLEST_ANGLE.0), milli(1_571_000), &mut angles())?;
    let cells = table.cells();
    let depths = table.forces.len() / cells;
    count(Field::TableForce, table.forces.len(), cells * depths.max(2))?;
    for (index, &force) in table.forces.iter().enumerate() {
        let force = I16F16::from_num(force) / 1000;
        within(Field::TableForce, force, I16F16::ZERO, milli(32_767))?;
        if force > largest {
            return Err(Refusal::TooStrong { layer: 0, force, limit: largest });
        }
        // The slope from the knot above; along a slanted needle it is less.
        let Some(above) = index.checked_sub(cells).and_then(|above| table.forces.get(above)) else {
            continue;
        };
        let rise = force.saturating_sub(I16F16::from_num(*above) / 1000);
        let slope = rise.saturating_div(table.depth_step.0);
        if slope > table.stiffness.0 {
            return Err(Refusal::TooStiff { layer: 0, slope, limit: table.stiffness.0 });
        }
    }
    Ok(())
}
