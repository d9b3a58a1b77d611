//! Bodies as surfaces and tubes in three dimensions, and what a straight needle meets in them.
//!
//! A body is a list of structures, each a union of intersections of convex solids. Where structures
//! overlap the later one counts, so that a bursa is a ball with the tendon's ball inside it. A
//! needle is a ray: each convex solid holds at most one stretch of it, found by solving for its
//! ends, and the list of layers follows. The law of force, the picture, the ultrasound image and
//! the section all ask here.
//!
//! Lengths are in mm. The limb's frame: x along the limb away from the trunk, y to its side, z
//! down; the limb's axis is at y = z = 0. The figures of each site, with their sources, are in
//! `docs/design/anatomy.md`.

#![forbid(unsafe_code)]

mod body;
mod outline;
mod place;
mod sites;
pub mod solid;
mod surface;
mod vector;

pub use body::{Body, Piece, Role, Structure, Tissue};
pub use outline::Outline;
pub use place::{Block, Line, Place, Refusal};
pub use sites::Site;
pub use surface::Triangle;
pub use vector::Vector;
