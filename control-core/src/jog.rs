//! The jog effect of a wall (seed 001, eq. 1): it resists along a rising parabola, gives way, and relieves along a
//! falling one that is felt only while the tip cuts on.

use crate::config;
use crate::math::{product, scaled, upper_half};
use crate::units::{Millimetres, Newtons};
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

    /// `(x − n)²/a + b` at depth `x`, saturating: for a parabola that [`crate::plan`] has yet to check.
    pub(crate) fn force(&self, depth: Millimetres) -> Newtons {
        let from_vertex = self.past_vertex(depth);
        // Q16 · Q23 to Q22, whose square is Q44, to Q16.
        let root_q22 = product(from_vertex.to_bits(), self.inverse_root_compliance.to_bits(), 17);
        let rise = I16F16::from_bits(product(root_q22, root_q22, 28));
        Newtons(rise.saturating_add(self.base))
    }

    /// How far `depth` is past the vertex.
    fn past_vertex(&self, depth: Millimetres) -> I16F16 {
        depth.0.saturating_sub(self.vertex)
    }

    /// [`Self::force`] so far from the vertex, where the wall is felt: [`crate::plan`] has seen to it that the rise is
    /// below 256 N there.
    fn force_felt(&self, from_vertex: I16F16) -> Newtons {
        let root_q22 = scaled(from_vertex.to_bits(), self.inverse_root_compliance.to_bits(), 17);
        let rise = I16F16::from_bits(upper_half(root_q22 << 2, root_q22 << 2));
        Newtons(rise.saturating_add(self.base))
    }
}

/// A wall ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    elastic: Parabola,
    relief: Parabola,
    /// Slope of unloading, N/mm in Q28.
    unload_q28: i32,
}

/// What the needle has done to a wall that has given way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// The furthest depth since then.
    frontier: Millimetres,
    /// How far that is past the relief parabola's vertex; before it, the force still falls.
    pub(crate) past_vertex: I16F16,
    /// Force while the tip cuts on there, never below zero.
    force: Newtons,
}

impl Cut {
    /// Of a wall that has not given way.
    pub(crate) const NONE: Self =
        Self { frontier: Millimetres(I16F16::MIN), past_vertex: I16F16::ZERO, force: Newtons(I16F16::ZERO) };
}

impl Wall {
    /// Of a layer that begins at `top`.
    pub(crate) fn new(config: &config::Wall, top: Millimetres) -> Self {
        Self {
            elastic: Parabola::new(&config.elastic, top),
            relief: Parabola::new(&config.relief, top),
            // At most 7 N/mm; [`crate::plan`] has seen to it.
            unload_q28: config.unload.0.to_bits() << 12,
        }
    }

    /// Force of the wall that is pressed, between contact and puncture.
    pub(crate) fn elastic_force(&self, depth: Millimetres) -> Newtons {
        self.elastic.force_felt(self.elastic.past_vertex(depth))
    }

    /// Force of the wall that has given way, with the tip at its puncture or deeper, or drawn back from there: then the
    /// force lets go along the unloading slope and never pulls.
    pub(crate) fn relief_force(&self, cut: &mut Cut, depth: Millimetres) -> Newtons {
        if depth > cut.frontier {
            let past_vertex = self.relief.past_vertex(depth);
            // Past the vertex the base stays.
            let force = self.relief.force_felt(past_vertex.min(I16F16::ZERO)).0;
            *cut = Cut { frontier: depth, past_vertex, force: Newtons(force.max(I16F16::ZERO)) };
            return cut.force;
        }
        let drawn_back = cut.frontier.0.saturating_sub(depth.0).to_bits();
        // Drawn back by 2 m, further than the needle is long, every force has let go.
        let drawn_back_q20 = drawn_back.clamp(-1 << 27, (1 << 27) - 1) << 4;
        let unloaded = I16F16::from_bits(upper_half(drawn_back_q20, self.unload_q28));
        Newtons(cut.force.0.saturating_sub(unloaded).max(I16F16::ZERO))
    }
}
