//! Watches the energy that goes in and out through the needle, of walls and of friction apart. An
//! element that gives back more than it was given is active and rings; then damping takes the
//! surplus away from its force (time-domain passivity control, Hannaford and Ryu 2002). It may
//! reduce a force that pushes the needle along and never turns it round.
//!
//! Apart, because friction takes energy all the way in and gives none of it back: counted with the
//! walls it would be a credit that they could spend for seconds. What a wall has stored is gone
//! when it gives way; of what friction took no more can come back than its hold stores. What counts
//! is the force that the motor gave, after every limit.

use crate::TICK_HZ;
use crate::math::{saturating_product, truncating_product};
use crate::units::{Damping, Millimetres, Newtons};
use fixed::types::{I8F24, I16F16};

/// Below this an element stores nothing worth counting, and a new count begins: 5 mN.
const NOTHING: i32 = 328;
/// Ticks over which the speed of a bounce is taken: 0.8 ms, for the speed window is too slow for
/// it.
const BOUNCE_TICKS: usize = 8;

/// The observer's damping ready for the tick; none leaves it off.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BounceDamping {
    /// Force for each mm that the needle has moved in [`BOUNCE_TICKS`].
    newtons_per_mm: I8F24,
}

impl BounceDamping {
    /// `damping` is at most 0.02 N·s/mm; [`crate::plan`] has seen to it.
    pub(crate) fn new(damping: Damping) -> Self {
        const BOUNCES_PER_SECOND: i32 = (TICK_HZ as usize / BOUNCE_TICKS) as i32;
        Self { newtons_per_mm: damping.0.saturating_mul_int(BOUNCES_PER_SECOND) }
    }
}

/// The most that a hold of friction stores: 1 N at 1 N/mm.
const FRICTION_STORE: Energy = Energy(1 << (ENERGY_PLACES - 1));
/// No further than this the needle goes in a tick, a step less than 1 mm: that would be 10 m/s,
/// which is a fault.
const LARGEST_WAY: i32 = (1 << 16) - 1;
/// Binary places of an [`Energy`].
const ENERGY_PLACES: u32 = 20;

/// Energy in mJ, in Q20: steps of a nanojoule, up to 2 J.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
struct Energy(i32);

impl Energy {
    /// With the work of `force` over `way`, which is at most [`LARGEST_WAY`].
    fn with_work(self, force: Newtons, way: i32) -> Self {
        // Q16 times Q16; 256 N over 1 mm fit.
        let work = truncating_product(force.0.to_bits(), way, 32 - ENERGY_PLACES);
        Self(self.0.saturating_add(work))
    }

    fn is_negative(self) -> bool {
        self.0 < 0
    }
}

/// The force of the tissue by what makes it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Elements {
    /// The force of walls, which return the energy that they store.
    pub(crate) walls: Newtons,
    /// The force of friction, cutting and damping.
    pub(crate) friction: Newtons,
}

impl Elements {
    /// No force.
    pub(crate) const NONE: Self = Self { walls: Newtons(I16F16::ZERO), friction: Newtons(I16F16::ZERO) };

    /// All together.
    pub(crate) fn total(self) -> Newtons {
        Newtons(self.walls.0.saturating_add(self.friction.0))
    }
}

/// The observer with its memory.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Observer {
    /// The energy that went into the walls and has not come out.
    walls: Energy,
    /// The same of friction, at most [`FRICTION_STORE`].
    friction: Energy,
    /// The forces of the tick before, as the motor gave them.
    given: Elements,
    depth: Millimetres,
    depths: [Millimetres; BOUNCE_TICKS],
    next: usize,
}

impl Observer {
    /// From where the needle is, with no energy counted yet.
    pub(crate) fn new(depth: Millimetres) -> Self {
        Self { depth, depths: [depth; BOUNCE_TICKS], ..Self::default() }
    }

    /// One tick in which a wall may have given way: the force to give instead of `wanted`, and
    /// whether damping was added.
    pub(crate) fn tick(
        &mut self,
        damping: BounceDamping,
        depth: Millimetres,
        wanted: Elements,
        has_given_way: bool,
    ) -> (Newtons, bool) {
        self.count_energy(depth, wanted, has_given_way);
        let moved = self.moved_in_a_bounce(depth);
        self.given = wanted;
        let is_active = self.walls.is_negative() || self.friction.is_negative();
        if is_active && moved != I16F16::ZERO && damping.newtons_per_mm > I8F24::ZERO {
            self.damp(damping, moved);
            return (self.given.total(), self.given != wanted);
        }
        (wanted.total(), false)
    }

    /// The motor gave so much less than the force of the tick, N, because of a limit: the walls
    /// gave it the less.
    pub(crate) fn held_back(&mut self, missing: I16F16) {
        let walls = self.given.walls.0;
        let left = walls.saturating_sub(missing);
        let (least, most) = if walls.is_negative() { (walls, I16F16::ZERO) } else { (I16F16::ZERO, walls) };
        self.given.walls = Newtons(left.clamp(least, most));
    }

    /// Counts the energy of the forces of the tick before over the way since then.
    fn count_energy(&mut self, depth: Millimetres, wanted: Elements, has_given_way: bool) {
        let way = depth.0.saturating_sub(self.depth.0).to_bits().clamp(-LARGEST_WAY - 1, LARGEST_WAY);
        self.depth = depth;
        self.walls = counted(self.walls, self.given.walls, wanted.walls, way);
        if has_given_way {
            // What it had stored has gone into its tearing.
            self.walls = self.walls.min(Energy::default());
        }
        self.friction = counted(self.friction, self.given.friction, wanted.friction, way).min(FRICTION_STORE);
    }

    fn moved_in_a_bounce(&mut self, depth: Millimetres) -> I16F16 {
        self.next = (self.next + 1) % BOUNCE_TICKS;
        let Some(oldest) = self.depths.get_mut(self.next) else { return I16F16::ZERO };
        let moved = depth.0.saturating_sub(oldest.0);
        *oldest = depth;
        moved
    }

    /// Reduces what an active element gives along the needle's way.
    #[inline(never)]
    fn damp(&mut self, damping: BounceDamping, moved: I16F16) {
        let damped = |force: Newtons| {
            let is_pushed_along = force.0.is_negative() != moved.is_negative();
            if is_pushed_along { reduced(damping, moved, force) } else { force }
        };
        if self.walls.is_negative() {
            self.given.walls = damped(self.given.walls);
        }
        if self.friction.is_negative() {
            self.given.friction = damped(self.given.friction);
        }
    }
}

/// `energy` after `given` has acted over `way`; where next to nothing is wanted a new count begins.
fn counted(energy: Energy, given: Newtons, wanted: Newtons, way: i32) -> Energy {
    // From −NOTHING to NOTHING, both left out, in one comparison.
    let is_nothing =
        wanted.0.to_bits().wrapping_add(NOTHING - 1).cast_unsigned() < (2 * NOTHING - 1).cast_unsigned();
    if is_nothing { Energy::default() } else { energy.with_work(given, way) }
}

/// The energy that the compensation has put into the mechanism, less the energy that the found
/// friction has dissipated, in mN·m·counts in Q16. Waves by angle return what they took, up to what
/// they store; friction compensation puts in less than friction dissipates. An excess over that
/// store is a surplus that makes the needle ring: then nothing is given along the way of the needle
/// until friction has taken it. A weight does not count: it is the same on the way in and out.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Account {
    injected: i64,
    /// The way of the needle when it last moved.
    way: i32,
}

impl Account {
    /// One tick in which the needle moved by `way` counts under `before`, against `friction` of the
    /// mechanism (mN·m): what to give of `wanted`, and whether something was held back.
    pub(crate) fn allow(
        &mut self,
        store: i64,
        before: I16F16,
        friction: I16F16,
        way: i32,
        wanted: I16F16,
    ) -> (I16F16, bool) {
        if way != 0 {
            // A needle that turns round meets the edge again that it has just passed, and has gone
            // no way in between.
            let has_turned = way.is_negative() != self.way.is_negative();
            let gone = if has_turned { way - (way >> 31 | 1) } else { way };
            self.way = way;
            // Both far from the largest number.
            let left = if gone.is_negative() { before + friction } else { before - friction };
            self.injected = (self.injected + i64::from(left.to_bits()) * i64::from(gone)).max(-store);
        }
        let is_along = wanted != I16F16::ZERO && wanted.is_negative() == self.way.is_negative();
        if self.injected > store && is_along { (I16F16::ZERO, true) } else { (wanted, false) }
    }
}

/// `wanted` without what damping takes, towards zero.
fn reduced(damping: BounceDamping, moved: I16F16, wanted: Newtons) -> Newtons {
    let surplus = saturating_product(moved.saturating_abs().to_bits(), damping.newtons_per_mm.to_bits(), 24);
    let left = wanted.0.saturating_abs().saturating_sub(I16F16::from_bits(surplus)).max(I16F16::ZERO);
    Newtons(if wanted.0 < I16F16::ZERO { -left } else { left })
}

#[cfg(test)]
mod tests;
