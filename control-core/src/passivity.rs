//! Watches the energy that goes in and out through the needle. A virtual wall that gives back more than it was given is
//! active and rings; then damping takes the surplus away (time-domain passivity control, Hannaford and Ryu 2002). It may
//! reduce the force that pushes out and never turns it round.

use crate::TICK_HZ;
use crate::math::product;
use crate::units::{Damping, Millimetres, Newtons};
use fixed::types::{I8F24, I16F16, I32F32, U16F16};

/// Below this the tissue stores nothing worth counting, and a new count begins: 5 mN.
const NOTHING: U16F16 = U16F16::from_bits(328);
/// Ticks over which the speed of a bounce is taken: 0.8 ms, for the speed window is too slow for it.
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

/// The observer with its memory.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Observer {
    /// Energy that went in and has not come out, in mJ.
    energy: I32F32,
    force: Newtons,
    depth: Millimetres,
    depths: [Millimetres; BOUNCE_TICKS],
    next: usize,
}

impl Observer {
    /// From where the needle is, with no energy counted yet.
    pub(crate) fn new(depth: Millimetres) -> Self {
        Self { depth, depths: [depth; BOUNCE_TICKS], ..Self::default() }
    }

    /// One tick: the force to give instead of `wanted`, and whether damping was added.
    pub(crate) fn tick(
        &mut self,
        damping: BounceDamping,
        depth: Millimetres,
        wanted: Newtons,
    ) -> (Newtons, bool) {
        self.count_energy(depth, wanted);
        let moved = self.moved_in_a_bounce(depth);
        let is_pushed_along = moved != I16F16::ZERO && wanted.0.is_negative() != moved.is_negative();
        let reduces = self.energy < I32F32::ZERO && is_pushed_along && damping.newtons_per_mm > I8F24::ZERO;
        let given = if reduces { reduced(damping, moved, wanted) } else { wanted };
        self.force = given;
        (given, reduces)
    }

    /// What the force of the tick before did over the way since then.
    fn count_energy(&mut self, depth: Millimetres, wanted: Newtons) {
        let way = depth.0.saturating_sub(self.depth.0);
        self.depth = depth;
        self.energy = if wanted.0.unsigned_abs() < NOTHING {
            I32F32::ZERO
        } else {
            self.energy.saturating_add(self.force.0.wide_mul(way))
        };
    }

    fn moved_in_a_bounce(&mut self, depth: Millimetres) -> I16F16 {
        self.next = (self.next + 1) % BOUNCE_TICKS;
        let Some(oldest) = self.depths.get_mut(self.next) else { return I16F16::ZERO };
        let moved = depth.0.saturating_sub(oldest.0);
        *oldest = depth;
        moved
    }
}

/// What the compensation has put into the mechanism, less what the friction that was found there has taken out of it, in
/// mN·m·counts in Q16. Waves by angle give back what they took, up to what they store; friction gives back less than it is
/// there to take. What is more than that store is a surplus that makes the needle ring: then nothing is given along the way of
/// the needle until friction has taken it. A weight does not count: it is the same on the way in and out.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Account {
    injected: i64,
    /// The way of the needle when it last moved.
    way: i32,
}

impl Account {
    /// One tick in which the needle moved by `way` counts under `before`, against `friction` of the mechanism (mN·m): what to
    /// give of `wanted`, and whether something was held back.
    pub(crate) fn allow(
        &mut self,
        store: i64,
        before: I16F16,
        friction: I16F16,
        way: i32,
        wanted: I16F16,
    ) -> (I16F16, bool) {
        if way != 0 {
            // A needle that turns round meets the edge again that it has just passed, and has gone no way in between.
            let has_turned = way.is_negative() != self.way.is_negative();
            let gone = if has_turned { way - way.signum() } else { way };
            self.way = way;
            let given = i64::from(before.to_bits()) * i64::from(gone);
            let taken = i64::from(friction.to_bits()) * i64::from(gone.unsigned_abs());
            self.injected = (self.injected + given - taken).max(-store);
        }
        let is_along = wanted != I16F16::ZERO && wanted.is_negative() == self.way.is_negative();
        if self.injected > store && is_along { (I16F16::ZERO, true) } else { (wanted, false) }
    }
}

/// `wanted` without what damping takes, towards zero.
fn reduced(damping: BounceDamping, moved: I16F16, wanted: Newtons) -> Newtons {
    let surplus = product(moved.saturating_abs().to_bits(), damping.newtons_per_mm.to_bits(), 24);
    let left = wanted.0.saturating_abs().saturating_sub(I16F16::from_bits(surplus)).max(I16F16::ZERO);
    Newtons(if wanted.0 < I16F16::ZERO { -left } else { left })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn n(newtons: f64) -> Newtons {
        Newtons(I16F16::from_num(newtons))
    }

    fn mm(millimetres: f64) -> Millimetres {
        Millimetres(I16F16::from_num(millimetres))
    }

    /// 0.02 N·s/mm: 25 N for a millimetre in a bounce.
    fn damping() -> BounceDamping {
        BounceDamping::new(Damping(I8F24::from_num(0.02)))
    }

    #[test]
    fn damping_takes_its_share_and_never_turns_the_force_round() {
        for sign in [-1.0, 1.0] {
            let moved = I16F16::from_num(-0.04 * sign);
            let Newtons(left) = reduced(damping(), moved, n(3.0 * sign));
            assert!((left.to_num::<f64>() - 2.0 * sign).abs() < 1e-3, "{left}");
            assert_eq!(reduced(damping(), moved, n(0.5 * sign)), n(0.0));
        }
    }

    /// A force that pushes the needle before it from the first tick on gives energy that nobody put in.
    #[expect(clippy::float_arithmetic, reason = "a test")]
    fn pushed(force: f64, from: f64, step: f64, ticks: i32) -> (Observer, usize) {
        let mut observer = Observer::new(mm(from));
        let reduced = (1..=ticks).filter(|&tick| {
            let depth = mm(from + step * f64::from(tick));
            observer.tick(damping(), depth, n(force)).1
        });
        let reduced = reduced.count();
        (observer, reduced)
    }

    #[test]
    fn only_a_force_that_gives_more_than_it_got_is_reduced() {
        // In the first tick no force has done anything yet.
        assert_eq!(pushed(1.0, 5.0, -0.01, 20).1, 19, "pushed out");
        assert_eq!(pushed(-1.0, 5.0, 0.01, 20).1, 19, "pulled in");
        assert_eq!(pushed(1.0, 5.0, 0.01, 20).1, 0, "pressed in");
        assert_eq!(pushed(1.0, 5.0, 0.0, 20).1, 0, "held");
    }

    #[test]
    fn without_damping_nothing_is_reduced() {
        let mut observer = Observer::new(mm(5.0));
        let off = BounceDamping::new(Damping::default());
        for tick in 1..20 {
            let depth = mm(5.0 - 0.01 * f64::from(tick));
            assert_eq!(observer.tick(off, depth, n(1.0)), (n(1.0), false));
        }
    }

    #[test]
    fn what_was_put_in_may_come_out_again() {
        let (mut observer, _) = pushed(1.0, 5.0, 0.01, 20);
        let back = (0..18).filter(|&tick| {
            let depth = mm(5.2 - 0.01 * f64::from(tick));
            observer.tick(damping(), depth, n(1.0)).1
        });
        assert_eq!(back.count(), 0);
    }

    #[test]
    fn a_force_next_to_nothing_begins_a_new_count() {
        let (mut observer, _) = pushed(1.0, 5.0, -0.01, 20);
        assert!(observer.energy < I32F32::ZERO);
        observer.tick(damping(), mm(4.8), n(0.006));
        assert!(observer.energy < I32F32::ZERO, "6 mN are something");
        observer.tick(damping(), mm(4.8), n(0.004));
        assert_eq!(observer.energy, I32F32::ZERO);
    }

    #[test]
    fn a_compensation_gives_no_more_than_its_store_and_what_friction_takes() {
        let (store, torque, friction) = (10 << 16, I16F16::from_num(1), I16F16::from_num(0.5));
        let pushed = |friction, wanted: i32| {
            let mut account = Account::default();
            let wanted = I16F16::from_num(wanted);
            (0..100).filter(|_| account.allow(store, torque, friction, 1, wanted).1).count()
        };
        // Half a mN·m·count a tick is left, and 10 are allowed: the 21st is more.
        assert_eq!(pushed(friction, 1), 80);
        assert_eq!(pushed(friction, -1), 0, "what holds the needle back may stay");
        assert_eq!(pushed(torque, 1), 0, "friction takes all of it");
    }

    #[test]
    fn a_compensation_that_swings_in_its_store_is_left_alone_and_one_that_pumps_is_not() {
        // To and fro over a spring that is late by a count: each turn gives more than it took.
        let run = |late: i32| {
            let mut account = Account::default();
            let spring = |place: i32| I16F16::from_num(-place);
            let (mut before, mut place, mut held) = (I16F16::ZERO, -10, 0);
            for tick in 0..4_000_i32 {
                let way = if tick % 40 < 20 { 1 } else { -1 };
                place += way;
                let wanted = spring(place - late * way);
                let (given, is_held) = account.allow(60 << 16, before, I16F16::ZERO, way, wanted);
                (before, held) = (given, held + i32::from(is_held));
            }
            held
        };
        assert_eq!(run(0), 0);
        assert!(run(2) > 100, "{}", run(2));
    }
}
