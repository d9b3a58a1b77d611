//! The tissue picture: layers and a vessel that deform under the needle, for the eye only.
//!
//! Extended position-based dynamics (Macklin, Müller, Chentanez 2016) of particles held by
//! distances, tetrahedron volumes, bending angles and ties between layers, in small substeps. The
//! needle is a rigid line with a puncture state for every wall: it pushes a wall in until that
//! gives way, then the tissue is held to the needle's axis and dragged along it.
//!
//! It computes no force that anyone feels and knows neither the control core nor the page: anatomy
//! and needle come in, positions, triangles and puncture states go out. Lengths are in mm, times in
//! s, masses in g; x runs along the skin in the direction of insertion, y across, z into the body.

#![forbid(unsafe_code)]

pub mod body;
pub mod configuration;
pub(crate) mod constraint;
mod lattice;
pub mod needle;
pub mod push;
mod shaft;
pub mod solver;
mod tube;
pub mod vector;

pub use body::{Surface, Tissue};
pub use configuration::{Configuration, Layer, Refusal, Relief, Vessel};
pub use needle::{Needle, PunctureState, Punctures};
