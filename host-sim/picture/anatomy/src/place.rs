//! The place and the direction in which a needle enters a limb that may be turned, and the frame in
//! which a picture shows it.

use crate::body::{Body, Piece};
use crate::vector::{Vector, add, dot, scale, sub};
use std::fmt;

/// The smallest angle between needle and skin at entry, degrees.
const FLATTEST_DEG: f64 = 5.0;
/// The largest angle between the vertical and a line perpendicular to the skin at entry, degrees.
const STEEPEST_DEG: f64 = 60.0;
/// Farther from the limb's axis there is no skin, mm.
const FARTHEST_MM: f64 = 400.0;

/// A point of entry, a direction and the turn of the limb.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Place {
    /// Along the limb away from the trunk, mm.
    pub along_mm: f64,
    /// Around the limb, from the top of a limb that is not turned towards its side y, degrees.
    pub around_deg: f64,
    /// The needle's direction seen from above: 0 along the limb, 90 towards y, degrees.
    pub azimuth_deg: f64,
    /// The turn of the limb about its axis, degrees: with 90 its top has become its side y.
    pub turn_deg: f64,
    /// The needle's inclination below the horizontal, degrees, 0–90.
    pub incline_deg: f64,
}

/// The reason why a needle cannot enter: what, where and what to do.
#[derive(Clone, Debug, PartialEq)]
pub struct Refusal(String);

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Refusal {}

/// The frame of a picture about the point of entry: x horizontal in the needle's plane, y
/// horizontal across it, z down.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Block {
    /// The point of entry in the limb's frame, mm.
    pub origin: Vector,
    /// The directions x, y and z in the limb's frame.
    pub axes: [Vector; 3],
}

impl Block {
    /// Returns a place of the block in the limb's frame.
    pub fn to_limb(&self, place: Vector) -> Vector {
        add(self.origin, self.direction_to_limb(place))
    }

    /// Returns a direction of the block in the limb's frame.
    pub fn direction_to_limb(&self, direction: Vector) -> Vector {
        let parts = [0, 1, 2].map(|axis| scale(self.axes[axis], direction[axis]));
        parts.into_iter().fold([0.0; 3], add)
    }

    /// Returns a place of the limb's frame in the block.
    pub fn from_limb(&self, place: Vector) -> Vector {
        self.axes.map(|axis| dot(sub(place, self.origin), axis))
    }
}

/// A needle's way into a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Line {
    /// The frame about the point of entry.
    pub block: Block,
    /// The needle's direction in the limb's frame.
    pub direction: Vector,
    /// The direction of length 1 into the body perpendicular to the skin at entry, in the block's
    /// frame.
    pub inwards: Vector,
    /// The angle between needle and skin at entry, degrees.
    pub angle_deg: f64,
}

impl Place {
    /// Returns the way of a needle that enters `body` here, or the reason why it cannot.
    pub fn line(&self, body: &Body) -> Result<Line, Refusal> {
        let (entry, outwards) = self.entry(body)?;
        let [azimuth, turn, incline] =
            [self.azimuth_deg, self.turn_deg, self.incline_deg].map(f64::to_radians);
        // From the world, in which the limb has turned, back into the limb.
        let (s, c) = (libm::sin(turn), libm::cos(turn));
        let to_limb = |v: Vector| [v[0], c * v[1] + s * v[2], -s * v[1] + c * v[2]];
        let (side, ahead) = (libm::sin(azimuth), libm::cos(azimuth));
        let axes = [[ahead, side, 0.0], [-side, ahead, 0.0], [0.0, 0.0, 1.0]].map(to_limb);
        let block = Block { origin: entry, axes };
        let (down, flat) = (libm::sin(incline), libm::cos(incline));
        let direction = block.direction_to_limb([flat, 0.0, down]);
        let inwards = axes.map(|axis| -dot(axis, outwards));
        let angle_deg = libm::asin((-dot(direction, outwards)).clamp(-1.0, 1.0)).to_degrees();
        if angle_deg < FLATTEST_DEG {
            return Err(Refusal(format!(
                "the needle enters at {angle_deg:.0} degrees to the skin at {:.0} mm along and {:.0} degrees around the limb, and at least \
                 {FLATTEST_DEG} are needed; make it steeper, point it elsewhere or turn the limb",
                self.along_mm, self.around_deg
            )));
        }
        let slope_deg = libm::acos(inwards[2].clamp(-1.0, 1.0)).to_degrees();
        if slope_deg > STEEPEST_DEG {
            return Err(Refusal(format!(
                "the skin at {:.0} mm along and {:.0} degrees around the limb slopes by {slope_deg:.0} degrees to the skin of a level limb, and \
                 at most {STEEPEST_DEG} are possible; turn the limb until the place is on top",
                self.along_mm, self.around_deg
            )));
        }
        Ok(Line { block, direction, inwards, angle_deg })
    }

    /// Returns the place of the skin, and the direction out of the body there.
    fn entry(&self, body: &Body) -> Result<(Vector, Vector), Refusal> {
        let numbers = [self.along_mm, self.around_deg, self.azimuth_deg, self.turn_deg, self.incline_deg];
        if !numbers.iter().all(|number| number.abs() <= 1e4) {
            return Err(Refusal("the point of entry and the direction must be numbers".into()));
        }
        let around = self.around_deg.to_radians();
        let radial = [0.0, libm::sin(around), -libm::cos(around)];
        let axis = [self.along_mm, 0.0, 0.0];
        let skin = body.structures.first();
        let ends = skin.into_iter().flat_map(|skin| &skin.parts).filter_map(|part| {
            let [_, to] = crate::solid::inside_all(part, axis, radial)?;
            (0.0..FARTHEST_MM).contains(&to).then_some((to, part))
        });
        let Some((far, part)) = ends.max_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Err(Refusal(format!(
                "there is no skin at {:.0} mm along the limb; choose a place on it",
                self.along_mm
            )));
        };
        let entry = add(axis, scale(radial, far));
        let outwards = part.first().map_or([0.0, 0.0, -1.0], |solid| solid.outwards(entry));
        Ok((entry, outwards))
    }
}

impl Line {
    /// Returns what the needle meets in its first `reach_mm`, in order, mm along the needle from
    /// the skin.
    pub fn met(&self, body: &Body, reach_mm: f64) -> Vec<Piece> {
        body.met(self.block.origin, self.direction, reach_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sites::Site;

    const STRAIGHT: Place =
        Place { along_mm: 0.0, around_deg: 0.0, azimuth_deg: 0.0, turn_deg: 0.0, incline_deg: 90.0 };

    fn names(site: Site, place: Place) -> Vec<(&'static str, f64)> {
        let body = site.body(site.usual_fat_mm());
        let line = place.line(&body).expect("it goes in");
        let pieces = line.met(&body, 60.0);
        pieces.iter().map(|p| (body.structures[p.structure].name, p.from_mm)).collect()
    }

    /// The figures of docs/design/anatomy.md straight in: 2.5 mm of skin, then fat, deltoid to 12
    /// mm over the bursa.
    #[test]
    fn straight_in_the_layers_are_as_thick_as_the_figures_say() {
        let place = Place { along_mm: 5.0, ..STRAIGHT };
        let met = names(Site::Shoulder, place);
        let wanted = [
            ("skin", 0.0),
            ("fat", 2.5),
            ("deltoid", 8.29),
            ("bursa", 52.29 - 31.607),
            ("rotator cuff", 52.29 - 28.566),
        ];
        for ((name, from), (wanted_name, wanted_from)) in met.iter().zip(wanted) {
            assert!(*name == wanted_name && (from - wanted_from).abs() < 0.01, "{met:?}");
        }
    }

    /// A limb that turns with the point of entry under a needle that turns with both is the same
    /// limb.
    #[test]
    fn turning_the_limb_is_moving_the_needle_around_it() {
        let round = Site::Shoulder;
        let still = Place { along_mm: 30.0, incline_deg: 55.0, azimuth_deg: 160.0, ..STRAIGHT };
        let turned = Place { around_deg: 25.0, turn_deg: -25.0, ..still };
        let (body, reach) = (round.body(4.0), 60.0);
        let line = |place: Place| place.line(&body).expect("it goes in");
        let (a, b) = (line(still), line(turned));
        assert!((a.angle_deg - b.angle_deg).abs() < 1e-9, "{} {}", a.angle_deg, b.angle_deg);
        let skin = |line: &Line| line.met(&body, reach)[1].from_mm;
        assert!((skin(&a) - skin(&b)).abs() < 1e-9);
        let back = b.block.from_limb(b.block.to_limb([1.0, 2.0, 3.0]));
        assert!(back.iter().zip([1.0, 2.0, 3.0]).all(|(x, wanted)| (x - wanted).abs() < 1e-9), "{back:?}");
    }

    #[test]
    fn a_needle_that_leaves_or_grazes_the_limb_is_refused() {
        let body = Site::Forearm.body(8.0);
        let refused = |place: Place| place.line(&body).expect_err("it is refused").to_string();
        let beside = Place { around_deg: 40.0, azimuth_deg: 90.0, incline_deg: 30.0, ..STRAIGHT };
        assert!(refused(beside).contains("turn the limb"), "{}", refused(beside));
        assert!(refused(Place { around_deg: 85.0, ..STRAIGHT }).contains("turn the limb"));
        assert!(refused(Place { along_mm: f64::NAN, ..STRAIGHT }).contains("must be numbers"));
        let shoulder = Site::Shoulder.body(4.0);
        let off = Place { along_mm: -60.0, ..STRAIGHT }.line(&shoulder).expect_err("no skin").to_string();
        assert!(off.contains("no skin at -60 mm"), "{off}");
    }

    #[test]
    fn a_vein_branches_and_an_artery_lies_deeper() {
        let at = |along_mm: f64, around_deg: f64| {
            names(Site::Forearm, Place { along_mm, around_deg, turn_deg: -around_deg, ..STRAIGHT })
        };
        let meets = |met: Vec<(&'static str, f64)>, name: &str| met.iter().any(|(own, _)| *own == name);
        // Over the vein where it runs along the top, and over both of its branches further on.
        assert!(meets(at(10.0, 0.0), "vein") && !meets(at(10.0, 12.0), "vein"));
        let hits: Vec<bool> = (-30..=40).map(|deg| meets(at(90.0, f64::from(deg)), "vein")).collect();
        let veins = hits.windows(2).filter(|pair| pair[1] && !pair[0]).count();
        assert_eq!(veins, 2, "{hits:?}");
        assert!((-30..=10).any(|deg| meets(at(10.0, f64::from(deg)), "artery")));
    }
}
