//! A body cut along the needle's plane: the outline of each part of each structure.

use crate::body::Body;
use crate::place::Block;
use crate::solid::{Convex, Stretch, inside_all};

/// From where to where along the section, mm from the point of entry, and between two columns.
const ALONG_MM: [f64; 2] = [-90.0, 110.0];
const STEP_MM: f64 = 1.25;
/// At least so many columns show a part that is small.
const COLUMNS: f64 = 24.0;
/// Above and below this there is nothing to draw, mm below the point of entry.
const DOWN_MM: [f64; 2] = [-90.0, 110.0];
/// Halvings that find the end of a part between two columns.
const HALVINGS: usize = 10;

/// One part of a structure, cut: a closed line.
#[derive(Clone, Debug, PartialEq)]
pub struct Outline {
    /// The number of the structure in [`Body::structures`].
    pub structure: usize,
    /// Points as mm along the section and below the point of entry.
    pub points_mm: Vec<[f64; 2]>,
}

impl Body {
    /// Returns the outlines in the plane of the block's x and z, in the order in which they are
    /// laid over one another.
    pub fn outlines(&self, block: &Block) -> Vec<Outline> {
        let parts = self.structures.iter().enumerate();
        let parts = parts.flat_map(|(structure, own)| own.parts.iter().map(move |part| (structure, part)));
        let outlines = parts.map(|(structure, part)| Outline { structure, points_mm: outline(part, block) });
        outlines.filter(|outline| outline.points_mm.len() > 2).collect()
    }
}

/// A convex part is one stretch in each column: down along the first ends, back along the last.
fn outline(part: &[Convex], block: &Block) -> Vec<[f64; 2]> {
    let down = block.axes[2];
    let column = |x: f64| {
        let [from, to] = inside_all(part, block.to_limb([x, 0.0, 0.0]), down)?;
        let [from, to] = [from.max(DOWN_MM[0]), to.min(DOWN_MM[1])];
        (from < to).then_some([from, to])
    };
    let [low, high] = extent(part, block);
    let columns = ((high - low) / STEP_MM).max(COLUMNS).ceil();
    let mut found: Vec<(f64, Stretch)> = vec![];
    let mut before: Option<(f64, Option<Stretch>)> = None;
    for number in 0..=columns as usize {
        let x = low + (high - low) * number as f64 / columns;
        let here = column(x);
        match (before, here) {
            (Some((empty, None)), Some(_)) => found.extend(end(empty, x, column)),
            (Some((full, Some(_))), None) => found.extend(end(x, full, column)),
            _ => {}
        }
        found.extend(here.map(|stretch| (x, stretch)));
        before = Some((x, here));
    }
    let round = |mm: f64| (mm * 100.0).round() / 100.0;
    let first = found.iter().map(|(x, [from, _])| [round(*x), round(*from)]);
    first.chain(found.iter().rev().map(|(x, [_, to])| [round(*x), round(*to)])).collect()
}

/// From where to where along the section a part can be, a little more than it is, mm.
fn extent(part: &[Convex], block: &Block) -> [f64; 2] {
    let (points, around) = match part.first() {
        Some(Convex::Capsule { ends, radius }) => (ends.to_vec(), *radius),
        Some(Convex::Ellipsoid { centre, half }) => (vec![*centre], half.iter().copied().fold(0.0, f64::max)),
        _ => return ALONG_MM,
    };
    let along = points.iter().map(|point| block.from_limb(*point)[0]);
    let low = along.clone().fold(f64::INFINITY, f64::min) - 1.01 * around;
    let high = along.fold(f64::NEG_INFINITY, f64::max) + 1.01 * around;
    [low.clamp(ALONG_MM[0], ALONG_MM[1]), high.clamp(ALONG_MM[0], ALONG_MM[1])]
}

/// The last column of a part towards one without it.
fn end(mut empty: f64, mut full: f64, column: impl Fn(f64) -> Option<Stretch>) -> Option<(f64, Stretch)> {
    for _ in 0..HALVINGS {
        let middle = 0.5 * (empty + full);
        if column(middle).is_some() {
            full = middle;
        } else {
            empty = middle;
        }
    }
    column(full).map(|stretch| (full, stretch))
}

#[cfg(test)]
mod tests {
    use crate::{Place, Site};

    /// The needle's own line is in the section: what it meets at 45° is on the outlines.
    #[test]
    fn a_section_shows_what_the_needle_meets() {
        let body = Site::Shoulder.body(5.79);
        let place =
            Place { along_mm: 25.0, around_deg: 0.0, azimuth_deg: 180.0, turn_deg: 0.0, incline_deg: 45.0 };
        let line = place.line(&body).expect("it goes in");
        let outlines = body.outlines(&line.block);
        for piece in line.met(&body, 45.0).iter().skip(1) {
            let flat = piece.from_mm / 2.0_f64.sqrt();
            let own = outlines.iter().filter(|outline| outline.structure == piece.structure);
            let gap =
                own.flat_map(|outline| edges(&outline.points_mm)).map(|edge| distance(edge, [flat, flat]));
            let gap = gap.fold(f64::INFINITY, f64::min);
            assert!(gap < 0.05, "structure {} is {gap} mm off", piece.structure);
        }
    }

    fn edges(points: &[[f64; 2]]) -> impl Iterator<Item = [[f64; 2]; 2]> + '_ {
        points.windows(2).map(|pair| [pair[0], pair[1]])
    }

    fn distance([a, b]: [[f64; 2]; 2], p: [f64; 2]) -> f64 {
        let along = [b[0] - a[0], b[1] - a[1]];
        let size = along[0] * along[0] + along[1] * along[1];
        let share =
            if size > 0.0 { ((p[0] - a[0]) * along[0] + (p[1] - a[1]) * along[1]) / size } else { 0.0 };
        let share = share.clamp(0.0, 1.0);
        f64::hypot(p[0] - a[0] - share * along[0], p[1] - a[1] - share * along[1])
    }
}
