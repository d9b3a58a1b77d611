//! The compensation of a device's part as a file has it: torques in mN·m, phases in degrees, gains
//! as shares.

use crate::profile::fix;
use control_core::compensation::{Compensation, Friction, Gain, Gains, VERSION, Wave};
use control_core::units::{Damping, MillimetresPerSecond, MillinewtonMetres};
use fixed::types::I8F24;
use serde::{Deserialize, Serialize};

/// The section `[compensation]`.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Compensated {
    version: u8,
    rest_speed_mm_s: f64,
    full_speed_mm_s: f64,
    weight_mnm: f64,
    offset_mnm: f64,
    deadband_mnm: f64,
    inwards: Rubbing,
    outwards: Rubbing,
    gains: Shares,
    #[serde(default)]
    angle: Vec<Periodic>,
    #[serde(default)]
    ripple: Vec<Periodic>,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Rubbing {
    dry_mnm: f64,
    viscous_n_s_per_mm: f64,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Shares {
    angle: f64,
    friction: f64,
    weight: f64,
    drive: f64,
}

/// A wave: its amplitude is in mN·m, or a share for the ripple.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Periodic {
    order: u16,
    amplitude: f64,
    phase_deg: f64,
}

/// The nearest gain to a share of 0 to 1; at 1, the one just below.
pub fn gain(share: f64) -> Gain {
    Gain((share * 256.0).round().clamp(0.0, 255.0) as u8)
}

/// The nearest phase, of which 65,536 are a turn.
pub fn phase(degrees: f64) -> u16 {
    (degrees.rem_euclid(360.0) / 360.0 * 65_536.0).round() as u32 as u16
}

impl Compensated {
    pub(super) fn new(found: &Compensation) -> Self {
        let rubbing = |friction: &Friction| Rubbing {
            dry_mnm: friction.dry.0.to_num(),
            viscous_n_s_per_mm: friction.viscous.0.to_num(),
        };
        let share = |gain: Gain| f64::from(gain.0) / 256.0;
        let periodic = |waves: &[Wave]| {
            let waves = waves.iter().take_while(|wave| wave.order != 0);
            waves
                .map(|wave| Periodic {
                    order: wave.order,
                    amplitude: wave.amplitude.to_num(),
                    phase_deg: f64::from(wave.phase) * 360.0 / 65_536.0,
                })
                .collect()
        };
        let gains = found.gains;
        Self {
            version: found.version,
            rest_speed_mm_s: found.rest_speed.0.to_num(),
            full_speed_mm_s: found.full_speed.0.to_num(),
            weight_mnm: found.weight.0.to_num(),
            offset_mnm: found.offset.0.to_num(),
            deadband_mnm: found.deadband.0.to_num(),
            inwards: rubbing(&found.inwards),
            outwards: rubbing(&found.outwards),
            gains: Shares {
                angle: share(gains.angle),
                friction: share(gains.friction),
                weight: share(gains.weight),
                drive: share(gains.drive),
            },
            angle: periodic(&found.angle),
            ripple: periodic(&found.ripple),
        }
    }

    pub(super) fn compensation(&self) -> Result<Compensation, String> {
        if self.version != VERSION {
            return Err(format!(
                "compensation.version is {}; this program reads version {VERSION}: compensate again",
                self.version
            ));
        }
        let torque = |key: &str, value: f64| fix(key, value).map(MillinewtonMetres);
        let speed = |key: &str, value: f64| fix(key, value).map(MillimetresPerSecond);
        let rubbing = |key: &str, r: &Rubbing| -> Result<Friction, String> {
            let viscous = I8F24::checked_from_num(r.viscous_n_s_per_mm).ok_or_else(|| {
                format!("{key}.viscous_n_s_per_mm is {}; it must be a small number", r.viscous_n_s_per_mm)
            })?;
            Ok(Friction { dry: torque(&format!("{key}.dry_mnm"), r.dry_mnm)?, viscous: Damping(viscous) })
        };
        let share = |key: &str, share: f64| {
            let held = (0.0..1.0).contains(&share).then(|| gain(share));
            held.ok_or_else(|| format!("gains.{key} is {share}; it must be from 0 to below 1"))
        };
        Ok(Compensation {
            version: self.version,
            angle: waves("angle", &self.angle)?,
            ripple: waves("ripple", &self.ripple)?,
            inwards: rubbing("inwards", &self.inwards)?,
            outwards: rubbing("outwards", &self.outwards)?,
            rest_speed: speed("rest_speed_mm_s", self.rest_speed_mm_s)?,
            full_speed: speed("full_speed_mm_s", self.full_speed_mm_s)?,
            weight: torque("weight_mnm", self.weight_mnm)?,
            offset: torque("offset_mnm", self.offset_mnm)?,
            deadband: torque("deadband_mnm", self.deadband_mnm)?,
            gains: Gains {
                angle: share("angle", self.gains.angle)?,
                friction: share("friction", self.gains.friction)?,
                weight: share("weight", self.gains.weight)?,
                drive: share("drive", self.gains.drive)?,
            },
        })
    }
}

fn waves<const N: usize>(key: &str, given: &[Periodic]) -> Result<[Wave; N], String> {
    if given.len() > N {
        return Err(format!("{key} has {} waves; at most {N} are possible", given.len()));
    }
    let mut waves = [Wave::default(); N];
    for (wave, periodic) in waves.iter_mut().zip(given) {
        let Periodic { order, amplitude, phase_deg } = *periodic;
        if order == 0 || !phase_deg.is_finite() {
            return Err(format!("{key} has a wave of order {order} and phase {phase_deg}; correct it"));
        }
        *wave =
            Wave { order, amplitude: fix(&format!("{key}.amplitude"), amplitude)?, phase: phase(phase_deg) };
    }
    Ok(waves)
}

#[cfg(test)]
pub(in crate::device) mod tests {
    use super::*;
    use fixed::types::I16F16;

    /// A compensation with a value in every place.
    pub(in crate::device) fn something() -> Compensation {
        let mut found = Compensation {
            inwards: Friction {
                dry: MillinewtonMetres(I16F16::from_num(0.4)),
                viscous: Damping(I8F24::from_num(1.2e-5)),
            },
            outwards: Friction {
                dry: MillinewtonMetres(I16F16::from_num(0.5)),
                viscous: Damping(I8F24::from_num(1.0e-5)),
            },
            weight: MillinewtonMetres(I16F16::from_num(1.5)),
            offset: MillinewtonMetres(I16F16::from_num(-0.1)),
            deadband: MillinewtonMetres(I16F16::from_num(0.2)),
            gains: Gains { angle: Gain(230), friction: Gain(200), weight: Gain(243), drive: Gain(1) },
            ..Compensation::NONE
        };
        found.angle[0] = Wave { order: 14, amplitude: I16F16::from_num(0.31), phase: 65_535 };
        found.ripple[0] = Wave { order: 7, amplitude: I16F16::from_num(0.03), phase: 1 };
        found
    }

    #[test]
    fn mistakes_are_named() {
        let sound = toml::to_string(&Compensated::new(&something())).expect("it can be written");
        for (from, to, hint) in [
            ("version = 1", "version = 2", "compensate again"),
            ("order = 14", "order = 0", "order 0"),
            ("friction = 0.78125", "friction = 1.0", "gains.friction"),
        ] {
            assert!(sound.contains(from), "{sound}");
            let wrong: Compensated = toml::from_str(&sound.replace(from, to)).expect("it can be read");
            let said = wrong.compensation().expect_err(hint);
            assert!(said.contains(hint), "{said}");
        }
        assert_eq!((gain(1.0), gain(-1.0), phase(-90.0)), (Gain(255), Gain(0), 49_152));
    }
}
