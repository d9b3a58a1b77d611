//! From counts to depth and speed. Counts are exact; nothing here rounds before it has to.

use crate::TICK_HZ;
use crate::math::{saturate, saturating_product};
use crate::units::{Counts, Millimetres, MillimetresPerSecond};
use fixed::types::{I2F30, I8F24, I16F16, U14F18};
use serde::{Deserialize, Serialize};

/// Length of the speed window: 12.8 ms, so that one count is 1.2 mm/s at a 10 mm roller.
pub const WINDOW_TICKS: u32 = 128;
/// Edges that [`SpeedMethod::EdgeTiming`] remembers.
const EDGES: usize = 8;
/// Edges are stored at least this far apart, so that the memory spans the window at any speed.
const EDGE_SPACING_TICKS: u32 = WINDOW_TICKS / EDGES as u32;
/// No edge for this long is rest: 0.1 s.
const REST_TICKS: u32 = TICK_HZ / 10;

/// The estimator of speed. One count a tick is 157 mm/s at a 10 mm roller: counts are never
/// differenced tick by tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum SpeedMethod {
    /// Counts over the last [`WINDOW_TICKS`] ticks.
    Window,
    /// Counts over the time between the edges that delimit them; finer at low speed.
    EdgeTiming,
}

/// Length of one count along the needle, and the speed of one count in a given time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scale {
    pub(crate) mm_per_count: I2F30,
    /// Speed of one count in a window: below 48 mm/s.
    window_speed_per_count: I8F24,
    /// Speed of one count in a tick: below 6,200 mm/s.
    tick_speed_per_count: U14F18,
}

impl Scale {
    /// For counts of this length, at most 0.62 mm.
    pub(crate) fn new(mm_per_count: I2F30) -> Self {
        let per_tick_q30 = i64::from(mm_per_count.to_bits()) * i64::from(TICK_HZ);
        let per_window_q30 = per_tick_q30 / i64::from(WINDOW_TICKS);
        Self {
            mm_per_count,
            window_speed_per_count: I8F24::from_bits(saturate(per_window_q30 >> 6)),
            tick_speed_per_count: U14F18::from_bits(u32::try_from(per_tick_q30 >> 12).unwrap_or(u32::MAX)),
        }
    }

    /// Depth of `counts` past the zero.
    pub(crate) fn depth(&self, counts: Counts) -> Millimetres {
        Millimetres(I16F16::from_bits(saturating_product(counts.0, self.mm_per_count.to_bits(), 14)))
    }

    /// Speed of `counts` in a window.
    fn window_speed(&self, counts: i32) -> MillimetresPerSecond {
        MillimetresPerSecond(I16F16::from_bits(saturating_product(
            counts,
            self.window_speed_per_count.to_bits(),
            8,
        )))
    }

    /// Speed of `counts` in `ticks`.
    fn speed(&self, counts: i32, ticks: u32) -> MillimetresPerSecond {
        let in_a_tick_q18 = u64::from(counts.unsigned_abs()) * u64::from(self.tick_speed_per_count.to_bits());
        let magnitude = quotient(in_a_tick_q18 >> 2, ticks);
        MillimetresPerSecond(I16F16::from_bits(if counts < 0 { -magnitude } else { magnitude }))
    }
}

/// Ticks from one look at the movement to the next.
pub(crate) const LOOK_TICKS: u32 = 16;
/// A needle that has not come this far has not changed its direction: 0.25 mm in Q16, more than a
/// hand at rest trembles.
const TURNED: u32 = 1 << 14;
/// A needle that has not gone on for this many looks rests: 0.25 s, with which 0.1 mm/s is still a
/// movement.
const QUIET_LOOKS: u32 = 2_500 / LOOK_TICKS;
/// A needle that has not gone on for this many looks, 20 ms, with 16 µm a count slower than 0.8
/// mm/s, has stopped …
const STOPPED_LOOKS: u32 = 200 / LOOK_TICKS;
/// … unless it has come back this far by then, in Q16: 0.1 mm.
const TURNING: u32 = 6_554;

/// The needle's direction, for the state that is reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Direction {
    #[default]
    Rests,
    In,
    Out,
}

/// Tells a movement from a rest by the way that the needle goes, not by its speed: one count in a
/// window of the speed is 1.2 mm/s already, and a hand at rest trembles as fast.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Movement {
    direction: Direction,
    has_stopped: bool,
    is_turning: bool,
    /// The furthest place in this direction; at rest, where the rest began.
    furthest: Millimetres,
    quiet_looks: u32,
}

impl Default for Movement {
    fn default() -> Self {
        Self {
            direction: Direction::Rests,
            has_stopped: true,
            is_turning: false,
            furthest: Millimetres::default(),
            quiet_looks: 0,
        }
    }
}

impl Movement {
    /// The needle's direction at the last look.
    pub(crate) fn direction(&self) -> Direction {
        self.direction
    }

    /// True if the needle had stopped by the last look: earlier than it rests, and not while it
    /// turns round.
    pub(crate) fn has_stopped(&self) -> bool {
        self.has_stopped
    }

    /// True if the needle had come back by 0.1 mm by the last look.
    pub(crate) fn is_turning(&self) -> bool {
        self.is_turning
    }

    /// Follows the tip, every [`LOOK_TICKS`].
    pub(crate) fn look(&mut self, depth: Millimetres) {
        let off = depth.0.saturating_sub(self.furthest.0).to_bits();
        let gone = if self.direction == Direction::Out { off.saturating_neg() } else { off };
        self.quiet_looks = self.quiet_looks.saturating_add(1);
        if gone > 0 && self.direction != Direction::Rests {
            (self.furthest, self.quiet_looks) = (depth, 0);
        } else if off.unsigned_abs() >= TURNED {
            self.direction = if off > 0 { Direction::In } else { Direction::Out };
            (self.furthest, self.quiet_looks) = (depth, 0);
        } else if self.quiet_looks == QUIET_LOOKS {
            (self.direction, self.furthest) = (Direction::Rests, depth);
        }
        self.is_turning = off.unsigned_abs() >= TURNING;
        self.has_stopped =
            self.direction == Direction::Rests || self.quiet_looks > STOPPED_LOOKS && !self.is_turning;
    }
}

/// `dividend / divisor` to 20 bits or more for a divisor below 2^11, saturating: the board divides
/// 32 bits in one instruction and 64 in a hundred.
fn quotient(dividend: u64, divisor: u32) -> i32 {
    let (high, low) = ((dividend >> 32) as u32, dividend as u32);
    let excess = 32 - high.leading_zeros();
    let leading = high.unbounded_shl(32 - excess) | low.unbounded_shr(excess);
    let quotient = leading / divisor.max(1);
    if quotient.leading_zeros() > excess { (quotient << excess).cast_signed() } else { i32::MAX }
}

/// Speed from counts. Memory for either method; a tick costs the same however fast the needle is.
#[derive(Clone, Debug)]
pub(crate) struct SpeedEstimator {
    method: SpeedMethod,
    window: [i32; WINDOW_TICKS as usize],
    /// A ring: the edge with number n is at n modulo [`EDGES`].
    edges: [Edge; EDGES],
    latest: Edge,
    /// Ticks and counts from where the window begins to `latest`.
    span: Edge,
    /// The tick in which the latest of them was stored.
    stored_tick: u32,
    /// Number of the next edge that is stored.
    next_edge: usize,
    /// Number of the oldest stored edge within the window, else of the last one before it.
    oldest_edge: usize,
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
            span: Edge { tick: 0, count: 0 },
            stored_tick: 0,
            next_edge: 1,
            oldest_edge: 0,
            now: 0,
        }
    }

    /// One tick: the speed at `count`.
    #[inline]
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
        self.forget_edge();
        if count != self.latest.count {
            self.latest = Edge { tick: self.now, count };
            if self.now.wrapping_sub(self.stored_tick) >= EDGE_SPACING_TICKS {
                self.store_edge();
            }
            let oldest = self.edge(self.oldest_edge);
            let ticks = self.now.wrapping_sub(oldest.tick);
            let is_recent = ticks <= REST_TICKS;
            self.span = if is_recent {
                Edge { tick: ticks, count: count.wrapping_sub(oldest.count) }
            } else {
                Edge { tick: 0, count: 0 }
            };
        }
        let silent = self.now.wrapping_sub(self.latest.tick);
        if silent > REST_TICKS {
            // Time stands still until the next edge: however long the rest is, no edge before it
            // becomes recent again when the number of ticks wraps.
            self.now = self.now.wrapping_sub(1);
            return MillimetresPerSecond::default();
        }
        // Waiting for the next edge bounds the speed from above: it is less than a count in
        // `silent`, however many counts came before.
        let Edge { tick, count } = self.span;
        if silent.wrapping_mul(count.unsigned_abs()) > tick {
            scale.speed(count.signum(), silent)
        } else {
            scale.speed(count, tick)
        }
    }

    fn edge(&self, number: usize) -> Edge {
        self.edges.get(number % EDGES).copied().unwrap_or(self.latest)
    }

    /// Stores the latest edge; the ring may lose its oldest.
    fn store_edge(&mut self) {
        if let Some(slot) = self.edges.get_mut(self.next_edge % EDGES) {
            *slot = self.latest;
        }
        self.stored_tick = self.now;
        self.next_edge = self.next_edge.wrapping_add(1);
        if self.next_edge.wrapping_sub(self.oldest_edge) > EDGES {
            self.oldest_edge = self.oldest_edge.wrapping_add(1);
        }
    }

    /// Lets go of the oldest edge once it has left the window; never of the last one. Stored edges
    /// are more than a tick apart: one a tick is enough.
    fn forget_edge(&mut self) {
        let age = self.now.wrapping_sub(self.edge(self.oldest_edge).tick);
        let next = self.oldest_edge.wrapping_add(1);
        if age > WINDOW_TICKS && next != self.next_edge {
            self.oldest_edge = next;
        }
    }
}

/// Returns the needle's motion: the wrapped difference of two absolute counts.
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

#[cfg(test)]
#[expect(clippy::indexing_slicing, reason = "a test")]
mod tests;
