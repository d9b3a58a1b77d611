//! The parts of a body that stay as they are in the picture: the skin around the block of tissue,
//! the section beyond it, bones, bursae and tubes.

use crate::drawn::{Kind, SurfaceView};
use crate::limb::{BLOCK_MM, Limb, code};
use anatomy::{Role, Tissue};
use ultrasound::Medium;

/// The limb beyond the block: from where to where along and across, and between two lines, mm.
const LIMB_MM: [f64; 2] = [-90.0, 110.0];
const LIMB_ACROSS_MM: f64 = 60.0;
const LIMB_STEP_MM: f64 = 5.0;
/// Skin deeper than this below the point of entry is not drawn, mm.
const LOWEST_MM: f64 = 60.0;
/// A section is painted over that of the structure before it by so much, mm towards the eye: all of
/// them are thinner than a needle.
const OVER_MM: f64 = 0.04;
/// The section beyond the block of tissue reaches so far into it, mm.
const EDGE_MM: f64 = 1.4;
/// Points around a tube and a ball.
const AROUND: usize = 16;
const UPRIGHT: usize = 12;

fn medium(tissue: Tissue) -> Medium {
    Medium::named(match tissue {
        Tissue::Skin => "skin",
        Tissue::Fat => "fat",
        Tissue::Muscle => "muscle",
        Tissue::Artery | Tissue::Vessel => "blood",
        Tissue::Bursa => "bursa",
        Tissue::Tendon | Tissue::Nerve => "tendon",
        Tissue::Cartilage => "cartilage",
    })
}

/// A surface that stays, for the ultrasound image.
#[derive(Clone, Debug)]
pub(crate) struct Closed {
    pub(crate) triangles: Vec<[u32; 3]>,
    pub(crate) behind: Medium,
    /// It is a vessel's.
    pub(crate) has_wall: bool,
}

/// Points and surfaces that stay.
#[derive(Clone, Debug, Default)]
pub(crate) struct Still {
    pub(crate) points: Vec<[f32; 4]>,
    pub(crate) normals: Vec<[f32; 4]>,
    pub(crate) views: Vec<SurfaceView>,
    pub(crate) closed: Vec<Closed>,
}

impl Limb {
    /// Everything that stays: the skin of the limb around the block, the section beyond it, and
    /// what is inside, without the tube that gives way.
    pub(crate) fn still(&self, along: [f32; 2], half_width: f32, moving: Option<[usize; 2]>) -> Still {
        let mut still = Still::default();
        self.skin_around(along.map(f64::from), f64::from(half_width), &mut still);
        self.section(along.map(f64::from), moving, &mut still);
        for (number, structure) in self.body.structures.iter().enumerate() {
            match structure.role {
                Role::Layer => {}
                Role::Inside => {
                    for part in &structure.parts {
                        self.ball(part, structure.tissue, &mut still);
                    }
                }
                Role::Tube => {
                    for (tube, (line, radius)) in structure.tubes.iter().enumerate() {
                        let pieces = if moving == Some([number, tube]) {
                            self.beyond(line, along, half_width)
                        } else {
                            vec![line.clone()]
                        };
                        for line in pieces {
                            self.pipe(&line, *radius, structure.tissue, &mut still);
                        }
                    }
                }
            }
        }
        still
    }

    /// The pieces of a tube's line before and behind the block, each up to its first point in it.
    fn beyond(&self, line: &[[f64; 3]], along: [f32; 2], half_width: f32) -> Vec<Vec<[f64; 3]>> {
        let inside = |place: &[f64; 3]| self.is_in_block(*place, along, half_width);
        let first = line.iter().position(inside).unwrap_or(line.len());
        let last = line.iter().rposition(inside).unwrap_or(0);
        let before = line[..(first + 1).min(line.len())].to_vec();
        [before, line[last..].to_vec()].into_iter().filter(|piece| piece.len() > 1).collect()
    }

    fn skin_around(&self, along: [f64; 2], half_width: f64, still: &mut Still) {
        let spread = |from: f64, to: f64| {
            let steps = ((to - from) / LIMB_STEP_MM).ceil().max(1.0);
            (0..steps as usize).map(move |step| from + (to - from) * step as f64 / steps)
        };
        let xs: Vec<f64> = spread(LIMB_MM[0], along[0])
            .chain(spread(along[0], along[1]))
            .chain(spread(along[1], LIMB_MM[1]))
            .chain([LIMB_MM[1]])
            .collect();
        let side: Vec<f64> = spread(0.0, half_width).chain(spread(half_width, LIMB_ACROSS_MM)).collect();
        let ys: Vec<f64> = side.iter().rev().map(|y| -y).chain(side.iter().skip(1).copied()).collect();
        let Some(skin) = self.body.structures.first() else { return };
        let first = still.points.len() as u32;
        let mut known = vec![false; xs.len() * ys.len()];
        for (j, y) in ys.iter().enumerate() {
            for (i, x) in xs.iter().enumerate() {
                let top = self.top(skin, *x, *y).filter(|top| *top < LOWEST_MM);
                known[j * xs.len() + i] = top.is_some();
                still.points.push([*x as f32, *y as f32, top.unwrap_or(0.0) as f32, 0.0]);
            }
        }
        let in_block = |x: f64, y: f64| x > along[0] && x < along[1] && y.abs() < half_width;
        let mut halves = [vec![], vec![]];
        for j in 0..ys.len() - 1 {
            for i in 0..xs.len() - 1 {
                let corners = [[i, j], [i + 1, j], [i + 1, j + 1], [i, j + 1]].map(|[i, j]| j * xs.len() + i);
                let middle = [0.5 * (xs[i] + xs[i + 1]), 0.5 * (ys[j] + ys[j + 1])];
                if corners.iter().all(|corner| known[*corner]) && !in_block(middle[0], middle[1]) {
                    let [a, b, c, d] = corners.map(|corner| first + corner as u32);
                    halves[usize::from(middle[1] > 0.0)].extend([[a, c, b], [a, d, c]]);
                }
            }
        }
        let [behind, before] = halves;
        still.shade(first, &[&behind[..], &before[..]].concat());
        still.view(Kind::SkinBehind, 0, behind);
        still.view(Kind::SkinBefore, 0, before);
    }

    /// Cut faces along the needle's plane, each painted over those before it.
    fn section(&self, along: [f64; 2], moving: Option<[usize; 2]>, still: &mut Still) {
        for outline in self.body.outlines(self.block()) {
            let structure = &self.body.structures[outline.structure];
            let is_moving = moving.is_some_and(|[number, _]| number == outline.structure);
            let is_layer = structure.role == Role::Layer;
            let aside = (OVER_MM * (1 + outline.structure) as f64) as f32;
            let first = still.points.len() as u32;
            let count = outline.points_mm.len();
            // A little over its edges, which do not move.
            let in_block = |x: f64| x > along[0] + EDGE_MM && x < along[1] - EDGE_MM;
            // The block of tissue shows its own; under it the layer goes on, from a second line of
            // points.
            let tops = outline.points_mm.iter().take(count / 2);
            let under =
                tops.map(|[x, z]| [*x, if is_layer { z.max(self.skin(*x, 0.0) + BLOCK_MM) } else { *z }]);
            for [x, z] in outline.points_mm.iter().copied().chain(under) {
                still.points.push([x as f32, aside, z as f32, 0.0]);
            }
            let mut triangles = vec![];
            for column in 0..(count / 2).saturating_sub(1) {
                let is_within =
                    [column, column + 1].into_iter().all(|number| in_block(outline.points_mm[number][0]));
                let top = if is_within { count + column } else { column };
                let corners = [top, top + 1, count - 2 - column, count - 1 - column];
                let [a, b, c, d] = corners.map(|number| first + number as u32);
                let depth = |corner: u32| still.points[corner as usize][2];
                if (is_moving && is_within) || depth(a) >= depth(d) || depth(b) >= depth(c) {
                    continue;
                }
                triangles.extend([[a, b, c], [a, c, d]]);
            }
            still.normals.resize(still.points.len(), [0.0, 1.0, 0.0, 0.0]);
            still.view(Kind::Section, code(structure.tissue), triangles);
        }
    }

    /// A convex part, as seen from a point in it in all directions.
    fn ball(&self, part: &[anatomy::solid::Convex], tissue: Tissue, still: &mut Still) {
        let Some(middle) = middle_of(part) else { return };
        let first = still.points.len() as u32;
        for ring in 0..=UPRIGHT {
            for number in 0..AROUND {
                let (height, level) = (std::f64::consts::PI * ring as f64 / UPRIGHT as f64).sin_cos();
                let (side, ahead) = (std::f64::consts::TAU * number as f64 / AROUND as f64).sin_cos();
                let wanted = [height * ahead * middle.1[0], height * side * middle.1[1], level * middle.1[2]];
                let size = wanted.iter().map(|v| v * v).sum::<f64>().sqrt().max(1e-9);
                let direction = wanted.map(|v| v / size);
                let far = anatomy::solid::inside_all(part, middle.0, direction)
                    .map_or(0.0, |[_, to]| to.min(150.0));
                let place: [f64; 3] = std::array::from_fn(|axis| middle.0[axis] + far * direction[axis]);
                let [x, y, z] = self.block().from_limb(place).map(|mm| mm as f32);
                still.points.push([x, y, z, 0.0]);
            }
        }
        still.rings(first, UPRIGHT, tissue);
    }

    /// A tube about a line.
    fn pipe(&self, line: &[[f64; 3]], radius: f64, tissue: Tissue, still: &mut Still) {
        let first = still.points.len() as u32;
        for (number, place) in line.iter().enumerate() {
            let next = line.get(number + 1).unwrap_or(place);
            let before = line.get(number.wrapping_sub(1)).unwrap_or(place);
            let ahead: [f64; 3] = std::array::from_fn(|axis| next[axis] - before[axis]);
            let flat = ahead[0].hypot(ahead[1]).max(1e-9);
            let across = [-ahead[1] / flat, ahead[0] / flat, 0.0];
            let size = flat.hypot(ahead[2]);
            let up = [
                -ahead[2] * across[1] / size,
                ahead[2] * across[0] / size,
                (ahead[0] * across[1] - ahead[1] * across[0]) / size,
            ];
            for step in 0..AROUND {
                let (s, c) = (std::f64::consts::TAU * step as f64 / AROUND as f64).sin_cos();
                let place: [f64; 3] =
                    std::array::from_fn(|axis| place[axis] + radius * (s * across[axis] + c * up[axis]));
                let [x, y, z] = self.block().from_limb(place).map(|mm| mm as f32);
                still.points.push([x, y, z, 0.0]);
            }
        }
        still.rings(first, line.len().saturating_sub(1), tissue);
    }
}

/// A point inside a convex part, and its extents in three directions.
fn middle_of(part: &[anatomy::solid::Convex]) -> Option<([f64; 3], [f64; 3])> {
    use anatomy::solid::{Convex, inside_all};
    let start = match part.first()? {
        Convex::Ellipsoid { centre, .. } => *centre,
        Convex::Capsule { ends, .. } => std::array::from_fn(|axis| 0.5 * (ends[0][axis] + ends[1][axis])),
        _ => return None,
    };
    let (mut middle, mut extents) = (start, [1.0; 3]);
    for axis in [2, 0, 1] {
        let direction = std::array::from_fn(|own| f64::from(u8::from(own == axis)));
        let [from, to] = inside_all(part, middle, direction)?;
        middle[axis] += 0.5 * (from + to);
        extents[axis] = 0.5 * (to - from);
    }
    Some((middle, extents))
}

impl Still {
    /// The same with its points after `count` others.
    pub(crate) fn after(mut self, count: u32) -> Self {
        let views = self.views.iter_mut().map(|view| &mut view.triangles);
        let closed = self.closed.iter_mut().map(|closed| &mut closed.triangles);
        for triangle in views.chain(closed).flatten() {
            *triangle = triangle.map(|index| index + count);
        }
        self
    }

    fn view(&mut self, kind: Kind, tissue: u32, triangles: Vec<[u32; 3]>) {
        if !triangles.is_empty() {
            self.views.push(SurfaceView { kind, layer: 0, tissue, triangles });
        }
    }

    /// Normals of new points from `first` on, by the triangles that share them.
    fn shade(&mut self, first: u32, triangles: &[[u32; 3]]) {
        self.normals.resize(self.points.len(), [0.0; 4]);
        for triangle in triangles {
            let [a, b, c] = triangle.map(|index| self.points[index as usize]);
            let (u, v) = ([0, 1, 2].map(|n| b[n] - a[n]), [0, 1, 2].map(|n| c[n] - a[n]));
            let normal = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]];
            for index in triangle.iter().filter(|index| **index >= first) {
                for (sum, part) in self.normals[*index as usize].iter_mut().zip(normal) {
                    *sum += part;
                }
            }
        }
    }

    /// A closed surface of `count` + 1 rings from point `first` on.
    fn rings(&mut self, first: u32, count: usize, tissue: Tissue) {
        let at = |ring: usize, number: usize| first + (ring * AROUND + number % AROUND) as u32;
        let mut triangles = vec![];
        for ring in 0..count {
            for number in 0..AROUND {
                let [a, b] = [at(ring, number), at(ring, number + 1)];
                let [c, d] = [at(ring + 1, number), at(ring + 1, number + 1)];
                triangles.extend([[a, c, d], [a, d, b]]);
            }
        }
        self.shade(first, &triangles);
        let is_vessel = matches!(tissue, Tissue::Vessel | Tissue::Artery);
        let across =
            |triangle: &&[u32; 3]| triangle.iter().map(|n| self.points[*n as usize][1]).sum::<f32>() < 0.0;
        let (behind, before): (Vec<_>, Vec<_>) = triangles.iter().partition(across);
        let kinds = if is_vessel {
            [Kind::VesselBehind, Kind::VesselBefore]
        } else {
            [Kind::InsideBehind, Kind::InsideBefore]
        };
        self.view(kinds[0], code(tissue), behind);
        self.view(kinds[1], code(tissue), before);
        self.closed.push(Closed { triangles, behind: medium(tissue), has_wall: is_vessel });
    }
}
