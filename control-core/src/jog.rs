//! The jog effect of a wall (seed 001, eq. 1): it resists along a rising parabola, gives way, and relieves along a
//! falling one that is felt only while the tip cuts on.

use crate::config;
use crate::math::{multiply, product};
use crate::units::{Millimetres, Newtons, Stiffness};
use fixed::types::{I9F23, I16F16};

/// A parabola ready for the tick. `(x − n)²/a` is computed as `((x − n)/√a)²`: two multiplications, and precise for a
/// soft wall and a hard one alike.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parabola {
    /// Depth at which it turns.
    vertex: I16F16,
    inverse_root_compliance: I9F23,
    base: I16F16,
}

impl Parabola {
    /// For a layer that begins at `top`. `config.compliance` is at least 0.05 mm²/N; [`crate::plan`] has seen to it.
    pub(crate) fn new(config: &config::Parabola, top: Millimetres) -> Self {
        let compliance = u64::from(config.compliance.0.to_bits().unsigned_abs().max(3_277));
        // a is a·2^16 here, so 2^62/a is (1/a)·2^46, whose root is Q23.
        let root = ((1_u64 << 62) / compliance).isqrt();
        Self {
            vertex: top.0.saturating_add(config.vertex.0),
            inverse_root_compliance: I9F23::from_bits(i32::try_from(root).unwrap_or(i32::MAX)),
            base: config.base.0,
        }
    }

    /// `(x − n)²/a + b` at depth `x`, saturating.
    pub(crate) fn force(&self, depth: Millimetres) -> Newtons {
        let from_vertex = depth.0.saturating_sub(self.vertex);
        // Q16 · Q23 to Q22, whose square is Q44, to Q16.
        let root_q22 = product(from_vertex.to_bits(), self.inverse_root_compliance.to_bits(), 17);
        let rise = I16F16::from_bits(product(root_q22, root_q22, 28));
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
    /// Of a layer that begins at `top`.
    pub(crate) fn new(config: &config::Wall, top: Millimetres) -> Self {
        Self {
            elastic: Parabola::new(&config.elastic, top),
            relief: Parabola::new(&config.relief, top),
            unload: config.unload,
        }
    }

    /// Force of the wall that has given way. `frontier` is the furthest depth since then; drawn back from it, the force
    /// lets go along the unloading slope and never pulls.
    pub(crate) fn relief_force(&self, depth: Millimetres, frontier: Millimetres) -> Newtons {
        let cutting = if self.is_relieving(frontier) {
            self.relief.force(frontier).0
        } else if self.relief.base > I16F16::ZERO {
            self.relief.base
        } else {
            return Newtons::default();
        };
        let drawn_back = frontier.0.saturating_sub(depth.0);
        let unloaded = multiply(drawn_back, self.unload.0);
        Newtons(cutting.saturating_sub(unloaded).max(I16F16::ZERO))
    }

    /// Whether cutting on at `frontier` still falls along the relief parabola.
    pub(crate) fn is_relieving(&self, frontier: Millimetres) -> bool {
        frontier.0 < self.relief.vertex
    }
}
