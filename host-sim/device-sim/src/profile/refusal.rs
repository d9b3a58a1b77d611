//! A refusal of the control law in a person's words.

use super::File;
use crate::session::tissue_name;
use control_core::plan;

/// The control law names layers by number; a person by what they are.
pub(super) fn say(refusal: &plan::Refusal, file: &File) -> String {
    use plan::Refusal::{
        BeyondTravel, ContactStep, NoVessel, Overlap, ReliefAboveElastic, TooStiff, TooStrong, WrongWay,
    };
    let layer = match *refusal {
        TooStiff { layer, .. } | TooStrong { layer, .. } | Overlap { layer } | ContactStep { layer, .. } => {
            layer
        }
        WrongWay { layer } | ReliefAboveElastic { layer } | BeyondTravel { layer } | NoVessel { layer } => {
            layer
        }
        _ => return refusal.to_string(),
    };
    match file.layer.get(usize::from(layer)) {
        Some(named) => format!("{refusal} (layer {layer} is {})", tissue_name(named.tissue.into())),
        None => refusal.to_string(),
    }
}
