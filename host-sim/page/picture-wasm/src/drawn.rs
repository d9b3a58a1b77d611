//! Layers as the page hands them over, and surfaces as it draws them.

/// Tissues by the number that the page calls them by.
pub const TISSUES: [&str; 7] = ["skin", "fat", "muscle", "other", "bursa", "tendon", "cartilage"];

/// The way in which the page draws a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Skin behind the needle's plane.
    SkinBehind = 0,
    /// Skin before it.
    SkinBefore = 1,
    /// A layer cut along the plane.
    Section = 2,
    /// The vessel's wall behind the plane.
    VesselBehind = 3,
    /// The vessel's wall before it.
    VesselBefore = 4,
    /// A part inside the body, such as a bone, behind the plane.
    InsideBehind = 5,
    /// The same before it.
    InsideBefore = 6,
}

/// A surface as the page draws it.
#[derive(Clone, Debug)]
pub struct SurfaceView {
    /// As what.
    pub kind: Kind,
    /// Number of its layer in the scene.
    pub layer: usize,
    /// In a body, its tissue by the number that the page calls it by: those of the input, 9 an
    /// artery.
    pub tissue: u32,
    /// Three particles each.
    pub triangles: Vec<[u32; 3]>,
}

/// A layer as the page hands it over.
pub(crate) struct Given {
    pub(crate) kind: u32,
    pub(crate) depth_mm: f32,
    /// The travel by which its wall is pushed in, mm; negative where it has no wall.
    pub(crate) travel_mm: f32,
    pub(crate) is_vessel: bool,
    pub(crate) is_far: bool,
}
