//! The scene that is imaged, and the size of its image.

use crate::medium::Medium;
use crate::plane::Mesh;
use crate::probe::Shaft;

/// Lines of an image.
pub const LINES: usize = 256;
/// Samples of a line.
pub const SAMPLES: usize = 1024;

/// The scene to image.
#[derive(Clone, Copy, Debug)]
pub struct Scene<'a> {
    /// The medium above the first interface; gel counts as skin.
    pub first: Medium,
    /// Interfaces.
    pub meshes: &'a [Mesh<'a>],
    /// The needle, where there is one.
    pub shaft: Option<Shaft>,
}
