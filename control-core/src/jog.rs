//! The jog effect of a wall (seed 001, eq. 1): it resists along a rising parabola, gives way, and relieves along a
//! falling one that is felt only while the tip cuts on.

use crate::config;
use crate::math::times;
use crate::units::{Millimetres, Newtons, Stiffness};
use fixed::types::{I2F30, I16F16};

/// A parabola ready for the tick: the division is done once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parabola {
    pub(crate) vertex: I16F16,
    inverse_compliance: I2F30,
    /// The inverse is scaled down by this, to fit its format where the compliance is below 1 mm²/N.
    shift: u32,
    pub(crate) base: I16F16,
}

impl Parabola {
    /// `config.compliance` is at least 0.05 mm²/N; [`crate::plan`] has seen to it.
    pub(crate) fn new(config: &config::Parabola) -> Self {
        let compliance = i64::from(config.compliance.0.to_bits().max(3_277));
        // 2^46 / (a·2^16) is 1/a in Q30; 1/a ≤ 20 needs five bits more than I2F30 has.
        let shift = if compliance <= 1 << 16 { 5 } else { 0 };
        let inverse = ((1_i64 << (46 - shift)) + compliance / 2) / compliance;
        Self {
            vertex: config.vertex.0,
            inverse_compliance: I2F30::from_bits(i32::try_from(inverse).unwrap_or(i32::MAX)),
            shift,
            base: config.base.0,
        }
    }

    /// `(T − n)²/a + b`, saturating.
    pub(crate) fn force(&self, travel: Millimetres) -> Newtons {
        let from_vertex = travel.0.saturating_sub(self.vertex);
        let square: I16F16 = from_vertex.wide_mul(from_vertex).saturating_to_num();
        let rise = times(square, self.inverse_compliance).saturating_mul_int(1 << self.shift);
        Newtons(rise.saturating_add(self.base))
    }
}

/// A wall ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    pub(crate) elastic: Parabola,
    pub(crate) relief: Parabola,
    unload: Stiffness,
}

impl Wall {
    pub(crate) fn new(config: &config::Wall) -> Self {
        Self {
            elastic: Parabola::new(&config.elastic),
            relief: Parabola::new(&config.relief),
            unload: config.unload,
        }
    }

    /// Force of the wall that has given way. `frontier` is the furthest travel since then; drawn back from it, the force
    /// lets go along the unloading slope and never pulls.
    pub(crate) fn relief_force(&self, travel: Millimetres, frontier: Millimetres) -> Newtons {
        let cutting = self.relief.force(Millimetres(frontier.0.min(self.relief.vertex)));
        let drawn_back = frontier.0.saturating_sub(travel.0);
        let unloaded = drawn_back.saturating_mul(self.unload.0);
        Newtons(cutting.0.saturating_sub(unloaded).max(I16F16::ZERO))
    }

    /// Whether cutting on at `frontier` still falls along the relief parabola.
    pub(crate) fn is_relieving(&self, frontier: Millimetres) -> bool {
        frontier.0 < self.relief.vertex
    }
}
