//! The section through triangles: where each line of the image meets an interface.

use crate::medium::Medium;
use crate::probe::{Axes, Vector};

/// An interface as triangles.
#[derive(Clone, Copy, Debug)]
pub struct Mesh<'a> {
    /// Places, mm; the fourth number is not looked at.
    pub points: &'a [[f32; 4]],
    /// Triangles by the numbers of their corners.
    pub triangles: &'a [[u32; 3]],
    /// The medium behind it: under the surface of a layer, inside a vessel.
    pub behind: Medium,
    /// A closed surface: the second crossing leads out of it again, into the last of those that it
    /// is in, of which 64 are distinguished. It is a wall as thick as this, mm; 0 is a surface
    /// without one.
    pub wall_mm: Option<f32>,
}

/// The crossing of a line of the image and an interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Crossing {
    /// Along the line, mm.
    pub(crate) depth: f32,
    /// The number of its mesh.
    pub(crate) mesh: usize,
    /// Cosine of the angle between line and normal within the image.
    pub(crate) facing: f32,
}

/// Cuts `meshes` at `elevation` mm beside the image's plane: for each of `lines`, its crossings
/// from the skin down.
pub(crate) fn cut(axes: &Axes, elevation: f32, width: f32, meshes: &[Mesh<'_>], lines: &mut [Vec<Crossing>]) {
    lines.iter_mut().for_each(Vec::clear);
    for (number, mesh) in meshes.iter().enumerate() {
        for triangle in mesh.triangles {
            let Some(corners) = corners(mesh.points, triangle) else { continue };
            let [p, q, r] = corners.map(|corner| {
                let mut own = axes.of(corner);
                own[2] -= elevation;
                own
            });
            if let Some((from, to)) = section(p, q, r) {
                enter(from, to, number, width, lines);
            }
        }
    }
    for line in lines {
        line.sort_by(|a, b| a.depth.total_cmp(&b.depth));
        // Neighbouring triangles both claim the edge between them.
        line.dedup_by(|b, a| a.mesh == b.mesh && (b.depth - a.depth).abs() < 1e-3);
    }
}

fn corners(points: &[[f32; 4]], triangle: &[u32; 3]) -> Option<[Vector; 3]> {
    let mut corners = [[0.0; 3]; 3];
    for (corner, index) in corners.iter_mut().zip(triangle) {
        let [x, y, z, _] = *points.get(*index as usize)?;
        *corner = [x, y, z];
    }
    Some(corners)
}

/// The part of a triangle (in the probe's own axes) that lies in the plane: two places (lateral,
/// axial).
fn section(p: Vector, q: Vector, r: Vector) -> Option<([f32; 2], [f32; 2])> {
    let mut ends = [[0.0; 2]; 2];
    let mut found = 0;
    for (a, b) in [(p, q), (q, r), (r, p)] {
        // Half open, so that a corner in the plane counts once.
        if (a[2] < 0.0) == (b[2] < 0.0) {
            continue;
        }
        let share = a[2] / (a[2] - b[2]);
        if found < 2 {
            ends[found] = [a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1])];
            found += 1;
        }
    }
    (found == 2).then_some((ends[0], ends[1]))
}

/// Enters the piece between two places into the lines that it passes.
fn enter(from: [f32; 2], to: [f32; 2], mesh: usize, width: f32, lines: &mut [Vec<Crossing>]) {
    let (from, to) = if from[0] <= to[0] { (from, to) } else { (to, from) };
    let span = to[0] - from[0];
    // Neither a piece along the line nor one that is no number crosses any.
    let crosses = span > 1e-6 && from[1].is_finite() && to[1].is_finite();
    if !crosses {
        return;
    }
    let count = lines.len() as f32;
    let number = |lateral: f32| (lateral / width + 0.5) * count - 0.5;
    let first = number(from[0]).ceil().max(0.0);
    let last = number(to[0]).min(count - 1.0);
    let slope = (to[1] - from[1]) / span;
    let facing = 1.0 / (1.0 + slope * slope).sqrt();
    let mut at = first;
    while at <= last {
        let lateral = ((at + 0.5) / count - 0.5) * width;
        let depth = from[1] + slope * (lateral - from[0]);
        if let Some(line) = lines.get_mut(at as usize) {
            line.push(Crossing { depth, mesh, facing });
        }
        at += 1.0;
    }
}
