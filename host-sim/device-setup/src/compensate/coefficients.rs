//! From what a diagnosis found (its patched rig) to the numbers that the device feeds forward. Pure
//! calculation.

use control_core::compensation::{Compensation, Friction, Gains, Wave};
use control_core::kinematics::WINDOW_TICKS;
use control_core::units::{Damping, MillimetresPerSecond, MillinewtonMetres};
use control_core::{Device, TICK_HZ};
use device_sim::device::compensated::gain;
use device_sim::error::Error;
use diagnosis::laws::{Effect, EffectName};
use diagnosis::rig::{Kind, Rig};
use fixed::types::{I8F24, I16F16};
use std::f64::consts::TAU;

/// Gains at `--gain 1`: so much of what was found. Of friction less, for it is what keeps a stiff
/// wall quiet.
const FULL_GAINS: [f64; 4] = [0.92, 0.8, 0.92, 0.92];
/// Friction is given back above so many counts in a window of the speed estimate, and all of it
/// from so many on: slow hands insert at 3 mm/s, where a count in a window is 1.2 mm/s.
const REST_COUNTS: f64 = 1.06;
const FULL_COUNTS: f64 = 2.5;
/// An order may be off a whole number by so much, and is rounded.
const WHOLE: f64 = 0.02;

/// The coefficients to feed forward, and the findings that are not.
#[derive(Clone, Debug)]
pub struct Found {
    /// For the device.
    pub compensation: Compensation,
    /// Waves by angle in N·m on the device's scale: order, amplitude, phase in rad. For finding the
    /// rotor's angle.
    pub waves: Vec<(u16, f64, f64)>,
    /// Inertia in kg·m² on the device's scale.
    pub inertia: f64,
    /// True if the rig has a weight, found or given; one of zero counts.
    pub has_weight: bool,
    /// The findings that cannot be fed forward, a sentence each.
    pub left_out: Vec<String>,
}

/// Returns the coefficients that `rig` gives for `device`, every gain at `share` of the usual one.
pub fn found(rig: &Rig, device: &Device, share: f64) -> Result<Found, Error> {
    if rig.kind != Kind::Rotary || rig.actuator.command_unit != "dac" {
        return Err(Error::input(
            "the report is not of this device: a device is rotary and commanded in DAC steps; diagnose what characterise has recorded",
        ));
    }
    let full_scale = device.full_scale_torque.0.to_num::<f64>() * 1e-3;
    // A device knows torque by its own full scale; the fit knows it by the inertia.
    let scale = full_scale / f64::from(device.dac.span()) / rig.actuator.gain;
    let mut sums = NormalEquations::new(rig, scale, full_scale / f64::from(device.dac.span()));
    rig.effects.iter().for_each(|effect| sums.add(effect));
    sums.finish(device, share, rig.model.inertia * scale)
}

/// The parts while effects are gone through, on the device's scale.
struct NormalEquations {
    scale: f64,
    per_code: f64,
    dry: [f64; 2],
    viscous: [f64; 2],
    weight: f64,
    has_weight: bool,
    offset: f64,
    deadband: f64,
    waves: Vec<(u16, f64, f64)>,
    ripple: Vec<(u16, f64, f64)>,
    left_out: Vec<String>,
}

impl NormalEquations {
    fn new(rig: &Rig, scale: f64, per_code: f64) -> Self {
        let model = &rig.model;
        let value = |x: Option<f64>| x.unwrap_or(0.0) * scale;
        Self {
            scale,
            per_code,
            dry: [value(model.coulomb); 2],
            viscous: [value(model.viscous); 2],
            weight: value(model.weight),
            has_weight: model.weight.is_some(),
            offset: value(model.offset),
            deadband: 0.0,
            waves: Vec::new(),
            ripple: Vec::new(),
            left_out: Vec::new(),
        }
    }

    fn add(&mut self, effect: &Effect) {
        let value = |key: &str| effect.coefficients.get(key).copied().unwrap_or(0.0) * self.scale;
        match effect.name {
            EffectName::CoulombFriction => self.dry = self.dry.map(|dry| dry + value("coulomb")),
            EffectName::ViscousFriction => self.viscous = self.viscous.map(|b| b + value("viscous")),
            EffectName::AsymmetricFriction => {
                let (dry, viscous) = (value("coulomb_difference"), value("viscous_difference"));
                self.dry = [self.dry[0] + dry, self.dry[1] - dry];
                self.viscous = [self.viscous[0] + viscous, self.viscous[1] - viscous];
            }
            EffectName::TiltGravity => {
                self.weight += value("weight");
                self.has_weight = true;
            }
            EffectName::Cogging | EffectName::MassImbalance => {
                let waves = self.read_waves(effect, self.scale);
                self.waves.extend(waves);
            }
            // Of the drive's own torque: a share.
            EffectName::TorqueRipple => {
                let waves = self.read_waves(effect, 1.0);
                self.ripple.extend(waves);
            }
            other => match effect.shifted_dead_band() {
                Some(half_width) => self.deadband = half_width * self.per_code,
                None => self.left_out.push(format!("{} is not fed forward", other.in_words())),
            },
        }
    }

    /// Order, amplitude and phase of each wave of `amplitude·sin(order·angle + phase)`.
    fn read_waves(&mut self, effect: &Effect, scale: f64) -> Vec<(u16, f64, f64)> {
        let mut waves = effect.waves();
        if waves.is_empty() {
            waves.push(("1".into(), 1.0));
        }
        let value = |key: String| effect.coefficients.get(&key).copied().unwrap_or(0.0) * scale;
        let mut read = Vec::new();
        for (name, per_rad) in waves {
            let (cos, sin) = (value(format!("cos_{name}")), value(format!("sin_{name}")));
            let order = per_rad.round();
            if (per_rad - order).abs() > WHOLE || !(1.0..=500.0).contains(&order) {
                self.left_out.push(format!("a wave of {per_rad:.3} periods a turn is not fed forward"));
            } else {
                read.push((order as u16, cos.hypot(sin), cos.atan2(sin)));
            }
        }
        read
    }

    fn finish(mut self, device: &Device, share: f64, inertia: f64) -> Result<Found, Error> {
        // Less than half a code is nothing that the drive could give.
        let waves =
            strongest::<{ control_core::compensation::MAX_WAVES }>(&mut self.waves, 0.5 * self.per_code);
        let ripple = strongest::<{ control_core::compensation::MAX_RIPPLES }>(&mut self.ripple, 1e-3);
        let radius = device.roller_radius.0.to_num::<f64>();
        let mnm = |torque: f64| fixed(torque * 1e3).map(MillinewtonMetres);
        let friction = |direction: usize| -> Result<Friction, Error> {
            // N·m·s/rad over the radius squared in mm² is N·s/mm over a thousand.
            let viscous = self.viscous[direction].max(0.0) * 1e3 / (radius * radius);
            let viscous = I8F24::checked_from_num(viscous).ok_or_else(|| not_a_size(viscous))?;
            Ok(Friction { dry: mnm(self.dry[direction].max(0.0))?, viscous: Damping(viscous) })
        };
        let [angle_gain, friction_gain, weight_gain, drive_gain] = FULL_GAINS.map(|most| gain(most * share));
        let count_speed =
            TAU * radius / f64::from(device.counts_per_turn) * f64::from(TICK_HZ) / f64::from(WINDOW_TICKS);
        let speed = |counts: f64| fixed(counts * count_speed).map(MillimetresPerSecond);
        let compensation = Compensation {
            rest_speed: speed(REST_COUNTS)?,
            full_speed: speed(FULL_COUNTS)?,
            angle: fixed_waves(&waves, 1e3)?,
            ripple: fixed_waves(&ripple, 1.0)?,
            inwards: friction(0)?,
            outwards: friction(1)?,
            weight: mnm(self.weight)?,
            offset: mnm(self.offset)?,
            deadband: mnm(self.deadband)?,
            gains: Gains {
                angle: angle_gain,
                friction: friction_gain,
                weight: weight_gain,
                drive: drive_gain,
            },
            ..Compensation::NONE
        };
        if !compensation.is_some() {
            return Err(Error::input(
                "the report found nothing that a device can feed forward; see report.html for what it found",
            ));
        }
        Ok(Found { compensation, waves, inertia, has_weight: self.has_weight, left_out: self.left_out })
    }
}

/// The strongest waves of at least `least`.
fn strongest<const N: usize>(waves: &mut Vec<(u16, f64, f64)>, least: f64) -> Vec<(u16, f64, f64)> {
    waves.retain(|wave| wave.1 >= least);
    waves.sort_by(|a, b| b.1.total_cmp(&a.1));
    waves.iter().take(N).copied().collect()
}

fn fixed_waves<const N: usize>(waves: &[(u16, f64, f64)], unit: f64) -> Result<[Wave; N], Error> {
    let mut fixed_waves = [Wave::default(); N];
    for (wave, &(order, amplitude, phase)) in fixed_waves.iter_mut().zip(waves) {
        let phase = device_sim::device::compensated::phase((phase / TAU) * 360.0);
        *wave = Wave { order, amplitude: fixed(amplitude * unit)?, phase };
    }
    Ok(fixed_waves)
}

fn fixed(value: f64) -> Result<I16F16, Error> {
    I16F16::checked_from_num(value).ok_or_else(|| not_a_size(value))
}

fn not_a_size(value: f64) -> Error {
    Error::input(format_args!("the report has a value of {value}, which no device can give; diagnose again"))
}
