//! The jog effect of a wall (seed 001, eq. 1): it resists along a rising parabola, gives way, and relieves along a
//! falling one that is felt only while the tip cuts on.

use crate::config;
use crate::units::{Millimetres, Newtons, Stiffness};
use fixed::types::{I9F23, I10F22, I16F16};

/// A parabola ready for the tick. `(T − n)²/a` is computed as `((T − n)/√a)²`: two multiplications, and precise for a
/// soft wall and a hard one alike.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parabola {
    pub(crate) vertex: I16F16,
    inverse_root_compliance: I9F23,
    base: I16F16,
}

impl Parabola {
    /// `config.compliance` is at least 0.05 mm²/N; [`crate::plan`] has seen to it.
    pub(crate) fn new(config: &config::Parabola) -> Self {
        let compliance = u64::from(config.compliance.0.to_bits().unsigned_abs().max(3_277));
        // a is a·2^16 here, so 2^62/a is (1/a)·2^46, whose root is Q23.
        let root = ((1_u64 << 62) / compliance).isqrt();
        Self {
            vertex: config.vertex.0,
            inverse_root_compliance: I9F23::from_bits(i32::try_from(root).unwrap_or(i32::MAX)),
            base: config.base.0,
        }
    }

    /// `(T − n)²/a + b`, saturating.
    pub(crate) fn force(&self, travel: Millimetres) -> Newtons {
        let from_vertex = travel.0.saturating_sub(self.vertex);
        let root: I10F22 = from_vertex.wide_mul(self.inverse_root_compliance).saturating_to_num();
        let rise: I16F16 = root.wide_mul(root).saturating_to_num();
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
        if !self.is_relieving(frontier) && self.relief.base <= 0 {
            return Newtons::default();
        }
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
