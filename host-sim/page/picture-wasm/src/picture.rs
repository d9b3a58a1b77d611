//! Tissue, needle, probe and image together, from the anatomy that the page was told of.

use crate::drawn::{Given, SurfaceView};
use crate::limb::{self, Limb};
use crate::slab::{bottom_mm, configure, views};
use crate::still::{Closed, Still};
use crate::table_1;
use tissue::body::Part;
use tissue::needle::WallName;
use tissue::{Configuration, Needle, PunctureState, Punctures, Tissue};
use ultrasound::{Imager, InPlaneScore, Look, Medium, Mesh, Probe, Scene, Shaft};

/// Numbers for each layer in the input.
const PER_LAYER: usize = 4;
/// Places along the insertion where the vessel's walls in the needle's plane are known.
pub const SLICES: usize = 64;
/// The time that one step of the tissue takes, and the longest that a picture moves it on, s.
const STEP_S: f32 = 1.0 / 60.0;
const LONGEST_S: f32 = 0.25;
/// Width of the ultrasound image, mm.
const IMAGE_WIDTH_MM: f32 = 24.0;
/// Its smallest and largest depth, and how far it reaches below the innermost layer's top, mm.
const IMAGE_DEPTH_MM: [f32; 2] = [16.0, 40.0];
const IMAGE_BELOW_MM: f32 = 4.0;

/// Everything that is drawn of the body.
pub struct Picture {
    tissue: Tissue,
    surfaces: Vec<SurfaceView>,
    /// The wall of each layer of the scene, where the picture has one.
    walls: Vec<Option<WallName>>,
    /// The tissue under each layer's top, outermost first.
    media: Vec<Medium>,
    along_mm: [f32; 2],
    limb_radius_mm: f32,
    /// The body, where there is one.
    limb: Option<Limb>,
    closed: Vec<Closed>,
    /// Places and normals of the tissue's particles, then of what stays.
    points: Vec<[f32; 4]>,
    normals: Vec<[f32; 4]>,
    lumen: [[f32; 2]; SLICES],
    imager: Imager,
    probe: Probe,
    score: InPlaneScore,
    shaft: Shaft,
}

/// Deep enough for the innermost layer, focused in the middle.
fn probe_for(given: &[Given]) -> Probe {
    let innermost = given.iter().map(|layer| layer.depth_mm).fold(0.0, f32::max);
    let depth_mm = (innermost + IMAGE_BELOW_MM).clamp(IMAGE_DEPTH_MM[0], IMAGE_DEPTH_MM[1]);
    Probe { width_mm: IMAGE_WIDTH_MM, depth_mm, focus_mm: depth_mm / 2.0, ..Probe::default() }
}

/// The layers from the numbers of the input.
fn given(numbers: &[f32]) -> Vec<Given> {
    let layers = numbers.chunks_exact(PER_LAYER).map(|n| Given {
        kind: n[0] as u32,
        depth_mm: n[1],
        travel_mm: n[2],
        is_vessel: n[0] == 7.0,
        is_far: n[0] == 8.0,
    });
    layers.collect()
}

/// The surfaces to draw, of the tissue and of what stays beside it; and what stays, its points
/// after the tissue's.
fn surfaces(
    tissue: &Tissue,
    walls: &[Option<WallName>],
    limb: Option<&Limb>,
    configuration: &Configuration,
    tube: Option<[usize; 2]>,
) -> (Vec<SurfaceView>, Still) {
    let mut surfaces = views(tissue, walls);
    let Some(limb) = limb else { return (surfaces, Still::default()) };
    let mut still = limb.still(configuration.along_mm, configuration.half_width_mm, tube);
    still = still.after(tissue.points().len() as u32);
    limb.name(&mut surfaces);
    surfaces.append(&mut still.views);
    (surfaces, still)
}

impl Picture {
    /// From numbers: how many layers there are; for each its tissue (`TISSUES`, 7 the vessel, 8 its
    /// far wall), its depth below the skin in mm, how far its wall is pushed in along the needle
    /// before it gives way in mm (negative: no wall) and friction in N/mm; then the vessel's width
    /// and how far its axis lies beside the needle's plane, in mm; then the angle to the skin in
    /// rad and the needle's diameter in mm; then 1 for Table 1 of Paper 000 instead of the limb, or
    /// 2 for a body, with its numbers as `Limb::new` reads them.
    pub fn new(numbers: &[f32]) -> Result<Self, String> {
        let count = numbers.first().copied().filter(|n| (1.0..=8.0).contains(n)).ok_or("no layers")? as usize;
        let rest = numbers.get(1 + PER_LAYER * count..).unwrap_or_default();
        let [width, offset, angle, diameter_mm] =
            rest.get(..4).and_then(|n| n.try_into().ok()).ok_or("too few numbers")?;
        let diameter_mm: f32 = diameter_mm;
        if !(0.1..=5.0).contains(&diameter_mm) {
            return Err(format!("a needle {diameter_mm} mm thick"));
        }
        let given = given(&numbers[1..=PER_LAYER * count]);
        let angle: f32 = angle;
        let angle = if angle.is_finite() { angle.clamp(0.1, 1.57) } else { 0.5 };
        let limb = match rest.get(4) {
            Some(2.0) => Some(Limb::new(rest.get(5..5 + limb::NUMBERS).unwrap_or_default())?),
            _ => None,
        };
        let (configuration, walls, tube) = match (&limb, rest.get(4)) {
            (Some(limb), _) => limb.configure(&given),
            (None, Some(1.0)) => {
                let (configuration, walls) = table_1::configure(&given, bottom_mm(&given))?;
                (configuration, walls, None)
            }
            _ => {
                let (configuration, walls) = configure(&given, [width, offset], angle);
                (configuration, walls, None)
            }
        };
        let mut tissue = Tissue::new(&configuration).map_err(|refusal| refusal.to_string())?;
        tissue.set_punctures(Punctures::Told);
        let (surfaces, still) = surfaces(&tissue, &walls, limb.as_ref(), &configuration, tube);
        let media = configuration.layers.iter().map(|layer| Medium::named(&layer.name)).collect();
        let radius = configuration.limb_radius_mm.unwrap_or(1e4);
        let (tissue_points, particles) = (tissue.points().to_vec(), tissue.points().len());
        let mut picture = Self {
            tissue,
            surfaces,
            walls,
            media,
            along_mm: configuration.along_mm,
            limb_radius_mm: radius,
            limb,
            closed: still.closed,
            points: [tissue_points, still.points].concat(),
            normals: [vec![[0.0; 4]; particles], still.normals].concat(),
            lumen: [[0.0; 2]; SLICES],
            imager: Imager::default(),
            probe: probe_for(&given),
            score: InPlaneScore::default(),
            shaft: Shaft {
                tip_mm: [0.0; 3],
                direction: [1.0, 0.0, 0.0],
                radius_mm: diameter_mm / 2.0,
                inserted_mm: 0.0,
            },
        };
        picture.cut_vessel();
        Ok(picture)
    }

    /// Returns the depth of the ultrasound image, mm.
    pub fn image_depth_mm(&self) -> f32 {
        self.probe.depth_mm
    }

    /// The device says that the wall of a layer of the scene gave way, or that the needle has left
    /// it.
    pub fn tell(&mut self, layer: usize, state: PunctureState) {
        if let Some(Some(wall)) = self.walls.get(layer) {
            self.tissue.tell(*wall, state);
        }
    }

    /// Moves time on with the tip `depth_mm` along a needle at `angle` rad to the skin, whose line
    /// has depth 0 at `origin_mm` along the skin and below it: one that has turned in tissue turns
    /// about the point that holds it and not about its entry.
    ///
    /// Where pictures come slowly the needle goes from its last place to this one in steps of a
    /// sixtieth of a second: a wall that is pushed by millimetres at once folds, and stays folded.
    pub fn step(&mut self, seconds: f32, depth_mm: f32, angle: f32, origin_mm: [f32; 2]) {
        let mut needle = Needle::entering(depth_mm, angle, 0.0);
        needle.tip[0] += origin_mm[0];
        needle.tip[2] += origin_mm[1];
        let seconds = seconds.clamp(0.0, LONGEST_S);
        let steps = (seconds / STEP_S).round().max(1.0);
        let last = Needle { tip: self.shaft.tip_mm, direction: self.shaft.direction };
        for number in 1..=steps as u32 {
            self.tissue.step(&last.towards(&needle, number as f32 / steps), seconds / steps);
        }
        let moved = self.tissue.points();
        self.points[..moved.len()].copy_from_slice(moved);
        self.cut_vessel();
        let is_in = self.tissue.states().next().is_some_and(|(_, state, _)| state == PunctureState::Inserted);
        let inserted_mm = if is_in && depth_mm > 0.0 { depth_mm } else { 0.0 };
        self.shaft = Shaft { tip_mm: needle.tip, direction: needle.direction, inserted_mm, ..self.shaft };
    }

    /// Returns the state of the wall of a layer of the scene: away from the needle, touched or
    /// pierced.
    pub fn wall_state(&self, layer: usize) -> PunctureState {
        let Some(Some(wall)) = self.walls.get(layer) else { return PunctureState::Away };
        let state = self.tissue.states().find(|(name, ..)| name == wall);
        state.map_or(PunctureState::Away, |(_, state, _)| state)
    }

    /// Places of the particles.
    pub fn points(&self) -> &[[f32; 4]] {
        &self.points
    }

    /// Their normals.
    pub fn normals(&mut self) -> &[[f32; 4]] {
        let own = self.tissue.normals();
        self.normals[..own.len()].copy_from_slice(own);
        &self.normals
    }

    /// Returns the surfaces to draw.
    pub fn surfaces(&self) -> &[SurfaceView] {
        &self.surfaces
    }

    /// Upper and lower wall of the vessel in the needle's plane, mm, at [`SLICES`] places along the
    /// block; equal where there is none.
    pub fn lumen(&self) -> &[[f32; 2]] {
        &self.lumen
    }

    /// Holds the probe.
    pub fn hold_probe(&mut self, along_mm: f32, across_mm: f32, azimuth: f32, lean: f32) {
        let [down, slope] = self.on_skin([along_mm, across_mm], azimuth);
        let centre_mm = [along_mm, across_mm, down];
        self.probe = Probe { centre_mm, azimuth, lean: lean + slope, ..self.probe }.checked();
    }

    /// Returns the probe as it is held.
    pub fn probe(&self) -> &Probe {
        &self.probe
    }

    /// Returns the depth of the skin at a place along and across, mm, and, on a body, the lean that
    /// makes a probe of this turn stand upright on it, rad.
    pub fn on_skin(&self, [along_mm, across_mm]: [f32; 2], azimuth: f32) -> [f32; 2] {
        let Some(limb) = &self.limb else {
            let radius = self.limb_radius_mm;
            return [radius - (radius * radius - across_mm * across_mm).max(0.0).sqrt(), 0.0];
        };
        let (side, ahead) = azimuth.sin_cos();
        let skin = |aside: f32| {
            let [x, y] = [along_mm - side * aside, across_mm + ahead * aside].map(f64::from);
            limb.skin(x, y) as f32
        };
        [skin(0.0), -(0.5 * (skin(1.0) - skin(-1.0))).atan()]
    }

    /// Returns where a line of sight meets the skin: the place in mm and, on a body, how far along
    /// (mm) and around (degrees) the limb that is.
    pub fn pick(&self, eye: [f32; 3], direction: [f32; 3]) -> Option<[f32; 5]> {
        let line = [eye, direction].map(|v| v.map(f64::from));
        let (place, [along, around]) = match &self.limb {
            Some(limb) => limb.pick(line)?,
            None => (limb::pick_cylinder(f64::from(self.limb_radius_mm), line)?, [f64::NAN; 2]),
        };
        let [x, y, z] = place;
        Some([x, y, z, along, around].map(|number| number as f32))
    }

    /// Makes an image, `seconds` after the last.
    pub fn image(&mut self, seconds: f32, gain_db: f32) -> &[u8] {
        let mut meshes: Vec<Mesh<'_>> = vec![];
        for surface in self.tissue.surfaces() {
            let (behind, wall_mm) = match surface.part {
                Part::Top(layer) if layer > 0 => (self.media[layer], None),
                Part::Vessel => (ultrasound::medium::BLOOD, Some(0.4)),
                _ => continue,
            };
            meshes.push(Mesh {
                points: self.tissue.points(),
                triangles: &surface.triangles,
                behind,
                wall_mm,
            });
        }
        meshes.extend(self.closed.iter().map(|closed| Mesh {
            points: &self.points,
            triangles: &closed.triangles,
            behind: closed.behind,
            wall_mm: Some(if closed.has_wall { 0.4 } else { 0.0 }),
        }));
        let first = self.media.first().copied().unwrap_or(ultrasound::medium::SKIN);
        let scene = Scene { first, meshes: &meshes, shaft: Some(self.shaft) };
        let standard = Look::default();
        let look = Look { gain_db: standard.gain_db + gain_db.clamp(-40.0, 40.0), ..standard };
        self.imager.frame(&self.probe, &scene, &look);
        self.score.take(self.imager.visible(), &self.shaft, seconds.min(0.5));
        self.imager.image()
    }

    /// Returns the number `what` of those that the crate's function `seen` lists.
    pub fn seen(&self, what: u32) -> f32 {
        let now = self.imager.visible();
        match what {
            0 => now.share,
            1 => f32::from(u8::from(now.tip)),
            2 => now.tip_beside_mm,
            3 => self.score.tip_share(),
            4 => self.score.mean_share(),
            5 => self.score.inserted_s,
            _ => 0.0,
        }
    }

    fn cut_vessel(&mut self) {
        self.lumen = [[0.0; 2]; SLICES];
        let [low, high] = self.along_mm;
        let points = self.tissue.points();
        let vessel = self.tissue.surfaces().iter().find(|surface| surface.part == Part::Vessel);
        for triangle in vessel.into_iter().flat_map(|surface| &surface.triangles) {
            let corners = triangle.map(|index| points[index as usize]);
            let mut ends = vec![];
            for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(a, b): (usize, usize)| (corners[a], corners[b])) {
                if (a[1] < 0.0) != (b[1] < 0.0) {
                    let share = a[1] / (a[1] - b[1]);
                    ends.push([a[0] + share * (b[0] - a[0]), a[2] + share * (b[2] - a[2])]);
                }
            }
            let [from, to] = ends[..] else { continue };
            let (from, to) = if from[0] <= to[0] { (from, to) } else { (to, from) };
            let slot = |x: f32| (x - low) / (high - low) * (SLICES - 1) as f32;
            let mut number = slot(from[0]).ceil().max(0.0);
            while number <= slot(to[0]).min((SLICES - 1) as f32) {
                let x = low + number / (SLICES - 1) as f32 * (high - low);
                let share = if to[0] > from[0] { (x - from[0]) / (to[0] - from[0]) } else { 0.0 };
                let z = from[1] + share * (to[1] - from[1]);
                let pair = &mut self.lumen[number as usize];
                *pair = if pair[1] == 0.0 { [z, z] } else { [pair[0].min(z), pair[1].max(z)] };
                number += 1.0;
            }
        }
        // The very ends may lie a hair outside the first and the last ring.
        for (end, inner) in [(0, 1), (SLICES - 1, SLICES - 2)] {
            if self.lumen[end] == [0.0; 2] {
                self.lumen[end] = self.lumen[inner];
            }
        }
    }
}

#[cfg(test)]
mod tests;
