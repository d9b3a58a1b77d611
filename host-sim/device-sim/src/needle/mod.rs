//! The one place that says where a needle is in its tissue: the picture, the score and the lines
//! that are sent to the device all ask here.
//!
//! Depth counts along the needle from the skin. A needle that turns in tissue turns about the point
//! of its entry track that holds it: the deepest wall that it has pierced and not left, else the
//! point of entry. What it has passed above that point goes along with it, and the layers below are
//! met where its new line meets them. That a wall holds and the tissue between two walls gives is
//! an assumption: a rigid needle on an even elastic foundation would turn about half to two thirds
//! of its length in tissue, and fascia and vessel walls are stiffer than fat.

mod meeting;
mod sender;

pub use sender::LineSender;

use crate::profile::Profile;
use control_core::config::Tissue;
use link::frames::EventKind;
use meeting::Meeting;

/// A wall is left when the tip is this far outside it, mm along the needle, as in the device.
const EXIT_MM: f64 = 0.2;
/// Less is the noise of a tilt sensor, rad.
const TURNED_RAD: f64 = 0.5e-3;

/// A needle in the section of its patient that the picture shows: mm along the skin (the
/// horizontal, in a body) and below it, from the point of entry.
#[derive(Clone, Debug)]
pub struct NeedleTrack {
    meeting: Meeting,
    walls: Vec<bool>,
    vessel: Option<usize>,
    far_wall: Option<usize>,
    /// The walls that hold it, outermost first.
    held: Vec<Hold>,
    origin_mm: [f64; 2],
    angle_rad: f64,
    depth_mm: f64,
    /// The depth at which its line meets each layer of the device, mm; none where it does not.
    tops_mm: Vec<Option<f64>>,
    bone_mm: Option<f64>,
}

/// A point of the entry track that holds the needle.
#[derive(Clone, Copy, Debug, Default)]
struct Hold {
    layer: usize,
    /// The depth at which the tip was there, mm.
    at_mm: f64,
    place_mm: [f64; 2],
}

fn along([x, y]: [f64; 2], angle_rad: f64, mm: f64) -> [f64; 2] {
    [x + mm * libm::cos(angle_rad), y + mm * libm::sin(angle_rad)]
}

impl NeedleTrack {
    /// A needle outside the skin of `profile`, at its angle.
    pub fn new(profile: &Profile) -> Self {
        let layers = &profile.config.patient.layers;
        let number = |wanted: Tissue| layers.iter().position(|layer| layer.tissue == wanted);
        let meeting = Meeting::new(profile);
        Self {
            tops_mm: meeting.tops_mm([0.0; 2], profile.entry_rad),
            bone_mm: meeting.bone_mm([0.0; 2], profile.entry_rad),
            meeting,
            walls: profile.walls(),
            vessel: number(Tissue::Vessel),
            far_wall: number(Tissue::FarWall),
            held: Vec::new(),
            origin_mm: [0.0; 2],
            angle_rad: profile.entry_rad,
            depth_mm: f64::NEG_INFINITY,
        }
    }

    /// The tip is at `depth_mm` and the needle at `angle_rad` to the level skin.
    pub fn move_to(&mut self, depth_mm: f64, angle_rad: f64) {
        self.depth_mm = depth_mm;
        let holding = self.held.len();
        while self.held.last().is_some_and(|last| depth_mm < last.at_mm - EXIT_MM) {
            self.held.pop();
        }
        if self.held.len() != holding || (angle_rad - self.angle_rad).abs() > TURNED_RAD {
            self.turn(angle_rad);
        }
    }

    fn turn(&mut self, angle_rad: f64) {
        let pivot = self.held.last().copied().unwrap_or_default();
        self.angle_rad = angle_rad;
        self.origin_mm = along(pivot.place_mm, angle_rad, -pivot.at_mm);
        let below = if self.held.is_empty() { 0 } else { pivot.layer + 1 };
        let tops_mm = self.meeting.tops_mm(self.origin_mm, angle_rad);
        self.bone_mm = self.meeting.bone_mm(self.origin_mm, angle_rad);
        for (top, new) in self.tops_mm.iter_mut().zip(tops_mm).skip(below) {
            *top = new.map(|mm| mm.max(pivot.at_mm));
        }
    }

    /// Takes an event of the device, after the move to where it happened.
    pub fn happen(&mut self, kind: &EventKind) {
        let (EventKind::Puncture { layer } | EventKind::InTrack { layer }) = *kind else { return };
        let layer = usize::from(layer);
        if self.holds(layer) || !self.walls.get(layer).is_some_and(|has_wall| *has_wall) {
            return;
        }
        let met_mm = self.tops_mm.get(layer).copied().flatten().unwrap_or(self.depth_mm);
        let at_mm = met_mm.min(self.depth_mm);
        self.held.push(Hold { layer, at_mm, place_mm: along(self.origin_mm, self.angle_rad, at_mm) });
    }

    fn holds(&self, layer: usize) -> bool {
        self.held.iter().any(|hold| hold.layer == layer)
    }

    /// Returns the place at which the needle's line has depth 0, mm.
    pub fn origin_mm(&self) -> [f64; 2] {
        self.origin_mm
    }

    /// Returns the place of the tip, mm.
    pub fn tip_mm(&self) -> [f64; 2] {
        along(self.origin_mm, self.angle_rad, self.depth_mm)
    }

    /// Returns the angle to the level skin that was told last, rad.
    pub fn angle_rad(&self) -> f64 {
        self.angle_rad
    }

    /// Returns the depth that was told last, mm.
    pub fn depth_mm(&self) -> f64 {
        self.depth_mm
    }

    /// Returns the depth at which bone stops the needle, mm along it; none where its line meets no
    /// bone.
    pub fn bone_mm(&self) -> Option<f64> {
        self.bone_mm
    }

    /// True if the tip is in layer `number`: past its wall, if it has one.
    pub fn is_in(&self, number: usize) -> bool {
        if self.walls.get(number).is_some_and(|has_wall| *has_wall) {
            return self.holds(number);
        }
        let met = self.tops_mm.get(number).copied().flatten();
        met.is_some_and(|top_mm| self.depth_mm >= top_mm)
    }

    /// Returns the deepest layer that the tip is in; none outside, or where it presses on the skin.
    pub fn layer(&self) -> Option<usize> {
        (0..self.tops_mm.len()).rev().find(|number| self.is_in(*number))
    }

    /// True if the tip is in the vessel's lumen.
    pub fn is_in_lumen(&self) -> bool {
        self.vessel.is_some_and(|near| self.is_in(near)) && !self.far_wall.is_some_and(|far| self.is_in(far))
    }

    /// Returns where the line meets each layer of the device, mm along the needle; none for a layer
    /// that it does not meet.
    pub fn tops_mm(&self) -> &[Option<f64>] {
        &self.tops_mm
    }
}

#[cfg(test)]
mod tests;
