//! The device's part of a configuration as a person or `commission` writes it (TOML, decimal
//! numbers with their unit in the key), and as the control law takes it ([`Device`], fixed point).
//! It knows nothing of patients. Every key may be left out: the built-in device's value holds then.

use super::compensated::Compensated;
use super::grip::Grip;
use super::winding::Winding;
use crate::error::Error;
use crate::named_files::{self, Text};
use crate::profile::fix;
use control_core::config::{DacWidth, Mechanism, SafetyConfig, Sensors, SpeedMethod};
use control_core::units::{Damping, Grams, Millimetres, MillinewtonMetres, Milliradians, Newtons, Stiffness};
use control_core::{Device, Patient, Plan};
use fixed::types::I8F24;
use link::Command;
use link::commissioning::Record;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The devices that come with the program, by name.
const BUILT_IN: [(&str, &str); 1] = [("paper-001", include_str!("../../../devices/paper-001.toml"))];

/// A device's part from a file.
#[derive(Clone, Debug)]
pub struct DeviceConfig {
    /// Its name.
    pub name: String,
    /// As the control law takes it, checked.
    pub device: Device,
    /// The seal under which a device reported it, if one did.
    seal: Option<u32>,
    /// The force that its rollers hold, if measured.
    pub grip: Option<Grip>,
    /// The winding of its motor, if not the built-in one.
    pub winding: Option<Winding>,
    /// The text that it came from, for recordings.
    pub source: Text,
}

impl DeviceConfig {
    /// Reads a file, or one that comes with the program by its name.
    pub fn read(path: &Path) -> Result<Self, Error> {
        Self::parse(named_files::find("device", &path.display().to_string(), &BUILT_IN)?)
    }

    /// Checks the text of one.
    pub fn parse(source: Text) -> Result<Self, Error> {
        let file: File = named_files::parse(&source)?;
        let refuse = |what: String| Error::input(format_args!("{}: {what}", source.origin));
        if file.format != 1 {
            return Err(refuse(format!("format is {}; this program reads format 1", file.format)));
        }
        let device = file.device().map_err(refuse)?;
        Plan::new(&device, &Patient::nobody()).map_err(|why| refuse(why.to_string()))?;
        Ok(Self { name: file.name, device, seal: file.seal, grip: file.grip, winding: file.motor, source })
    }

    /// The command that gives it to a device.
    pub fn command(&self) -> Command {
        let device = self.device;
        self.seal
            .map_or(Command::ConfigureDevice(device), |seal| Command::RestoreDevice(Record { device, seal }))
    }
}

/// Returns the text of a device's part as the device reported it. [`DeviceConfig::parse`] reads the
/// same values from it, to the last digit.
pub fn to_toml(name: &str, record: &Record) -> Result<String, Error> {
    toml::to_string(&File::new(name, record)).map_err(Error::failed)
}

#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: u32,
    name: String,
    /// As `commission` writes it; without it, the device refuses to start.
    #[serde(default)]
    commissioned: bool,
    /// The seal as the device reported it, by which the device recognises its own record.
    seal: Option<u32>,
    #[serde(default)]
    drive: Drive,
    #[serde(default)]
    limits: Limits,
    #[serde(default)]
    control: Control,
    #[serde(default)]
    mechanism: Moving,
    #[serde(default)]
    sensors: Fitted,
    compensation: Option<Compensated>,
    grip: Option<Grip>,
    motor: Option<Winding>,
}

#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Drive {
    roller_radius_mm: Option<f64>,
    counts_per_turn: Option<u16>,
    encoder_reversed: Option<bool>,
    full_scale_torque_mnm: Option<f64>,
    /// Two standard deviations, as a weight on the needle has shown it.
    full_scale_uncertainty_percent: Option<f64>,
    dac_bits: Option<u8>,
    dac_zero_codes: Option<i16>,
    motor_reversed: Option<bool>,
    skin_tilt_deg: Option<f64>,
}

#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Limits {
    torque_mnm: Option<f64>,
    continuous_torque_mnm: Option<f64>,
    winding_time_s: Option<u16>,
    slew_mnm_per_tick: Option<f64>,
    fade_in_ms: Option<u16>,
    max_counts_per_tick: Option<u16>,
    travel_mm: Option<f64>,
    stiffness_n_per_mm: Option<f64>,
    heartbeat_ms: Option<u16>,
}

/// The moving mechanism, which limits the stiffness of a wall.
#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Moving {
    mass_g: Option<f64>,
    dry_friction_n: Option<f64>,
    delay_us: Option<u16>,
}

/// The optional sensors that commissioning found.
#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
struct Fitted {
    encoder_supply: bool,
    current: bool,
}

#[derive(Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Control {
    speed: Option<Speed>,
    damping_n_s_per_mm: Option<f64>,
    passivity_damping_n_s_per_mm: Option<f64>,
}

#[derive(Clone, Copy, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Speed {
    Window,
    EdgeTiming,
}

fn damping(key: &str, value: f64) -> Result<Damping, String> {
    let held = I8F24::checked_from_num(value);
    held.map(Damping).ok_or_else(|| format!("{key} is {value}; it must be a small number: 0.00002 is usual"))
}

fn tilt(key: &str, degrees: f64) -> Result<Milliradians, String> {
    if !(-90.0..=90.0).contains(&degrees) {
        return Err(format!("{key} is {degrees} degrees; it must be from -90 to 90 degrees"));
    }
    Ok(Milliradians((degrees.to_radians() * 1e3).round() as i16))
}

impl File {
    fn device(&self) -> Result<Device, String> {
        let (mut device, drive, control) = (Device::default(), &self.drive, &self.control);
        device.commissioned = self.commissioned;
        if let Some(radius) = drive.roller_radius_mm {
            device.roller_radius = Millimetres(fix("roller_radius_mm", radius)?);
        }
        if let Some(torque) = drive.full_scale_torque_mnm {
            device.full_scale_torque = MillinewtonMetres(fix("full_scale_torque_mnm", torque)?);
        }
        if let Some(percent) = drive.full_scale_uncertainty_percent {
            if !(0.0..=100.0).contains(&percent) {
                return Err(format!("full_scale_uncertainty_percent is {percent}; it must be from 0 to 100"));
            }
            device.torque_uncertainty = (percent * 10.0).round() as u16;
        }
        if let Some(bits) = drive.dac_bits {
            device.dac =
                DacWidth::try_from(bits).map_err(|_| format!("dac_bits is {bits}; it must be 8 to 16"))?;
        }
        if let Some(degrees) = drive.skin_tilt_deg {
            device.skin_tilt = tilt("skin_tilt_deg", degrees)?;
        }
        device.counts_per_turn = drive.counts_per_turn.unwrap_or(device.counts_per_turn);
        device.encoder_reversed = drive.encoder_reversed.unwrap_or(device.encoder_reversed);
        device.dac_zero = drive.dac_zero_codes.unwrap_or(device.dac_zero);
        device.motor_reversed = drive.motor_reversed.unwrap_or(device.motor_reversed);
        self.limits.set(&mut device.limits)?;
        if let Some(speed) = control.speed {
            device.speed = match speed {
                Speed::Window => SpeedMethod::Window,
                Speed::EdgeTiming => SpeedMethod::EdgeTiming,
            };
        }
        if let Some(value) = control.damping_n_s_per_mm {
            device.damping = damping("damping_n_s_per_mm", value)?;
        }
        if let Some(value) = control.passivity_damping_n_s_per_mm {
            device.passivity_damping = damping("passivity_damping_n_s_per_mm", value)?;
        }
        self.mechanism.set(&mut device.mechanism)?;
        let Fitted { encoder_supply, current } = self.sensors;
        device.sensors = Sensors { encoder_supply, current };
        if let Some(compensation) = &self.compensation {
            device.compensation = compensation.compensation()?;
        }
        if let Some(grip) = self.grip {
            grip.bound(&mut device, self.limits.torque_mnm)?;
        }
        if let Some(winding) = self.motor {
            winding.check(&device)?;
        }
        Ok(device)
    }

    fn new(name: &str, Record { device, seal }: &Record) -> Self {
        let limits = &device.limits;
        Self {
            format: 1,
            name: name.to_owned(),
            commissioned: device.commissioned,
            seal: Some(*seal),
            drive: Drive {
                roller_radius_mm: Some(device.roller_radius.0.to_num()),
                counts_per_turn: Some(device.counts_per_turn),
                encoder_reversed: Some(device.encoder_reversed),
                full_scale_torque_mnm: Some(device.full_scale_torque.0.to_num()),
                full_scale_uncertainty_percent: (device.torque_uncertainty > 0)
                    .then(|| f64::from(device.torque_uncertainty) / 10.0),
                dac_bits: Some(device.dac.bits()),
                dac_zero_codes: Some(device.dac_zero),
                motor_reversed: Some(device.motor_reversed),
                skin_tilt_deg: Some((f64::from(device.skin_tilt.0) * 1e-3).to_degrees()),
            },
            limits: Limits {
                torque_mnm: Some(limits.torque.0.to_num()),
                continuous_torque_mnm: Some(limits.continuous_torque.0.to_num()),
                winding_time_s: Some(limits.winding_time_s),
                slew_mnm_per_tick: Some(limits.slew_per_tick.0.to_num()),
                fade_in_ms: Some(limits.fade_in_ms),
                max_counts_per_tick: Some(limits.max_counts_per_tick),
                travel_mm: Some(limits.travel.0.to_num()),
                stiffness_n_per_mm: Some(limits.stiffness.0.to_num()),
                heartbeat_ms: Some(limits.heartbeat_ms),
            },
            control: Control {
                speed: Some(match device.speed {
                    SpeedMethod::Window => Speed::Window,
                    SpeedMethod::EdgeTiming => Speed::EdgeTiming,
                }),
                damping_n_s_per_mm: Some(device.damping.0.to_num()),
                passivity_damping_n_s_per_mm: Some(device.passivity_damping.0.to_num()),
            },
            mechanism: Moving {
                mass_g: Some(device.mechanism.mass.0.to_num()),
                dry_friction_n: Some(device.mechanism.dry_friction.0.to_num()),
                delay_us: Some(device.mechanism.delay_us),
            },
            sensors: Fitted {
                encoder_supply: device.sensors.encoder_supply,
                current: device.sensors.current,
            },
            // It is the ceiling of torque that a device keeps of it.
            grip: None,
            // A device knows its torque at full scale and no current.
            motor: None,
            compensation: device.compensation.is_some().then(|| Compensated::new(&device.compensation)),
        }
    }
}

impl Moving {
    fn set(&self, mechanism: &mut Mechanism) -> Result<(), String> {
        if let Some(value) = self.mass_g {
            mechanism.mass = Grams(fix("mass_g", value)?);
        }
        if let Some(value) = self.dry_friction_n {
            mechanism.dry_friction = Newtons(fix("dry_friction_n", value)?);
        }
        mechanism.delay_us = self.delay_us.unwrap_or(mechanism.delay_us);
        Ok(())
    }
}

impl Limits {
    fn set(&self, limits: &mut SafetyConfig) -> Result<(), String> {
        if let Some(value) = self.torque_mnm {
            limits.torque = MillinewtonMetres(fix("torque_mnm", value)?);
        }
        if let Some(value) = self.continuous_torque_mnm {
            limits.continuous_torque = MillinewtonMetres(fix("continuous_torque_mnm", value)?);
        }
        if let Some(value) = self.slew_mnm_per_tick {
            limits.slew_per_tick = MillinewtonMetres(fix("slew_mnm_per_tick", value)?);
        }
        if let Some(value) = self.travel_mm {
            limits.travel = Millimetres(fix("travel_mm", value)?);
        }
        if let Some(value) = self.stiffness_n_per_mm {
            limits.stiffness = Stiffness(fix("stiffness_n_per_mm", value)?);
        }
        limits.winding_time_s = self.winding_time_s.unwrap_or(limits.winding_time_s);
        limits.fade_in_ms = self.fade_in_ms.unwrap_or(limits.fade_in_ms);
        limits.max_counts_per_tick = self.max_counts_per_tick.unwrap_or(limits.max_counts_per_tick);
        limits.heartbeat_ms = self.heartbeat_ms.unwrap_or(limits.heartbeat_ms);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control_core::units::MillimetresPerSecond;
    use fixed::types::I16F16;

    fn parse(text: &str) -> Result<DeviceConfig, Error> {
        DeviceConfig::parse(Text { origin: "device.toml".into(), text: text.into() })
    }

    #[test]
    fn what_is_left_out_is_the_built_in_devices() {
        let part = parse("format = 1\nname = \"bench 3\"\n[drive]\nmotor_reversed = true\n").expect("sound");
        assert_eq!(part.device, Device { motor_reversed: true, ..Device::default() });
        assert_eq!(part.name, "bench 3");
        assert_eq!(part.command(), Command::ConfigureDevice(part.device), "no device has told it");
    }

    #[test]
    fn what_is_written_is_read_again_to_the_last_place() {
        let mut device = Device {
            encoder_reversed: true,
            dac: DacWidth::BITS_8,
            dac_zero: -3,
            skin_tilt: Milliradians(-123),
            speed: SpeedMethod::EdgeTiming,
            counts_per_turn: 2_048,
            sensors: Sensors { encoder_supply: true, current: false },
            torque_uncertainty: 17,
            ..Device::commissioned_virtual()
        };
        device.limits.winding_time_s = 30;
        device.compensation = crate::device::compensated::tests::something();
        // A count of so coarse an encoder is 2.4 mm/s in a speed window.
        device.compensation.rest_speed = MillimetresPerSecond(I16F16::from_num(3));
        device.limits.torque.0 /= 3;
        let record = Record::of(&device, [7; 12]);
        let part = parse(&to_toml("mine", &record).expect("it can be written")).expect("sound");
        assert_eq!(part.device, device);
        assert_eq!(part.command(), Command::RestoreDevice(record));
    }

    #[test]
    fn no_torque_is_given_that_the_rollers_do_not_hold() {
        // 6 N of pressing at 0.35 hold 2.1 N: 21 mN·m on a roller of 10 mm, instead of 28.8.
        let gripped =
            "format = 1\nname = \"x\"\ncommissioned = true\n[grip]\npressing_n = 6.0\nfriction = 0.35\n";
        let part = parse(gripped).expect("sound");
        assert!((part.device.limits.torque.0.to_num::<f64>() - 21.0).abs() < 1e-3);
        // The shoulder at its scale asks for 2.86 N: refused before it starts. An adult's 1.0 N is
        // fine.
        let refused =
            crate::profile::Profile::find_for("shoulder", &part.device).expect_err("too strong").to_string();
        assert!(refused.contains("N") && !refused.contains('\n'), "{refused}");
        assert!(crate::profile::Profile::find_for("adult", &part.device).is_ok());
        // A firm grip takes nothing away; a stated ceiling above a loose one is refused.
        let firm = parse(&gripped.replace("6.0", "20.0")).expect("sound");
        assert_eq!(firm.device.limits.torque, Device::default().limits.torque);
        let stated =
            parse(&format!("{gripped}[limits]\ntorque_mnm = 25.0\n")).expect_err("above").to_string();
        assert!(stated.contains("slips at 2.10 N") && stated.contains("device.toml"), "{stated}");
        for (wrong, hint) in [("6.0", "0.0"), ("6.0", "nan"), ("0.35", "5.0")] {
            assert!(parse(&gripped.replacen(wrong, hint, 1)).is_err(), "{hint}");
        }
    }

    #[test]
    fn mistakes_and_a_patients_keys_are_refused_by_name() {
        for (wrong, hint) in [
            ("format = 1\nname = \"x\"\n[[layer]]\ntissue = \"skin\"", "layer"),
            ("format = 1\nname = \"x\"\n[drive]\nroller_radius_mm = 90.0", "roller_radius_mm is"),
            ("format = 1\nname = \"x\"\n[drive]\nroller_radius_mm = nan", "roller_radius_mm"),
            ("format = 1\nname = \"x\"\n[drive]\ndac_bits = 17", "dac_bits"),
            ("format = 1\nname = \"x\"\n[drive]\nskin_tilt_deg = 120.0", "skin_tilt_deg"),
            ("format = 2\nname = \"x\"", "format is 2"),
        ] {
            let said = parse(wrong).expect_err(hint).to_string();
            assert!(said.contains(hint) && said.contains("device.toml") && !said.contains('\n'), "{said}");
        }
    }
}
