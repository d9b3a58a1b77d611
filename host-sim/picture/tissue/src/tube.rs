//! A vessel as a tube of rings: wall of distances and bending angles, a lumen that keeps its
//! volume, ties to the tissue around.

use crate::configuration::Vessel;
use crate::constraint::{Bending, Distance, Volume, bending_angle, place, volume};
use crate::lattice::{Extent, KPA, sag};
use crate::solver::Parts;
use crate::vector::{Vector, add, cross, direction, dot, length, scale, sub};

/// Particles around a ring.
pub(crate) const AROUND: usize = 16;
/// Thickness of the wall that stiffness and mass are made of, mm.
const WALL_MM: f32 = 0.5;
/// Distance between rings, mm.
const BETWEEN_MM: f32 = 1.3;

/// The positions of a vessel's particles.
#[derive(Clone, Debug)]
pub(crate) struct Tube {
    first: u32,
    pub(crate) rings: usize,
    /// A particle on the axis of each ring, for the lumen's volume.
    axis_first: u32,
}

impl Tube {
    /// Adds the vessel's particles and constraints to `parts`; it runs from one side of the block
    /// to the other, or along its path.
    pub(crate) fn build(vessel: &Vessel, extent: Extent<'_>, parts: &mut Parts) -> Self {
        let line = if vessel.path_mm.is_empty() { straight(vessel, extent) } else { vessel.path_mm.clone() };
        let long: f32 = line.windows(2).map(|ends| length(sub(ends[1], ends[0]))).sum();
        let rings = ((long / BETWEEN_MM).round() as usize).clamp(2, 64) + 1;
        let tube = Self {
            first: parts.points.len() as u32,
            rings,
            axis_first: (parts.points.len() + rings * AROUND) as u32,
        };
        let on_line = |ring: usize| along_line(&line, long * ring as f32 / (rings - 1) as f32);
        let centre = |ring: usize| on_line(ring).0;
        for ring in 0..rings {
            let (middle, ahead) = on_line(ring);
            let across = direction([-ahead[1], ahead[0], 0.0]).unwrap_or([0.0, 1.0, 0.0]);
            let up = cross(across, ahead);
            for number in 0..AROUND {
                let (aside, height) = (number as f32 / AROUND as f32 * std::f32::consts::TAU).sin_cos();
                let side = scale(across, 0.5 * vessel.horizontal_mm * aside);
                let [x, y, z] = add(middle, add(side, scale(up, 0.5 * vessel.vertical_mm * height)));
                parts.points.push([x, y, z, 0.0]);
            }
        }
        for ring in 0..rings {
            let [x, y, z] = centre(ring);
            parts.points.push([x, y, z, 0.0]);
        }
        tube.constrain(vessel, extent.density, parts);
        tube
    }

    /// Number of a particle of the wall; `number` goes round, from the side towards the skin.
    pub(crate) fn at(&self, ring: usize, number: usize) -> u32 {
        self.first + (ring * AROUND + number % AROUND) as u32
    }

    fn on_axis(&self, ring: usize) -> u32 {
        self.axis_first + ring as u32
    }

    /// Its particles.
    pub(crate) fn particles(&self) -> std::ops::Range<u32> {
        self.first..self.axis_first + self.rings as u32
    }

    fn constrain(&self, vessel: &Vessel, density: f32, parts: &mut Parts) {
        let at = |parts: &Parts, index: u32| place(&parts.points[index as usize]);
        let mut edge = |a: u32, b: u32, wide: f32, stiffness_kpa: f32| {
            let rest = length(sub(at(parts, a), at(parts, b)));
            let stiffness = stiffness_kpa * KPA * wide * WALL_MM / rest;
            parts.distances.push(Distance { ends: [a, b], rest, compliance: 1.0 / stiffness });
        };
        let arc = 0.5 * std::f32::consts::PI * (vessel.vertical_mm + vessel.horizontal_mm) / AROUND as f32;
        for ring in 0..self.rings {
            for number in 0..AROUND {
                edge(self.at(ring, number), self.at(ring, number + 1), BETWEEN_MM, vessel.stiffness_kpa);
                if ring + 1 < self.rings {
                    edge(self.at(ring, number), self.at(ring + 1, number), arc, vessel.stiffness_kpa);
                    edge(
                        self.at(ring, number),
                        self.at(ring + 1, number + 1),
                        0.5 * arc,
                        vessel.stiffness_kpa,
                    );
                }
            }
            if ring + 1 < self.rings {
                // Blood has no shape: the axis only has to stay in the middle.
                edge(self.on_axis(ring), self.on_axis(ring + 1), arc, 0.1 * vessel.stiffness_kpa);
            }
        }
        self.fill(vessel, parts);
        self.bend(vessel, parts);
        let mass = density * WALL_MM * BETWEEN_MM * arc;
        let blood =
            density * 0.25 * std::f32::consts::PI * vessel.vertical_mm * vessel.horizontal_mm * BETWEEN_MM;
        for ring in 0..self.rings {
            let held = ring == 0 || ring == self.rings - 1;
            for number in 0..AROUND {
                let share = blood * 0.5 / AROUND as f32;
                parts.points[self.at(ring, number) as usize][3] =
                    if held { 0.0 } else { 1.0 / (mass + share) };
            }
            parts.points[self.on_axis(ring) as usize][3] = if held { 0.0 } else { 2.0 / blood };
        }
    }

    /// The lumen: wedges from the axis to the wall, three tetrahedra each.
    fn fill(&self, vessel: &Vessel, parts: &mut Parts) {
        for ring in 0..self.rings - 1 {
            for number in 0..AROUND {
                let [o, a, b] = [self.on_axis(ring), self.at(ring, number), self.at(ring, number + 1)];
                let [p, c, d] =
                    [self.on_axis(ring + 1), self.at(ring + 1, number), self.at(ring + 1, number + 1)];
                for mut corners in [[o, a, b, d], [o, a, d, c], [o, c, d, p]] {
                    let size =
                        |corners: [u32; 4]| volume(corners.map(|index| place(&parts.points[index as usize])));
                    if size(corners) < 0.0 {
                        corners.swap(0, 1);
                    }
                    let built = size(corners);
                    // Soft: blood flows away along the vessel.
                    let compliance = built / (0.3 * vessel.stiffness_kpa * KPA);
                    parts.volumes.push(Volume { corners, rest: built * vessel.volume_ratio, compliance });
                }
            }
        }
    }

    fn bend(&self, vessel: &Vessel, parts: &mut Parts) {
        if vessel.bending_stiffness == 0.0 {
            return;
        }
        for ring in 0..self.rings - 1 {
            for number in 0..AROUND {
                // About the long edges: what keeps it open. The corners are the diagonals' other
                // ends.
                let corners = [
                    self.at(ring, number),
                    self.at(ring + 1, number),
                    self.at(ring + 1, number + 1),
                    self.at(ring, number + AROUND - 1),
                ];
                let rest = bending_angle(corners.map(|index| place(&parts.points[index as usize])));
                parts.bendings.push(Bending { corners, rest, compliance: 1.0 / vessel.bending_stiffness });
            }
        }
    }

    /// Triangles of the wall, facing outwards.
    pub(crate) fn triangles(&self, points: &[[f32; 4]]) -> Vec<[u32; 3]> {
        let mut triangles = vec![];
        for ring in 0..self.rings - 1 {
            for number in 0..AROUND {
                let [a, b] = [self.at(ring, number), self.at(ring, number + 1)];
                let [c, d] = [self.at(ring + 1, number), self.at(ring + 1, number + 1)];
                triangles
                    .extend([[a, c, d], [a, d, b]].map(|triangle| self.outwards(triangle, ring, points)));
            }
        }
        triangles
    }

    fn outwards(&self, [a, b, c]: [u32; 3], ring: usize, points: &[[f32; 4]]) -> [u32; 3] {
        let at = |index: u32| -> Vector { place(&points[index as usize]) };
        let normal = cross(sub(at(b), at(a)), sub(at(c), at(a)));
        let middle = scale(add(at(self.on_axis(ring)), at(self.on_axis(ring + 1))), 0.5);
        if dot(normal, sub(at(a), middle)) < 0.0 { [a, c, b] } else { [a, b, c] }
    }
}

/// The centre line of a straight vessel: its depth counts from the skin above it.
fn straight(vessel: &Vessel, extent: Extent<'_>) -> Vec<Vector> {
    let (sine, cosine) = vessel.axis_deg.to_radians().sin_cos();
    let [low, high] = reach(vessel, [cosine, sine], extent.along, extent.half_width);
    let [cx, cy] = vessel.centre_mm;
    let points = (((high - low) / BETWEEN_MM).round() as usize).clamp(2, 64);
    let point = |number: usize| {
        let s = low + (high - low) * number as f32 / points as f32;
        let (x, y) = (cx + s * cosine, cy + s * sine);
        [x, y, vessel.top_mm + 0.5 * vessel.vertical_mm + sag(extent.limb_radius, y)]
    };
    (0..=points).map(point).collect()
}

/// The place `way` mm along a line of points, and the direction there.
fn along_line(line: &[Vector], mut way: f32) -> (Vector, Vector) {
    let mut last = ([0.0; 3], [1.0, 0.0, 0.0]);
    for ends in line.windows(2) {
        let piece = sub(ends[1], ends[0]);
        let (long, ahead) = (length(piece), direction(piece).unwrap_or([1.0, 0.0, 0.0]));
        last = (add(ends[0], scale(ahead, way.min(long))), ahead);
        if way <= long {
            break;
        }
        way -= long;
    }
    last
}

/// From where to where along its axis the vessel lies in the block, mm from its centre.
fn reach(vessel: &Vessel, axis: [f32; 2], along: [f32; 2], half_width: f32) -> [f32; 2] {
    let [cx, cy] = vessel.centre_mm;
    let mut reach = [-1e3_f32, 1e3_f32];
    for (component, low, high) in
        [(axis[0], along[0] - cx, along[1] - cx), (axis[1], -half_width - cy, half_width - cy)]
    {
        if component.abs() < 1e-3 {
            continue;
        }
        let ends = [low / component, high / component];
        reach[0] = reach[0].max(ends[0].min(ends[1]));
        reach[1] = reach[1].min(ends[0].max(ends[1]));
    }
    // A vessel that only touches the block's corner is still a tube.
    [reach[0].min(-1.0), reach[1].max(1.0)]
}
