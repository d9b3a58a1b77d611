//! Tells an encoder that no longer counts from a hand that holds still.
//!
//! Both look the same: torque, and no count. A hand shows itself when the torque falls, for then its own force moves the needle; an
//! encoder that is dead shows nothing, whatever the torque. So when there has been torque and no count for a while, the torque is
//! taken away slowly, within 40 ms, until a count comes: the force that a hand feels changes by no more than it takes to move its needle
//! by a count, and comes back within 50 ms. Where no count comes, not even without torque, the encoder is dead.
//!
//! How long it waits depends on what the encoder's lines say. An encoder without its supply or its ground leaves both of them
//! at one level, as a live one does at every other count. Where they agree, 50 ms without a count are in doubt. Where one is
//! high and the other low, both against their pulls, the encoder has power, and only its disc or an output could be dead: that is in
//! doubt after 4 s. So are counts that go to and fro between two values for so long, as beside a channel that is dead.

use crate::TICK_HZ;
use crate::math::truncating_product;
use fixed::types::{I2F30, I16F16, U16F16};

/// Ticks with torque and without a count before a needle whose lines agree is in doubt: 50 ms.
const AGREEING_TICKS: u32 = 50 * TICK_HZ / 1_000;
/// Ticks before any other one is: 4 s.
const DIFFERING_TICKS: u32 = 4 * TICK_HZ;
/// Share of the torque that is taken away in a tick: all of it in 40 ms.
const FALL: I2F30 = I2F30::from_bits(I2F30::ONE.to_bits() / (40 * TICK_HZ as i32 / 1_000));
/// Share that comes back in a tick: all of it in 50 ms.
const RISE: I2F30 = I2F30::from_bits(I2F30::ONE.to_bits() / (50 * TICK_HZ as i32 / 1_000));
/// Ticks without torque after which a needle that has not moved is not held by a hand: 10 ms.
const WITHOUT_TORQUE_TICKS: u32 = 10 * TICK_HZ / 1_000;

/// The watch with its memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stillness {
    /// Ticks with torque since the last count.
    since_count: u32,
    /// Ticks with torque since the last count that did not go back to where the one before came from.
    since_progress: u32,
    /// Share of the torque that is taken away.
    taken: I2F30,
    without_torque: u32,
}

impl Default for Stillness {
    fn default() -> Self {
        Self { since_count: 0, since_progress: 0, taken: I2F30::ZERO, without_torque: 0 }
    }
}

/// A tick as the watch sees it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    /// The needle has moved.
    pub(crate) has_moved: bool,
    /// It went back to where the step before came from.
    pub(crate) is_back: bool,
}

impl Stillness {
    /// Takes a tick; `is_loaded` where the torque that the law asks for would move a needle that nobody holds.
    pub(crate) fn see(&mut self, seen: Seen, is_loaded: bool) {
        if !is_loaded {
            (self.since_count, self.since_progress) = (0, 0);
            return;
        }
        self.since_count = if seen.has_moved { 0 } else { self.since_count.saturating_add(1) };
        let is_still = !seen.has_moved || seen.is_back;
        self.since_progress = if is_still { self.since_progress.saturating_add(1) } else { 0 };
    }

    /// Whether the encoder is in doubt, without asking it.
    pub(crate) fn is_doubtful(&self, lines_agree: bool) -> bool {
        (lines_agree && self.since_count > AGREEING_TICKS) || self.since_progress > DIFFERING_TICKS
    }

    /// Whether torque is being taken away or comes back.
    pub(crate) fn is_asking(&self) -> bool {
        self.taken != I2F30::ZERO
    }

    /// Takes torque away while the encoder is in doubt, and gives it back. `is_off`: none was given in the tick before.
    /// Whether the encoder is dead.
    #[cold]
    #[inline(never)]
    pub(crate) fn ask(&mut self, is_doubtful: bool, is_off: bool) -> bool {
        if !is_doubtful {
            self.without_torque = 0;
            // Asked again before all of it is back, a hand would give way a little further each time, and then no more.
            self.since_count = 0;
            self.taken = self.taken.saturating_sub(RISE).max(I2F30::ZERO);
            return false;
        }
        self.taken = self.taken.saturating_add(FALL).min(I2F30::ONE);
        if self.taken == I2F30::ONE && is_off {
            self.without_torque += 1;
        }
        self.without_torque > WITHOUT_TORQUE_TICKS
    }

    /// What is left of `torque`.
    pub(crate) fn left_of(&self, torque: I16F16) -> I16F16 {
        let left = I2F30::ONE.saturating_sub(self.taken);
        I16F16::from_bits(truncating_product(torque.to_bits(), left.to_bits(), 30))
    }
}

/// A torque below this share of the limit is none: a friction of the needle's bearings.
const LOADED_SHARE: u32 = 8;
/// A torque that moves a needle which nobody holds is at least so many times the dry friction.
const TIMES_FRICTION: u32 = 3;

/// The torque from which on a needle without a count is looked at, in mN·m: an eighth of the limit, or three times the dry
/// friction, and what stands even where no force is felt.
pub(crate) fn loaded_torque(limit: I16F16, dry_friction: U16F16, at_rest: U16F16) -> U16F16 {
    let share = limit.unsigned_abs() / LOADED_SHARE;
    share.max(dry_friction.saturating_mul_int(TIMES_FRICTION)).saturating_add(at_rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    const STILL: Seen = Seen { has_moved: false, is_back: false };

    /// Ticks until the encoder is found dead where nothing moves, at most `ticks`.
    fn dead(lines_agree: bool, ticks: u32) -> Option<u32> {
        let mut still = Stillness::default();
        (0..ticks).find(|_| {
            still.see(STILL, true);
            let is_doubtful = still.is_doubtful(lines_agree);
            let is_off = still.left_of(I16F16::ONE) == I16F16::ZERO;
            (is_doubtful || still.is_asking()) && still.ask(is_doubtful, is_off)
        })
    }

    #[test]
    fn an_encoder_that_never_counts_is_found() {
        let agreeing = dead(true, 10_000);
        assert!(agreeing.is_some_and(|ticks| (990..=1_020).contains(&ticks)), "{agreeing:?}");
        let differing = dead(false, 60_000);
        assert!(differing.is_some_and(|ticks| (40_490..=40_520).contains(&ticks)), "{differing:?}");
    }

    #[test]
    fn a_count_gives_the_torque_back() {
        let mut still = Stillness::default();
        let mut least = I16F16::ONE;
        for tick in 0..20_000 {
            // It moves once a third of the torque is gone.
            let has_moved = still.left_of(I16F16::ONE) < I16F16::from_num(2) / 3 && tick < 10_000;
            let is_loaded = tick < 10_000;
            still.see(Seen { has_moved, ..STILL }, is_loaded);
            let is_doubtful = still.is_doubtful(true);
            assert!(!still.ask(is_doubtful, false), "tick {tick}");
            least = least.min(still.left_of(I16F16::ONE));
        }
        assert!(least > I16F16::from_num(0.6), "{least}");
        assert_eq!(still.left_of(I16F16::ONE), I16F16::ONE);
    }

    #[test]
    fn a_count_to_and_fro_is_progress_for_four_seconds_only() {
        let mut still = Stillness::default();
        let mut found = None;
        for tick in 0..60_000_u32 {
            let has_moved = tick.is_multiple_of(500);
            still.see(Seen { has_moved, is_back: true }, true);
            if still.is_doubtful(tick % 1_000 < 500) && found.is_none() {
                found = Some(tick);
            }
        }
        assert_eq!(found, Some(40_000));
    }
}
