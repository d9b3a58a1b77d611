//! The jog effect of a wall (Paper 001, eq. 1): it resists along a rising parabola, gives way, and
//! relieves along a falling one that is felt only while the tip cuts on.

use crate::math::{saturating_product, truncating_product, upper_half};
use crate::tissue::{self, MAX_LAYERS};
use crate::units::{Millimetres, Newtons};
use fixed::types::{I9F23, I16F16};
use heapless::Vec;

/// A parabola ready for the tick. `(x − n)²/a` is computed as `((x − n)/√a)²`: two multiplications,
/// and precise for a soft wall and a hard one alike.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Parabola {
    /// Travel past contact at which it turns.
    vertex: I16F16,
    inverse_root_compliance: I9F23,
    base: I16F16,
}

impl Parabola {
    /// `config.compliance` is at least 0.05 mm²/N; [`crate::plan`] has seen to it.
    pub(crate) fn new(config: &tissue::Parabola) -> Self {
        let compliance = u64::from(config.compliance.0.to_bits().unsigned_abs().max(3_277));
        // a is a·2^16 here, so 2^62/a is (1/a)·2^46, whose root is Q23.
        let root = ((1_u64 << 62) / compliance).isqrt();
        Self {
            vertex: config.vertex.0,
            inverse_root_compliance: I9F23::from_bits(i32::try_from(root).unwrap_or(i32::MAX)),
            base: config.base.0,
        }
    }

    /// `(T − n)²/a + b`, saturating: for a parabola that [`crate::plan`] has yet to check.
    pub(crate) fn force(&self, travel: Millimetres) -> Newtons {
        let from_vertex = self.past_vertex(travel.0);
        // Q16 · Q23 to Q22, whose square is Q44, to Q16.
        let root_q22 = saturating_product(from_vertex.to_bits(), self.inverse_root_compliance.to_bits(), 17);
        let rise = I16F16::from_bits(saturating_product(root_q22, root_q22, 28));
        Newtons(rise.saturating_add(self.base))
    }

    fn past_vertex(&self, travel: I16F16) -> I16F16 {
        travel.saturating_sub(self.vertex)
    }

    /// [`Self::force`] so far from the vertex, where the wall is felt: [`crate::plan`] has seen to
    /// it that the rise is below 256 N there.
    fn force_felt(&self, from_vertex: I16F16) -> Newtons {
        let root_q22 = truncating_product(from_vertex.to_bits(), self.inverse_root_compliance.to_bits(), 17);
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

/// The needle's cut through a wall that has given way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cut {
    /// The furthest travel past contact since then.
    frontier: I16F16,
    /// The distance of that past the relief parabola's vertex; before it, the force still falls.
    pub(crate) past_vertex: I16F16,
    /// Force while the tip cuts on there, never below zero.
    force: Newtons,
}

impl Cut {
    /// The cut of a wall that has not given way.
    pub(crate) const NONE: Self =
        Self { frontier: I16F16::MIN, past_vertex: I16F16::ZERO, force: Newtons(I16F16::ZERO) };
}

impl Wall {
    /// As [`crate::plan`] has checked it.
    pub(crate) fn new(config: &tissue::Wall) -> Self {
        Self {
            elastic: Parabola::new(&config.elastic),
            relief: Parabola::new(&config.relief),
            // At most 7 N/mm; [`crate::plan`] has seen to it.
            unload_q28: config.unload.0.to_bits() << 12,
        }
    }

    /// Force of the wall that is pressed, between contact and puncture.
    pub(crate) fn elastic_force(&self, travel: I16F16) -> Newtons {
        self.elastic.force_felt(self.elastic.past_vertex(travel))
    }

    /// Force of the wall that has given way, with the tip at its puncture or deeper, or drawn back
    /// from there: then the force lets go along the unloading slope and never pulls.
    pub(crate) fn relief_force(&self, cut: &mut Cut, travel: I16F16) -> Newtons {
        if travel > cut.frontier {
            let past_vertex = self.relief.past_vertex(travel);
            // Past the vertex the base stays.
            let force = self.relief.force_felt(past_vertex.min(I16F16::ZERO)).0;
            *cut = Cut { frontier: travel, past_vertex, force: Newtons(force.max(I16F16::ZERO)) };
            return cut.force;
        }
        let drawn_back = cut.frontier.saturating_sub(travel).to_bits();
        // Drawn back by 2 m, further than the needle is long, every force has let go.
        let drawn_back_q20 = drawn_back.clamp(-1 << 27, (1 << 27) - 1) << 4;
        let unloaded = I16F16::from_bits(upper_half(drawn_back_q20, self.unload_q28));
        Newtons(cut.force.0.saturating_sub(unloaded).max(I16F16::ZERO))
    }
}

/// The force at which a wall gives way.
pub(crate) fn peak(wall: &tissue::Wall) -> I16F16 {
    Parabola::new(&wall.elastic).force(wall.puncture_travel).0
}

/// The steepest rise of a wall that is pushed in, N/mm.
pub(crate) fn steepest_rise(wall: &tissue::Wall) -> I16F16 {
    slope_at_puncture(wall, &wall.elastic)
}

/// The steepest change of a wall that has given way, N/mm.
pub(crate) fn steepest_fall(wall: &tissue::Wall) -> I16F16 {
    slope_at_puncture(wall, &wall.relief).max(wall.unload.0)
}

fn slope_at_puncture(wall: &tissue::Wall, parabola: &tissue::Parabola) -> I16F16 {
    let from_vertex = wall.puncture_travel.0.saturating_sub(parabola.vertex.0).saturating_abs();
    from_vertex.saturating_mul_int(2).saturating_div(parabola.compliance.0)
}

/// Those of `layers` that have one, outermost first.
pub(crate) fn all<'a>(layers: impl Iterator<Item = &'a tissue::Layer>) -> Vec<Wall, MAX_LAYERS> {
    layers.filter_map(|layer| layer.wall.as_ref()).map(Wall::new).collect()
}
