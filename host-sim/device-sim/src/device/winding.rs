//! The motor's winding in a device's file: what turns the amplifier's current into torque. The
//! device itself only knows the torque at full scale, and a real one keeps nothing of this; the
//! virtual device's motor is built from it.

use crate::plant::motor::Motor;
use control_core::Device;
use serde::{Deserialize, Serialize};

/// The section `[motor]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Winding {
    /// Torque for each ampere, mN·m/A.
    pub torque_constant_mnm_per_a: f64,
    /// Largest current of the amplifier, A.
    pub current_a: f64,
    /// Supply of the amplifier, V.
    pub supply_v: f64,
}

impl Winding {
    /// Refuses a motor that cannot give the device's torque at full scale.
    pub(super) fn check(self, device: &Device) -> Result<(), String> {
        for (key, value, low, high) in [
            ("torque_constant_mnm_per_a", self.torque_constant_mnm_per_a, 1.0, 500.0),
            ("current_a", self.current_a, 0.05, 30.0),
            ("supply_v", self.supply_v, 3.0, 60.0),
        ] {
            if !(low..=high).contains(&value) {
                return Err(format!("motor.{key} is {value}; it must be from {low} to {high}"));
            }
        }
        let asked_mnm = device.full_scale_torque.0.to_num::<f64>();
        let most_mnm = self.torque_constant_mnm_per_a * self.current_a;
        // The device keeps torque in steps of 1/65536 mN·m.
        if asked_mnm > most_mnm + 1e-3 {
            return Err(format!(
                "full_scale_torque_mnm is {asked_mnm:.1}, and the motor makes {most_mnm:.1} mN·m at {} A; raise motor.current_a or lower the torque",
                self.current_a
            ));
        }
        let volts = self.motor(asked_mnm * 1e-3).resistance * asked_mnm / self.torque_constant_mnm_per_a;
        if volts > self.supply_v {
            return Err(format!(
                "full_scale_torque_mnm is {asked_mnm:.1}, for which the motor needs {volts:.1} V at rest; raise motor.supply_v or lower the torque"
            ));
        }
        Ok(())
    }

    /// Returns the motor: an RE25 wound otherwise. Resistance and inductance go with the square of
    /// the torque constant, as they do where the same copper makes more turns of a thinner wire;
    /// the current loop keeps its bandwidth.
    pub fn motor(self, full_scale_torque: f64) -> Motor {
        let usual = Motor::re25(full_scale_torque);
        let torque_constant = self.torque_constant_mnm_per_a * 1e-3;
        let turns = (torque_constant / usual.torque_constant).powi(2);
        Motor {
            resistance: usual.resistance * turns,
            inductance: usual.inductance * turns,
            current_gain: usual.current_gain * turns,
            torque_constant,
            supply: self.supply_v,
            current_limit: self.current_a,
            full_scale_torque,
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::device::device_config::DeviceConfig;
    use crate::named_files::Text;

    fn parse(text: &str) -> Result<DeviceConfig, crate::error::Error> {
        DeviceConfig::parse(Text { origin: "device.toml".into(), text: text.into() })
    }

    #[test]
    fn a_motor_that_cannot_give_the_torque_is_refused() {
        let text = include_str!("../../../devices/paper-001.toml");
        assert!(parse(text).is_ok());
        for (from, to, hint) in [
            // The RE25's own constant: 0.6 A make half of the torque.
            ("= 48.0", "= 23.4", "14.0 mN·m at 0.6 A"),
            ("= 24.0", "= 5.0", "at rest"),
            ("= 0.6", "= nan", "motor.current_a"),
            ("= 48.0", "= 0.0", "torque_constant_mnm_per_a"),
        ] {
            let said = parse(&text.replace(from, to)).expect_err(hint).to_string();
            assert!(said.contains(hint) && said.contains("device.toml") && !said.contains('\n'), "{said}");
        }
    }
}
