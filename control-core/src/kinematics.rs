//! From counts to depth and speed. Counts are exact; nothing here rounds before it has to.

use crate::TICK_HZ;
use crate::config::SpeedMethod;
use crate::math::{product, saturate};
use crate::units::{Counts, Millimetres, MillimetresPerSecond};
use fixed::types::{I2F30, I8F24, I14F18, I16F16};

/// Length of the speed window: 12.8 ms, so that one count is 1.2 mm/s at a 10 mm roller.
pub const WINDOW_TICKS: u32 = 128;
/// Edges that [`SpeedMethod::EdgeTiming`] remembers.
const EDGES: usize = 8;
/// Edges are stored at this distance at the least, so that the memory spans the window at any speed.
const EDGE_SPACING_TICKS: u32 = WINDOW_TICKS / EDGES as u32;
/// No edge for this long is rest: 0.1 s.
const REST_TICKS: u32 = TICK_HZ / 10;

/// Length of one count along the needle, and the speed of one count in a given time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    pub(crate) mm_per_count: I2F30,
    /// Speed of one count in a window: below 48 mm/s.
    window_speed_per_count: I8F24,
    /// Speed of one count in a tick: below 6,200 mm/s.
    tick_speed_per_count: I14F18,
}

impl Scale {
    /// Of counts of this length, at most 0.62 mm.
    pub(crate) fn new(mm_per_count: I2F30) -> Self {
        let per_tick_q30 = i64::from(mm_per_count.to_bits()) * i64::from(TICK_HZ);
        let per_window_q30 = per_tick_q30 / i64::from(WINDOW_TICKS);
        Self {
            mm_per_count,
            window_speed_per_count: I8F24::from_bits(saturate(per_window_q30 >> 6)),
            tick_speed_per_count: I14F18::from_bits(saturate(per_tick_q30 >> 12)),
        }
    }

    /// Depth of `counts` past the zero.
    pub(crate) fn depth(&self, counts: Counts) -> Millimetres {
        Millimetres(I16F16::from_bits(product(counts.0, self.mm_per_count.to_bits(), 14)))
    }

    /// Speed of `counts` in a window.
    fn window_speed(&self, counts: i32) -> MillimetresPerSecond {
        MillimetresPerSecond(I16F16::from_bits(product(counts, self.window_speed_per_count.to_bits(), 8)))
    }

    /// Speed of `counts` in `ticks`.
    fn speed(&self, counts: i32, ticks: u32) -> MillimetresPerSecond {
        let in_a_tick_q18 =
            u64::from(counts.unsigned_abs()) * u64::from(self.tick_speed_per_count.to_bits().unsigned_abs());
        let magnitude = quotient(in_a_tick_q18 >> 2, ticks);
        MillimetresPerSecond(I16F16::from_bits(if counts < 0 { -magnitude } else { magnitude }))
    }
}

/// `dividend / divisor` to 20 bits or more for a divisor below 2^11, saturating: the board divides 32 bits in one
/// instruction and 64 in a hundred.
fn quotient(dividend: u64, divisor: u32) -> i32 {
    let excess = 32 - ((dividend >> 32) as u32).leading_zeros();
    let quotient = (dividend >> excess) as u32 / divisor.max(1);
    i32::try_from(u64::from(quotient) << excess).unwrap_or(i32::MAX)
}

/// Speed from counts. Memory for either method; a tick costs the same however fast the needle is.
#[derive(Clone, Debug)]
pub(crate) struct SpeedEstimator {
    method: SpeedMethod,
    window: [i32; WINDOW_TICKS as usize],
    edges: [Edge; EDGES],
    latest: Edge,
    /// Where the span that ends at `latest` begins.
    first: Edge,
    next_edge: usize,
    now: u32,
}

#[derive(Clone, Copy, Debug)]
struct Edge {
    tick: u32,
    count: i32,
}

impl SpeedEstimator {
    pub(crate) fn new(method: SpeedMethod, count: Counts) -> Self {
        let edge = Edge { tick: 0, count: count.0 };
        Self {
            method,
            window: [count.0; WINDOW_TICKS as usize],
            edges: [edge; EDGES],
            latest: edge,
            first: edge,
            next_edge: 0,
            now: 0,
        }
    }

    /// One tick: the speed at `count`.
    pub(crate) fn tick(&mut self, scale: &Scale, count: Counts) -> MillimetresPerSecond {
        self.now = self.now.wrapping_add(1);
        match self.method {
            SpeedMethod::Window => self.over_window(scale, count.0),
            SpeedMethod::EdgeTiming => self.between_edges(scale, count.0),
        }
    }

    fn over_window(&mut self, scale: &Scale, count: i32) -> MillimetresPerSecond {
        let slot = (self.now % WINDOW_TICKS) as usize;
        let Some(oldest) = self.window.get_mut(slot) else { return MillimetresPerSecond::default() };
        let moved = count.wrapping_sub(*oldest);
        *oldest = count;
        scale.window_speed(moved)
    }

    fn between_edges(&mut self, scale: &Scale, count: i32) -> MillimetresPerSecond {
        if count != self.latest.count {
            self.latest = Edge { tick: self.now, count };
            let stored = self.edges.get((self.next_edge + EDGES - 1) % EDGES).map_or(0, |e| e.tick);
            if self.now.wrapping_sub(stored) >= EDGE_SPACING_TICKS
                && let Some(slot) = self.edges.get_mut(self.next_edge)
            {
                *slot = self.latest;
                self.next_edge = (self.next_edge + 1) % EDGES;
            }
            self.first = self.oldest_in_window();
        }
        let silent = self.now.wrapping_sub(self.latest.tick);
        if silent > REST_TICKS {
            return MillimetresPerSecond::default();
        }
        let first = self.first;
        let span = self.latest.tick.wrapping_sub(first.tick);
        // Waiting for the next edge bounds the speed from above: it cannot have been less than `silent` away.
        scale.speed(self.latest.count.wrapping_sub(first.count), span.max(silent).max(1))
    }

    /// The oldest stored edge within the window before the latest one, else the last one before it.
    fn oldest_in_window(&self) -> Edge {
        let mut before = self.latest;
        // The slot that is overwritten next holds the oldest.
        for slot in 0..EDGES {
            let Some(&edge) = self.edges.get((self.next_edge + slot) % EDGES) else { break };
            match self.latest.tick.wrapping_sub(edge.tick) {
                1..=WINDOW_TICKS => return edge,
                age if age > WINDOW_TICKS && age <= REST_TICKS => before = edge,
                _ => {}
            }
        }
        before
    }
}

/// How far the needle may have moved in a tick: the wrapped difference of two absolute counts.
pub(crate) fn moved(from: Counts, to: Counts) -> Counts {
    Counts(to.0.wrapping_sub(from.0))
}

/// Counts of a depth, rounded up, so that `depth(counts) ≥ depth` first at that count.
pub(crate) fn counts_reaching(depth: Millimetres, mm_per_count: I2F30) -> i32 {
    let bits = i64::from(depth.0.to_bits()) << 14;
    let per_count = i64::from(mm_per_count.to_bits().max(1));
    let floor = bits.div_euclid(per_count);
    i32::try_from(floor + i64::from(bits.rem_euclid(per_count) != 0)).unwrap_or(i32::MAX)
}

/// One count along the needle: `2πr/counts_per_turn`, in Q30.
pub(crate) fn mm_per_count(roller_radius: Millimetres, counts_per_turn: u16) -> I2F30 {
    /// 2π in Q29.
    const TWO_PI_Q29: i64 = 3_373_259_426;
    let circumference_q45 = TWO_PI_Q29 * i64::from(roller_radius.0.to_bits());
    let bits = (circumference_q45 / i64::from(counts_per_turn.max(1))) >> 15;
    I2F30::from_bits(i32::try_from(bits).unwrap_or(i32::MAX))
}
