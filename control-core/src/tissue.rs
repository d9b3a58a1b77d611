//! Tissue as a person configures it: layers with their walls, perpendicular to the skin, and a
//! vessel among them.

use crate::units::{FrictionPerMillimetre, JogCompliance, Millimetres, Newtons, Stiffness};
use fixed::types::I16F16;
use serde::{Deserialize, Serialize};

/// The share of an indentation that remains when a wall gives way, if unknown: 0.3, an assumption.
pub const SPRING_BACK: I16F16 = I16F16::from_bits(19_661);

/// The most layers of a tissue.
pub const MAX_LAYERS: usize = 6;

/// A vessel among the layers, the one whose near wall is of [`Tissue::Vessel`]: a tube with its
/// axis level with the skin and along the way that the needle points, oval across. Its depth and
/// its vertical diameter are those of its two walls' layers over the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Vessel {
    /// Horizontal diameter, 0.2–30 mm.
    pub width: Millimetres,
    /// The distance of the needle's plane from the axis; half the width and more is past the
    /// vessel.
    pub offset: Millimetres,
}

/// One layer of tissue.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Layer {
    /// Its tissue, for events and pictures.
    pub tissue: Tissue,
    /// Depth of its outer face, perpendicular to the skin.
    pub depth: Millimetres,
    /// Its wall, where it has one that gives way.
    pub wall: Option<Wall>,
    /// Friction limit gained for each mm of needle inside it.
    pub friction: FrictionPerMillimetre,
}

/// The tissue of a layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[repr(u8)]
pub enum Tissue {
    /// Skin.
    Skin = 0,
    /// Subcutaneous fat.
    Fat = 1,
    /// Muscle.
    Muscle = 2,
    /// A blood vessel: its puncture is the aim.
    Vessel = 3,
    /// Anything else.
    Other = 4,
    /// The bursa of a joint.
    Bursa = 5,
    /// Tendon.
    Tendon = 6,
    /// Cartilage.
    Cartilage = 7,
    /// The far wall of the vessel above it, and what lies under that: its puncture is a mistake.
    FarWall = 8,
}

/// The jog effect of a wall: it rises along one parabola and, once punctured, falls along another.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wall {
    /// Force against travel past contact until it gives way; its vertex is at or before contact.
    pub elastic: Parabola,
    /// Travel past contact at which it gives way, up to 30 mm.
    pub puncture_travel: Millimetres,
    /// Force against travel past contact once it has given way; its vertex is beyond
    /// `puncture_travel`, and past it the force is `base`.
    pub relief: Parabola,
    /// Slope with which the relief force lets go when the needle is drawn back.
    pub unload: Stiffness,
    /// Part of the indentation that is left when the wall has just given way, 0–1; it goes as far
    /// as the relief goes.
    pub spring_back: I16F16,
}

/// `f(T) = (T − vertex)²/compliance + base` (Paper 001, eq. 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parabola {
    /// n: travel past contact at which the parabola turns.
    pub vertex: Millimetres,
    /// a, 0.05–1,000 mm²/N.
    pub compliance: JogCompliance,
    /// b: force at the vertex.
    pub base: Newtons,
}
