//! One insertion as a movement in the section that the picture shows: where the tip was, at 100 Hz.
//! What follows from it (path, redirections, angle error, speed) is geometry; forces and walls are
//! not its business.

use std::ops::Range;

/// Places a second: finer, the path would be made of the encoder's steps and of a tremor that no
/// trainee can help.
pub const RATE_HZ: f64 = 100.0;
/// A needle drawn back by less than this, or pushed in again by less, is still on the same way in,
/// mm.
const PASS_MM: f64 = 2.0;
/// A new pass whose angle differs by less than this from the last one's has the same direction, °.
const SAME_DIRECTION_DEG: f64 = 3.0;

/// The needle's place.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Place {
    /// The depth of the tip past the entry point, along the needle, mm.
    pub depth_mm: f64,
    /// Angle of the needle to the skin, rad.
    pub angle_rad: f64,
    /// The place at which its line has depth 0, mm along the skin and below it.
    pub origin_mm: [f64; 2],
}

impl Place {
    /// Along the skin and below it, mm.
    pub(crate) fn in_section(self) -> (f64, f64) {
        let (sin, cos) = self.angle_rad.sin_cos();
        let [x, y] = self.origin_mm;
        (x + self.depth_mm * cos, y + self.depth_mm * sin)
    }
}

/// One insertion, [`RATE_HZ`] places a second.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gesture {
    /// In their order in time.
    pub places: Vec<Place>,
}

/// The error of the needle's angle, °.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AngleError {
    /// Root mean square, every mm of the way counting the same, so that a needle at rest adds
    /// nothing.
    pub rms_deg: f64,
    /// Largest, with its sign: positive is too steep.
    pub largest_deg: f64,
}

/// The number of times that the needle was pushed in before it left the skin again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Passes {
    /// Ways in: one, and one more whenever it was pushed in again by 2 mm after having been drawn
    /// back by 2 mm.
    pub passes: u32,
    /// Those of them, but the first, that went in another direction: by 3° or more.
    pub redirections: u32,
}

impl Gesture {
    /// Returns places at [`RATE_HZ`] from places at any higher rate, each the mean of its hundredth
    /// of a second.
    pub fn new(rate_hz: f64, places: impl IntoIterator<Item = Place>) -> Self {
        let many = ((rate_hz / RATE_HZ).round() as usize).max(1);
        let (mut means, mut sum, mut counted) = (Vec::new(), Place::default(), 0_usize);
        for place in places {
            sum.depth_mm += place.depth_mm;
            sum.angle_rad += place.angle_rad;
            sum.origin_mm = std::array::from_fn(|axis| sum.origin_mm[axis] + place.origin_mm[axis]);
            counted += 1;
            if counted == many {
                let share = 1.0 / many as f64;
                means.push(Place {
                    depth_mm: sum.depth_mm * share,
                    angle_rad: sum.angle_rad * share,
                    origin_mm: sum.origin_mm.map(|mm| mm * share),
                });
                (sum, counted) = (Place::default(), 0);
            }
        }
        Self { places: means }
    }

    /// Length of the tip's way in all, in and out and sideways, mm.
    pub fn path_mm(&self) -> f64 {
        self.steps_mm().sum()
    }

    fn steps_mm(&self) -> impl Iterator<Item = f64> + '_ {
        self.places.windows(2).map(|pair| {
            let ((x0, y0), (x1, y1)) = (pair[0].in_section(), pair[1].in_section());
            (x1 - x0).hypot(y1 - y0)
        })
    }

    /// From the beginning to the deepest place.
    pub fn way_in(&self) -> Range<usize> {
        let deepest = |a: &(usize, &Place), b: &(usize, &Place)| a.1.depth_mm.total_cmp(&b.1.depth_mm);
        0..self.places.iter().enumerate().max_by(deepest).map_or(0, |(index, _)| index + 1)
    }

    /// Speed of the tip in `range`, mm/s.
    pub fn speed_mm_s(&self, range: Range<usize>) -> Vec<f64> {
        let steps = self.steps_mm().skip(range.start).take(range.len().saturating_sub(1));
        steps.map(|mm| mm * RATE_HZ).collect()
    }

    /// Returns the error of the angle from `wanted_rad` along the whole way; `None` if the tip has
    /// not moved.
    pub(crate) fn angle_error(&self, wanted_rad: f64) -> Option<AngleError> {
        let (mut squares, mut way, mut largest) = (0.0, 0.0, 0.0_f64);
        for (place, mm) in self.places.iter().skip(1).zip(self.steps_mm()) {
            let error = (place.angle_rad - wanted_rad).to_degrees();
            squares += error * error * mm;
            way += mm;
            if mm > 0.0 && error.abs() > largest.abs() {
                largest = error;
            }
        }
        (way > 0.0).then(|| AngleError { rms_deg: (squares / way).sqrt(), largest_deg: largest })
    }

    /// Returns the number of times that it was pushed in anew, and in another direction: that of a
    /// pass is the angle at its deepest place.
    pub fn passes(&self) -> Passes {
        let Some(first) = self.places.first() else { return Passes::default() };
        let (mut inwards, mut turn, mut angles) = (true, *first, Vec::new());
        for place in &self.places {
            let gone = if inwards { turn.depth_mm - place.depth_mm } else { place.depth_mm - turn.depth_mm };
            if gone <= 0.0 {
                turn = *place;
            } else if gone >= PASS_MM {
                angles.extend(inwards.then_some(turn.angle_rad));
                inwards = !inwards;
                turn = *place;
            }
        }
        angles.extend(inwards.then_some(turn.angle_rad));
        let is_other = |pair: &&[f64]| (pair[1] - pair[0]).to_degrees().abs() >= SAME_DIRECTION_DEG;
        Passes {
            passes: angles.len() as u32,
            redirections: angles.windows(2).filter(is_other).count() as u32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Straight lines between (mm, °) corners, 50 places each.
    fn gesture(corners: &[(f64, f64)]) -> Gesture {
        let line = |pair: &[(f64, f64)]| {
            let ((d0, a0), (d1, a1)) = (pair[0], pair[1]);
            (0..=50).map(move |i| {
                let share = f64::from(i) / 50.0;
                let angle = a0 + share * (a1 - a0);
                Place { depth_mm: d0 + share * (d1 - d0), angle_rad: angle.to_radians(), origin_mm: [0.0; 2] }
            })
        };
        Gesture { places: corners.windows(2).flat_map(line).collect() }
    }

    #[test]
    fn the_way_of_a_needle_that_does_not_turn_is_in_and_out() {
        let there_and_back = gesture(&[(0.0, 30.0), (9.6, 30.0), (0.0, 30.0)]);
        assert!((there_and_back.path_mm() - 19.2).abs() < 1e-9);
        assert_eq!(there_and_back.passes(), Passes { passes: 1, redirections: 0 });
        let error = there_and_back.angle_error(25_f64.to_radians()).expect("it moved");
        assert!((error.rms_deg - 5.0).abs() < 1e-9 && (error.largest_deg - 5.0).abs() < 1e-9, "{error:?}");
    }

    #[test]
    fn a_tip_that_turns_sweeps_an_arc() {
        // A quarter of a circle of 10 mm: 15.708 mm, of which 50 chords leave out less than a
        // thousandth.
        let arc = gesture(&[(10.0, 0.0), (10.0, 90.0)]);
        assert!((arc.path_mm() - 15.708).abs() < 0.01, "{}", arc.path_mm());
        // Errors from 0° to 90° along equal steps: the root of a third of 90².
        let error = arc.angle_error(0.0).expect("it moved");
        assert!((error.rms_deg - 90.0 / 3.0_f64.sqrt()).abs() < 1.0, "{error:?}");
        assert!((error.largest_deg - 90.0).abs() < 1e-9);
    }

    #[test]
    fn every_mm_of_the_way_counts_the_same_and_rest_counts_nothing() {
        // 6 mm at an error of 10°, a rest, 18 mm at none: √(6·100/24) = 5°.
        let mut way = gesture(&[(0.0, 40.0), (6.0, 40.0), (6.0, 40.0)]);
        way.places.extend(gesture(&[(6.0, 30.0), (24.0, 30.0)]).places);
        let sweep = 2.0 * 6.0 * 5_f64.to_radians().sin();
        let error = way.angle_error(30_f64.to_radians()).expect("it moved");
        // The turn itself is part of the way too, at the error with which it ends: zero.
        let expected = (6.0 * 100.0 / (24.0 + sweep)).sqrt();
        assert!((error.rms_deg - expected).abs() < 1e-6, "{error:?}, not {expected}");
    }

    #[test]
    fn a_redirection_is_a_new_pass_in_another_direction() {
        let passes = |corners: &[(f64, f64)]| gesture(corners).passes();
        let said = |passes, redirections| Passes { passes, redirections };
        // Drawn back by 6 mm and pushed in again where it was.
        assert_eq!(passes(&[(0.0, 30.0), (10.0, 30.0), (4.0, 30.0), (10.0, 30.0)]), said(2, 0));
        // Turned while drawn back; twice.
        let twice =
            [(0.0, 30.0), (10.0, 30.0), (4.0, 30.0), (4.0, 36.0), (10.0, 36.0), (3.0, 36.0), (9.0, 30.0)];
        assert_eq!(passes(&twice), said(3, 2));
        // Too little to count: a hand that trembles.
        assert_eq!(passes(&[(0.0, 30.0), (10.0, 30.0), (8.5, 30.0), (11.0, 40.0), (0.0, 40.0)]), said(1, 0));
        assert_eq!(Gesture::default().passes(), said(0, 0));
    }

    #[test]
    fn places_are_means_of_their_hundredth_of_a_second() {
        let fast =
            (0..1_000).map(|tick| Place { depth_mm: f64::from(tick), angle_rad: 0.5, origin_mm: [0.0; 2] });
        let gesture = Gesture::new(10_000.0, fast);
        assert_eq!(gesture.places.len(), 10);
        assert!((gesture.places[0].depth_mm - 49.5).abs() < 1e-9);
        // A tick a mm is 100 mm a place.
        assert!(gesture.speed_mm_s(0..10).iter().all(|v| (v - 1e4).abs() < 1e-6));
        assert_eq!((gesture.way_in(), gesture.speed_mm_s(0..10).len()), (0..10, 9));
        assert_eq!(gesture.speed_mm_s(0..0).len(), 0);
    }
}
