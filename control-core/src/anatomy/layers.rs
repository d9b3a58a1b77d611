//! The layers, walls and vessel as the tick reads them, and the angle at which it meets them.

use crate::math::truncating_product;
use crate::tissue::{MAX_LAYERS, Tissue};
use crate::units::{Millimetres, Milliradians};
use fixed::types::{I2F30, I8F24, I16F16};
use heapless::Vec;

/// The smallest angle to the skin that is distinguished: 5°. Below it, layers stay where they are
/// met at 5°.
pub(crate) const SMALLEST_ANGLE: Milliradians = Milliradians(87);
/// Straight in.
pub(crate) const LARGEST_ANGLE: Milliradians = Milliradians(1_571);

/// One layer that the tip can meet. Outermost first, each deeper than the one before.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer {
    /// Its number in the configuration.
    pub(crate) number: u8,
    /// Perpendicular to the skin.
    pub(crate) depth: Millimetres,
    /// Walls in the layers above.
    pub(crate) walls_above: usize,
    /// It begins with a wall that gives way.
    pub(crate) has_wall: bool,
    /// A bit where the law of force decides that it gives way, else nothing.
    pub(crate) opens: u8,
}

/// The travel at which a wall gives way, and its springing back.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wall {
    /// The layer that begins with it.
    pub(crate) layer: usize,
    /// Travel past contact, along the needle.
    pub(crate) puncture: I16F16,
    /// Travel past contact at which nothing is left of it.
    pub(crate) relieved: I16F16,
    /// The remaining indentation when it has just given way.
    pub(crate) left: I16F16,
    /// `left / (left + relieved − puncture)`, below 1: see [`super::Insertion::carried_along`].
    pub(crate) share: I2F30,
}

/// The condition for the tip to be past the wall of a layer, or in the layer if it has none.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Passage {
    /// The layer.
    pub(crate) layer: usize,
    /// The number of walls that have given way.
    pub(crate) given: usize,
    /// A bit of the layers that have given way by the law of force, or nothing.
    pub(crate) opens: u8,
}

impl Passage {
    /// Past layer number `layer`, which is `met`.
    pub(crate) fn of(layer: usize, met: &Layer) -> Self {
        Self { layer, given: if met.has_wall { met.walls_above + 1 } else { 0 }, opens: met.opens }
    }
}

/// A vessel among the layers.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Vessel {
    /// Its near and its far wall.
    Met { near: Passage, far: Option<Passage> },
    /// The needle passes beside it from this depth on, perpendicular to the skin: that of the
    /// near wall, layer `number` of the configuration.
    Beside { depth: Millimetres, number: u8 },
}

/// The anatomy ready for the tick. [`crate::plan`] has checked it.
#[derive(Clone, Debug, Default)]
pub(crate) struct Anatomy {
    pub(crate) layers: Vec<Layer, MAX_LAYERS>,
    pub(crate) walls: Vec<Wall, MAX_LAYERS>,
    pub(crate) vessel: Option<Vessel>,
    /// The sensor's tilt with the needle laid on the skin.
    pub(crate) skin_tilt: i16,
    /// The number of layers that are configured.
    pub(crate) configured: usize,
    /// The way along the needle by which a line moves a layer that the tip has touched, at most;
    /// for each number of walls that have given way.
    pub(crate) line_steps: Vec<I16F16, { MAX_LAYERS + 1 }>,
}

/// The angle to the skin at which the layers are met.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angle {
    pub(super) taken: Milliradians,
    /// 1/sin of what is taken: length along the needle for each length perpendicular to the skin.
    pub(super) path_per_depth: I8F24,
    /// Its sine, the other way round.
    pub(super) depth_per_path: I2F30,
}

impl Angle {
    /// Along the needle, for a depth perpendicular to the skin of up to 2,000 mm.
    pub(super) fn along(&self, depth: Millimetres) -> I16F16 {
        I16F16::from_bits(truncating_product(depth.0.to_bits(), self.path_per_depth.to_bits(), 24))
    }

    /// Perpendicular to the skin, for a length along the needle.
    pub(super) fn below_skin(&self, along: I16F16) -> I16F16 {
        I16F16::from_bits(truncating_product(along.to_bits(), self.depth_per_path.to_bits(), 30))
    }
}

impl Anatomy {
    /// The angle to the skin at a measured tilt, within what is distinguished.
    pub(super) fn angle(&self, tilt: Milliradians) -> Milliradians {
        Milliradians(tilt.0.saturating_sub(self.skin_tilt).clamp(SMALLEST_ANGLE.0, LARGEST_ANGLE.0))
    }
}

/// True if the tissue is a wall of a vessel.
pub(crate) fn is_vessel_wall(tissue: Tissue) -> bool {
    matches!(tissue, Tissue::Vessel | Tissue::FarWall)
}
