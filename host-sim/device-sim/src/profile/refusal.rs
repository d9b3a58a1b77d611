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
        OutOfRange { field, value, .. } => {
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
