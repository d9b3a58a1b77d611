//! Friction along the needle inside tissue (Paper 001, eq. 2): as printed, as a clamped proxy that
//! holds, and as one with a static and a dynamic level.

use crate::anchor::Anchor;
use crate::math::{exp, saturating_multiply, saturating_product, truncating_product};
use crate::units::{Millimetres, Newtons, Stiffness};
use fixed::types::{I2F30, I16F16};

/// A law of friction ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) enum PreparedFriction {
    /// Equation 2 as printed, with the missing gain K_f.
    Paper {
        /// 1/S_f1 in 1/mm.
        per_level_length: I2F30,
        level_cap: I16F16,
        /// S_f2.
        follow: I2F30,
        stiffness: Stiffness,
        /// T_f_max.
        limit: Newtons,
        /// T_f_min, negative.
        least: Newtons,
    },
    /// `z = x − w`, clamped to `limit/K`; `F = K·z`.
    Cone { stiffness: Stiffness, inverse_stiffness: I16F16 },
    /// The same, clamped to `sliding·limit/K` while the needle slides.
    StickSlip { stiffness: Stiffness, inverse_stiffness: I16F16, sliding: I16F16 },
}

/// A needle that has not slid for so many ticks sticks again: 20 ms. One that is slower than a
/// count in that time (0.8 mm/s at 16 µm a count) therefore counts as at rest from one count to the
/// next.
const STICKS_AFTER: u16 = 200;

/// The point at which the needle is held.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Hold {
    anchor: Anchor,
    /// Ticks for which the needle still counts as sliding, 0 is at rest; only of
    /// [`PreparedFriction::StickSlip`].
    sliding_ticks: u16,
}

impl Hold {
    /// Here, without a force.
    pub(crate) fn at(depth: Millimetres) -> Self {
        let mut hold = Self::default();
        hold.anchor.release(depth);
        hold
    }
}

impl PreparedFriction {
    /// One tick inside tissue. `inserted` is the length past the entry, `limit` the friction limit
    /// that the layers make there, for the law that asks.
    pub(crate) fn tick(
        &self,
        Hold { anchor, sliding_ticks }: &mut Hold,
        depth: Millimetres,
        inserted: Millimetres,
        limit: impl FnOnce() -> Newtons,
    ) -> Newtons {
        match self {
            PreparedFriction::Paper { per_level_length, level_cap, follow, stiffness, limit, least } => {
                anchor.follow(depth.0, *follow);
                // 1/S_f1 is at most 1.
                let levels = truncating_product(inserted.0.to_bits(), per_level_length.to_bits(), 30);
                let level = exp(I16F16::from_bits(levels)).min(*level_cap);
                // A metre, further than the needle is long: with levels up to 32 and slopes up to 7
                // N/mm all fits.
                let stretch = anchor.stretch(depth).to_bits().clamp(-1 << 26, (1 << 26) - 1);
                let levelled = saturating_product(stretch, level.to_bits(), 16);
                let force = I16F16::from_bits(saturating_product(levelled, stiffness.0.to_bits(), 16));
                Newtons(force.min(limit.0).max(least.0))
            }
            PreparedFriction::Cone { stiffness, inverse_stiffness } => {
                let limit = limit();
                let reach = saturating_multiply(limit.0, *inverse_stiffness);
                anchor.drag(depth, reach, reach);
                Newtons(saturating_multiply(anchor.stretch(depth), stiffness.0).min(limit.0).max(-limit.0))
            }
            PreparedFriction::StickSlip { stiffness, inverse_stiffness, sliding } => {
                let limit = limit().0;
                let level = if *sliding_ticks > 0 { saturating_multiply(limit, *sliding) } else { limit };
                let reach = saturating_multiply(level, *inverse_stiffness);
                let slides = anchor.drag(depth, reach, reach);
                *sliding_ticks = if slides { STICKS_AFTER } else { sliding_ticks.saturating_sub(1) };
                Newtons(saturating_multiply(anchor.stretch(depth), stiffness.0).min(level).max(-level))
            }
        }
    }
}
