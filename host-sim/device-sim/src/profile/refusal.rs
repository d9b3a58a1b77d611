//! A refusal of the control law in a person's words.

use super::{File, Layer, Wall};
use crate::session::tissue_name;
use control_core::plan::{self, Field};
use fixed::types::I16F16;

/// The control law names layers by number; a person by what they are.
pub(super) fn say(refusal: &plan::Refusal, file: &File) -> String {
    use plan::Refusal::{
        BeyondTravel, ContactStep, NoVessel, OutOfRange, Overlap, ReliefAboveElastic, TooStiff, TooStrong,
        WrongWay,
    };
    let layer = match *refusal {
        TooStiff { layer, .. } | TooStrong { layer, .. } | Overlap { layer } | ContactStep { layer, .. } => {
            layer
        }
        WrongWay { layer } | ReliefAboveElastic { layer } | BeyondTravel { layer } | NoVessel { layer } => {
            layer
        }
        OutOfRange { field, value, low, high } => {
            if let Some(sentence) = in_degrees(field, [value, low, high]) {
                return sentence;
            }
            return match file.layer.iter().position(|layer| has(layer, field, value)) {
                Some(at) => {
                    format!("{refusal} (in layer {at}, {})", tissue_name(file.layer[at].tissue.into()))
                }
                None => refusal.to_string(),
            };
        }
        _ => return refusal.to_string(),
    };
    match file.layer.get(usize::from(layer)) {
        Some(named) => format!("{refusal} (layer {layer} is {})", tissue_name(named.tissue.into())),
        None => refusal.to_string(),
    }
}

/// A value out of its range, for a field that the file has per degree or in degrees.
fn in_degrees(field: Field, numbers: [I16F16; 3]) -> Option<String> {
    let degree_mrad = 1f64.to_radians() * 1e3;
    let (key, factor, unit, parts) = match field {
        // The device takes whole milliradians: a tenth of a degree is what the user wrote.
        Field::LargestAngle => ("largest_deg", 1.0 / degree_mrad, "degrees", 10.0),
        Field::LateralForce => ("lateral_n_per_deg", degree_mrad, "N per degree", 100.0),
        _ => return None,
    };
    let [value, low, high] = numbers.map(|number| (number.to_num::<f64>() * factor * parts).round() / parts);
    Some(format!("{key} is {value} {unit}; it must be from {low} to {high} {unit}"))
}

/// True if a layer has this value under the key of `field`.
fn has(layer: &Layer, field: Field, value: I16F16) -> bool {
    let both = |of: fn(&Wall) -> [f64; 2]| layer.wall.as_ref().map(of);
    let found = match field {
        Field::LayerDepth => layer.depth_mm.map(|depth| [depth; 2]),
        Field::Friction => layer.friction_n_per_mm.map(|friction| [friction; 2]),
        Field::PunctureTravel => both(|wall| [wall.puncture_mm; 2]),
        Field::UnloadStiffness => both(|wall| [wall.unload_n_per_mm; 2]),
        Field::Compliance => {
            both(|wall| [wall.elastic.compliance_mm2_per_n, wall.relief.compliance_mm2_per_n])
        }
        Field::Vertex => both(|wall| [wall.elastic.vertex_mm, wall.relief.vertex_mm]),
        Field::BaseForce => both(|wall| [wall.elastic.base_n, wall.relief.base_n]),
        _ => None,
    };
    found.into_iter().flatten().any(|number| I16F16::checked_from_num(number) == Some(value))
}
