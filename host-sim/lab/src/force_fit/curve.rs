//! A curve of straight pieces between landmarks, fitted to many noisy points. Depth in mm, force in
//! N.
//!
//! Landmarks cut an insertion into pieces: a rise, a fall, a rise … A depth is given by its piece
//! and how far it is along it, so that insertions whose layers give way at different depths are
//! laid over one another. Only rises are fitted; a fall joins the two.

/// A line of straight pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Depth of each knot, rising, mm.
    pub depths_mm: Vec<f64>,
    /// Force at each knot, N.
    pub forces_n: Vec<f64>,
}

impl Curve {
    /// The force at a depth; beyond the ends it stays what it is there.
    pub fn at(&self, depth_mm: f64) -> f64 {
        let Some(last) = self.depths_mm.len().checked_sub(1) else { return 0.0 };
        let next = self.depths_mm.partition_point(|knot| *knot <= depth_mm).clamp(1.min(last), last);
        let left = next.saturating_sub(1);
        let gap = self.depths_mm[next] - self.depths_mm[left];
        let share = if gap > 0.0 { ((depth_mm - self.depths_mm[left]) / gap).clamp(0.0, 1.0) } else { 0.0 };
        self.forces_n[left] + share * (self.forces_n[next] - self.forces_n[left])
    }
}

/// The depths that cut an insertion into pieces: the skin, the beginning and the end of each fall,
/// the deepest place.
#[derive(Clone, Debug, PartialEq)]
pub struct Landmarks(pub Vec<f64>);

impl Landmarks {
    /// Which piece a depth is in and how far along it, 0 to 1; none outside.
    fn place(&self, depth_mm: f64) -> Option<(usize, f64)> {
        let next = self.0.partition_point(|mark| *mark <= depth_mm);
        let piece = next.checked_sub(1)?;
        let (from, to) = (self.0[piece], *self.0.get(next)?);
        Some((piece, (depth_mm - from) / (to - from)))
    }

    /// The depth of a place.
    pub fn depth(&self, piece: usize, share: f64) -> f64 {
        self.0[piece] + share * (self.0[piece + 1] - self.0[piece])
    }

    /// Returns the number of pieces.
    pub fn pieces(&self) -> usize {
        self.0.len() - 1
    }
}

/// True for the pieces over which a force rises or stays; the others are falls.
pub(crate) fn is_rise(piece: usize) -> bool {
    piece.is_multiple_of(2)
}

/// Parts of a piece in which its points are taken together.
const PARTS: usize = 64;

/// The points of the last part of a piece count this often: the force at which a layer gives way is
/// felt more than the way to it.
const PEAK_WEIGHT: f64 = 8.0;

/// The points of one cell, laid over one another.
#[derive(Clone, Debug)]
pub struct Overlaid {
    /// The sums of the parts of each piece.
    pieces: Vec<[Part; PARTS]>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Part {
    count: f64,
    share: f64,
    force: f64,
    square: f64,
}

/// The places of the knots within each piece, 0 to 1, both ends included and rising.
pub type Knots = Vec<Vec<f64>>;

impl Overlaid {
    /// Returns one of so many pieces, without points.
    pub fn new(pieces: usize) -> Self {
        Self { pieces: vec![[Part::default(); PARTS]; pieces] }
    }

    /// Adds the points of an insertion with landmarks of its own.
    pub fn add(&mut self, marks: &Landmarks, points: &[(f64, f64)]) {
        for &(depth, force) in points {
            let Some((piece, share)) = marks.place(depth) else { continue };
            let part = &mut self.pieces[piece][((share * PARTS as f64) as usize).min(PARTS - 1)];
            part.count += 1.0;
            part.share += share;
            part.force += force;
            part.square += force * force;
        }
    }

    /// True if a piece has points.
    pub fn has(&self, piece: usize) -> bool {
        self.pieces[piece].iter().any(|part| part.count > 0.0)
    }

    /// The forces at the knots of a piece that fit its points best, by least squares over all knots
    /// at once; none without points.
    pub fn fit(&self, piece: usize, knots: &[f64]) -> Option<Vec<f64>> {
        if !self.has(piece) {
            return None;
        }
        let (mut diagonal, mut upper, mut right) =
            (vec![0.0; knots.len()], vec![0.0; knots.len()], vec![0.0; knots.len()]);
        let total: f64 = self.pieces[piece].iter().map(|part| part.count).sum();
        for (place, part) in self.pieces[piece].iter().enumerate().filter(|(_, part)| part.count > 0.0) {
            let (left, share) = between(knots, part.share / part.count);
            let weight = if place + 1 == PARTS { PEAK_WEIGHT } else { 1.0 };
            let (near, far) = (weight * (1.0 - share), weight * share);
            diagonal[left] += part.count * near * (1.0 - share);
            diagonal[left + 1] += part.count * far * share;
            upper[left] += part.count * near * share;
            right[left] += near * part.force;
            right[left + 1] += far * part.force;
        }
        // Where no point is, a knot follows its neighbours: a bend costs a little.
        let bend = 1e-6 * total;
        for knot in 0..knots.len() - 1 {
            diagonal[knot] += bend;
            diagonal[knot + 1] += bend;
            upper[knot] -= bend;
        }
        Some(tridiagonal(diagonal, &upper, right))
    }

    /// Squares of what the best forces at these knots leave of the means of the parts, each part
    /// counting by its points.
    pub fn left(&self, piece: usize, knots: &[f64]) -> f64 {
        let Some(forces) = self.fit(piece, knots) else { return 0.0 };
        let parts = self.pieces[piece].iter().filter(|part| part.count > 0.0);
        parts
            .map(|part| {
                let (left, share) = between(knots, part.share / part.count);
                let fitted = forces[left] + share * (forces[left + 1] - forces[left]);
                part.count * (part.force / part.count - fitted).powi(2)
            })
            .sum()
    }
}

/// The knot below and how far it is to the next.
fn between(knots: &[f64], at: f64) -> (usize, f64) {
    let left = knots.partition_point(|knot| *knot <= at).clamp(1, knots.len() - 1) - 1;
    (left, (at - knots[left]) / (knots[left + 1] - knots[left]))
}

/// Solves a symmetric tridiagonal system that is positive definite.
fn tridiagonal(mut diagonal: Vec<f64>, upper: &[f64], mut right: Vec<f64>) -> Vec<f64> {
    for row in 1..diagonal.len() {
        let factor = upper[row - 1] / diagonal[row - 1];
        diagonal[row] -= factor * upper[row - 1];
        right[row] -= factor * right[row - 1];
    }
    for row in (0..diagonal.len()).rev() {
        let below = if row + 1 < diagonal.len() { upper[row] * right[row + 1] } else { 0.0 };
        right[row] = (right[row] - below) / diagonal[row];
    }
    right
}

/// Places `count` knots beyond the ends of the pieces where they help most, the same in all cells.
pub(crate) fn place_knots(cells: &[&Overlaid], pieces: usize, count: usize) -> Knots {
    /// Places that a knot may have within a piece.
    const CANDIDATES: usize = 16;
    let mut knots: Knots = vec![vec![0.0, 1.0]; pieces];
    let left = |piece: usize, knots: &[f64]| cells.iter().map(|cell| cell.left(piece, knots)).sum::<f64>();
    for _ in 0..count {
        let mut best: Option<(f64, usize, Vec<f64>)> = None;
        for piece in (0..pieces).filter(|piece| is_rise(*piece)) {
            let before = left(piece, &knots[piece]);
            for candidate in (1..CANDIDATES).map(|n| n as f64 / CANDIDATES as f64) {
                if knots[piece].contains(&candidate) {
                    continue;
                }
                let mut more = knots[piece].clone();
                more.push(candidate);
                more.sort_by(f64::total_cmp);
                let gain = before - left(piece, &more);
                if best.as_ref().is_none_or(|best| gain > best.0) {
                    best = Some((gain, piece, more));
                }
            }
        }
        let Some((_, piece, more)) = best else { break };
        knots[piece] = more;
    }
    knots
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn knots_gather_where_a_curve_bends() {
        // Level, then a rise like the sixth power: most of its bend is in the last third.
        let truth = |x: f64| (x / 10.0).powi(6);
        let points: Vec<_> =
            (0..4_000).map(|n| (f64::from(n) * 0.0025, truth(f64::from(n) * 0.0025))).collect();
        let marks = Landmarks(vec![0.0, 10.0]);
        let mut cell = Overlaid::new(1);
        cell.add(&marks, &points);
        let knots = place_knots(&[&cell], 1, 4);
        assert_eq!(knots[0].len(), 6);
        assert!(knots[0].iter().filter(|k| **k > 0.6).count() >= 4, "{:?}", knots[0]);
        let forces = cell.fit(0, &knots[0]).expect("there are points");
        assert!((forces[5] - 1.0).abs() < 0.02, "the end of a steep rise is kept: {forces:?}");
    }

    #[test]
    fn insertions_that_give_way_elsewhere_are_laid_over_one_another() {
        let mut cell = Overlaid::new(3);
        for gives_way in [2.0, 2.5] {
            let marks = Landmarks(vec![0.0, gives_way, gives_way + 0.1, 8.0]);
            let truth = |d: f64| if d < gives_way { d / gives_way } else { 0.3 };
            let points: Vec<_> =
                (0..1_600).map(|n| (f64::from(n) * 0.005, truth(f64::from(n) * 0.005))).collect();
            cell.add(&marks, &points);
        }
        let rise = cell.fit(0, &[0.0, 0.5, 1.0]).expect("there are points");
        assert!(rise.iter().zip([0.0, 0.5, 1.0]).all(|(a, b)| (a - b).abs() < 1e-3), "{rise:?}");
        let after = cell.fit(2, &[0.0, 1.0]).expect("there are points");
        assert!(after.iter().all(|a| (a - 0.3).abs() < 1e-3), "{after:?}");
    }

    #[test]
    fn a_knot_without_points_follows_its_neighbours() {
        let points: Vec<_> = (0..100).map(|n| (f64::from(n) * 0.04, 1.0)).collect();
        let mut cell = Overlaid::new(1);
        cell.add(&Landmarks(vec![0.0, 10.0]), &points);
        let forces = cell.fit(0, &[0.0, 0.5, 1.0]).expect("there are points");
        assert!(forces.iter().all(|n| (n - 1.0).abs() < 0.01), "{forces:?}");
        assert_eq!(Overlaid::new(1).fit(0, &[0.0, 1.0]), None);
    }

    #[test]
    fn a_curve_is_level_beyond_its_ends() {
        let curve = Curve { depths_mm: vec![1.0, 2.0, 4.0], forces_n: vec![0.0, 1.0, 0.0] };
        for (at, wanted) in [(0.0, 0.0), (1.5, 0.5), (2.0, 1.0), (3.0, 0.5), (9.0, 0.0)] {
            assert!((curve.at(at) - wanted).abs() < 1e-12, "{at} mm: {}", curve.at(at));
        }
    }
}
