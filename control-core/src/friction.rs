//! Friction along the needle inside tissue (seed 001, eq. 2): as printed, and as a clamped proxy that holds.

use crate::math::{exp, multiply, scaled};
use crate::units::{Millimetres, Newtons, Stiffness};
use fixed::types::{I2F30, I16F16, I32F32};

/// A law of friction ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Law {
    /// Equation 2 as printed, with the missing gain K_f.
    Paper {
        /// 1/S_f1 in 1/mm.
        per_level_length: I2F30,
        level_cap: I16F16,
        /// S_f2.
        follow: I2F30,
        stiffness: Stiffness,
        limit: Newtons,
    },
    /// `z = x − w`, clamped to `limit/K`; `F = K·z`.
    Cone { stiffness: Stiffness, inverse_stiffness: I16F16 },
}

/// The anchor `w` of either law: P_curr_f of the paper, the proxy of the cone.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Anchor {
    /// Finer than a depth: the paper's anchor follows by shares of a thousandth and less.
    position: I32F32,
}

impl Anchor {
    /// No friction: the anchor is where the needle is.
    pub(crate) fn release(&mut self, depth: Millimetres) {
        self.position = fine(depth.0);
    }

    /// One tick inside tissue. `inserted` is the length past the entry, `limit` the friction limit that the layers make
    /// there, for the law that asks.
    pub(crate) fn tick(
        &mut self,
        law: &Law,
        depth: Millimetres,
        inserted: Millimetres,
        limit: impl FnOnce() -> Newtons,
    ) -> Newtons {
        match law {
            Law::Paper { per_level_length, level_cap, follow, stiffness, limit } => {
                self.follow(depth, *follow);
                // 1/S_f1 is at most 1.
                let levels = scaled(inserted.0.to_bits(), per_level_length.to_bits(), 30);
                let level = exp(I16F16::from_bits(levels)).min(*level_cap);
                // A metre, further than the needle is long: with levels up to 32 and slopes up to 7 N/mm all fits.
                let stretch = self.stretch(depth).to_bits().clamp(-1 << 26, (1 << 26) - 1);
                let levelled = scaled(stretch, level.to_bits(), 16);
                let force = I16F16::from_bits(scaled(levelled, stiffness.0.to_bits(), 16));
                Newtons(force.min(limit.0).max(-limit.0))
            }
            Law::Cone { stiffness, inverse_stiffness } => {
                let limit = limit();
                self.drag(depth, multiply(limit.0, *inverse_stiffness));
                Newtons(multiply(self.stretch(depth), stiffness.0).min(limit.0).max(-limit.0))
            }
        }
    }

    /// Goes `share` of the way to the needle.
    fn follow(&mut self, depth: Millimetres, share: I2F30) {
        let step_q46 = i64::from(self.stretch(depth).to_bits()) * i64::from(share.to_bits());
        self.position += I32F32::from_bits(step_q46 >> 14);
    }

    /// Is dragged along only when the cone is full; a resting needle keeps its force.
    fn drag(&mut self, depth: Millimetres, reach: I16F16) {
        let (nearest, furthest) = (depth.0.saturating_sub(reach), depth.0.saturating_add(reach));
        self.position = fine(coarse(self.position).clamp(nearest, furthest));
    }

    /// `x − w`, towards −∞.
    fn stretch(&self, depth: Millimetres) -> I16F16 {
        let upwards = I32F32::from_bits(0xFFFF);
        depth.0.saturating_sub(coarse(self.position + upwards))
    }
}

fn fine(length: I16F16) -> I32F32 {
    I32F32::from_bits(i64::from(length.to_bits()) << 16)
}

/// Of a position that began as a depth and never left the range of one.
fn coarse(position: I32F32) -> I16F16 {
    I16F16::from_bits((position.to_bits() >> 16) as i32)
}
