//! `[force_table]` of a patient, of the law of Paper 000, as `fit-force` writes it.

use super::fix;
use control_core::config::{ForceTable, MAX_ANGLES, MAX_DEPTHS, MAX_LAYERS, MAX_SPEEDS};
use control_core::units::{MillimetresPerSecond, Milliradians, Stiffness};
use serde::Deserialize;

/// The largest force that a table holds.
const MOST_MILLINEWTONS: f64 = 16_383.0;
/// Its deepest knot, 0.01 mm.
const MOST_HUNDREDTHS: f64 = 16_383.0;

/// `[force_table]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Forces {
    /// From one knot to the next; or each knot in `depths_mm`.
    depth_step_mm: Option<f64>,
    depths_mm: Option<Depths>,
    speeds_mm_s: Vec<f64>,
    angles_deg: Vec<f64>,
    /// True for each speed and angle that was measured; the angles of a speed together.
    measured: Vec<bool>,
    /// As many rows, a force for each depth.
    force_n: Vec<Vec<f64>>,
    /// Knots, counted from 0, at which a layer gives way; without it, none does.
    #[serde(default)]
    gives_way: Vec<u8>,
}

/// `depths_mm`: the same knots for all speeds and angles, or a row for each, like `force_n`.
#[derive(Deserialize)]
#[serde(untagged)]
enum Depths {
    Shared(Vec<f64>),
    Each(Vec<Vec<f64>>),
}

impl Forces {
    /// Returns the table, or in a sentence what is wrong with it.
    pub(super) fn table(&self, stiffness: f64, withdrawal: f64) -> Result<ForceTable, String> {
        let speeds = self.speeds_mm_s.iter().map(|v| fix("speeds_mm_s", *v).map(MillimetresPerSecond));
        let speeds = speeds.collect::<Result<Vec<_>, _>>()?;
        let angles = self.angles_deg.iter().map(|a| mrad("angles_deg", *a)).collect::<Result<Vec<_>, _>>()?;
        let (cells, depths) = (speeds.len() * angles.len(), self.force_n.first().map_or(0, Vec::len));
        for (key, found, most) in [
            ("speeds_mm_s", speeds.len(), MAX_SPEEDS),
            ("angles_deg", angles.len(), MAX_ANGLES),
            ("a row of force_n", depths, MAX_DEPTHS),
        ] {
            if found > most {
                return Err(format!("{key} has {found} values; at most {most} are possible"));
            }
        }
        if self.force_n.len() != cells || self.force_n.iter().any(|row| row.len() != depths) {
            return Err(format!(
                "force_n is not a table; {} speeds and {} angles need {cells} rows of as many values each",
                speeds.len(),
                angles.len()
            ));
        }
        if self.measured.len() != cells {
            return Err(format!(
                "measured has {} values; there must be {cells}, one for each speed and angle",
                self.measured.len()
            ));
        }
        let mut forces = Vec::new();
        for depth in 0..depths {
            for row in &self.force_n {
                let millinewtons = (row[depth] * 1e3).round();
                if !(0.0..=MOST_MILLINEWTONS).contains(&millinewtons) {
                    return Err(format!(
                        "force_n holds {} N; a force must be from 0 to 16.383 N",
                        row[depth]
                    ));
                }
                forces.push(millinewtons as u16);
            }
        }
        if self.gives_way.len() > MAX_LAYERS {
            return Err(format!(
                "gives_way has {} knots; at most {MAX_LAYERS} are possible",
                self.gives_way.len()
            ));
        }
        let bits = self.measured.iter().enumerate().filter(|(_, is)| **is);
        Ok(ForceTable {
            depths: self.depths(depths)?.into_iter().collect(),
            gives_way: self.gives_way.iter().copied().collect(),
            measured: bits.fold(0, |bits, (cell, _)| bits | 1_u16.checked_shl(cell as u32).unwrap_or(0)),
            stiffness: Stiffness(fix("stiffness_n_per_mm", stiffness)?),
            withdrawal: fix("withdrawal", withdrawal)?,
            // None has more than there is room for.
            forces: forces.into_iter().collect(),
            speeds: speeds.into_iter().collect(),
            angles: angles.into_iter().collect(),
        })
    }
    /// Returns the depth of each of `count` knots in hundredths of a mm, in the order of the
    /// forces, or once for all cells.
    fn depths(&self, count: usize) -> Result<Vec<u16>, String> {
        if let Some(step) = self.depth_step_mm.filter(|step| !step.is_finite()) {
            return Err(format!("depth_step_mm is {step}; it must be a number"));
        }
        let hundredths = |mm: f64| {
            let hundredths = (mm * 100.0).round();
            if (0.0..=MOST_HUNDREDTHS).contains(&hundredths) {
                Ok(hundredths as u16)
            } else {
                Err(format!("[force_table] has a knot at {mm} mm; it must be from 0 to 163.83"))
            }
        };
        match (self.depth_step_mm, &self.depths_mm) {
            (Some(step), None) => (0..count).map(|knot| hundredths(step * knot as f64)).collect(),
            (None, Some(Depths::Shared(row))) if row.len() == count => {
                row.iter().map(|mm| hundredths(*mm)).collect()
            }
            (None, Some(Depths::Each(rows)))
                if rows.len() == self.force_n.len() && rows.iter().all(|row| row.len() == count) =>
            {
                (0..count).flat_map(|knot| rows.iter().map(move |row| hundredths(row[knot]))).collect()
            }
            (None, Some(_)) => Err(format!(
                "depths_mm must have {count} values, as many as a row of force_n, or a row of them for each row of force_n"
            )),
            _ => Err("[force_table] needs either depth_step_mm or depths_mm".into()),
        }
    }
}

/// Returns an angle of a file in the control law's unit; `key` as the user wrote it.
pub(super) fn mrad(key: &str, degrees: f64) -> Result<Milliradians, String> {
    if (0.0..=180.0).contains(&degrees) {
        Ok(Milliradians((degrees.to_radians() * 1e3).round() as i16))
    } else {
        Err(format!("{key} is {degrees} degrees; it must be from 0 to 180 degrees"))
    }
}
