//! Distinguishes an encoder that no longer counts from a hand that holds still.
//!
//! Both look the same: torque, and no count. A hand shows itself when the torque falls, because its
//! own force then moves the needle; a dead encoder shows nothing, whatever the torque. So after a
//! while of torque without a count the torque is taken away, within 40 ms, until a count comes: the
//! force that a hand feels changes by no more than it takes to move its needle by a count, and
//! comes back within 50 ms. If no count comes, not even without torque, the encoder is dead.
//!
//! The wait depends on what the encoder's lines say. An encoder without its supply or its ground
//! leaves both of them at one level, as a live one does at every other count. If they agree, 50 ms
//! without a count are in doubt. If one is high and the other low, both against their pulls, the
//! encoder has power, and only its disc or an output could be dead: that is in doubt after 4 s. So
//! are counts that go to and fro between two values for 4 s, as they do when one channel is dead.
//!
//! Each tick notes its step; the rest is done in one tick of eight, so that the tick stays short.

use crate::TICK_HZ;
use crate::math::truncating_product;
use fixed::types::{I2F30, I16F16, U16F16};

/// Ticks from one look to the next: 0.8 ms.
pub(crate) const LOOK_TICKS: u32 = 8;
/// Looks in a second.
const LOOK_HZ: u32 = TICK_HZ / LOOK_TICKS;
/// Looks with torque and without a count before a needle whose lines agree is in doubt: 50 ms.
const AGREEING_LOOKS: u32 = 50 * LOOK_HZ / 1_000;
/// Looks before any other one is: 4 s.
const DIFFERING_LOOKS: u32 = 4 * LOOK_HZ;
/// Share of the torque that is taken away in a look: all of it in 40 ms.
const FALL: I2F30 = I2F30::from_bits(I2F30::ONE.to_bits() / (40 * LOOK_HZ as i32 / 1_000));
/// Share that comes back in a look: all of it in 50 ms.
const RISE: I2F30 = I2F30::from_bits(I2F30::ONE.to_bits() / (50 * LOOK_HZ as i32 / 1_000));
/// Looks without torque after which a needle that has not moved is not held by a hand: 10 ms.
const WITHOUT_TORQUE_LOOKS: u32 = 10 * LOOK_HZ / 1_000;

/// The needle has moved.
const MOVED: u8 = 1;
/// It has moved, and not back to where the step before came from.
const PROGRESSED: u8 = 2;

/// The watch with its memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stillness {
    /// [`MOVED`] and [`PROGRESSED`] since the last look.
    moves: u8,
    /// Looks with torque since the last count.
    since_count: u32,
    /// Looks with torque since the last count that did not go back to where the one before came
    /// from.
    since_progress: u32,
    /// Share of the torque that is taken away.
    taken: I2F30,
    without_torque: u32,
}

impl Default for Stillness {
    fn default() -> Self {
        Self { moves: 0, since_count: 0, since_progress: 0, taken: I2F30::ZERO, without_torque: 0 }
    }
}

impl Stillness {
    /// Takes a step of the needle; `is_back` if it went back to where the step before came from.
    /// Called in every tick with a step.
    #[inline]
    pub(crate) fn step(&mut self, is_back: bool) {
        self.moves |= if is_back { MOVED } else { MOVED | PROGRESSED };
    }

    /// Returns true if the needle has got on since the last look and all of the torque is given:
    /// then there is nothing to look at.
    #[inline]
    pub(crate) fn is_moving(&self) -> bool {
        self.moves & PROGRESSED != 0 && !self.is_asking()
    }

    /// Begins anew, as after a step of the needle that got on.
    #[inline]
    pub(crate) fn forget(&mut self) {
        (self.moves, self.since_count, self.since_progress) = (0, 0, 0);
    }

    /// Takes a look; `is_loaded` if the torque that the law asks for would move a needle that
    /// nobody holds. Called in one tick of [`LOOK_TICKS`].
    pub(crate) fn look(&mut self, is_loaded: bool) {
        let moves = core::mem::take(&mut self.moves);
        // They never wrap: long before, the needle is in doubt.
        let next = |looks: u32, begins_anew: bool| if begins_anew { 0 } else { looks.wrapping_add(1) };
        self.since_count = next(self.since_count, moves & MOVED != 0 || !is_loaded);
        self.since_progress = next(self.since_progress, moves & PROGRESSED != 0 || !is_loaded);
    }

    /// Returns true if the encoder is in doubt, without asking it.
    pub(crate) fn is_doubtful(&self, lines_agree: bool) -> bool {
        (lines_agree && self.since_count > AGREEING_LOOKS) || self.since_progress > DIFFERING_LOOKS
    }

    /// Returns true while torque is being taken away or comes back.
    #[inline]
    pub(crate) fn is_asking(&self) -> bool {
        self.taken != I2F30::ZERO
    }

    /// Takes torque away while the encoder is in doubt, and gives it back; called after each look.
    /// `is_off` if no torque was given in the tick before. Returns true if the encoder is dead.
    pub(crate) fn ask(&mut self, is_doubtful: bool, is_off: bool) -> bool {
        if !is_doubtful {
            self.without_torque = 0;
            // Asked again before all of it is back, a hand would give way a little further each
            // time, and then no more.
            self.since_count = 0;
            self.taken = self.taken.saturating_sub(RISE).max(I2F30::ZERO);
            return false;
        }
        self.taken = self.taken.saturating_add(FALL).min(I2F30::ONE);
        if self.taken == I2F30::ONE && is_off {
            self.without_torque += 1;
        }
        self.without_torque > WITHOUT_TORQUE_LOOKS
    }

    /// Returns the rest of `torque`.
    pub(crate) fn left_of(&self, torque: I16F16) -> I16F16 {
        let left = I2F30::ONE.saturating_sub(self.taken);
        I16F16::from_bits(truncating_product(torque.to_bits(), left.to_bits(), 30))
    }
}

/// A torque below this share of the limit does not count: the friction of the needle's bearings.
const LOADED_SHARE: u32 = 8;
/// A torque that moves a needle which nobody holds is at least so many times the dry friction.
const TIMES_FRICTION: u32 = 3;

/// The smallest torque at which a needle without a count is looked at, in mN·m: an eighth of the
/// limit, or three times the dry friction, and the torque that is there even where no force is
/// felt.
pub(crate) fn loaded_torque(limit: I16F16, dry_friction: U16F16, at_rest: U16F16) -> U16F16 {
    let share = limit.unsigned_abs() / LOADED_SHARE;
    share.max(dry_friction.saturating_mul_int(TIMES_FRICTION)).saturating_add(at_rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ticks until the encoder is found dead if nothing moves, at most `ticks`.
    fn dead(lines_agree: bool, ticks: u32) -> Option<u32> {
        let mut still = Stillness::default();
        (0..ticks).step_by(LOOK_TICKS as usize).find(|_| {
            still.look(true);
            let is_doubtful = still.is_doubtful(lines_agree);
            let is_off = still.left_of(I16F16::ONE) == I16F16::ZERO;
            (is_doubtful || still.is_asking()) && still.ask(is_doubtful, is_off)
        })
    }

    #[test]
    fn an_encoder_that_never_counts_is_found() {
        let agreeing = dead(true, 10_000);
        assert!(agreeing.is_some_and(|ticks| (980..=1_030).contains(&ticks)), "{agreeing:?}");
        let differing = dead(false, 60_000);
        assert!(differing.is_some_and(|ticks| (40_480..=40_530).contains(&ticks)), "{differing:?}");
    }

    #[test]
    fn a_count_gives_the_torque_back() {
        let mut still = Stillness::default();
        let mut least = I16F16::ONE;
        for look in 0..2_500 {
            // It moves once a third of the torque is gone.
            let is_loaded = look < 1_250;
            if is_loaded && still.left_of(I16F16::ONE) < I16F16::from_num(2) / 3 {
                still.step(false);
            }
            still.look(is_loaded);
            let is_doubtful = still.is_doubtful(true);
            assert!(!still.ask(is_doubtful, false), "look {look}");
            least = least.min(still.left_of(I16F16::ONE));
        }
        assert!(least > I16F16::from_num(0.6), "{least}");
        assert_eq!(still.left_of(I16F16::ONE), I16F16::ONE);
    }

    #[test]
    fn a_count_to_and_fro_is_progress_for_four_seconds_only() {
        let mut still = Stillness::default();
        let mut found = None;
        for look in 0..7_500_u32 {
            if look.is_multiple_of(60) {
                still.step(true);
            }
            still.look(true);
            if still.is_doubtful(look % 120 < 60) && found.is_none() {
                found = Some(look);
            }
        }
        assert_eq!(found, Some(5_000));
    }
}
