//! The scene that a picture shows before anything moves, and the names of its parts. It does not
//! change while the session runs.

use control_core::config::Tissue;
use control_core::event::{State, VesselState};
use serde::Serialize;

/// The scene that a picture shows before anything moves. Depths of layers are perpendicular to the
/// skin.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scene {
    /// The source of the samples.
    pub source: Source,
    /// Name of the profile.
    pub profile: String,
    /// Name of the scripted procedure, where a hand follows one.
    pub procedure: Option<String>,
    /// The tissue, outermost layer first.
    pub layers: Vec<SceneLayer>,
    /// Radius of the roller in mm.
    pub roller_radius_mm: f64,
    /// Largest depth along the needle in mm.
    pub travel_mm: f64,
    /// Largest force at the roller in N.
    pub largest_force_n: f64,
    /// Share of the law's forces that the hand gets, where the motor is too weak for all of them: a
    /// pose's `force_n` times this is felt.
    pub force_scale: f64,
    /// Inclination below the horizontal that the procedure begins with, in rad.
    pub tilt_rad: f64,
    /// Inclination of the needle laid on the skin, in rad; the angle to the skin is the rest of the
    /// tilt.
    pub skin_tilt_rad: f64,
    /// The smallest and the largest angle to the skin, degrees, between which a barrier holds the
    /// needle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub slope_deg: Option<[f64; 2]>,
    /// The vessel, where there is one with two walls.
    pub vessel: Option<SceneVessel>,
    /// The body that the layers come from; without it they are slabs that go on for ever.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub body: Option<SceneBody>,
    /// Structures next to the needle's way that it is to spare.
    pub beside: Vec<SceneBeside>,
    /// The needle, the same for every picture.
    pub needle: SceneNeedle,
    /// True if [`super::Control::Drag`], [`super::Control::Tilt`] and [`super::Control::Demo`] have
    /// an effect: only with the virtual device.
    pub hand: bool,
}

/// The source of the samples.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case", tag = "kind")]
pub enum Source {
    /// The control core against the plant.
    Virtual,
    /// A device behind a serial port.
    Serial {
        /// The port.
        path: String,
    },
    /// A recording.
    Recording {
        /// The file.
        file: String,
    },
}

/// A tube with its axis level with the skin and along the way that the needle points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SceneVessel {
    /// Depth of its axis, perpendicular to the skin, in mm.
    pub axis_mm: f64,
    /// Diameter perpendicular to the skin in mm.
    pub height_mm: f64,
    /// Diameter along the skin in mm.
    pub width_mm: f64,
    /// The distance of the needle's plane from the axis in mm.
    pub offset_mm: f64,
}

/// A body in three dimensions, and where a needle enters it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneBody {
    /// Its number in `anatomy::Site::ALL`.
    pub site: usize,
    /// Its name.
    pub name: String,
    /// The point of entry along the limb in mm.
    pub along_mm: f64,
    /// The point of entry around the limb in degrees.
    pub around_deg: f64,
    /// The needle's direction seen from above in degrees.
    pub azimuth_deg: f64,
    /// The turn of the limb about its axis in degrees.
    pub turn_deg: f64,
    /// The needle's inclination that the layers are for, in degrees.
    pub incline_deg: f64,
    /// Thickness of its fat in mm.
    pub fat_mm: f64,
    /// From where to where along the limb a needle may enter, in mm.
    pub reach_mm: [f64; 2],
    /// The direction of length 1 into the body perpendicular to the skin at entry: along the
    /// needle's plane, across it, down.
    pub inwards: [f64; 3],
    /// The section along the needle's plane, in the order in which it is painted.
    pub outlines: Vec<SceneOutline>,
}

/// A structure of a body cut along the needle's plane.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneOutline {
    /// Its name.
    pub name: String,
    /// Its tissue, as in a patient's file; `other` is an artery.
    pub tissue: String,
    /// A closed line: mm along the section and below the point of entry.
    pub points_mm: Vec<[f64; 2]>,
}

/// A structure to be spared, drawn as an ellipse in the needle's plane.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneBeside {
    /// Its name.
    pub name: String,
    /// Its middle along the skin from the point of entry in mm.
    pub along_mm: f64,
    /// Its middle below the skin in mm.
    pub depth_mm: f64,
    /// Its extent along the skin in mm.
    pub width_mm: f64,
    /// Its extent perpendicular to the skin in mm.
    pub height_mm: f64,
}

/// A hypodermic needle of 21 gauge. Its hub sits at the end of the cannula, so that the needle goes
/// in until the hub meets the skin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SceneNeedle {
    /// Length of the cannula from the tip to the hub in mm.
    pub length_mm: f64,
    /// Outer diameter of the cannula in mm.
    pub diameter_mm: f64,
    /// Length of the ground face at the tip in mm.
    pub bevel_mm: f64,
    /// Length of the hub behind the cannula in mm.
    pub hub_length_mm: f64,
    /// Diameter of the hub in mm.
    pub hub_diameter_mm: f64,
}

/// Lengths in which such needles are sold (1, 1¼, 1½, 2 and 3⅛ inches), in mm.
const LENGTHS_MM: [f64; 5] = [25.0, 32.0, 38.0, 50.0, 80.0];
/// The length of the cannula that stays outside at the deepest wall in mm.
const OUTSIDE_MM: f64 = 8.0;

impl SceneNeedle {
    /// The shortest needle that reaches `depth_mm` along itself with some of it left outside; the
    /// longest where none does.
    pub fn reaching(depth_mm: f64) -> Self {
        let reaches = |length: &f64| *length >= depth_mm + OUTSIDE_MM;
        let length_mm = LENGTHS_MM.into_iter().find(reaches).unwrap_or(LENGTHS_MM[LENGTHS_MM.len() - 1]);
        // ISO 9626: 21 gauge has an outer diameter of 0.80 to 0.83 mm.
        Self { length_mm, diameter_mm: 0.82, bevel_mm: 2.1, hub_length_mm: 7.0, hub_diameter_mm: 3.4 }
    }
}

/// One layer of tissue.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneLayer {
    /// The name of its tissue.
    pub name: String,
    /// The name of the body's structure that it is, if it comes from a body.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub structure: Option<String>,
    /// True if it is the vessel that the procedure aims at.
    pub is_vessel: bool,
    /// True if it begins with the vessel's far wall.
    pub is_far_wall: bool,
    /// Depth of its outer face in mm, perpendicular to the skin.
    pub depth_mm: f64,
    /// From where to where along the skin it reaches, in mm from the point of entry, if it ends.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reach_mm: Option<[f64; 2]>,
    /// The travel along the needle at which its wall gives way, in mm, if it has one.
    pub puncture_travel_mm: Option<f64>,
    /// Part of that which is left when it has just given way, 0 to 1.
    pub spring_back: Option<f64>,
    /// Force at which its wall gives way in N, friction not counted.
    pub puncture_force_n: Option<f64>,
    /// Friction gained for each mm inside it, in N/mm.
    pub friction_n_per_mm: f64,
}

/// Returns the name of a tissue for people.
pub fn tissue_name(tissue: Tissue) -> &'static str {
    match tissue {
        Tissue::Skin => "skin",
        Tissue::Fat => "fat",
        Tissue::Muscle => "muscle",
        Tissue::Vessel => "vessel",
        Tissue::Other => "other",
        Tissue::Bursa => "bursa",
        Tissue::Tendon => "tendon",
        Tissue::Cartilage => "cartilage",
        Tissue::FarWall => "far wall",
    }
}

/// Returns the name for programs of the tip's place relative to a vessel.
pub(crate) fn vessel_name(code: u8) -> &'static str {
    match VesselState::from_code(code) {
        Some(VesselState::Outside) => "outside",
        Some(VesselState::Touching) => "touching",
        Some(VesselState::InLumen) => "in_lumen",
        Some(VesselState::Through) => "through",
        Some(VesselState::Beside) => "beside",
        None => "unknown",
    }
}

/// Returns the name of a device's state for people.
pub fn state_name(code: u8) -> &'static str {
    match State::from_code(code) {
        Some(State::Idle) => "idle",
        Some(State::Approach) => "approach",
        Some(State::Elastic) => "elastic",
        Some(State::Puncture) => "puncture",
        Some(State::Friction) => "friction",
        Some(State::Withdrawal) => "withdrawal",
        Some(State::Excitation) => "excitation",
        Some(State::Fault) => "fault",
        None => "unknown",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_needle_is_long_enough_for_the_deepest_wall() {
        // An adult's far wall at 30°, a shoulder's cartilage at 45°, and deeper than any needle.
        for (depth_mm, length_mm) in [(15.6, 25.0), (41.0, 50.0), (0.0, 25.0), (300.0, 80.0)] {
            assert!((SceneNeedle::reaching(depth_mm).length_mm - length_mm).abs() < 1e-9, "{depth_mm}");
        }
    }
}
