//! The clamped proxy that all three laws hold the needle with: an anchor `w` that is dragged along
//! at a distance which the force allows, and may come after the needle by itself; the force is a
//! stiffness times `x − w`.

use crate::units::Millimetres;
use fixed::types::{I2F30, I16F16, I32F32};

/// The point that the needle is held to: P_curr_f of Paper 001's eq. 2, the tracking wall of
/// Paper 002.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Anchor {
    /// Finer than a depth: an anchor that comes after the needle does so by shares of a thousandth
    /// and less.
    position: I32F32,
}

impl Anchor {
    /// No force: the anchor is where the needle is.
    pub(crate) fn release(&mut self, depth: Millimetres) {
        self.position = fine(depth.0);
    }

    /// Goes `share` of the way to `target`.
    pub(crate) fn follow(&mut self, target: I16F16, share: I2F30) {
        let way = i64::from(target.saturating_sub(coarse(self.position + UPWARDS)).to_bits());
        self.position += I32F32::from_bits((way * i64::from(share.to_bits())) >> 14);
    }

    /// Is dragged along by a needle at `depth`, no further than `behind` it on its way in and
    /// `ahead` of it on its way out. Neither is negative. Whether it was dragged.
    pub(crate) fn drag(&mut self, depth: Millimetres, behind: I16F16, ahead: I16F16) -> bool {
        let (nearest, furthest) = (depth.0.saturating_sub(behind), depth.0.saturating_add(ahead));
        let at = coarse(self.position);
        if at < nearest {
            self.position = fine(nearest);
        } else if at > furthest {
            self.position = fine(furthest);
        } else {
            return false;
        }
        true
    }

    /// `x − w`, towards −∞.
    pub(crate) fn stretch(&self, depth: Millimetres) -> I16F16 {
        depth.0.saturating_sub(coarse(self.position + UPWARDS))
    }
}

/// All of a place but the last.
const UPWARDS: I32F32 = I32F32::from_bits(0xFFFF);

fn fine(length: I16F16) -> I32F32 {
    I32F32::from_bits(i64::from(length.to_bits()) << 16)
}

/// Rounds a position that began as a depth and never left the range of one.
fn coarse(position: I32F32) -> I16F16 {
    I16F16::from_bits((position.to_bits() >> 16) as i32)
}
