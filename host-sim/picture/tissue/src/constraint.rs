//! The constraints: distance, volume of a tetrahedron, bending angle, tie of a particle to a place
//! between others.
//!
//! Each is solved for itself, one after the other (Gauss–Seidel), by `Δλ = −(C + α̃·λ)/(Σ w|∇C|² +
//! α̃)`, `Δx = w·∇C·Δλ`, `α̃ = α/dt²` (Macklin et al. 2016, eq. 17 and 18), `λ` being kept over the
//! iterations of a substep. `w` is the inverse mass in 1/g, `α` the compliance, the inverse of a
//! stiffness.

use crate::vector::{Vector, add, cross, dot, length, scale, sub};

/// Place in mm and inverse mass in 1/g of a particle.
pub(crate) type Point = [f32; 4];

/// The place of a particle.
#[inline]
pub(crate) fn place(point: &Point) -> Vector {
    [point[0], point[1], point[2]]
}

#[inline]
fn shift(point: &mut Point, by: Vector) {
    point[0] += by[0];
    point[1] += by[1];
    point[2] += by[2];
}

/// One constraint: what the solver has to know of it.
pub(crate) trait Constraint {
    /// The particles that it moves; the same number for every constraint of a type, unused ones
    /// repeat a used one.
    fn particles(&self) -> impl Iterator<Item = u32>;
    /// One projection. `inverse_dt2` is 1/dt² in 1/s²; `lambda` is the multiplier so far in this
    /// substep.
    fn project(&self, points: &mut [Point], lambda: &mut f32, inverse_dt2: f32);
    /// Returns its violation (in its own unit) and its compliance α: the energy is C²/(2α).
    fn violation(&self, points: &[Point]) -> (f32, f32);
    /// Calls `at` with each particle and the slope of C along its place.
    fn slopes(&self, points: &[Point], at: impl FnMut(u32, Vector));
}

/// `C = |x_a − x_b| − L₀`, Paper 000.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Distance {
    /// The two particles.
    pub ends: [u32; 2],
    /// L₀ in mm.
    pub rest: f32,
    /// mm/µN.
    pub compliance: f32,
}

impl Constraint for Distance {
    fn particles(&self) -> impl Iterator<Item = u32> {
        self.ends.into_iter()
    }

    #[inline]
    fn project(&self, points: &mut [Point], lambda: &mut f32, inverse_dt2: f32) {
        let [a, b] = self.ends.map(|index| index as usize);
        let (pa, pb) = (points[a], points[b]);
        let gap = sub(place(&pa), place(&pb));
        let distance = length(gap);
        let softness = self.compliance * inverse_dt2;
        let weight = pa[3] + pb[3] + softness;
        // Particles in one place have no direction to part in; the others will move them.
        if distance < 1e-6 || weight <= 0.0 {
            return;
        }
        let change = -(distance - self.rest + softness * *lambda) / weight;
        *lambda += change;
        let push = scale(gap, change / distance);
        shift(&mut points[a], scale(push, pa[3]));
        shift(&mut points[b], scale(push, -pb[3]));
    }

    fn violation(&self, points: &[Point]) -> (f32, f32) {
        let [a, b] = self.ends.map(|index| place(&points[index as usize]));
        (length(sub(a, b)) - self.rest, self.compliance)
    }

    fn slopes(&self, points: &[Point], mut at: impl FnMut(u32, Vector)) {
        let [a, b] = self.ends.map(|index| place(&points[index as usize]));
        let along = scale(sub(a, b), 1.0 / length(sub(a, b)).max(1e-6));
        at(self.ends[0], along);
        at(self.ends[1], scale(along, -1.0));
    }
}

/// `C = V − V₀` of a tetrahedron, Paper 000; V is signed, so that one turned inside out turns back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// The four corners.
    pub corners: [u32; 4],
    /// V₀ in mm³, positive.
    pub rest: f32,
    /// mm³ per (µN/mm²).
    pub compliance: f32,
}

/// Six times the signed volume of a tetrahedron.
#[inline]
fn six_volumes(p: [Vector; 4]) -> f32 {
    dot(cross(sub(p[1], p[0]), sub(p[2], p[0])), sub(p[3], p[0]))
}

/// Signed volume of a tetrahedron in mm³.
pub(crate) fn volume(p: [Vector; 4]) -> f32 {
    six_volumes(p) / 6.0
}

impl Constraint for Volume {
    fn particles(&self) -> impl Iterator<Item = u32> {
        self.corners.into_iter()
    }

    #[inline]
    fn project(&self, points: &mut [Point], lambda: &mut f32, inverse_dt2: f32) {
        let at = self.corners.map(|index| index as usize);
        let p = at.map(|index| points[index]);
        let (e1, e2, e3) = (
            sub(place(&p[1]), place(&p[0])),
            sub(place(&p[2]), place(&p[0])),
            sub(place(&p[3]), place(&p[0])),
        );
        // Six times the gradients.
        let (g1, g2, g3) = (cross(e2, e3), cross(e3, e1), cross(e1, e2));
        let g0 = scale(add(add(g1, g2), g3), -1.0);
        let softness = self.compliance * inverse_dt2;
        let squares =
            p[0][3] * dot(g0, g0) + p[1][3] * dot(g1, g1) + p[2][3] * dot(g2, g2) + p[3][3] * dot(g3, g3);
        let weight = squares * (1.0 / 36.0) + softness;
        if weight < 1e-12 {
            return;
        }
        let missing = dot(g3, e3) * (1.0 / 6.0) - self.rest;
        let change = -(missing + softness * *lambda) / weight;
        *lambda += change;
        let sixth = change * (1.0 / 6.0);
        shift(&mut points[at[0]], scale(g0, p[0][3] * sixth));
        shift(&mut points[at[1]], scale(g1, p[1][3] * sixth));
        shift(&mut points[at[2]], scale(g2, p[2][3] * sixth));
        shift(&mut points[at[3]], scale(g3, p[3][3] * sixth));
    }

    fn violation(&self, points: &[Point]) -> (f32, f32) {
        let p = self.corners.map(|index| place(&points[index as usize]));
        (volume(p) - self.rest, self.compliance)
    }

    fn slopes(&self, points: &[Point], mut at: impl FnMut(u32, Vector)) {
        let [o, a, b, c] = self.corners.map(|index| place(&points[index as usize]));
        let (e1, e2, e3) = (sub(a, o), sub(b, o), sub(c, o));
        let others = [cross(e2, e3), cross(e3, e1), cross(e1, e2)].map(|six| scale(six, 1.0 / 6.0));
        at(self.corners[0], scale(add(add(others[0], others[1]), others[2]), -1.0));
        for (corner, slope) in self.corners[1..].iter().zip(others) {
            at(*corner, slope);
        }
    }
}

/// `C = θ − θ₀` of two triangles that share an edge, Paper 000. θ is the angle between their
/// normals in rad, signed: 0 is flat. Paper 000's angle is the one between the planes, 180° where
/// they are flat: θ₀ = π − it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bending {
    /// The two ends of the edge, then the two corners beside it.
    pub corners: [u32; 4],
    /// θ₀ in rad.
    pub rest: f32,
    /// rad/(µN·mm).
    pub compliance: f32,
}

/// The angle between two triangles and its gradients at the four corners (Bridson, Marino, Fedkiw
/// 2003); `None` where a triangle has no area.
#[inline]
fn angle(p: [Vector; 4]) -> Option<(f32, [Vector; 4])> {
    let edge = sub(p[1], p[0]);
    let n1 = cross(sub(p[0], p[2]), sub(p[1], p[2]));
    let n2 = cross(sub(p[1], p[3]), sub(p[0], p[3]));
    let (s1, s2, long) = (dot(n1, n1), dot(n2, n2), length(edge));
    if s1 < 1e-10 || s2 < 1e-10 || long < 1e-6 {
        return None;
    }
    let (n1, n2) = (scale(n1, 1.0 / s1), scale(n2, 1.0 / s2));
    let sine = dot(cross(n1, n2), edge) / long;
    let angle = sine.atan2(dot(n1, n2));
    let share = |corner: Vector, from: Vector| dot(sub(corner, from), edge) / long;
    Some((
        angle,
        [
            scale(add(scale(n1, share(p[2], p[1])), scale(n2, share(p[3], p[1]))), -1.0),
            scale(add(scale(n1, share(p[2], p[0])), scale(n2, share(p[3], p[0]))), 1.0),
            scale(n1, -long),
            scale(n2, -long),
        ],
    ))
}

/// Angle between the normals of two triangles that share the edge `p[0]`, `p[1]`, in rad; 0 where
/// they are flat.
pub(crate) fn bending_angle(p: [Vector; 4]) -> f32 {
    angle(p).map_or(0.0, |(angle, _)| angle)
}

impl Constraint for Bending {
    fn particles(&self) -> impl Iterator<Item = u32> {
        self.corners.into_iter()
    }

    #[inline]
    fn project(&self, points: &mut [Point], lambda: &mut f32, inverse_dt2: f32) {
        let at = self.corners.map(|index| index as usize);
        let p = at.map(|index| points[index]);
        let Some((angle, gradients)) = angle(p.map(|point| place(&point))) else { return };
        let softness = self.compliance * inverse_dt2;
        let weight: f32 = softness + p.iter().zip(gradients).map(|(p, g)| p[3] * dot(g, g)).sum::<f32>();
        if weight < 1e-12 {
            return;
        }
        let change = -(angle - self.rest + softness * *lambda) / weight;
        *lambda += change;
        for (index, (point, gradient)) in at.into_iter().zip(p.iter().zip(gradients)) {
            shift(&mut points[index], scale(gradient, point[3] * change));
        }
    }

    fn violation(&self, points: &[Point]) -> (f32, f32) {
        let p = self.corners.map(|index| place(&points[index as usize]));
        (bending_angle(p) - self.rest, self.compliance)
    }

    fn slopes(&self, points: &[Point], mut at: impl FnMut(u32, Vector)) {
        let p = self.corners.map(|index| place(&points[index as usize]));
        let Some((_, slopes)) = angle(p) else { return };
        for (corner, slope) in self.corners.into_iter().zip(slopes) {
            at(corner, slope);
        }
    }
}

/// Most particles that a place is given by.
pub(crate) const MOST_CORNERS: usize = 8;

/// A place in the tissue: a weighted mean of particles. It moves with them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Anchor {
    /// The particles; unused ones repeat the first.
    pub corners: [u32; MOST_CORNERS],
    /// Their weights, which sum to 1; unused ones are 0.
    pub weights: [f32; MOST_CORNERS],
}

impl Anchor {
    /// The mean of `corners`, at most eight of them.
    pub fn new(corners: &[(u32, f32)]) -> Self {
        let first = corners.first().map_or(0, |corner| corner.0);
        let mut anchor = Self { corners: [first; MOST_CORNERS], weights: [0.0; MOST_CORNERS] };
        for (slot, (index, weight)) in corners.iter().take(MOST_CORNERS).enumerate() {
            anchor.corners[slot] = *index;
            anchor.weights[slot] = *weight;
        }
        anchor
    }

    /// Returns its position.
    pub fn place(&self, points: &[Point]) -> Vector {
        let mut sum = [0.0; 3];
        for (corner, weight) in self.corners.iter().zip(self.weights) {
            sum = add(sum, scale(place(&points[*corner as usize]), weight));
        }
        sum
    }

    /// Inverse mass of the place: Σ wᵢ·weightᵢ².
    fn inverse_mass(&self, points: &[Point]) -> f32 {
        self.corners
            .iter()
            .zip(self.weights)
            .map(|(c, weight)| points[*c as usize][3] * weight * weight)
            .sum()
    }

    fn push(&self, points: &mut [Point], by: Vector) {
        for (corner, weight) in self.corners.iter().zip(self.weights) {
            if weight != 0.0 {
                let point = &mut points[*corner as usize];
                shift(point, scale(by, point[3] * weight));
            }
        }
    }

    /// Moves the place to `target` as far as `compliance` (mm/µN) lets it.
    pub fn hold(&self, points: &mut [Point], target: Vector, compliance: f32, inverse_dt2: f32) {
        let weight = self.inverse_mass(points) + compliance * inverse_dt2;
        if weight > 1e-12 {
            let gap = sub(target, self.place(points));
            self.push(points, scale(gap, 1.0 / weight));
        }
    }
}

/// Ties a particle of one layer to a place in another: `C = |x − Σ weightᵢ·xᵢ − offset|`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tie {
    /// The particle.
    pub particle: u32,
    /// The place in the other layer that it belongs to.
    pub anchor: Anchor,
    /// From that place to the particle at rest, mm.
    pub offset: Vector,
    /// mm/µN.
    pub compliance: f32,
}

impl Tie {
    /// As the two lie at rest.
    pub fn at_rest(particle: u32, anchor: Anchor, compliance: f32, rest: &[Point]) -> Self {
        let offset = sub(place(&rest[particle as usize]), anchor.place(rest));
        Self { particle, anchor, offset, compliance }
    }

    fn gap(&self, points: &[Point]) -> Vector {
        sub(sub(place(&points[self.particle as usize]), self.anchor.place(points)), self.offset)
    }
}

impl Constraint for Tie {
    fn particles(&self) -> impl Iterator<Item = u32> {
        std::iter::once(self.particle).chain(self.anchor.corners)
    }

    #[inline]
    fn project(&self, points: &mut [Point], lambda: &mut f32, inverse_dt2: f32) {
        let own = points[self.particle as usize];
        let gap = self.gap(points);
        let distance = length(gap);
        let softness = self.compliance * inverse_dt2;
        let weight = own[3] + self.anchor.inverse_mass(points) + softness;
        if distance < 1e-7 || weight < 1e-12 {
            return;
        }
        let change = -(distance + softness * *lambda) / weight;
        *lambda += change;
        let push = scale(gap, change / distance);
        shift(&mut points[self.particle as usize], scale(push, own[3]));
        self.anchor.push(points, scale(push, -1.0));
    }

    fn violation(&self, points: &[Point]) -> (f32, f32) {
        (length(self.gap(points)), self.compliance)
    }

    fn slopes(&self, points: &[Point], mut at: impl FnMut(u32, Vector)) {
        let gap = self.gap(points);
        let along = scale(gap, 1.0 / length(gap).max(1e-7));
        at(self.particle, along);
        for (corner, weight) in self.anchor.corners.into_iter().zip(self.anchor.weights) {
            at(corner, scale(along, -weight));
        }
    }
}

#[cfg(test)]
mod tests;
