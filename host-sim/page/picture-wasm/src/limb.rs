//! A body of three dimensions as the picture shows it: the layers about the point of entry as
//! curved tissue that gives way, everything else as surfaces that stay, all cut along the needle's
//! plane.

use crate::drawn::{Given, Kind, SurfaceView};
use anatomy::{Block, Body, Line, Place, Role, Site, Structure, Tissue};
use tissue::needle::WallName;
use tissue::{Configuration, Layer, Relief, Vessel};

/// Numbers that describe a body in the input: site, along, around, azimuth, turn, inclination, fat.
pub(crate) const NUMBERS: usize = 7;
/// The grid of the tissue's faces over the block.
const GRID: [usize; 2] = [28, 17];
/// The block of tissue reaches so deep under the skin, mm.
pub(crate) const BLOCK_MM: f64 = 30.0;
/// A tube deeper than this is outside the block, mm.
const DEEPEST_MM: f32 = 40.0;
/// A layer is drawn at least so thick, mm.
const THINNEST_MM: f64 = 0.35;
/// Starts above everything, mm.
const ABOVE_MM: f64 = 300.0;

/// The numbers of tissues that the page has colours for; the first seven are those of
/// `drawn::TISSUES`.
pub(crate) fn code(tissue: Tissue) -> u32 {
    match tissue {
        Tissue::Skin => 0,
        Tissue::Fat => 1,
        Tissue::Muscle => 2,
        Tissue::Artery => 9,
        Tissue::Bursa => 4,
        Tissue::Tendon | Tissue::Nerve => 5,
        Tissue::Cartilage => 6,
        Tissue::Vessel => 7,
    }
}

/// A body with a needle's way into it.
#[derive(Clone, Debug)]
pub(crate) struct Limb {
    pub(crate) body: Body,
    pub(crate) line: Line,
}

impl Limb {
    /// From the numbers of the input.
    pub(crate) fn new(numbers: &[f32]) -> Result<Self, String> {
        let numbers: [f32; NUMBERS] = numbers.try_into().map_err(|_| "too few numbers for a body")?;
        let [site, along_mm, around_deg, azimuth_deg, turn_deg, incline_deg, fat_mm] = numbers.map(f64::from);
        let site = Site::ALL.get(site as usize).ok_or("no such site")?;
        let place = Place { along_mm, around_deg, azimuth_deg, turn_deg, incline_deg };
        let body = site.body(fat_mm);
        let line = place.line(&body).map_err(|refusal| refusal.to_string())?;
        Ok(Self { body, line })
    }

    pub(crate) fn block(&self) -> &Block {
        &self.line.block
    }

    fn layers(&self) -> impl Iterator<Item = &Structure> {
        self.body.structures.iter().filter(|structure| structure.role == Role::Layer)
    }

    /// The depth at which a structure begins straight under a place of the block, mm; none where it
    /// does not.
    pub(crate) fn top(&self, structure: &Structure, x: f64, y: f64) -> Option<f64> {
        let down = self.block().axes[2];
        let from = self.block().to_limb([x, y, -ABOVE_MM]);
        let first = structure.stretches(from, down).map(|[from, _]| from).reduce(f64::min)?;
        Some(first - ABOVE_MM)
    }

    /// The skin straight under a place of the block, mm; where there is none, as deep as at its
    /// edge towards the entry.
    pub(crate) fn skin(&self, x: f64, y: f64) -> f64 {
        let Some(skin) = self.body.structures.first() else { return 0.0 };
        let inwards = (0..=20).map(|step| 1.0 - f64::from(step) * 0.05);
        inwards.into_iter().find_map(|share| self.top(skin, x * share, y * share)).unwrap_or(0.0)
    }

    /// Faces of the layers over the block, each at least a little below the one above.
    fn relief(&self, along: [f32; 2], half_width: f32) -> Relief {
        let layers: Vec<&Structure> = self.layers().collect();
        let mut faces = vec![vec![]; layers.len() + 1];
        for j in 0..GRID[1] {
            for i in 0..GRID[0] {
                let share = |number: usize, of: usize| number as f64 / (of - 1) as f64;
                let x = f64::from(along[0]) + f64::from(along[1] - along[0]) * share(i, GRID[0]);
                let y = f64::from(half_width) * (2.0 * share(j, GRID[1]) - 1.0);
                let skin = self.skin(x, y);
                let mut above = skin - THINNEST_MM;
                for (number, face) in faces.iter_mut().enumerate() {
                    let rest = (layers.len() - number) as f64;
                    let own = match layers.get(number) {
                        Some(layer) if number > 0 => self.top(layer, x, y).unwrap_or(skin + BLOCK_MM),
                        Some(_) => skin,
                        None => skin + BLOCK_MM,
                    };
                    let lowest = skin + BLOCK_MM - rest * THINNEST_MM;
                    let depth = own.min(lowest).max(above + THINNEST_MM);
                    above = depth;
                    face.push(depth as f32);
                }
            }
        }
        Relief { columns: GRID[0], lines: GRID[1], faces_mm: faces }
    }

    /// Tissue about the point of entry, the layer of the scene that each wall is, and the tube that
    /// is part of it.
    pub(crate) fn configure(
        &self,
        given: &[Given],
    ) -> (Configuration, Vec<Option<WallName>>, Option<[usize; 2]>) {
        let standard = Configuration::default();
        let relief = self.relief(standard.along_mm, standard.half_width_mm);
        let thick = |number: usize| {
            let pairs = relief.faces_mm[number].iter().zip(&relief.faces_mm[number + 1]);
            pairs.map(|(top, end)| end - top).sum::<f32>() / (GRID[0] * GRID[1]) as f32
        };
        let (mut layers, mut top) = (vec![], 0.0);
        for (number, structure) in self.layers().enumerate() {
            let kind = crate::drawn::TISSUES.get(code(structure.tissue) as usize).copied().unwrap_or("other");
            let mut layer = Layer::of(kind, top, thick(number));
            layer.rows = ((thick(number) / 3.0).round() as usize).clamp(1, 9);
            let own = given.iter().find(|given| given.kind == code(structure.tissue));
            layer.gives_mm = own.map_or(0.0, |given| given.travel_mm.clamp(0.0, 30.0));
            top += layer.thickness_mm;
            layers.push(layer);
        }
        let (vessel, tube) = self.vessel(given, standard.along_mm, standard.half_width_mm).unzip();
        let mut walls = vec![None; given.len()];
        for (number, structure) in self.layers().enumerate() {
            let own = given.iter().position(|given| given.kind == code(structure.tissue));
            if let Some(slot) = own.and_then(|own| walls.get_mut(own)) {
                *slot = Some(WallName::Layer(number));
            }
        }
        for (slot, layer) in walls.iter_mut().zip(given).filter(|_| vessel.is_some()) {
            if layer.is_vessel {
                *slot = Some(WallName::Near);
            } else if layer.is_far {
                *slot = Some(WallName::Far);
            }
        }
        let configuration =
            Configuration { layers, vessel, relief: Some(relief), limb_radius_mm: None, ..standard };
        (configuration, walls, tube)
    }

    /// The tube that the needle's line comes nearest to within the block, as a vessel that gives
    /// way, with its structure and its number there.
    fn vessel(&self, given: &[Given], along: [f32; 2], half_width: f32) -> Option<(Vessel, [usize; 2])> {
        let travel = |wanted: fn(&Given) -> bool| {
            given.iter().find(|layer| wanted(layer)).map_or(0.0, |layer| layer.travel_mm.clamp(0.0, 30.0))
        };
        let ahead = self
            .block()
            .axes
            .map(|axis| axis.iter().zip(self.line.direction).map(|(a, b)| a * b).sum::<f64>());
        let mut best: Option<(f64, Vessel, [usize; 2])> = None;
        for (number, structure) in self.body.structures.iter().enumerate() {
            if structure.tissue != Tissue::Vessel {
                continue;
            }
            for (tube, (line, radius)) in structure.tubes.iter().enumerate() {
                let inside = |place: &&[f64; 3]| self.is_in_block(**place, along, half_width);
                let line = line.iter().filter(inside).map(|place| self.block().from_limb(*place));
                let line: Vec<[f64; 3]> = line.collect();
                if line.len() < 3 {
                    continue;
                }
                let far = |p: &[f64; 3]| {
                    let along: f64 = p.iter().zip(ahead).map(|(a, b)| a * b).sum();
                    p.iter().zip(ahead).map(|(a, b)| (a - along * b).powi(2)).sum::<f64>()
                };
                let gap = line.iter().map(far).fold(f64::INFINITY, f64::min);
                if best.as_ref().is_none_or(|(known, ..)| gap < *known) {
                    let wide = 2.0 * *radius as f32;
                    let vessel = Vessel {
                        vertical_mm: wide,
                        horizontal_mm: wide,
                        path_mm: line.iter().map(|place| place.map(|mm| mm as f32)).collect(),
                        near_gives_mm: travel(|layer| layer.is_vessel),
                        far_gives_mm: travel(|layer| layer.is_far),
                        ..Vessel::default()
                    };
                    best = Some((gap, vessel, [number, tube]));
                }
            }
        }
        best.map(|(_, vessel, tube)| (vessel, tube))
    }

    /// True if a place of the limb's frame is in the block of tissue.
    pub(crate) fn is_in_block(&self, place: [f64; 3], along: [f32; 2], half_width: f32) -> bool {
        let [x, y, z] = self.block().from_limb(place).map(|mm| mm as f32);
        x >= along[0] && x <= along[1] && y.abs() <= half_width && z < DEEPEST_MM
    }

    /// Notes the tissue of each surface of the block: that of its layer, or a vessel's.
    pub(crate) fn name(&self, surfaces: &mut [SurfaceView]) {
        let codes: Vec<u32> = self.layers().map(|structure| code(structure.tissue)).collect();
        let mut sections = codes.iter();
        for surface in surfaces {
            surface.tissue = match surface.kind {
                Kind::Section => sections.next().copied().unwrap_or(3),
                Kind::VesselBehind | Kind::VesselBefore => code(Tissue::Vessel),
                _ => code(Tissue::Skin),
            };
        }
    }

    /// Returns the place where a line of sight in the block's frame first meets the skin, and how
    /// far along (mm) and around (degrees) the limb that is.
    pub(crate) fn pick(&self, [eye, direction]: [[f64; 3]; 2]) -> Option<([f64; 3], [f64; 2])> {
        let size = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        let (from, ahead) =
            (self.block().to_limb(eye), self.block().direction_to_limb(direction.map(|v| v / size)));
        let skin = self.body.structures.first()?;
        let way =
            skin.stretches(from, ahead).map(|[from, _]| from).filter(|way| *way > 0.0).reduce(f64::min)?;
        let place: [f64; 3] = std::array::from_fn(|axis| from[axis] + way * ahead[axis]);
        let around = place[1].atan2(-place[2]).to_degrees();
        Some((self.block().from_limb(place), [place[0], around]))
    }
}

/// Returns the place where a line of sight first meets a limb without a body: a cylinder that
/// touches the entry from below.
pub(crate) fn pick_cylinder(radius: f64, [eye, direction]: [[f64; 3]; 2]) -> Option<[f64; 3]> {
    let limb = anatomy::solid::Convex::Cylinder { across: radius, down: radius };
    let size = direction.iter().map(|v| v * v).sum::<f64>().sqrt();
    let ahead = direction.map(|v| v / size);
    let [way, _] = limb.stretch([eye[0], eye[1], eye[2] - radius], ahead)?;
    (way > 0.0).then(|| std::array::from_fn(|axis| eye[axis] + way * ahead[axis]))
}
