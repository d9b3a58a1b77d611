//! The configuration that a person writes, in physical units. It travels over the link and is kept
//! in flash; it says nothing about whether it is safe: only [`crate::plan::Plan::new`] does.

use crate::compensation::Compensation;
use crate::interlock::Interlock;
use crate::units::{
    Damping, FrictionPerMillimetre, Grams, JogCompliance, Millimetres, MillinewtonMetres, Milliradians,
    Newtons, Stiffness,
};
use fixed::types::I16F16;
use heapless::Vec;
use serde::{Deserialize, Serialize};

pub use crate::kinematics::SpeedMethod;
pub use crate::law::{
    Cutting, Fixture, ForceTable, FrictionLaw, Law, Lugre, MAX_ANGLES, MAX_DEPTHS, MAX_SPEEDS, Sparte,
};
pub use crate::tissue::{Layer, MAX_LAYERS, Parabola, SPRING_BACK, Tissue, Vessel, Wall};

/// All that the control law needs to know: the two parts, which are sent and stored apart. Neither
/// holds the other's keys.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Config {
    /// The device, as found when it was commissioned; it changes rarely.
    pub device: Device,
    /// Whom the needle goes into; every session sends it.
    pub patient: Patient,
}

impl Config {
    /// The default patient on [`Device::commissioned_virtual`].
    pub fn commissioned_virtual() -> Self {
        Self { device: Device::commissioned_virtual(), patient: Patient::default() }
    }
}

/// The device as it was built and commissioned: roller, encoder, converter, and what it never
/// exceeds, whoever the patient is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Device {
    /// Radius of the roller on the motor shaft, 4–25 mm.
    pub roller_radius: Millimetres,
    /// Encoder counts a turn after quadrature, 256–65,535.
    pub counts_per_turn: u16,
    /// The encoder counts down where the needle goes in.
    pub encoder_reversed: bool,
    /// Torque at the converter's full scale, from the amplifier's gain and the motor's torque
    /// constant. A calibration value.
    pub full_scale_torque: MillinewtonMetres,
    /// The converter.
    pub dac: DacWidth,
    /// The code at which the amplifier gives no torque, in codes past mid-scale: at most a
    /// sixteenth of the converter's span.
    pub dac_zero: i16,
    /// A code above zero drives the needle outwards.
    pub motor_reversed: bool,
    /// The reading of the needle's tilt when the needle is laid on the skin: −1,571 to 1,571 mrad.
    /// Measured tilt less this is the angle to the skin.
    pub skin_tilt: Milliradians,
    /// The limits that the device never exceeds.
    pub limits: SafetyConfig,
    /// The estimator of speed.
    pub speed: SpeedMethod,
    /// Damping added everywhere, for stability.
    pub damping: Damping,
    /// Damping added only while the tissue would give back more energy than it was given; 0 leaves
    /// the observer off.
    pub passivity_damping: Damping,
    /// The moving mechanism, which decides how stiff a wall may be.
    pub mechanism: Mechanism,
    /// The compensation of the device's own forces.
    pub compensation: Compensation,
    /// True if the values above were found on this device. Without it no torque is given but
    /// [`crate::excitation::GENTLE_TORQUE`].
    pub commissioned: bool,
    /// The optional sensors that commissioning found: without one of them it does not start.
    pub sensors: Sensors,
    /// The uncertainty of [`Self::full_scale_torque`] where a known weight was hung on the needle:
    /// two standard deviations, in thousandths of it. 0 where nobody did.
    pub torque_uncertainty: u16,
}

/// The optional sensors of the drive.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Sensors {
    /// The encoder's supply is sensed.
    pub encoder_supply: bool,
    /// The motor's current is measured.
    pub current: bool,
}

impl Sensors {
    /// The interlock of the first of these that is not among `fitted`.
    pub fn missing_in(self, fitted: Self) -> Option<Interlock> {
        if self.encoder_supply && !fitted.encoder_supply {
            Some(Interlock::EncoderSupplyUnsensed)
        } else {
            (self.current && !fitted.current).then_some(Interlock::CurrentUnmeasured)
        }
    }
}

/// The mass and friction that move with the roller, and the delay of the motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Mechanism {
    /// The mass of rotor, roller and needle, as felt along the needle, 1–1,000 g.
    pub mass: Grams,
    /// Dry friction along the needle, 0–10 N.
    pub dry_friction: Newtons,
    /// The delay from the reading of the encoder to the torque at the shaft, 20–1,000 µs, without
    /// the time for which a code is held.
    pub delay_us: u16,
}

impl Default for Mechanism {
    /// The mechanism that the design notes assume: 30 g, 0.06 N, and a tick for converter and
    /// amplifier.
    fn default() -> Self {
        Self {
            mass: Grams(I16F16::from_bits(30 << 16)),
            dry_friction: Newtons(I16F16::from_bits(3_932)),
            delay_us: 100,
        }
    }
}

/// Whom the needle goes into: tissue, its law of force, and limits of its own, which may be
/// narrower than the device's and never wider.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Patient {
    /// Largest force at the roller, where it is to be less than what the device gives.
    pub largest_force: Option<Newtons>,
    /// All forces of the law are given to the hand at this share, 0.1–1: a declared scale where
    /// they are more than the motor has.
    pub scale: I16F16,
    /// The law of force.
    pub law: Law,
    /// The tissue, outermost layer first.
    pub layers: Vec<Layer, MAX_LAYERS>,
    /// The vessel's properties beyond its layers; without it, the needle goes through its axis.
    pub vessel: Option<Vessel>,
}

/// Resolution of the converter that drives the amplifier, 8–16 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "WidthCode", into = "WidthCode")]
pub struct DacWidth(u8);

/// A width as it is sent and stored: the number of its bits, but for the two that were the only
/// ones before they were numbers.
#[derive(Clone, Copy, Serialize, Deserialize)]
struct WidthCode(u8);

impl WidthCode {
    const EIGHT: u8 = 0;
    const TWELVE: u8 = 1;
}

impl TryFrom<WidthCode> for DacWidth {
    type Error = NoWidth;

    fn try_from(WidthCode(code): WidthCode) -> Result<Self, NoWidth> {
        match code {
            WidthCode::EIGHT => Ok(Self::BITS_8),
            WidthCode::TWELVE => Ok(Self::BITS_12),
            bits => bits.try_into(),
        }
    }
}

impl From<DacWidth> for WidthCode {
    fn from(width: DacWidth) -> Self {
        Self(match width {
            DacWidth::BITS_8 => Self::EIGHT,
            DacWidth::BITS_12 => Self::TWELVE,
            DacWidth(bits) => bits,
        })
    }
}

/// A number of bits that no converter has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NoWidth(pub u8);

impl core::fmt::Display for NoWidth {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        write!(f, "a converter has {} to {} bits, not {}", DacWidth::LEAST, DacWidth::MOST, self.0)
    }
}

impl TryFrom<u8> for DacWidth {
    type Error = NoWidth;

    fn try_from(bits: u8) -> Result<Self, NoWidth> {
        if (Self::LEAST..=Self::MOST).contains(&bits) { Ok(Self(bits)) } else { Err(NoWidth(bits)) }
    }
}

impl DacWidth {
    const LEAST: u8 = 8;
    const MOST: u8 = 16;
    /// DAC0800, as in Paper 001.
    pub const BITS_8: Self = Self(8);
    /// The microcontroller's own.
    pub const BITS_12: Self = Self(12);
    /// An external converter, or a timer's pulse width with a line for the direction.
    pub const BITS_16: Self = Self(16);

    /// The number of bits.
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The code of zero torque.
    pub const fn mid_scale(self) -> u16 {
        // At most 16 bits, so that it fits.
        1 << (self.0 - 1)
    }

    /// The largest step away from mid-scale, the same both ways.
    pub const fn span(self) -> u16 {
        self.mid_scale() - 1
    }
}

/// The limits that the device never exceeds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SafetyConfig {
    /// Largest torque: the ceiling that no patient raises.
    pub torque: MillinewtonMetres,
    /// Torque that the motor bears for ever, 3–180 mN·m.
    pub continuous_torque: MillinewtonMetres,
    /// Time constant of the motor's winding, 1–600 s.
    pub winding_time_s: u16,
    /// Largest change of torque in one tick.
    pub slew_per_tick: MillinewtonMetres,
    /// Time over which torque fades in after a start, 10–5,000 ms.
    pub fade_in_ms: u16,
    /// Largest movement in one tick, in counts: the ceiling of speed; more is an encoder fault.
    /// 2–1,000.
    pub max_counts_per_tick: u16,
    /// Largest depth; beyond it is a fault. 1–500 mm.
    pub travel: Millimetres,
    /// Largest slope of any force law: at most what [`Mechanism`] bears, and 7 N/mm.
    pub stiffness: Stiffness,
    /// Largest silence of the PC while powered, 20–5,000 ms.
    pub heartbeat_ms: u16,
}

impl Default for Device {
    /// A 10 mm roller on the motor and encoder of Paper 001 and a 12-bit converter, not
    /// commissioned: the device that a board without a record of its own assumes.
    fn default() -> Self {
        let mm = |whole: i32| Millimetres(I16F16::from_bits(whole << 16));
        // 28.8 mN·m.
        let torque = MillinewtonMetres(I16F16::from_bits(1_887_437));
        Self {
            roller_radius: mm(10),
            counts_per_turn: 4000,
            encoder_reversed: false,
            full_scale_torque: torque,
            dac: DacWidth::BITS_12,
            dac_zero: 0,
            motor_reversed: false,
            skin_tilt: Milliradians(0),
            limits: SafetyConfig {
                torque,
                continuous_torque: torque,
                winding_time_s: 12,
                slew_per_tick: MillinewtonMetres(I16F16::from_bits(65_536)),
                fade_in_ms: 300,
                max_counts_per_tick: 16,
                travel: mm(60),
                stiffness: Stiffness(I16F16::from_bits(2 << 16)),
                heartbeat_ms: 200,
            },
            speed: SpeedMethod::Window,
            damping: Damping::default(),
            // 0.005 N·s/mm quietens a 7 N/mm wall under a light hand
            // (`a_stiff_wall_rings_without_the_observer`).
            passivity_damping: Damping(fixed::types::I8F24::from_bits(83_886)),
            mechanism: Mechanism::default(),
            compensation: Compensation::NONE,
            commissioned: false,
            sensors: Sensors::default(),
            torque_uncertainty: 0,
        }
    }
}

impl Device {
    /// The default device as a simulated one, whose wiring is known: it gives torque without being
    /// commissioned first. Never save it on a board.
    pub fn commissioned_virtual() -> Self {
        Self { commissioned: true, ..Self::default() }
    }
}

impl Default for Patient {
    /// An adult's antecubital vein, as `force-models` in the design notes gives it: skin 9 mm²/N to
    /// 1.0 N at 3 mm, vein 4 mm²/N to 0.56 N at 1.5 mm, 4.8 mm deep and 3.0 mm across,
    /// perpendicular to the skin.
    fn default() -> Self {
        let mm = |bits: i32| Millimetres(I16F16::from_bits(bits));
        let wall = |compliance: i32, puncture: i32, vertex: i32, relief: i32| Wall {
            elastic: Parabola {
                vertex: mm(0),
                compliance: JogCompliance(I16F16::from_bits(compliance)),
                base: Newtons::default(),
            },
            puncture_travel: mm(puncture),
            relief: Parabola {
                vertex: mm(vertex),
                compliance: JogCompliance(I16F16::from_bits(relief)),
                base: Newtons::default(),
            },
            unload: Stiffness(I16F16::from_bits(65_536)),
            spring_back: SPRING_BACK,
        };
        let layer = |tissue, top: i32, wall, friction: i32| Layer {
            tissue,
            depth: mm(top),
            wall,
            friction: FrictionPerMillimetre(I16F16::from_bits(friction)),
        };
        // Bits of Q16: 65,536 is one.
        let layers = [
            layer(Tissue::Skin, 0, Some(wall(9 << 16, 3 << 16, 4 << 16, 163_840)), 1_311),
            layer(Tissue::Fat, 2 << 16, None, 1_311),
            layer(Tissue::Vessel, 314_573, Some(wall(4 << 16, 98_304, 147_456, 147_456)), 1_311),
            layer(Tissue::FarWall, 511_181, Some(wall(4 << 16, 98_304, 147_456, 147_456)), 1_311),
        ];
        Self {
            largest_force: None,
            scale: I16F16::ONE,
            law: Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(I16F16::from_bits(65_536)) }),
            layers: layers.into_iter().collect(),
            vessel: None,
        }
    }
}

impl Patient {
    /// Nobody: the needle meets nothing and feels nothing. Any device bears it.
    pub fn nobody() -> Self {
        let nothing = Layer {
            tissue: Tissue::Other,
            depth: Millimetres::default(),
            wall: None,
            friction: FrictionPerMillimetre::default(),
        };
        Self {
            largest_force: None,
            scale: I16F16::ONE,
            // The softest hold that there may be: any limit of stiffness bears it.
            law: Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(I16F16::from_bits(3_276)) }),
            layers: core::iter::once(nothing).collect(),
            vessel: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_converter_reaches_as_far_one_way_as_the_other() {
        assert_eq!((DacWidth::BITS_8.mid_scale(), DacWidth::BITS_8.span()), (128, 127));
        assert_eq!((DacWidth::BITS_12.mid_scale(), DacWidth::BITS_12.span()), (2048, 2047));
        assert_eq!((DacWidth::BITS_16.mid_scale(), DacWidth::BITS_16.span()), (32_768, 32_767));
    }

    /// Devices hold records in which the two widths were the only ones.
    #[test]
    fn a_width_is_stored_as_it_always_was() {
        let stored = |width| WidthCode::from(width).0;
        assert_eq!([DacWidth::BITS_8, DacWidth::BITS_12, DacWidth::BITS_16].map(stored), [0, 1, 16]);
        for code in 0..=u8::MAX {
            let width = DacWidth::try_from(WidthCode(code));
            assert_eq!(width.is_ok(), code < 2 || (8..=16).contains(&code), "{code}");
            if let Ok(width) = width {
                assert_eq!(DacWidth::try_from(WidthCode::from(width)), Ok(width), "{code}");
            }
        }
    }

    #[test]
    fn a_width_has_8_to_16_bits() {
        for bits in 0..=u8::MAX {
            let width = DacWidth::try_from(bits);
            assert_eq!(
                width.map(DacWidth::bits),
                if (8..=16).contains(&bits) { Ok(bits) } else { Err(NoWidth(bits)) }
            );
        }
    }
}
