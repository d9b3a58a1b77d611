//! Interpolates between two counts of the encoder: the needle's place, and its speed without the
//! steps of a window of counts.
//!
//! At an edge the place is known: the border of two counts. From there on it moves with the steady
//! speed and never leaves its count. So the law sees a way without steps, late by nothing, and off
//! by half a count at most.

use crate::math::saturating_product;
use crate::units::{Millimetres, MillimetresPerSecond};
use fixed::types::I16F16;

/// The steady speed follows with a time constant of 2^9 ticks, 51 ms: a count in a window is 1.2
/// mm/s, and a table over speed would make a buzz of it.
const STEADY: u32 = 9;
/// A tick in s, times 2^14, in Q24: from mm/s in Q16 to mm in Q30.
const PER_TICK_Q24: i32 = 27_487_791;

/// Memory of the last count.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Interpolator {
    depth: Millimetres,
    /// The distance past the lower border of its count, mm in Q30.
    part: i32,
    /// mm/s in Q16 and nine bits more.
    steady: i64,
}

impl Interpolator {
    /// One tick at `depth`, the place of a count, with `speed` from a window; a count is this long.
    /// Between counts, and the steady speed. A needle that goes evenly is on average where its
    /// counts say.
    pub(crate) fn tick(
        &mut self,
        depth: Millimetres,
        speed: MillimetresPerSecond,
        count: I16F16,
    ) -> (Millimetres, MillimetresPerSecond) {
        self.steady += i64::from(speed.0.to_bits()) - (self.steady >> STEADY);
        let steady = (self.steady >> STEADY) as i32;
        // A count is at most 0.62 mm.
        let whole = count.to_bits() << 14;
        self.part = if depth == self.depth {
            let step = saturating_product(steady, PER_TICK_Q24, 24);
            // Not `clamp`, which panics where the bounds are the wrong way round.
            self.part.saturating_add(step).min(whole).max(0)
        } else if depth > self.depth {
            0
        } else {
            whole
        };
        self.depth = depth;
        let between = (self.part - whole / 2) >> 14;
        (
            Millimetres(depth.0.saturating_add(I16F16::from_bits(between))),
            MillimetresPerSecond(I16F16::from_bits(steady)),
        )
    }
}

#[cfg(test)]
#[expect(clippy::float_arithmetic, reason = "a test")]
mod tests {
    use super::*;

    /// Counts of 15.7 µm of a needle at an even speed; the speed as a window of 128 ticks sees it.
    fn follow(mm_per_s: f64, mut see: impl FnMut(f64, f64, f64)) {
        let count_mm = 0.015_708;
        let count_at = |tick: i32| (f64::from(tick) * mm_per_s * 1e-4 / count_mm).floor();
        let mut interpolator = Interpolator::default();
        for tick in 128..20_000 {
            let window = (count_at(tick) - count_at(tick - 128)) * count_mm / 0.0128;
            let depth = Millimetres(I16F16::from_num(count_at(tick) * count_mm));
            let speed = MillimetresPerSecond(I16F16::from_num(window));
            let (fine, steady) = interpolator.tick(depth, speed, I16F16::from_num(count_mm));
            let true_mm = f64::from(tick) * mm_per_s * 1e-4 - count_mm / 2.0;
            if tick > 6_000 {
                see(true_mm, fine.0.to_num(), steady.0.to_num());
            }
        }
    }

    #[test]
    fn an_even_way_is_followed_to_a_twentieth_of_a_count() {
        for mm_per_s in [1.0, -1.0, 3.0, 5.0, 20.0] {
            follow(mm_per_s, |wanted, fine, steady| {
                // Half a tick of way, and the place of an edge within its tick.
                let late = 0.000_1 * mm_per_s;
                assert!(
                    (fine - wanted).abs() < 0.000_8 + late.abs(),
                    "{mm_per_s} mm/s: {fine} mm, not {wanted}"
                );
                assert!((steady - mm_per_s).abs() < 0.08, "{mm_per_s} mm/s: {steady}");
            });
        }
    }

    #[test]
    fn a_needle_at_rest_stays_within_its_count() {
        let count = I16F16::from_num(0.015_708);
        let mut interpolator = Interpolator::default();
        let at = Millimetres(I16F16::from_num(3));
        let fast = MillimetresPerSecond(I16F16::from_num(50));
        interpolator.tick(at, fast, count);
        for _ in 0..10_000 {
            let (fine, _) = interpolator.tick(at, fast, count);
            assert!((fine.0 - at.0).saturating_abs() <= count / 2 + I16F16::DELTA);
        }
    }
}
