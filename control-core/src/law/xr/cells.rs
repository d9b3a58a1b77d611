//! The cells of a force table around a speed and an angle, and how much each of them counts.

use super::{ForceTable, MAX_ANGLES, MAX_SPEEDS};
use crate::units::{MillimetresPerSecond, Milliradians};

/// All of a weight, Q16.
const WHOLE: u32 = 1 << 16;

/// The values for finding a place among speeds and angles: one over the gap from each knot to the
/// next, Q24.
#[derive(Clone, Debug)]
pub(super) struct Gaps {
    speed: [i32; MAX_SPEEDS],
    angle: [i32; MAX_ANGLES],
}

impl Gaps {
    /// Returns those of a table that has been checked.
    pub(super) fn new(table: &ForceTable) -> Self {
        Self { speed: per_gap(speed_knots(table)), angle: per_gap(angle_knots(table)) }
    }
}

/// The cells around a speed and an angle. Speed and angle change slowly: each is looked up in one
/// tick of four.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cells {
    speed: Place,
    angle: Place,
    corners: [Corner; 4],
    is_estimated: bool,
    turn: u8,
}

/// A cell and its weight.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    cell: usize,
    /// Q16; those of all four corners add up to one.
    weight: u32,
}

impl Cells {
    /// Follows speed and angle.
    pub(super) fn follow(
        &mut self,
        table: &ForceTable,
        gaps: &Gaps,
        speed: MillimetresPerSecond,
        angle: Milliradians,
    ) {
        match self.turn {
            0 => self.look_anew(table, gaps, speed, angle),
            1 => self.speed = speed_place(table, gaps, speed),
            2 => self.angle = angle_place(table, gaps, angle),
            3 => self.weigh(table),
            _ => self.look_at_measured(table),
        }
        self.turn = (self.turn & 3) + 1;
    }

    /// All at once, in the first tick.
    #[cold]
    #[inline(never)]
    fn look_anew(
        &mut self,
        table: &ForceTable,
        gaps: &Gaps,
        speed: MillimetresPerSecond,
        angle: Milliradians,
    ) {
        self.speed = speed_place(table, gaps, speed);
        self.angle = angle_place(table, gaps, angle);
        self.weigh(table);
        self.look_at_measured(table);
    }

    #[inline(never)]
    fn weigh(&mut self, table: &ForceTable) {
        let angles = table.angles.len();
        let (row, next_row) = (self.speed.index * angles, self.speed.next * angles);
        let product = (self.speed.share * self.angle.share) >> 16;
        let corner = |row, column, weight| Corner { cell: row + column, weight };
        self.corners = [
            corner(row, self.angle.index, WHOLE + product - self.speed.share - self.angle.share),
            corner(row, self.angle.next, self.angle.share - product),
            corner(next_row, self.angle.index, self.speed.share - product),
            corner(next_row, self.angle.next, product),
        ];
    }

    #[inline(never)]
    fn look_at_measured(&mut self, table: &ForceTable) {
        let is_missing = |corner: &Corner| corner.weight > 0 && table.measured >> corner.cell & 1 == 0;
        self.is_estimated = self.corners.iter().any(is_missing);
    }

    /// Returns the value between those of the cells, Q16; the one of cell `n` is `values[n ·
    /// stride]`.
    #[inline(always)]
    pub(super) fn mix(&self, values: &[u16], stride: usize) -> i32 {
        let weighed =
            |corner: &Corner| values.get(corner.cell * stride).copied().map_or(0, u32::from) * corner.weight;
        let sum: u32 = self.corners.iter().map(weighed).sum();
        // Values are below 2^15, weights add up to 2^16.
        sum.cast_signed()
    }

    /// True if a cell that counts was not measured.
    pub(super) fn is_estimated(&self) -> bool {
        self.is_estimated
    }
}

/// Between knot `index` and the next, and how far: Q16.
#[derive(Clone, Copy, Debug, Default)]
struct Place {
    index: usize,
    next: usize,
    share: u32,
}

pub(super) fn speed_knots(table: &ForceTable) -> impl Iterator<Item = i32> + Clone {
    table.speeds.iter().map(|speed| speed.0.to_bits())
}

pub(super) fn angle_knots(table: &ForceTable) -> impl Iterator<Item = i32> + Clone {
    table.angles.iter().map(|angle| i32::from(angle.0) << 16)
}

#[inline(never)]
fn speed_place(table: &ForceTable, gaps: &Gaps, speed: MillimetresPerSecond) -> Place {
    place(speed_knots(table), &gaps.speed, speed.0.saturating_abs().to_bits())
}

#[inline(never)]
fn angle_place(table: &ForceTable, gaps: &Gaps, angle: Milliradians) -> Place {
    place(angle_knots(table), &gaps.angle, i32::from(angle.0) << 16)
}

/// One over the gaps between `knots` in Q16. The last knot's gap does not matter: nothing is beyond
/// it.
fn per_gap<const N: usize>(knots: impl Iterator<Item = i32> + Clone) -> [i32; N] {
    let mut gaps = [0; N];
    for (gap, (from, to)) in gaps.iter_mut().zip(knots.clone().zip(knots.skip(1))) {
        *gap = ((1_i64 << 40) / i64::from((to - from).max(1))) as i32;
    }
    gaps
}

/// Returns the place of `at` among `knots` in Q16.
fn place(knots: impl Iterator<Item = i32>, per_gap: &[i32], at: i32) -> Place {
    let mut place = Place::default();
    let mut count = 0;
    for (knot, per_gap) in knots.zip(per_gap) {
        count += 1;
        if at < knot {
            break;
        }
        let share = ((i64::from(at) - i64::from(knot)) * i64::from(*per_gap)) >> 24;
        // Not negative: the knot is at or below.
        place = Place { index: count - 1, next: 0, share: share.min(i64::from(WHOLE)) as u32 };
    }
    // The walk ends at the knot beyond, where there is one.
    Place { next: (place.index + 1).min(count.max(1) - 1), ..place }
}
