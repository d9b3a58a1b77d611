//! A layer as a lattice of cells, each of five tetrahedra.

use crate::configuration::{Layer, Relief};
use crate::constraint::{Anchor, Bending, Distance, Volume, bending_angle, place, volume};
use crate::solver::Parts;
use crate::vector::{Vector, length, sub};
use std::collections::BTreeSet;

/// kPa in µN/mm².
pub(crate) const KPA: f32 = 1e3;

/// The positions of a layer's particles, now and at rest.
#[derive(Clone, Debug)]
pub(crate) struct Lattice {
    first: u32,
    pub(crate) nx: usize,
    pub(crate) ny: usize,
    pub(crate) nz: usize,
    x: [f32; 2],
    half_width: f32,
    z: [f32; 2],
    faces: Faces,
}

/// The upper and lower face of a layer.
#[derive(Clone, Debug)]
enum Faces {
    /// Level along, and across as round as the limb.
    Limb(Option<f32>),
    /// As a grid says: the layer of this number in it.
    Relief(Relief, usize),
}

/// The block that all layers are cut from.
#[derive(Clone, Copy)]
pub(crate) struct Extent<'a> {
    pub(crate) along: [f32; 2],
    pub(crate) half_width: f32,
    pub(crate) limb_radius: Option<f32>,
    pub(crate) relief: Option<&'a Relief>,
    pub(crate) density: f32,
}

/// Tetrahedra of a cell by its corners (bit 0: x, bit 1: y, bit 2: z), in two orientations that
/// alternate, so that the diagonals of neighbours meet.
const TETRAHEDRA: [[[usize; 4]; 5]; 2] = [
    [[0, 1, 2, 4], [3, 2, 1, 7], [5, 4, 7, 1], [6, 7, 4, 2], [1, 2, 4, 7]],
    [[1, 0, 5, 3], [2, 3, 6, 0], [4, 5, 0, 6], [7, 6, 3, 5], [0, 3, 6, 5]],
];

/// Returns the drop of the skin below its highest line, `y` mm beside it, in mm.
pub(crate) fn sag(limb_radius: Option<f32>, y: f32) -> f32 {
    limb_radius.map_or(0.0, |radius| radius - (radius * radius - y * y).max(0.0).sqrt())
}

impl Lattice {
    /// Adds the particles and constraints of `layer` to `parts`.
    /// `number` counts them from the skin.
    pub(crate) fn build(layer: &Layer, number: usize, extent: Extent<'_>, parts: &mut Parts) -> Self {
        let Extent { along, half_width, limb_radius, relief, density } = extent;
        let cells = |long: f32| ((long / layer.spacing_mm).round() as usize).max(2);
        // An even number across, so that a row of particles lies in the needle's plane.
        let across = cells(2.0 * half_width).next_multiple_of(2);
        let lattice = Self {
            first: parts.points.len() as u32,
            nx: cells(along[1] - along[0]) + 1,
            ny: across + 1,
            nz: layer.rows + 1,
            x: along,
            half_width,
            z: [layer.top_mm, layer.top_mm + layer.thickness_mm],
            faces: match relief {
                Some(relief) => Faces::Relief(relief.clone(), number),
                None => Faces::Limb(limb_radius),
            },
        };
        for k in 0..lattice.nz {
            for j in 0..lattice.ny {
                for i in 0..lattice.nx {
                    let [x, y, z] = lattice.rest(i, j, k);
                    parts.points.push([x, y, z, 0.0]);
                }
            }
        }
        lattice.constrain(layer, density, parts);
        lattice
    }

    /// Number of the particle in column `i`, line `j`, row `k`.
    pub(crate) fn at(&self, i: usize, j: usize, k: usize) -> u32 {
        self.first + ((k * self.ny + j) * self.nx + i) as u32
    }

    /// Returns its position at rest.
    fn rest(&self, i: usize, j: usize, k: usize) -> Vector {
        let share = |number: usize, of: usize| number as f32 / (of - 1) as f32;
        let y = self.half_width * (2.0 * share(j, self.ny) - 1.0);
        let x = self.x[0] + (self.x[1] - self.x[0]) * share(i, self.nx);
        let [top, bottom] = self.span(x, y);
        [x, y, top + (bottom - top) * share(k, self.nz)]
    }

    /// Returns its upper and lower face over a place, mm.
    fn span(&self, x: f32, y: f32) -> [f32; 2] {
        match &self.faces {
            Faces::Limb(radius) => self.z.map(|z| z + sag(*radius, y)),
            Faces::Relief(relief, number) => {
                let along = (x - self.x[0]) / (self.x[1] - self.x[0]);
                let across = 0.5 * (y / self.half_width + 1.0);
                [*number, *number + 1].map(|face| relief.depth(face, along, across))
            }
        }
    }

    fn constrain(&self, layer: &Layer, density: f32, parts: &mut Parts) {
        let first = self.first as usize;
        let at = |points: &[[f32; 4]], index: u32| place(&points[index as usize]);
        let mut masses = vec![0.0_f32; self.nx * self.ny * self.nz];
        let mut edges = BTreeSet::new();
        for (i, j, k) in self.cells() {
            for corners in TETRAHEDRA[(i + j + k) % 2] {
                let mut corners =
                    corners.map(|bits| self.at(i + (bits & 1), j + (bits >> 1 & 1), k + (bits >> 2)));
                if volume(corners.map(|index| at(&parts.points, index))) < 0.0 {
                    corners.swap(0, 1);
                }
                let size = volume(corners.map(|index| at(&parts.points, index)));
                parts.volumes.push(Volume {
                    corners,
                    rest: size * layer.volume_ratio,
                    // Energy of a compressed volume: K(V − V₀)²/(2V₀).
                    compliance: size / (layer.bulk_kpa * KPA),
                });
                for (number, a) in corners.iter().enumerate() {
                    masses[*a as usize - first] += 0.25 * size * density;
                    edges.extend(corners[number + 1..].iter().map(|b| (*a.min(b), *a.max(b))));
                }
            }
        }
        let cell = layer.spacing_mm * layer.spacing_mm * (self.z[1] - self.z[0]) / (self.nz - 1) as f32;
        for (a, b) in edges {
            let rest = length(sub(at(&parts.points, a), at(&parts.points, b)));
            // An edge stands for a rod with a third of the cell's volume: E·A/L.
            let stiffness = layer.stiffness_kpa * KPA * cell / (3.0 * rest * rest);
            parts.distances.push(Distance { ends: [a, b], rest, compliance: 1.0 / stiffness });
        }
        self.bend(layer, parts);
        for (index, mass) in masses.into_iter().enumerate() {
            parts.points[first + index][3] = if self.is_held(index) { 0.0 } else { 1.0 / mass };
        }
    }

    /// The body goes on where the block ends.
    fn is_held(&self, index: usize) -> bool {
        let (i, j) = (index % self.nx, index / self.nx % self.ny);
        i == 0 || i == self.nx - 1 || j == 0 || j == self.ny - 1
    }

    /// Holds the bottom row: what lies deeper does not move.
    pub(crate) fn hold_bottom(&self, parts: &mut Parts) {
        for j in 0..self.ny {
            for i in 0..self.nx {
                parts.points[self.at(i, j, self.nz - 1) as usize][3] = 0.0;
            }
        }
    }

    fn cells(&self) -> impl Iterator<Item = (usize, usize, usize)> + use<> {
        let [nx, ny, nz] = [self.nx, self.ny, self.nz];
        (0..nz - 1).flat_map(move |k| (0..ny - 1).flat_map(move |j| (0..nx - 1).map(move |i| (i, j, k))))
    }

    /// Bending of the upper surface about the edges of its squares and their diagonals.
    fn bend(&self, layer: &Layer, parts: &mut Parts) {
        if layer.bending_stiffness == 0.0 {
            return;
        }
        let mut add = |corners: [u32; 4]| {
            let built = bending_angle(corners.map(|index| place(&parts.points[index as usize])));
            // The table's angle is between the planes; ours is between their normals.
            let rest = layer.bending_deg.map_or(built, |degrees| std::f32::consts::PI - degrees.to_radians());
            parts.bendings.push(Bending { corners, rest, compliance: 1.0 / layer.bending_stiffness });
        };
        for j in 0..self.ny - 1 {
            for i in 0..self.nx - 1 {
                let at = |a: usize, b: usize| self.at(i + a, j + b, 0);
                if (i + j) % 2 == 0 {
                    add([at(1, 0), at(0, 1), at(0, 0), at(1, 1)]);
                } else {
                    add([at(0, 0), at(1, 1), at(1, 0), at(0, 1)]);
                }
            }
        }
    }

    /// Triangles of the surface of row `k`, facing outwards (towards smaller z).
    pub(crate) fn row_triangles(&self, k: usize) -> Vec<[u32; 3]> {
        let mut triangles = vec![];
        for j in 0..self.ny - 1 {
            for i in 0..self.nx - 1 {
                let [a, b, c, d] =
                    [self.at(i, j, k), self.at(i + 1, j, k), self.at(i + 1, j + 1, k), self.at(i, j + 1, k)];
                if (i + j) % 2 == 0 {
                    triangles.extend([[a, d, b], [b, d, c]]);
                } else {
                    triangles.extend([[a, c, b], [a, d, c]]);
                }
            }
        }
        triangles
    }

    /// Triangles of the section through line `j`, along the insertion.
    pub(crate) fn line_triangles(&self, j: usize) -> Vec<[u32; 3]> {
        let mut triangles = vec![];
        for k in 0..self.nz - 1 {
            for i in 0..self.nx - 1 {
                let [a, b, c, d] =
                    [self.at(i, j, k), self.at(i + 1, j, k), self.at(i + 1, j, k + 1), self.at(i, j, k + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        triangles
    }

    /// Triangles of the section through column `i`, across the insertion.
    pub(crate) fn column_triangles(&self, i: usize) -> Vec<[u32; 3]> {
        let mut triangles = vec![];
        for k in 0..self.nz - 1 {
            for j in 0..self.ny - 1 {
                let [a, b, c, d] =
                    [self.at(i, j, k), self.at(i, j + 1, k), self.at(i, j + 1, k + 1), self.at(i, j, k + 1)];
                triangles.extend([[a, b, c], [a, c, d]]);
            }
        }
        triangles
    }

    /// The line of particles in the needle's plane.
    pub(crate) fn middle(&self) -> usize {
        self.ny / 2
    }

    /// The tissue that was at `rest` before anything moved: a mean of the eight corners of its
    /// cell; `None` outside.
    pub(crate) fn anchor(&self, rest: Vector) -> Option<Anchor> {
        let [top, bottom] = self.span(rest[0], rest[1]);
        let deep = (rest[2] - top) / (bottom - top);
        let split = |value: f32, low: f32, high: f32, count: usize| {
            let cells = (count - 1) as f32;
            let at = (value - low) / (high - low) * cells;
            if !(-1e-3..=cells + 1e-3).contains(&at) {
                return None;
            }
            let cell = at.floor().clamp(0.0, cells - 1.0);
            Some((cell as usize, (at - cell).clamp(0.0, 1.0)))
        };
        let (i, fx) = split(rest[0], self.x[0], self.x[1], self.nx)?;
        let (j, fy) = split(rest[1], -self.half_width, self.half_width, self.ny)?;
        let (k, fz) = split(deep, 0.0, 1.0, self.nz)?;
        let side = |bit: usize, share: f32| if bit == 1 { share } else { 1.0 - share };
        let corners: Vec<(u32, f32)> = (0..8_usize)
            .map(|bits| {
                let [a, b, c] = [bits & 1, bits >> 1 & 1, bits >> 2];
                (self.at(i + a, j + b, k + c), side(a, fx) * side(b, fy) * side(c, fz))
            })
            .filter(|(_, weight)| *weight > 1e-6)
            .collect();
        Some(Anchor::new(&corners))
    }
}
