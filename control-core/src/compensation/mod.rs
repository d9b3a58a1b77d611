//! The device's feedforward, by which the hand does not feel the mechanism: cogging and an
//! off-centre mass by the rotor's angle, dry and viscous friction by direction, weight by tilt, the
//! drive's offset, ripple and deadband. The forces as a diagnosis found them are here; [`check`]
//! says whether they may be fed forward and `feedforward` does it, tick by tick.
//!
//! Each part is fed forward at a gain below 1, so that some of the mechanism's own friction always
//! remains: the injected energy is less than the dissipated one. It may not know a force law, and
//! no force law knows it.

pub mod check;
pub(crate) mod feedforward;

use crate::units::{Damping, MillimetresPerSecond, MillinewtonMetres};
use fixed::types::I16F16;
use serde::{Deserialize, Serialize};

/// The most waves by the rotor's angle: cogging and an off-centre mass.
pub const MAX_WAVES: usize = 8;
/// The most waves of the ripple.
pub const MAX_RIPPLES: usize = 4;
/// Raised whenever a value here comes to mean something else.
pub const VERSION: u8 = 1;

/// The forces of a mechanism and at which gain each is taken away from the hand. Torques are those
/// that the mechanism adds in the direction of insertion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Compensation {
    /// [`VERSION`] of whoever wrote it; another one is refused.
    pub version: u8,
    /// Torque by the rotor's angle in mN·m; the first wave of order 0 ends them.
    pub angle: [Wave; MAX_WAVES],
    /// The excess of the drive's torque over the requested one, by the rotor's angle, as a share of
    /// it; as `angle`.
    pub ripple: [Wave; MAX_RIPPLES],
    /// Friction on the way in.
    pub inwards: Friction,
    /// Friction on the way out.
    pub outwards: Friction,
    /// Slower than this no friction is given back: at least the speed of one count in a speed
    /// window, so that a needle at rest on the edge of a count stays at rest.
    pub rest_speed: MillimetresPerSecond,
    /// From this speed on all of it is; between the two it rises smoothly.
    pub full_speed: MillimetresPerSecond,
    /// Torque of the weight where the needle points straight down.
    pub weight: MillinewtonMetres,
    /// Torque that is there without being asked for.
    pub offset: MillinewtonMetres,
    /// Half the width of the torques around zero that the drive swallows.
    pub deadband: MillinewtonMetres,
    /// The gains after a start.
    pub gains: Gains,
}

/// A part of a force that repeats with the rotor's turn: `amplitude·sin(order·θ + phase)`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wave {
    /// Periods a turn, up to an eighth of the counts; 0 means no wave.
    pub order: u16,
    /// In the unit of the force.
    pub amplitude: I16F16,
    /// The phase; 65,536 are a period.
    pub phase: u16,
}

/// Friction in one direction: `dry + viscous·|speed|`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Friction {
    /// Torque whatever the speed.
    pub dry: MillinewtonMetres,
    /// Force at the roller for its speed.
    pub viscous: Damping,
}

/// A share of what was found, in 256ths: always below 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Gain(pub u8);

impl Gain {
    /// As a number from 0 to 0.996.
    pub fn share(self) -> I16F16 {
        I16F16::from_bits(i32::from(self.0) << 8)
    }
}

/// The gain of each part.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Gains {
    /// The gain of the waves by angle.
    pub angle: Gain,
    /// The gain of friction.
    pub friction: Gain,
    /// The gain of the weight.
    pub weight: Gain,
    /// The gain of the drive's offset, ripple and deadband.
    pub drive: Gain,
}

impl Gains {
    /// Nothing is fed forward.
    pub const OFF: Self = Self { angle: Gain(0), friction: Gain(0), weight: Gain(0), drive: Gain(0) };

    fn each(self) -> [Gain; 4] {
        [self.angle, self.friction, self.weight, self.drive]
    }
}

impl Compensation {
    /// Nothing was found.
    pub const NONE: Self = Self {
        version: VERSION,
        angle: [Wave { order: 0, amplitude: I16F16::ZERO, phase: 0 }; MAX_WAVES],
        ripple: [Wave { order: 0, amplitude: I16F16::ZERO, phase: 0 }; MAX_RIPPLES],
        inwards: Friction {
            dry: MillinewtonMetres(I16F16::ZERO),
            viscous: Damping(fixed::types::I8F24::ZERO),
        },
        outwards: Friction {
            dry: MillinewtonMetres(I16F16::ZERO),
            viscous: Damping(fixed::types::I8F24::ZERO),
        },
        // 2 and 6 mm/s.
        rest_speed: MillimetresPerSecond(I16F16::from_bits(2 << 16)),
        full_speed: MillimetresPerSecond(I16F16::from_bits(6 << 16)),
        weight: MillinewtonMetres(I16F16::ZERO),
        offset: MillinewtonMetres(I16F16::ZERO),
        deadband: MillinewtonMetres(I16F16::ZERO),
        gains: Gains::OFF,
    };

    /// True if there is anything to feed forward, at whatever gain.
    pub fn is_some(&self) -> bool {
        Self {
            gains: Gains::OFF,
            rest_speed: Self::NONE.rest_speed,
            full_speed: Self::NONE.full_speed,
            ..*self
        } != Self::NONE
    }

    /// True if any part depends on the rotor's angle, which has to be found after each reset.
    pub fn needs_angle(&self) -> bool {
        self.angle[0].order != 0 || self.ripple[0].order != 0
    }
}

impl Default for Compensation {
    fn default() -> Self {
        Self::NONE
    }
}
