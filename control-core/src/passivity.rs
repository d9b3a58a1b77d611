//! Watches the energy that goes in and out through the needle. A virtual wall that gives back more than it was given is
//! active and rings; then damping takes the surplus away (time-domain passivity control, Hannaford and Ryu 2002). It may
//! reduce the force that pushes out and never turns it round.

use crate::math::times;
use crate::units::{Millimetres, MillimetresPerSecond, Newtons};
use fixed::types::{I2F30, I16F16, I32F32};

/// Below this the tissue stores nothing worth counting, and a new count begins: 5 mN.
const NOTHING: I16F16 = I16F16::from_bits(328);
/// Ticks over which the speed of a bounce is taken: 0.8 ms, for the speed window is too slow for it.
const BOUNCE_TICKS: usize = 8;

/// The observer with its memory.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Observer {
    /// Energy that went in and has not come out, in mJ.
    energy: I32F32,
    force: I16F16,
    depths: [I16F16; BOUNCE_TICKS],
    next: usize,
}

impl Observer {
    /// One tick: the force to give instead of `wanted`, and whether damping was added.
    pub(crate) fn tick(&mut self, damping: I2F30, depth: Millimetres, wanted: Newtons) -> (Newtons, bool) {
        let last = self.depths.get((self.next + BOUNCE_TICKS - 1) % BOUNCE_TICKS).copied().unwrap_or(depth.0);
        self.energy = self.energy.saturating_add(self.force.wide_mul(depth.0.saturating_sub(last)));
        if wanted.0.saturating_abs() < NOTHING {
            self.energy = I32F32::ZERO;
        }
        let speed = self.bounce_speed(depth);
        let reduces =
            damping > 0 && self.energy < I32F32::ZERO && (wanted.0 > 0) == (speed.0 < 0) && speed.0 != 0;
        let given = if reduces {
            let surplus = times(speed.0.saturating_abs(), damping).min(wanted.0.saturating_abs());
            wanted.0.saturating_sub(if wanted.0 > 0 { surplus } else { -surplus })
        } else {
            wanted.0
        };
        self.force = given;
        (Newtons(given), reduces)
    }

    fn bounce_speed(&mut self, depth: Millimetres) -> MillimetresPerSecond {
        let Some(oldest) = self.depths.get_mut(self.next) else { return MillimetresPerSecond::default() };
        let moved = depth.0.saturating_sub(*oldest);
        *oldest = depth.0;
        self.next = (self.next + 1) % BOUNCE_TICKS;
        const PER_SECOND: i32 = (crate::TICK_HZ as usize / BOUNCE_TICKS) as i32;
        MillimetresPerSecond(moved.saturating_mul_int(PER_SECOND))
    }
}
