//! The surface of a structure as triangles, to be printed: a layer by rays from the limb's axis, a
//! tube by rings about its centre line.

use crate::body::{Body, Role, Structure};
use crate::vector::{Vector, add, dot, scale, sub, unit};
use std::f64::consts::TAU;

/// Between two rings of a layer, mm.
const STEP_MM: f64 = 2.0;
/// Corners of a ring of a layer and of a tube: flat to 0.02 mm on a limb's skin and a vein's wall.
const CORNERS: [usize; 2] = [144, 32];

/// A ring with less than this between its middle and a corner is a point, mm.
const POINT_MM: f64 = 0.01;

/// A triangle, counter-clockwise as seen from outside, mm in the limb's frame.
pub type Triangle = [Vector; 3];

impl Body {
    /// Returns the closed surface of a structure between two places along the limb; empty if there
    /// is none there, or the structure is neither a layer nor a tube.
    pub fn surface(&self, structure: usize, [from_mm, to_mm]: [f64; 2]) -> Vec<Triangle> {
        let Some(own) = self.structures.get(structure) else { return vec![] };
        match own.role {
            Role::Layer => closed(&layer_rings(own, from_mm, to_mm)),
            Role::Tube => {
                let lines = own.tubes.iter();
                lines.flat_map(|(line, radius)| closed(&tube_rings(line, *radius, from_mm, to_mm))).collect()
            }
            Role::Inside => vec![],
        }
    }
}

/// A ring's middle and corners.
type Ring = (Vector, Vec<Vector>);

/// Rings about the limb's axis where it is inside the layer.
fn layer_rings(own: &Structure, from_mm: f64, to_mm: f64) -> Vec<Ring> {
    let steps = ((to_mm - from_mm) / STEP_MM).ceil().max(1.0);
    let ring = |step: usize| {
        let middle = [from_mm + (to_mm - from_mm) * step as f64 / steps, 0.0, 0.0];
        let corner = |number: usize| {
            let turned = TAU * number as f64 / CORNERS[0] as f64;
            let outwards = [0.0, libm::sin(turned), -libm::cos(turned)];
            let around =
                own.stretches(middle, outwards).filter(|[begin, end]| *begin <= 0.0 && *end > POINT_MM);
            around.map(|[_, end]| end).reduce(f64::max).map(|end| add(middle, scale(outwards, end)))
        };
        let corners: Option<Vec<Vector>> = (0..CORNERS[0]).map(corner).collect();
        corners.map(|corners| (middle, corners))
    };
    (0..=steps as usize).filter_map(ring).collect()
}

/// Rings across a centre line.
fn tube_rings(line: &[Vector], radius: f64, from_mm: f64, to_mm: f64) -> Vec<Ring> {
    let inside: Vec<Vector> = line.iter().copied().filter(|p| (from_mm..=to_mm).contains(&p[0])).collect();
    let last = inside.len().saturating_sub(1);
    let ring = |(number, middle): (usize, &Vector)| {
        let along = unit(sub(inside[(number + 1).min(last)], inside[number.saturating_sub(1)]));
        let down = [0.0, 0.0, 1.0];
        let up = unit(sub(scale(along, dot(down, along)), down));
        let side = cross(along, up);
        let corner = |number: usize| {
            let turned = TAU * number as f64 / CORNERS[1] as f64;
            let outwards = add(scale(side, libm::sin(turned)), scale(up, libm::cos(turned)));
            add(*middle, scale(outwards, radius))
        };
        (*middle, (0..CORNERS[1]).map(corner).collect())
    };
    inside.iter().enumerate().map(ring).collect()
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// The strips between the rings, and a lid on the first and on the last.
fn closed(rings: &[Ring]) -> Vec<Triangle> {
    let [(first, begin), .., (last, end)] = rings else { return vec![] };
    let corners = begin.len();
    let sides = (0..corners).map(|corner| (corner, (corner + 1) % corners));
    let strips = rings.windows(2).flat_map(|pair| {
        let [(_, near), (_, far)] = pair else { return vec![] };
        let strip = sides
            .clone()
            .flat_map(|(one, next)| [[near[one], near[next], far[one]], [near[next], far[next], far[one]]]);
        strip.collect::<Vec<Triangle>>()
    });
    let lids = sides
        .clone()
        .flat_map(|(one, next)| [[*first, begin[next], begin[one]], [*last, end[one], end[next]]]);
    strips.chain(lids).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Site;
    use std::collections::HashMap;
    use std::f64::consts::PI;

    /// By the divergence theorem: a sixth of the triple products of all triangles, if they look
    /// outwards.
    fn volume_mm3(triangles: &[Triangle]) -> f64 {
        triangles.iter().map(|[a, b, c]| dot(*a, cross(*b, *c)) / 6.0).sum()
    }

    /// Every edge is run through once each way.
    fn is_closed(triangles: &[Triangle]) -> bool {
        let key = |v: Vector| v.map(|mm| (mm * 1e6).round() as i64);
        let mut edges: HashMap<_, i32> = HashMap::new();
        for [a, b, c] in triangles {
            for (from, to) in [(a, b), (b, c), (c, a)] {
                *edges.entry((key(*from), key(*to))).or_default() += 1;
            }
        }
        edges.iter().all(|((from, to), count)| *count == 1 && edges.get(&(*to, *from)) == Some(&1))
    }

    #[test]
    fn an_arm_has_the_volume_of_its_formula() {
        // An elliptic cylinder of 34 + 8 + 2 by 26 + 8 + 2 mm, and the outermost ball and cylinder
        // of the shoulder.
        let radius = 44.0 + 5.0 + 2.5_f64;
        for (site, fat, along, wanted) in [
            (Site::Forearm, 8.0, [-60.0, 80.0], PI * 44.0 * 36.0 * 140.0),
            (
                Site::Shoulder,
                5.0,
                [-radius, 100.0],
                2.0 / 3.0 * PI * radius.powi(3) + PI * radius.powi(2) * 100.0,
            ),
        ] {
            let skin = site.body(fat).surface(0, along);
            assert!(is_closed(&skin), "{site:?}");
            let found = volume_mm3(&skin);
            assert!((found / wanted - 1.0).abs() < 2e-3, "{site:?}: {found} mm³, not {wanted}");
        }
    }

    #[test]
    fn a_vein_has_the_volume_of_its_tube() {
        let body = Site::Shoulder.body(5.0);
        let number = body.structures.iter().position(|own| own.name == "vein").expect("it has one");
        let vein = body.surface(number, [0.0, 120.0]);
        let (line, radius) = &body.structures[number].tubes[0];
        let length: f64 =
            line.windows(2).map(|two| dot(sub(two[1], two[0]), sub(two[1], two[0])).sqrt()).sum();
        assert!(is_closed(&vein) && length > 120.0);
        let (found, wanted) = (volume_mm3(&vein), PI * radius * radius * length);
        assert!((found / wanted - 1.0).abs() < 0.01, "{found} mm³, not {wanted}");
    }

    #[test]
    fn beyond_a_body_there_is_no_surface() {
        assert!(Site::Shoulder.body(5.0).surface(0, [310.0, 400.0]).is_empty());
        assert!(Site::Shoulder.body(5.0).surface(99, [0.0, 100.0]).is_empty());
    }
}
