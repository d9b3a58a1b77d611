//! Convex solids, and the stretch of a straight line inside each.

use crate::vector::{Vector, add, dot, scale, sub, unit};

/// The stretch of a line inside a solid: from and to, in mm along the line.
pub type Stretch = [f64; 2];

/// A solid such that the line between any two of its points is inside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Convex {
    /// An endless elliptic cylinder about the limb's axis: half its extent in y and in z, mm.
    Cylinder {
        /// In y.
        across: f64,
        /// In z.
        down: f64,
    },
    /// An ellipsoid along the axes.
    Ellipsoid {
        /// Its middle, mm.
        centre: Vector,
        /// Half its extents, mm.
        half: Vector,
    },
    /// All points within `radius` of the line between two ends.
    Capsule {
        /// Both ends, mm.
        ends: [Vector; 2],
        /// Its radius, mm.
        radius: f64,
    },
    /// All points whose coordinate number `axis` is at most `limit`.
    Below {
        /// 0 for x, 1 for y, 2 for z.
        axis: usize,
        /// In mm.
        limit: f64,
    },
}

impl Convex {
    /// Returns the stretch of the line from `origin` along `direction` (of length 1) inside it.
    pub fn stretch(&self, origin: Vector, direction: Vector) -> Option<Stretch> {
        match *self {
            Self::Cylinder { across, down } => {
                let flat = |v: Vector| [0.0, v[1] / across, v[2] / down];
                quadric(flat(origin), flat(direction))
            }
            Self::Ellipsoid { centre, half } => {
                let round = |v: Vector| [v[0] / half[0], v[1] / half[1], v[2] / half[2]];
                quadric(round(sub(origin, centre)), round(direction))
            }
            Self::Capsule { ends, radius } => capsule(ends, radius, origin, direction),
            Self::Below { axis, limit } => {
                let [at, along] = [origin, direction].map(|v| v.get(axis).copied().unwrap_or(0.0));
                if along.abs() < 1e-12 {
                    return (at <= limit).then_some([f64::NEG_INFINITY, f64::INFINITY]);
                }
                let cross = (limit - at) / along;
                Some(if along > 0.0 { [f64::NEG_INFINITY, cross] } else { [cross, f64::INFINITY] })
            }
        }
    }

    /// Returns the direction of length 1 that leads out of it most quickly at a place on its
    /// surface.
    pub fn outwards(&self, place: Vector) -> Vector {
        match *self {
            Self::Cylinder { across, down } => {
                unit([0.0, place[1] / (across * across), place[2] / (down * down)])
            }
            Self::Ellipsoid { centre, half } => {
                let from = sub(place, centre);
                unit([0, 1, 2].map(|axis| from[axis] / (half[axis] * half[axis])))
            }
            Self::Capsule { ends: [begin, end], .. } => {
                let axis = sub(end, begin);
                let share = (dot(sub(place, begin), axis) / dot(axis, axis)).clamp(0.0, 1.0);
                unit(sub(place, add(begin, scale(axis, share))))
            }
            Self::Below { axis, .. } => [0, 1, 2].map(|own| f64::from(u8::from(own == axis))),
        }
    }
}

/// The stretch of a line inside the unit ball (or cylinder): where |origin + t·direction|² ≤ 1.
fn quadric(origin: Vector, direction: Vector) -> Option<Stretch> {
    let (a, b, c) = (dot(direction, direction), dot(origin, direction), dot(origin, origin) - 1.0);
    if a < 1e-18 {
        return (c <= 0.0).then_some([f64::NEG_INFINITY, f64::INFINITY]);
    }
    let root = b * b - a * c;
    (root >= 0.0).then(|| [-1.0, 1.0].map(|sign| (-b + sign * libm::sqrt(root)) / a))
}

/// A capsule is two balls and the cylinder between: what is inside any of them is one stretch.
fn capsule(ends: [Vector; 2], radius: f64, origin: Vector, direction: Vector) -> Option<Stretch> {
    let ball =
        |centre: Vector| quadric(scale(sub(origin, centre), 1.0 / radius), scale(direction, 1.0 / radius));
    let axis = unit(sub(ends[1], ends[0]));
    let from = sub(origin, ends[0]);
    let across = |v: Vector| scale(sub(v, scale(axis, dot(v, axis))), 1.0 / radius);
    let (at, along) = (dot(from, axis), dot(direction, axis));
    let length = dot(sub(ends[1], ends[0]), axis);
    let between = if along.abs() < 1e-12 {
        (0.0..=length).contains(&at).then_some([f64::NEG_INFINITY, f64::INFINITY])
    } else {
        let (a, b) = (-at / along, (length - at) / along);
        Some([a.min(b), a.max(b)])
    };
    let tube = between.zip(quadric(across(from), across(direction))).and_then(|(a, b)| both(a, b));
    let stretches = [ball(ends[0]), ball(ends[1]), tube];
    stretches.into_iter().flatten().reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
}

/// Returns the part of the line that is in both stretches.
fn both(a: Stretch, b: Stretch) -> Option<Stretch> {
    let [from, to] = [a[0].max(b[0]), a[1].min(b[1])];
    (from < to).then_some([from, to])
}

/// Returns the stretch of a line inside all of `solids`.
pub fn inside_all(solids: &[Convex], origin: Vector, direction: Vector) -> Option<Stretch> {
    let everywhere = [f64::NEG_INFINITY, f64::INFINITY];
    solids.iter().try_fold(everywhere, |all, solid| both(all, solid.stretch(origin, direction)?))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(found: Option<Stretch>, wanted: Stretch) {
        let found = found.expect("the line meets it");
        assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} is not {wanted:?}");
    }

    const DOWN: Vector = [0.0, 0.0, 1.0];

    /// Each worked by hand.
    #[test]
    fn a_line_is_inside_from_one_root_to_the_other() {
        let limb = Convex::Cylinder { across: 40.0, down: 30.0 };
        near(limb.stretch([7.0, 0.0, -50.0], DOWN), [20.0, 80.0]);
        near(limb.stretch([7.0, 24.0, -50.0], DOWN), [26.0, 74.0]);
        assert_eq!(limb.stretch([0.0, 41.0, -50.0], DOWN), None);
        let bone = Convex::Ellipsoid { centre: [1.0, 2.0, 3.0], half: [4.0, 5.0, 6.0] };
        near(bone.stretch([1.0, 2.0, -7.0], DOWN), [4.0, 16.0]);
        let vein = Convex::Capsule { ends: [[0.0; 3], [10.0, 0.0, 0.0]], radius: 2.0 };
        near(vein.stretch([5.0, 0.0, -5.0], DOWN), [3.0, 7.0]);
        near(vein.stretch([-5.0, 0.0, 0.0], [1.0, 0.0, 0.0]), [3.0, 17.0]);
        near(vein.stretch([11.0, 0.0, -5.0], DOWN), [5.0 - 3.0_f64.sqrt(), 5.0 + 3.0_f64.sqrt()]);
        assert_eq!(vein.stretch([12.1, 0.0, -5.0], DOWN), None);
    }

    #[test]
    fn an_intersection_is_what_is_in_both() {
        let ball = Convex::Ellipsoid { centre: [0.0; 3], half: [10.0; 3] };
        let cap = [ball, Convex::Below { axis: 2, limit: -5.0 }];
        near(inside_all(&cap, [0.0, 0.0, -20.0], DOWN), [10.0, 15.0]);
        assert_eq!(inside_all(&cap, [9.9, 0.0, -20.0], DOWN), None, "the ball is there only below the cut");
    }
}
