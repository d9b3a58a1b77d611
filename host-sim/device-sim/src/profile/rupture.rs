//! Depths at which the layers of a force table give way, for pictures and procedures: the control
//! law finds it by itself.

use control_core::Patient;
use control_core::config::{ForceTable, Law};

/// A layer that gives way by the table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rupture {
    /// Its number.
    pub(super) layer: usize,
    /// The distance below its outer face at which it gives way, perpendicular to the skin, mm.
    pub(super) below_mm: f64,
    /// The force at which it does, N.
    pub(super) force_n: f64,
}

/// Returns the ruptures of a needle at this angle to the skin and the middle one of the table's
/// speeds; none of a law without a table.
pub(super) fn ruptures(patient: &Patient, angle_rad: f64) -> Vec<Rupture> {
    let Law::Xr(table) = &patient.law else { return Vec::new() };
    let cell = nearest_cell(table, angle_rad);
    let cells = table.speeds.len() * table.angles.len();
    let per_knot = table.depths.len() * cells / table.forces.len().max(1);
    let of = |knot: u8| {
        let knot = usize::from(knot);
        let depth_mm = f64::from(*table.depths.get(knot * per_knot + cell % per_knot.max(1))?) * 0.01;
        let force_n = f64::from(*table.forces.get(knot * cells + cell)?) * 1e-3;
        let layer = patient.layers.iter().rposition(|layer| layer.depth.0.to_num::<f64>() <= depth_mm)?;
        let below_mm = depth_mm - patient.layers.get(layer)?.depth.0.to_num::<f64>();
        Some(Rupture { layer, below_mm, force_n })
    };
    table.gives_way.iter().filter_map(|knot| of(*knot)).collect()
}

fn nearest_cell(table: &ForceTable, angle_rad: f64) -> usize {
    let off = |index: &usize| (f64::from(table.angles[*index].0) * 1e-3 - angle_rad).abs();
    let angle = (0..table.angles.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or(0);
    table.speeds.len() / 2 * table.angles.len() + angle
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::profile::Profile;

    #[test]
    fn the_phantoms_layers_give_way_where_its_table_peaks() {
        let phantom = Profile::find("phantom").expect("it is built in");
        let found = ruptures(&phantom.config.patient, phantom.entry_rad);
        // At 60° and 3 mm/s: 2.4, 4.8 and 8.0 mm below the skin, layers at 0, 4 and 7 mm.
        let wanted = [(0, 2.4, 0.672), (1, 0.8, 0.806), (2, 1.0, 1.064)];
        assert_eq!(found.len(), 3);
        for (rupture, (layer, below_mm, force_n)) in found.iter().zip(wanted) {
            assert_eq!(rupture.layer, layer);
            assert!((rupture.below_mm - below_mm).abs() < 1e-3, "{rupture:?}");
            assert!((rupture.force_n - force_n).abs() < 1e-3, "{rupture:?}");
        }
        let adult = Profile::find("adult").expect("it is built in");
        assert_eq!(ruptures(&adult.config.patient, adult.entry_rad), []);
    }
}
