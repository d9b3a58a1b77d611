//! The cells of a force table around a speed and an angle, and how much each of them counts.

use super::{ForceTable, MAX_ANGLES, MAX_SPEEDS};
use crate::math::truncating_product;
use crate::units::{MillimetresPerSecond, Milliradians};
use heapless::Vec;

/// All of a weight, Q16.
const WHOLE: u32 = 1 << 16;

/// The knots of speed and of angle.
#[derive(Clone, Debug)]
pub(super) struct Axes {
    speed: Axis<MAX_SPEEDS>,
    angle: Axis<MAX_ANGLES>,
}

impl Axes {
    /// Returns those of a table that has been checked.
    pub(super) fn new(table: &ForceTable) -> Self {
        let speeds: Vec<i32, MAX_SPEEDS> = table.speeds.iter().map(|speed| speed.0.to_bits()).collect();
        let angles: Vec<i32, MAX_ANGLES> = table.angles.iter().map(|angle| i32::from(angle.0) << 16).collect();
        Self { speed: Axis::new(&speeds), angle: Axis::new(&angles) }
    }
}

/// Knots, ready for finding a place among them.
#[derive(Clone, Debug)]
struct Axis<const N: usize> {
    /// In Q16, rising; where there are fewer, the largest number.
    knots: [i32; N],
    /// One over the gap from each knot to the next, Q24; none for the last: nothing is beyond it.
    per_gap: [i32; N],
    last: usize,
}

impl<const N: usize> Axis<N> {
    /// Returns that of knots in Q16 that are at least 0.01 apart. Out of line: it takes less flash.
    #[inline(never)]
    fn new(knots: &[i32]) -> Self {
        let mut axis = Self { knots: [i32::MAX; N], per_gap: [0; N], last: knots.len().saturating_sub(1) };
        for (place, &knot) in axis.knots.iter_mut().zip(knots) {
            *place = knot;
        }
        for (gap, (from, to)) in axis.per_gap.iter_mut().zip(knots.iter().zip(knots.iter().skip(1))) {
            *gap = ((1_i64 << 40) / i64::from((to - from).max(1))) as i32;
        }
        axis
    }

    /// Returns the place of `at`, which is not negative, in Q16.
    #[inline(always)]
    fn place(&self, at: i32) -> Place {
        let index = self.knots.iter().skip(1).filter(|&&knot| at >= knot).count().min(self.last);
        let knot = self.knots.get(index).copied().unwrap_or_default();
        let per_gap = self.per_gap.get(index).copied().unwrap_or_default();
        let share = truncating_product((at - knot).max(0), per_gap, 24).cast_unsigned();
        Place { index, next: (index + 1).min(self.last), share }
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
        axes: &Axes,
        speed: MillimetresPerSecond,
        angle: Milliradians,
    ) {
        match self.turn {
            0 => self.look_anew(table, axes, speed, angle),
            1 => self.find_speed(axes, speed),
            2 => self.find_angle(axes, angle),
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
        axes: &Axes,
        speed: MillimetresPerSecond,
        angle: Milliradians,
    ) {
        self.find_speed(axes, speed);
        self.find_angle(axes, angle);
        self.weigh(table);
        self.look_at_measured(table);
    }

    #[inline(never)]
    fn find_speed(&mut self, axes: &Axes, speed: MillimetresPerSecond) {
        self.speed = axes.speed.place(speed.0.saturating_abs().to_bits());
    }

    #[inline(never)]
    fn find_angle(&mut self, axes: &Axes, angle: Milliradians) {
        self.angle = axes.angle.place(i32::from(angle.0) << 16);
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

    /// Returns the value between those of the cells, Q16, for each of two rows of equal length,
    /// which have a value for each cell. Both at once: each cell is looked up once.
    #[inline(always)]
    pub(super) fn mix(&self, [from, to]: [&[u16]; 2]) -> [i32; 2] {
        // Values are below 2^15, weights add up to 2^16.
        let mut sums = [0_u32; 2];
        for corner in &self.corners {
            if let (Some(&from), Some(&to)) = (from.get(corner.cell), to.get(corner.cell)) {
                sums = [sums[0] + u32::from(from) * corner.weight, sums[1] + u32::from(to) * corner.weight];
            }
        }
        sums.map(u32::cast_signed)
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
