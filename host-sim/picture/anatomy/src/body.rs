//! A body: structures in the order in which they are laid over one another, and the list of those
//! that a line meets.

use crate::solid::{Convex, Stretch, inside_all};
use crate::vector::Vector;

/// The tissue that a structure is made of, which decides its force and its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tissue {
    /// Skin.
    Skin,
    /// Subcutaneous fat.
    Fat,
    /// Muscle.
    Muscle,
    /// A vessel that the needle looks for or is to spare.
    Vessel,
    /// An artery beside it.
    Artery,
    /// A nerve.
    Nerve,
    /// The bursa of a joint.
    Bursa,
    /// Tendon.
    Tendon,
    /// Cartilage and the bone under it.
    Cartilage,
}

/// The way in which a picture shows a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// One of the layers that follow one another from the skin inwards everywhere.
    Layer,
    /// Something inside them.
    Inside,
    /// A tube.
    Tube,
}

/// One structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Structure {
    /// Its name.
    pub name: &'static str,
    /// The tissue that it is made of.
    pub tissue: Tissue,
    /// The way in which a picture shows it.
    pub role: Role,
    /// It is wherever all solids of one of these lists are.
    pub parts: Vec<Vec<Convex>>,
    /// The centre lines of its tubes, and the radius of each, mm; empty unless it is a tube.
    pub tubes: Vec<(Vec<Vector>, f64)>,
}

impl Structure {
    /// Returns the stretches of a line inside it, one for each part that the line meets.
    pub fn stretches(&self, origin: Vector, direction: Vector) -> impl Iterator<Item = Stretch> + '_ {
        self.parts.iter().filter_map(move |part| inside_all(part, origin, direction))
    }
}

/// A stretch of a line in one structure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Piece {
    /// The number of the structure in [`Body::structures`].
    pub structure: usize,
    /// Its beginning, mm along the line.
    pub from_mm: f64,
    /// Its end, mm along the line.
    pub to_mm: f64,
}

/// A body.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// From the skin inwards; where two overlap, the later one counts.
    pub structures: Vec<Structure>,
}

impl Body {
    /// Returns what a line from `origin` along `direction` (of length 1) meets in its first
    /// `reach_mm`, in order. Stretches outside of the body are left out.
    pub fn met(&self, origin: Vector, direction: Vector, reach_mm: f64) -> Vec<Piece> {
        let mut stretches: Vec<(usize, Stretch)> = vec![];
        for (number, structure) in self.structures.iter().enumerate() {
            stretches.extend(structure.stretches(origin, direction).map(|stretch| (number, stretch)));
        }
        let mut edges: Vec<f64> = stretches.iter().flat_map(|(_, stretch)| *stretch).collect();
        edges.extend([0.0, reach_mm]);
        edges.retain(|edge| (0.0..=reach_mm).contains(edge));
        edges.sort_by(f64::total_cmp);
        let mut pieces: Vec<Piece> = vec![];
        for pair in edges.windows(2) {
            let [from_mm, to_mm] = [pair[0], pair[1]];
            let middle = 0.5 * (from_mm + to_mm);
            let owners = stretches.iter().filter(|(_, [from, to])| *from <= middle && middle <= *to);
            let Some(structure) = owners.map(|(number, _)| *number).max() else { continue };
            match pieces.last_mut() {
                Some(last) if last.structure == structure && last.to_mm >= from_mm => last.to_mm = to_mm,
                _ if to_mm > from_mm => pieces.push(Piece { structure, from_mm, to_mm }),
                _ => {}
            }
        }
        pieces
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(name: &'static str, radius: f64) -> Structure {
        let half = [radius; 3];
        let parts = vec![vec![Convex::Ellipsoid { centre: [0.0; 3], half }]];
        Structure { name, tissue: Tissue::Muscle, role: Role::Inside, parts, tubes: vec![] }
    }

    #[test]
    fn a_ball_in_a_ball_makes_the_outer_one_a_shell() {
        let body = Body { structures: vec![ball("outer", 10.0), ball("inner", 6.0)] };
        let pieces = body.met([0.0, 0.0, -12.0], [0.0, 0.0, 1.0], 20.0);
        let told: Vec<_> = pieces.iter().map(|p| (p.structure, p.from_mm, p.to_mm)).collect();
        assert_eq!(told, [(0, 2.0, 6.0), (1, 6.0, 18.0), (0, 18.0, 20.0)]);
    }

    #[test]
    fn two_parts_that_overlap_are_one_piece() {
        let mut pair = ball("pair", 3.0);
        pair.parts.push(vec![Convex::Ellipsoid { centre: [0.0, 0.0, 4.0], half: [3.0; 3] }]);
        let body = Body { structures: vec![pair] };
        let pieces = body.met([0.0, 0.0, -5.0], [0.0, 0.0, 1.0], 50.0);
        let [Piece { structure: 0, from_mm, to_mm }] = pieces[..] else { panic!("{pieces:?}") };
        assert!((from_mm - 2.0).abs() < 1e-9 && (to_mm - 12.0).abs() < 1e-9, "{pieces:?}");
    }
}
