//! The law of paper 000: `F(depth, speed, angle)` from a table that was fitted to insertions at
//! constant speed and angle.
//!
//! Knots that have the same number in every cell of speed and angle belong together: the tip's
//! contact, the force at which a layer gives way, the end of its fall. Depth and force of a knot
//! lie linearly between the cells, force linearly between two knots; beyond the table it is level.
//! So a layer that gives way deeper at another speed does so in between, too.
//!
//! A layer *gives way once*. From there on the needle has a track: in it, the force is the lower
//! hull of the table: the force where nothing has to give way. Beside the track the tissue is
//! whole. The paper says nothing of it, nor of a needle that rests or is drawn back: there the
//! force is held by a clamped proxy, `F = K·(x − w)` within what the table gives inwards and a
//! share of it outwards.

mod cells;
mod check;
mod surface;

use cells::{Axes, Cells};
use surface::Surface;

use super::{ForceLimits, Motion, Response, reach};
use crate::anatomy::Insertion;
use crate::anchor::Anchor;
use crate::event::State;
use crate::interpolator::Interpolator;
use crate::kinematics::Direction;
use crate::math::{saturating_multiply, share, truncating_product, upper_half};
use crate::passivity::Elements;
use crate::refusal::Refusal;
use crate::tissue::MAX_LAYERS;
use crate::units::{Millimetres, MillimetresPerSecond, Milliradians, Newtons, Stiffness};
use fixed::types::I16F16;
use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Largest number of knots of a force table along depth, speed and angle.
pub const MAX_DEPTHS: usize = 16;
/// See [`MAX_DEPTHS`].
pub const MAX_SPEEDS: usize = 3;
/// See [`MAX_DEPTHS`].
pub const MAX_ANGLES: usize = 3;
/// Deeper than any knot: 200 mm, in Q16.
const DEEPEST: i32 = 200 << 16;
const MAX_CELLS: usize = MAX_SPEEDS * MAX_ANGLES;

/// A needle whose tip is this far from its track goes beside it: 1 mm, the width of a cannula; an
/// assumption. In mm·mrad, Q16.
const BESIDE: i64 = 1_000 << 16;
/// A needle drawn out this far enters at another place, where the tissue is whole: 3 mm; an
/// assumption.
const ANOTHER_ENTRY: I16F16 = I16F16::from_bits(3 << 16);

/// The force of an insertion over depth, speed along the needle and angle to the skin.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct ForceTable {
    /// The depth of each knot in 0.01 mm, up to 163.83 mm, rising by 5 or more; the first is at or
    /// below the skin. Depth is perpendicular to it, as the layers' are. In the order of `forces`,
    /// or one for each knot that is at the same depth in all cells.
    pub depths: Vec<u16, { MAX_DEPTHS * MAX_CELLS }>,
    /// Rising.
    pub speeds: Vec<MillimetresPerSecond, MAX_SPEEDS>,
    /// To the skin, rising.
    pub angles: Vec<Milliradians, MAX_ANGLES>,
    /// In mN, up to 16 N, one for each knot, speed and angle: the angles of a speed together, then
    /// speeds, then knots.
    pub forces: Vec<u16, { MAX_DEPTHS * MAX_CELLS }>,
    /// Knots at which a layer gives way, rising; none where rupture is left to the shape of the
    /// curve.
    pub gives_way: Vec<u8, MAX_LAYERS>,
    /// A bit for each speed and angle that was measured: bit `speed · angles + angle`. The others
    /// hold an estimate, the product of what speed and angle do each by itself, and are reported as
    /// one.
    pub measured: u16,
    /// K of the proxy that holds the needle at rest; no steeper slope is felt.
    pub stiffness: Stiffness,
    /// Share of the force inwards that holds the needle against withdrawal, 0–1.
    pub withdrawal: I16F16,
}

/// The values that the tick needs in addition to the table.
#[derive(Clone, Debug)]
pub(crate) struct PreparedTable {
    /// The least force from each knot and cell on: the force on the needle in its track.
    hull: Vec<u16, { MAX_DEPTHS * MAX_CELLS }>,
    knots: usize,
    /// Each cell has depths of its own.
    has_depth_by_cell: bool,
    cells: usize,
    axes: Axes,
    ruptures: Vec<Rupture, MAX_LAYERS>,
    inverse_stiffness: I16F16,
    walls_that_close: usize,
    /// One count of the encoder along the needle, mm.
    count: I16F16,
}

/// A layer that gives way.
#[derive(Clone, Copy, Debug)]
struct Rupture {
    knot: usize,
    /// The layer among those that the needle meets.
    met: usize,
    /// A bit for its layer.
    layer: u8,
}

/// The tip's place among the knots of its cells.
#[derive(Clone, Copy, Debug)]
struct Position {
    knot: usize,
    /// Q16.
    share: i32,
}

impl Position {
    /// Knots, Q16.
    fn q16(self) -> u32 {
        ((self.knot as u32) << 16) + self.share.cast_unsigned()
    }
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
}

impl PreparedTable {
    /// Checks the table against what the motor gives and the stiffness that holds the needle.
    pub(crate) fn new(table: &ForceTable, limits: &ForceLimits) -> Result<Self, Refusal> {
        check::check(table, limits)?;
        let has_wall = limits.layers.iter().any(|met| met.layer.wall.is_some());
        let cells = table.cells();
        let knots = table.forces.len() / cells.max(1);
        let mut prepared = Self {
            hull: hull(&table.forces, cells),
            knots,
            has_depth_by_cell: table.depths.len() > knots,
            cells,
            axes: Axes::new(table),
            ruptures: Vec::new(),
            inverse_stiffness: I16F16::ONE.saturating_div(table.stiffness.0),
            walls_that_close: usize::from(has_wall),
            count: limits.count,
        };
        for &knot in &table.gives_way {
            let knot = usize::from(knot);
            let shallowest = (0..cells).map(|cell| prepared.depth(table, knot, cell)).min().unwrap_or(0);
            let above =
                |depth: Millimetres| i64::from(depth.0.to_bits()) * 100 <= i64::from(shallowest) << 16;
            let met = limits.layers.iter().rposition(|met| above(met.layer.depth)).unwrap_or(0);
            let number = limits.layers.get(met).map_or(0, |met| met.number);
            // There is room for as many as the table may have.
            let _ = prepared.ruptures.push(Rupture { knot, met, layer: 1_u8.unbounded_shl(number.into()) });
        }
        Ok(prepared)
    }

    /// A bit for each layer that gives way.
    pub(crate) fn ruptures(&self) -> u8 {
        self.ruptures.iter().fold(0, |layers, rupture| layers | rupture.layer)
    }

    /// Depth of a knot in a cell, 0.01 mm.
    fn depth(&self, table: &ForceTable, knot: usize, cell: usize) -> i32 {
        let index = if self.has_depth_by_cell { knot * self.cells + cell } else { knot };
        table.depths.get(index).copied().map_or(0, i32::from)
    }

    /// Returns the place of a depth among the knots of these cells. It is looked for from `near`
    /// on, a knot a tick: a needle that goes faster than a knot a tick trips the device.
    fn position(&self, table: &ForceTable, cells: &Cells, near: usize, depth: I16F16) -> Position {
        // 0.01 mm in Q16: beyond the table's deepest knot, nothing changes.
        let depth = depth.to_bits().min(DEEPEST) * 100;
        let last = self.knots.saturating_sub(1);
        let [from, to] = if self.has_depth_by_cell {
            cells.mix(self.rows(&table.depths, near))
        } else {
            [near, (near + 1).min(last)].map(|knot| self.depth(table, knot, 0) << 16)
        };
        if depth < from {
            return Position { knot: near.saturating_sub(1), share: if near > 0 { 1 << 16 } else { 0 } };
        }
        if depth >= to {
            return Position { knot: (near + 1).min(last), share: 0 };
        }
        Position { knot: near, share: share(depth - from, to - from) >> 12 }
    }

    /// The rows of `knot` and of the next, if there is one, in `values`, which has a value for each
    /// knot and cell.
    #[inline(always)]
    fn rows<'a>(&self, values: &'a [u16], knot: usize) -> [&'a [u16]; 2] {
        let rows = values.get(knot * self.cells..).unwrap_or_default();
        let Some((from, rest)) = rows.split_at_checked(self.cells) else { return [&[]; 2] };
        [from, rest.get(..self.cells).unwrap_or(from)]
    }

    /// The force of `forces` at `position`.
    fn force(&self, forces: &[u16], cells: &Cells, position: Position) -> I16F16 {
        let [from, to] = cells.mix(self.rows(forces, position.knot));
        let millinewtons = between(from, to, position.share);
        // mN to N: by 0.001 in Q40.
        I16F16::from_bits(upper_half(millinewtons, 1_099_511_628) >> 8)
    }
}

fn between(from: i32, to: i32, share_q16: i32) -> i32 {
    from + truncating_product(to - from, share_q16, 16)
}

/// The way that the needle has made for itself.
#[derive(Clone, Copy, Debug, Default)]
struct Track {
    /// Up to where it reaches, in knots, Q16.
    front: u32,
    /// The number of layers that have given way on it.
    given: usize,
    /// A bit for each of them.
    open: u8,
    /// The angle to the skin at which the first did.
    angle: Milliradians,
}

impl Track {
    /// Follows a tip that is `at` a knot, Q16, and `along` the needle past the skin. A bit for the
    /// layer that gives way now.
    fn follow(&mut self, prepared: &PreparedTable, at: u32, along: I16F16, angle: Milliradians) -> u8 {
        let off = i64::from((i32::from(angle.0) - i32::from(self.angle.0)).abs());
        if self.given > 0 && off * i64::from(along.to_bits()) > BESIDE {
            self.leave(prepared, at, angle);
        }
        let mut ruptured = 0;
        if let Some(next) = prepared.ruptures.get(self.given)
            && at >= (next.knot as u32) << 16
        {
            if self.given == 0 {
                self.angle = angle;
            }
            self.given += 1;
            ruptured = next.layer & !self.open;
            self.open |= next.layer;
        }
        if let Some(last) = self.given.checked_sub(1).and_then(|last| prepared.ruptures.get(last)) {
            // In the fall the track reaches as far as the tip has been.
            self.front = self.front.max(at.min((last.knot as u32 + 1) << 16));
        }
        ruptured
    }

    /// The tip is beside the track: what lies deeper is whole.
    #[inline(never)]
    fn leave(&mut self, prepared: &PreparedTable, at: u32, angle: Milliradians) {
        self.front = self.front.min(at);
        let is_above = |rupture: &&Rupture| (rupture.knot as u32) << 16 <= at;
        self.given = prepared.ruptures.iter().take(self.given).take_while(is_above).count();
        self.open = prepared.ruptures.iter().take(self.given).fold(0, |open, rupture| open | rupture.layer);
        self.angle = angle;
    }
}

/// The needle's history so far.
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// w.
    anchor: Anchor,
    way: Interpolator,
    cells: Cells,
    /// The knot that the tip was at.
    knot: usize,
    track: Track,
    surface: Surface,
}

impl Memory {
    /// Depth counts from a surface that is displaced by so much along the needle.
    pub(crate) fn displace(&mut self, displacement: Millimetres) {
        self.surface.follow(displacement);
    }

    /// One tick with the tip at `depth` along the needle.
    pub(crate) fn tick(
        &mut self,
        table: &ForceTable,
        prepared: &PreparedTable,
        met: &Insertion,
        Motion { depth, speed, movement }: Motion,
    ) -> Response {
        let (fine, steady) = self.way.tick(depth, speed, prepared.count);
        let fine = Millimetres(fine.0.saturating_sub(self.surface.tick()));
        self.cells.follow(table, &prepared.axes, steady, met.angle());
        if depth.0 < met.top(0) {
            self.anchor.release(fine);
            if depth.0 < met.top(0).saturating_sub(ANOTHER_ENTRY) {
                (self.track, self.knot) = (Track::default(), 0);
            }
            return Response { open: self.track.open, ..Response::NONE };
        }
        let along = fine.0.saturating_sub(met.top(0)).max(I16F16::ZERO);
        let inside = truncating_product(along.to_bits(), met.depth_per_path().to_bits(), 30);
        let position = prepared.position(table, &self.cells, self.knot, I16F16::from_bits(inside));
        self.knot = position.knot;
        let ruptured = self.track.follow(prepared, position.q16(), along, met.angle());
        let is_in_track = position.q16() < self.track.front;
        let most =
            prepared.force(if is_in_track { &prepared.hull } else { &table.forces }, &self.cells, position);
        let has_opened = prepared.ruptures.is_empty() || self.track.given > 0;
        let is_inside = met.given() >= prepared.walls_that_close && has_opened;
        // A wall that has not given way pushes back and does not hold.
        let share = if is_inside { table.withdrawal } else { I16F16::ZERO };
        let least = I16F16::from_bits(truncating_product(most.to_bits(), share.to_bits(), 16));
        self.anchor.drag(
            fine,
            reach(most, prepared.inverse_stiffness),
            reach(least, prepared.inverse_stiffness),
        );
        let force = saturating_multiply(self.anchor.stretch(fine), table.stiffness.0);
        let state = if is_inside && movement.direction() == Direction::Out {
            State::Withdrawal
        } else if !is_in_track && self.falls(prepared, position) {
            State::Puncture
        } else if met.presses() || self.presses(prepared, met, depth) {
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
        let estimated = self.cells.is_estimated();
        Response { force, state, estimated, ruptured, open: self.track.open, ..Response::NONE }
    }

    /// True if the tip is where the layer that gave way last falls.
    fn falls(&self, prepared: &PreparedTable, position: Position) -> bool {
        let last = self.track.given.checked_sub(1).and_then(|last| prepared.ruptures.get(last));
        last.is_some_and(|last| last.knot == position.knot)
    }

    /// True if the tip pushes in the layer that gives way next.
    fn presses(&self, prepared: &PreparedTable, met: &Insertion, depth: Millimetres) -> bool {
        prepared.ruptures.get(self.track.given).is_some_and(|next| depth.0 >= met.top(next.met))
    }
}

/// Returns, for each knot and cell, the least of its force and those of the knots below it.
fn hull(forces: &[u16], cells: usize) -> Vec<u16, { MAX_DEPTHS * MAX_CELLS }> {
    let mut hull: Vec<u16, { MAX_DEPTHS * MAX_CELLS }> = forces.iter().copied().collect();
    for index in (0..hull.len().saturating_sub(cells)).rev() {
        let below = hull.get(index + cells).copied().unwrap_or(u16::MAX);
        if let Some(force) = hull.get_mut(index) {
            *force = (*force).min(below);
        }
    }
    hull
}
