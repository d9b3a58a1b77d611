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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::device::device_config::DeviceConfig;
    use crate::device::virtual_device::VirtualDevice;
    use crate::named_files::Text;
    use crate::procedure::Procedure;
    use crate::profile::Profile;

    /// The adult's skin gives way at 1 N. Rollers that hold 0.3 N slip, which is said once for the
    /// skin; rollers that hold 7 N do not.
    #[test]
    fn a_needle_that_slips_is_reported() {
        let adult = Profile::find("adult").expect("it is built in");
        for (pressing_n, wanted) in [(20.0, 0..=0), (0.86, 1..=3)] {
            let file =
                "format = 1\nname = \"x\"\ncommissioned = true\n[grip]\npressing_n = 20.0\nfriction = 0.35\n";
            let mut part =
                DeviceConfig::parse(Text { origin: "device.toml".into(), text: file.into() }).expect("sound");
            // As loose as no file may say: less than the torque asks for.
            part.grip = Some(Grip { pressing_n, friction: 0.35 });
            let procedure = Procedure::find("venepuncture", &adult).expect("it is built in");
            let mut device = VirtualDevice::built(&adult, procedure, Some(&part));
            device.start_alone();
            let mut said = Vec::new();
            for _ in 0..50_000 {
                device.tick_alone();
                said.extend(device.take_done());
            }
            let count = said.iter().filter(|name| **name == "slipping").count();
            assert!(wanted.contains(&count), "{pressing_n} N: {said:?}");
        }
    }
}
