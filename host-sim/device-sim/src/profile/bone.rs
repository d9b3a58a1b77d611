//! `over_bone_mm` of a patient's layer: bone under level layers, which stops the needle. The
//! device's law has no bone: a motor as strong as a bone does not fit into a hand.

use super::File;
use control_core::Patient;
use std::ops::RangeInclusive;

/// From the top of a layer to the bone below it, mm.
const OVER_BONE_MM: RangeInclusive<f64> = 0.1..=100.0;

impl File {
    /// Returns the depth of the bone, perpendicular to the skin, mm; none where no layer lies over
    /// bone.
    pub(super) fn bone_mm(&self, patient: &Patient) -> Result<Option<f64>, String> {
        let mut over = self.layer.iter().zip(&patient.layers).filter_map(|(written, layer)| {
            Some((written.tissue.word(), written.over_bone_mm?, layer.depth.0.to_num::<f64>()))
        });
        let Some((word, mm, depth_mm)) = over.next() else { return Ok(None) };
        let (low, high) = (OVER_BONE_MM.start(), OVER_BONE_MM.end());
        if !OVER_BONE_MM.contains(&mm) {
            return Err(format!("over_bone_mm of the {word} is {mm}; it must be from {low} to {high}"));
        }
        if over.next().is_some() || patient.layers.last().is_some_and(|last| last.depth.0 > depth_mm + mm) {
            return Err(format!(
                "bone lies under the {word}, and a layer lies below it; give over_bone_mm to the last layer only"
            ));
        }
        Ok(Some(depth_mm + mm))
    }
}
