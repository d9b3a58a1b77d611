//! The tissue's composition: layers, a vessel, and the values that make them soft.

use std::fmt;

/// More particles are refused: the picture would not keep up.
pub(crate) const MOST_PARTICLES: usize = 20_000;

/// One layer of tissue: a slab of tetrahedra.
#[derive(Clone, Debug, PartialEq)]
pub struct Layer {
    /// Its name.
    pub name: String,
    /// The depth of its top below the skin, mm.
    pub top_mm: f32,
    /// Its thickness, mm.
    pub thickness_mm: f32,
    /// Distance between particles along the skin, mm: L₀ of Paper 000's Table 1.
    pub spacing_mm: f32,
    /// Rows of cells through its thickness.
    pub rows: usize,
    /// Young's modulus that the compliance of the distances is made of, kPa.
    pub stiffness_kpa: f32,
    /// Volume at rest as a share of the volume as built: V₀ of Table 1.
    pub volume_ratio: f32,
    /// Its bulk modulus, kPa.
    pub bulk_kpa: f32,
    /// Angle between the planes of its upper surface at rest, in degrees, 180 being flat: θ₀ of
    /// Table 1. `None` keeps the angle as built.
    pub bending_deg: Option<f32>,
    /// Bending stiffness of its upper surface, µN·mm/rad.
    pub bending_stiffness: f32,
    /// The travel by which its upper surface is pushed in before it gives way, mm; 0 if it does not
    /// resist.
    pub gives_mm: f32,
    /// The travel over which tissue that the needle has pierced is dragged along its axis before it
    /// slips, mm.
    pub drag_mm: f32,
}

/// A vessel: a tube with a wall, along a horizontal axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Vessel {
    /// Its near wall below the skin, mm, where the axis of insertion meets its plane.
    pub top_mm: f32,
    /// Diameter perpendicular to the skin, mm.
    pub vertical_mm: f32,
    /// Diameter along the skin, mm.
    pub horizontal_mm: f32,
    /// A point on its axis: x in mm from the entry, y in mm across.
    pub centre_mm: [f32; 2],
    /// Angle of its axis to the x axis, in degrees; 90 is a vessel cut across by the needle's
    /// plane.
    pub axis_deg: f32,
    /// Young's modulus of the wall, kPa.
    pub stiffness_kpa: f32,
    /// Volume of the lumen at rest as a share of the volume as built.
    pub volume_ratio: f32,
    /// Bending stiffness of the wall, µN·mm/rad.
    pub bending_stiffness: f32,
    /// The travel by which the near wall is pushed in before it gives way, mm.
    pub near_gives_mm: f32,
    /// The same for the far wall.
    pub far_gives_mm: f32,
    /// The travel over which the pierced wall is dragged along, mm.
    pub drag_mm: f32,
    /// Its centre line through the block, mm, if it is not straight; then `top_mm`, `centre_mm` and
    /// `axis_deg` do not count.
    pub path_mm: Vec<[f32; 3]>,
}

/// Curved layers: the height of the top of each, and of the bottom of the last, over a grid that
/// spans the block.
#[derive(Clone, Debug, PartialEq)]
pub struct Relief {
    /// Points of the grid along the insertion, at least 2.
    pub columns: usize,
    /// Points across it, at least 2.
    pub lines: usize,
    /// For each top from the skin inwards, and for the bottom, `lines` × `columns` depths in mm,
    /// line after line.
    pub faces_mm: Vec<Vec<f32>>,
}

impl Relief {
    /// The depth of face `face` at shares of the block's length and width, 0–1, mm.
    pub(crate) fn depth(&self, face: usize, along: f32, across: f32) -> f32 {
        let split = |share: f32, count: usize| {
            let at = share.clamp(0.0, 1.0) * (count - 1) as f32;
            let cell = (at as usize).min(count - 2);
            (cell, at - cell as f32)
        };
        let ((i, u), (j, v)) = (split(along, self.columns), split(across, self.lines));
        let at = |i: usize, j: usize| self.faces_mm[face][j * self.columns + i];
        let line = |j: usize| at(i, j) + u * (at(i + 1, j) - at(i, j));
        line(j) + v * (line(j + 1) - line(j))
    }

    fn check(&self, layers: usize) -> Result<(), Refusal> {
        let points = self.columns * self.lines;
        let is_whole = self.columns > 1 && self.lines > 1 && self.faces_mm.len() == layers + 1;
        if !is_whole || self.faces_mm.iter().any(|face| face.len() != points) {
            return Err(Refusal(
                "relief must have a grid of at least 2 × 2 for each layer and one for the bottom".into(),
            ));
        }
        let is_thick = |pair: &[Vec<f32>]| pair[0].iter().zip(&pair[1]).all(|(top, end)| end - top >= 0.05);
        if !self.faces_mm.windows(2).all(is_thick) {
            return Err(Refusal("relief must have each layer at least 0.05 mm thick everywhere".into()));
        }
        Ok(())
    }
}

/// Everything that is drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// From the skin inwards, each beginning where the one before ends.
    pub layers: Vec<Layer>,
    /// The vessel, where there is one.
    pub vessel: Option<Vessel>,
    /// From where to where along the insertion, mm; the needle enters at 0.
    pub along_mm: [f32; 2],
    /// Half of the width across, mm.
    pub half_width_mm: f32,
    /// Radius of the limb across, mm; `None` is flat.
    pub limb_radius_mm: Option<f32>,
    /// Curved layers; then each layer's depth and thickness say only how many rows it has and how
    /// stiff they are.
    pub relief: Option<Relief>,
    /// Density of the particles, g/mm³. Heavier than tissue (1e-3), so that the soft layers answer
    /// within a frame or two what a few iterations can solve (mass scaling).
    pub density: f32,
    /// Substeps of a step.
    pub substeps: u32,
    /// Iterations of a substep.
    pub iterations: u32,
    /// Rate at which motion dies away, 1/s.
    pub damping: f32,
}

/// The reason why a configuration cannot be drawn: what, where and what to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal(pub(crate) String);

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Refusal {}

impl Layer {
    /// A layer of the limb: `kind` is `skin`, `fat`, `muscle` or anything else.
    pub fn of(kind: &str, top_mm: f32, thickness_mm: f32) -> Self {
        // Moduli in the order of indentation measurements; only their ratios show in the picture.
        let stiffness_kpa = match kind {
            "skin" => 80.0,
            "fat" => 6.0,
            "muscle" => 15.0,
            _ => 12.0,
        };
        let is_skin = kind == "skin";
        Self {
            name: kind.to_string(),
            top_mm,
            thickness_mm,
            spacing_mm: 1.3,
            rows: ((thickness_mm / 1.7).round() as usize).clamp(1, 24),
            stiffness_kpa,
            volume_ratio: 1.0,
            bulk_kpa: 4.0 * stiffness_kpa,
            bending_deg: None,
            bending_stiffness: if is_skin { 2_000.0 } else { 0.0 },
            gives_mm: if is_skin { 3.0 } else { 0.0 },
            drag_mm: 0.7,
        }
    }
}

impl Default for Vessel {
    /// An antecubital vein (10.1177/11297298231186651), in the needle's plane.
    fn default() -> Self {
        Self {
            top_mm: 4.8,
            vertical_mm: 3.0,
            horizontal_mm: 4.5,
            centre_mm: [8.3, 0.0],
            axis_deg: 0.0,
            stiffness_kpa: 60.0,
            volume_ratio: 1.0,
            bending_stiffness: 600.0,
            near_gives_mm: 1.4,
            far_gives_mm: 1.4,
            drag_mm: 0.5,
            path_mm: vec![],
        }
    }
}

impl Default for Configuration {
    /// An adult's elbow: skin, muscle, a vein.
    fn default() -> Self {
        Self {
            layers: vec![Layer::of("skin", 0.0, 2.0), Layer::of("muscle", 2.0, 14.0)],
            vessel: Some(Vessel::default()),
            along_mm: [-9.1, 26.0],
            half_width_mm: 10.4,
            limb_radius_mm: Some(42.0),
            relief: None,
            density: 0.05,
            substeps: 2,
            iterations: 1,
            damping: 25.0,
        }
    }
}

impl Configuration {
    /// Paper 000: skin, vessel, skin, with the values of its Table 1. They have no unit there; L₀
    /// is taken as metres (10, 15 and 12 mm between particles), V₀ as a share of the volume as
    /// built, the bending angles as angles between planes, 180° being flat. The vessel's 0° is a
    /// wall folded on itself: taken literally and made weak, it is a vessel that tends to collapse
    /// (the table's "low-stiffness vascular response"). Thicknesses, stiffnesses and the depths at
    /// which walls give way are ours.
    pub fn paper_000() -> Self {
        let layer = |name: &str, top_mm, thickness_mm, l0_m: f32, v0, theta_deg, stiffness_kpa| Layer {
            name: name.into(),
            top_mm,
            thickness_mm,
            spacing_mm: 1_000.0 * l0_m,
            rows: 2,
            stiffness_kpa,
            volume_ratio: v0,
            bulk_kpa: 4.0 * stiffness_kpa,
            bending_deg: Some(theta_deg),
            bending_stiffness: 50.0 * stiffness_kpa,
            gives_mm: 6.0,
            drag_mm: 2.0,
        };
        Self {
            layers: vec![
                layer("skin", 0.0, 20.0, 0.01, 1.0, 180.0, 80.0),
                layer("vessel", 20.0, 30.0, 0.015, 0.8, 0.0, 20.0),
                layer("skin", 50.0, 24.0, 0.012, 1.0, 180.0, 80.0),
            ],
            vessel: None,
            along_mm: [-60.0, 120.0],
            half_width_mm: 60.0,
            limb_radius_mm: None,
            ..Self::default()
        }
    }

    /// Returns the tissue of Table 1 in a block as large as the default limb, with the outer faces
    /// of its layers at 0, `near_mm` and `far_mm`, its end at `bottom_mm`, and walls that give way
    /// after `gives_mm`. Spacings and drag are scaled by `bottom_mm` over the depth of the paper's
    /// block, so that they keep their ratios. None if the faces are not one below the other.
    pub fn table_1(near_mm: f32, far_mm: f32, bottom_mm: f32, gives_mm: [f32; 3]) -> Option<Self> {
        if !(near_mm > 0.0 && far_mm > near_mm && bottom_mm > far_mm) {
            return None;
        }
        let mut layers = Self::paper_000().layers;
        let depth_mm: f32 = layers.iter().map(|layer| layer.thickness_mm).sum();
        let scale = bottom_mm / depth_mm;
        let faces_mm = [0.0, near_mm, far_mm, bottom_mm];
        for ((layer, faces), gives) in layers.iter_mut().zip(faces_mm.windows(2)).zip(gives_mm) {
            layer.top_mm = faces[0];
            layer.thickness_mm = faces[1] - faces[0];
            layer.spacing_mm *= scale;
            layer.drag_mm *= scale;
            layer.gives_mm = gives.clamp(0.0, 30.0);
        }
        Some(Self { layers, vessel: None, ..Self::default() })
    }

    /// Refuses what cannot be built, with the reason.
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        let refuse = |what: String| Err(Refusal(what));
        let span = self.along_mm[1] - self.along_mm[0];
        let within = |value: f32, low: f32, high: f32| value >= low && value <= high;
        if self.layers.is_empty() {
            return refuse("there is no layer; give at least one".into());
        }
        if !within(span, 1.0, 1_000.0) || !within(self.half_width_mm, 1.0, 500.0) {
            return refuse("the block must be 1 to 1000 mm long and 2 to 1000 mm wide".into());
        }
        if self.limb_radius_mm.is_some_and(|radius| !within(radius, 1.2 * self.half_width_mm, 1e4)) {
            return refuse("limb_radius_mm must be larger than 1.2 times half_width_mm".into());
        }
        if !within(self.density, 1e-4, 10.0) || !within(self.damping, 0.0, 1e4) {
            return refuse("density must be from 0.0001 to 10 g/mm³ and damping from 0 to 10000 1/s".into());
        }
        if !(1..=64).contains(&self.substeps) || !(1..=64).contains(&self.iterations) {
            return refuse("substeps and iterations must be from 1 to 64".into());
        }
        self.relief.as_ref().map_or(Ok(()), |relief| relief.check(self.layers.len()))?;
        let mut particles = 0.0;
        let mut top = self.layers[0].top_mm;
        for (number, layer) in self.layers.iter().enumerate() {
            let numbers = [
                (layer.thickness_mm, 0.1, 500.0, "thickness_mm"),
                (layer.spacing_mm, 0.1, 100.0, "spacing_mm"),
                (layer.stiffness_kpa, 0.01, 1e5, "stiffness_kpa"),
                (layer.bulk_kpa, 0.01, 1e6, "bulk_kpa"),
                (layer.volume_ratio, 0.2, 3.0, "volume_ratio"),
                (layer.bending_stiffness, 0.0, 1e7, "bending_stiffness"),
                (layer.bending_deg.unwrap_or(180.0), 0.0, 360.0, "bending_deg"),
                (layer.gives_mm, 0.0, 50.0, "gives_mm"),
                (layer.drag_mm, 0.0, 20.0, "drag_mm"),
            ];
            if let Some((value, low, high, name)) =
                numbers.into_iter().find(|(v, low, high, _)| !within(*v, *low, *high))
            {
                return refuse(format!("layer {number}: {name} is {value}; it must be from {low} to {high}"));
            }
            if (layer.top_mm - top).abs() > 1e-3 {
                return refuse(format!(
                    "layer {number} begins at {} mm; the one before it ends at {top} mm",
                    layer.top_mm
                ));
            }
            if !(1..=64).contains(&layer.rows) {
                return refuse(format!("layer {number}: rows is {}; it must be from 1 to 64", layer.rows));
            }
            top += layer.thickness_mm;
            particles += (span / layer.spacing_mm + 2.0)
                * (2.0 * self.half_width_mm / layer.spacing_mm + 2.0)
                * (layer.rows + 1) as f32;
        }
        if particles > MOST_PARTICLES as f32 {
            return refuse(format!(
                "about {particles:.0} particles; at most {MOST_PARTICLES} are possible: widen spacing_mm"
            ));
        }
        self.vessel.as_ref().map_or(Ok(()), |vessel| self.check_vessel(vessel, top))
    }

    /// Refuses a vessel that cannot be built in layers that end at `bottom`, mm.
    fn check_vessel(&self, vessel: &Vessel, bottom: f32) -> Result<(), Refusal> {
        let refuse = |what: String| Err(Refusal(what));
        let within = |value: f32, low: f32, high: f32| value >= low && value <= high;
        let numbers = [
            (vessel.vertical_mm, 0.3, 50.0, "vertical_mm"),
            (vessel.horizontal_mm, 0.3, 50.0, "horizontal_mm"),
            (vessel.stiffness_kpa, 0.01, 1e5, "stiffness_kpa"),
            (vessel.volume_ratio, 0.2, 3.0, "volume_ratio"),
            (vessel.bending_stiffness, 0.0, 1e7, "bending_stiffness"),
            (vessel.near_gives_mm, 0.0, 50.0, "near_gives_mm"),
            (vessel.far_gives_mm, 0.0, 50.0, "far_gives_mm"),
            (vessel.drag_mm, 0.0, 20.0, "drag_mm"),
        ];
        let placed = [
            (vessel.axis_deg, -360.0, 360.0, "axis_deg"),
            (vessel.centre_mm[0], self.along_mm[0], self.along_mm[1], "centre_mm along"),
            (vessel.centre_mm[1], -self.half_width_mm, self.half_width_mm, "centre_mm across"),
            (vessel.top_mm, self.layers[0].top_mm + 0.1, bottom - vessel.vertical_mm - 0.1, "top_mm"),
        ];
        let is_straight = vessel.path_mm.is_empty();
        if !is_straight
            && (vessel.path_mm.len() < 2 || vessel.path_mm.iter().flatten().any(|mm| !within(*mm, -1e3, 1e3)))
        {
            return refuse("the vessel's path_mm must have at least 2 points within 1000 mm".into());
        }
        let placed = placed.into_iter().filter(|_| is_straight);
        match numbers.into_iter().chain(placed).find(|(value, low, high, _)| !within(*value, *low, *high)) {
            Some((value, low, high, name)) => {
                refuse(format!("the vessel's {name} is {value}; it must be from {low} to {high}"))
            }
            None => Ok(()),
        }
    }
}
