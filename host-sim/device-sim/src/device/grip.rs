//! The force that the rollers hold: Paper 001 transmits force by the friction between two rollers
//! and the needle, without loss "within maximum static frictional force". Beyond it the needle
//! slips, and what the hand feels is friction instead of the law.

use control_core::Device;
use fixed::types::I16F16;
use serde::{Deserialize, Serialize};

/// Grip and friction as a person measures them: how hard the rollers are pressed together, and what
/// the needle needs to slide.
#[derive(Clone, Copy, Debug, PartialEq, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Grip {
    /// Force with which the two rollers press on the needle, N.
    pub pressing_n: f64,
    /// Static friction between the driven roller's coat and the needle, as a share of that force.
    pub friction: f64,
}

impl Grip {
    /// Largest force along the needle before it slips, N. Only the driven roller holds it; the
    /// other one turns freely.
    pub(crate) fn slips_at_n(self) -> f64 {
        self.pressing_n * self.friction
    }

    /// Takes away torque that the rollers could not hold. `stated_mnm` is a ceiling that the file
    /// itself asks for: one above the grip is refused, for somebody counted on it.
    pub(super) fn bound(self, device: &mut Device, stated_mnm: Option<f64>) -> Result<(), String> {
        for (key, value, low, high) in
            [("pressing_n", self.pressing_n, 0.1, 200.0), ("friction", self.friction, 0.05, 2.0)]
        {
            if !(low..=high).contains(&value) {
                return Err(format!("grip.{key} is {value}; it must be from {low} to {high}"));
            }
        }
        let radius_mm = device.roller_radius.0.to_num::<f64>();
        let held_mnm = self.slips_at_n() * radius_mm;
        if let Some(stated) = stated_mnm.filter(|stated| *stated > held_mnm) {
            return Err(format!(
                "limits.torque_mnm is {stated}, {:.2} N at the roller, and the needle slips at {:.2} N; press the rollers harder or lower it",
                stated / radius_mm,
                self.slips_at_n()
            ));
        }
        device.limits.torque.0 = device.limits.torque.0.min(I16F16::saturating_from_num(held_mnm));
        Ok(())
    }
}
