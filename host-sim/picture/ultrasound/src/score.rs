//! A score of how well the needle is kept in the image's plane.

use crate::probe::{Probe, Shaft};

/// Places along the needle that are looked at.
const PLACES: usize = 32;
/// A place counts as seen where the beam has this share of its pressure.
const SEEN: f32 = 0.5;

/// The part of the needle that the beam sees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InPlane {
    /// Share of the inserted length that is seen, 0 to 1.
    pub share: f32,
    /// True if the tip is seen.
    pub tip: bool,
    /// The distance of the tip from the plane, mm.
    pub tip_beside_mm: f32,
}

impl InPlane {
    /// For this needle under this probe; zero where the needle is outside.
    pub fn of(probe: &Probe, shaft: &Shaft) -> Self {
        if !shaft.is_there() {
            return Self::default();
        }
        let probe = probe.checked();
        let axes = probe.axes();
        let tip = axes.of(shaft.tip_mm);
        let back = axes.turn(shaft.direction);
        let seen = |behind: f32| {
            let [u, v, n] = [0, 1, 2].map(|axis| tip[axis] - behind * back[axis]);
            u.abs() <= 0.5 * probe.width_mm
                && (0.0..=probe.depth_mm).contains(&v)
                && (-0.5 * (n / probe.beam_sigma_mm(v)).powi(2)).exp() >= SEEN
        };
        let places =
            (0..PLACES).filter(|place| seen((*place as f32 + 0.5) / PLACES as f32 * shaft.inserted_mm));
        Self { share: places.count() as f32 / PLACES as f32, tip: seen(0.0), tip_beside_mm: tip[2] }
    }
}

/// The score of a whole insertion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InPlaneScore {
    /// Time that the needle was in the body, s.
    pub inserted_s: f32,
    /// The time that the tip was seen, s.
    pub tip_seen_s: f32,
    /// Integral of the share of the needle that was seen, s.
    pub share_s: f32,
}

impl InPlaneScore {
    /// Takes `seconds` more in; time with the needle outside does not count.
    pub fn take(&mut self, seen: InPlane, shaft: &Shaft, seconds: f32) {
        if shaft.is_there() && seconds > 0.0 && seconds.is_finite() {
            self.inserted_s += seconds;
            self.share_s += seen.share * seconds;
            self.tip_seen_s += if seen.tip { seconds } else { 0.0 };
        }
    }

    /// Share of the time in the body that the tip was seen, 0 to 1; 0 before there was any.
    pub fn tip_share(&self) -> f32 {
        if self.inserted_s > 0.0 { self.tip_seen_s / self.inserted_s } else { 0.0 }
    }

    /// Mean share of the needle that was seen, 0 to 1.
    pub fn mean_share(&self) -> f32 {
        if self.inserted_s > 0.0 { self.share_s / self.inserted_s } else { 0.0 }
    }
}
