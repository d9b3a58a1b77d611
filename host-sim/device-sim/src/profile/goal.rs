//! `[target]` of a patient: the structure that the needle is to reach.

use super::rupture::ruptures;
use super::{Layer, TissueName};
use crate::session::tissue_name;
use control_core::Patient;
use control_core::config::{self, Tissue};
use serde::Deserialize;

/// A structure to be reached. Layers of the device go on for ever: where it ends to either side,
/// that is for whoever judges.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Its name.
    pub name: String,
    /// The layer that it is, or that begins with its wall.
    pub layer: u8,
    /// It is entered where its wall gives way, else where it is touched.
    pub has_wall: bool,
    /// The layer below, and whether that has a wall.
    pub below: Option<(u8, bool)>,
    /// From where to where it reaches along the skin, mm from the point of entry; none where it
    /// goes on for ever.
    pub reach_mm: Option<(f64, f64)>,
}

/// Returns for each layer, outermost first, whether it has a wall that gives way.
pub(super) fn walls(patient: &Patient, entry_rad: f64) -> Vec<bool> {
    let ruptures = ruptures(patient, entry_rad);
    let has_wall = |(index, layer): (usize, &config::Layer)| {
        layer.wall.is_some() || ruptures.iter().any(|rupture| rupture.layer == index)
    };
    patient.layers.iter().enumerate().map(has_wall).collect()
}

/// As the file has it.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Written {
    tissue: TissueName,
    from_mm: Option<f64>,
    to_mm: Option<f64>,
}

impl Written {
    /// Returns the tissue that is to be reached.
    pub(super) fn tissue(self) -> Tissue {
        self.tissue.into()
    }

    /// Checks that it is one of the layers and ends below its beginning.
    pub(super) fn check(self, layers: &[Layer]) -> Result<(), String> {
        if !layers.iter().any(|layer| layer.tissue == self.tissue) {
            return Err("target.tissue is not one of the layers; name one of them".into());
        }
        match (self.from_mm, self.to_mm) {
            (None, None) => Ok(()),
            (Some(from), Some(to)) if from < to && from.is_finite() && to.is_finite() => Ok(()),
            _ => Err("target needs both from_mm and to_mm, the smaller one first, or neither".into()),
        }
    }
}

/// The number of a layer that the needle's line does not meet.
const NOT_MET: u8 = u8::MAX;

/// Returns the goal of the file, or the lumen of the vessel if the file gives no goal. Without such
/// a layer the result is `None`. If `may_miss` is true, because the line through a body need not
/// meet the layer, the result is instead a goal that cannot be reached.
pub(super) fn goal(
    written: Option<Written>,
    patient: &Patient,
    entry_rad: f64,
    may_miss: bool,
) -> Option<Goal> {
    let layers = &patient.layers;
    let tissue = written.map_or(Tissue::Vessel, |goal| goal.tissue.into());
    let name = if tissue == Tissue::Vessel { "lumen" } else { tissue_name(tissue) };
    let Some(index) = layers.iter().position(|layer| layer.tissue == tissue) else {
        let name = name.to_owned();
        return may_miss.then_some(Goal {
            name,
            layer: NOT_MET,
            has_wall: false,
            below: None,
            reach_mm: None,
        });
    };
    let walls = walls(patient, entry_rad);
    let has_wall = |index: usize| walls.get(index).copied().unwrap_or(false);
    Some(Goal {
        name: name.to_owned(),
        layer: index as u8,
        has_wall: has_wall(index),
        below: (index + 1 < layers.len()).then(|| (index as u8 + 1, has_wall(index + 1))),
        reach_mm: written.and_then(|goal| goal.from_mm.zip(goal.to_mm)),
    })
}
