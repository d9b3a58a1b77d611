//! Friction along the needle inside tissue (seed 001, eq. 2): as printed, and as a clamped proxy that holds.

use crate::math::{exp, times};
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
    position: I32F32,
}

impl Anchor {
    /// No friction: the anchor is where the needle is.
    pub(crate) fn release(&mut self, depth: Millimetres) {
        self.position = depth.0.into();
    }

    /// One tick inside tissue. `inserted` is the length past the entry, `limit` the friction limit there.
    pub(crate) fn tick(
        &mut self,
        law: &Law,
        depth: Millimetres,
        inserted: Millimetres,
        limit: Newtons,
    ) -> Newtons {
        match law {
            Law::Paper { per_level_length, level_cap, follow, stiffness, limit } => {
                let ahead: I16F16 = I32F32::from(depth.0).saturating_sub(self.position).saturating_to_num();
                let step: I32F32 = I32F32::saturating_from_num(ahead.wide_mul(*follow));
                self.position = self.position.saturating_add(step);
                let stretch: I16F16 = I32F32::from(depth.0).saturating_sub(self.position).saturating_to_num();
                let level = exp(times(inserted.0, *per_level_length)).min(*level_cap);
                let force = stretch.saturating_mul(level).saturating_mul(stiffness.0);
                Newtons(force.clamp(-limit.0, limit.0))
            }
            Law::Cone { stiffness, inverse_stiffness } => {
                let reach = I32F32::from(limit.0.saturating_mul(*inverse_stiffness));
                let x = I32F32::from(depth.0);
                // The proxy is dragged only when the cone is full; a resting needle keeps its force.
                self.position = self.position.clamp(x.saturating_sub(reach), x.saturating_add(reach));
                let stretch: I16F16 = x.saturating_sub(self.position).saturating_to_num();
                Newtons(stretch.saturating_mul(stiffness.0).clamp(-limit.0, limit.0))
            }
        }
    }
}
