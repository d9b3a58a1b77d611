//! The motor's winding as one heat store: torque squared warms it, time cools it. Before the heat
//! of the continuous torque is reached the torque limit falls to the continuous torque; that is a
//! limit in force, not a fault.

use crate::TICK_HZ;
use crate::math::{saturating_product, truncating_product};
use crate::units::MillinewtonMetres;
use fixed::types::{I2F30, I16F16, I32F32};

/// The limit begins to fall when this much of the allowed heat is left: a fifth.
const BLEND: i64 = 5;

/// Ticks whose torque warms the winding at once.
pub(crate) const WARM_TICKS: u32 = 8;

/// The model ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ThermalLimits {
    continuous: I16F16,
    /// Heat of the continuous torque in (mN·m)².
    allowed: I32F32,
    /// Share of the way to a torque's heat that [`WARM_TICKS`] go, times 2^10.
    warming: I2F30,
    /// 1/(allowed/5).
    per_blend: I2F30,
}

impl ThermalLimits {
    /// `time_constant_s` is the winding's, 1–600 s.
    pub(crate) fn new(continuous: MillinewtonMetres, time_constant_s: u16) -> Self {
        let allowed = I32F32::from(continuous.0) * I32F32::from(continuous.0);
        let ticks = i64::from(time_constant_s.max(1)) * i64::from(TICK_HZ);
        let blend = (allowed / BLEND).max(I32F32::ONE);
        Self {
            continuous: continuous.0,
            allowed,
            warming: I2F30::from_bits(
                i32::try_from((i64::from(WARM_TICKS) << 40) / ticks).unwrap_or(i32::MAX),
            ),
            per_blend: I2F30::saturating_from_num(I32F32::ONE / blend),
        }
    }
}

/// Heat in (mN·m)²: what the squared torque has been, on average over the time constant.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Winding {
    heat: I32F32,
    /// Sum of the squared torques that have not warmed it yet.
    squared: I32F32,
    /// The largest torque that the heat allows.
    allowed: I16F16,
}

impl Winding {
    /// With `heat` from before.
    pub(crate) fn with_heat(heat: u32) -> Self {
        Self { heat: I32F32::from_bits(i64::from(heat) << 16), ..Self::default() }
    }

    /// One of unknown heat. It may be as hot as the continuous torque makes it, and hotter where
    /// another program drove it: it counts as so hot that it reaches that heat after its time
    /// constant at the earliest.
    pub(crate) fn unknown(limits: &ThermalLimits) -> Self {
        Self { heat: limits.allowed * I32F32::E, ..Self::default() }
    }

    /// Heat in (mN·m)², in Q16; hotter than that holds is as hot as it holds.
    pub(crate) fn heat(&self) -> u32 {
        u32::try_from(self.heat.to_bits() >> 16).unwrap_or(u32::MAX)
    }

    /// One tick with `given` torque.
    pub(crate) fn tick(&mut self, given: MillinewtonMetres) {
        // Torques stay below 512 mN·m: eight squares fit.
        self.squared += given.0.wide_mul(given.0);
    }

    /// Adds the heat of the torques of the last [`WARM_TICKS`].
    pub(crate) fn warm(&mut self, limits: &ThermalLimits) {
        const { assert!(WARM_TICKS == 8, "three places") };
        let mean: I32F32 = core::mem::take(&mut self.squared) >> 3_u32;
        let towards_q32 = (mean - self.heat).to_bits();
        // The rest of the difference fits. The step is a share of 2^-10 or less: in Q52, with 20
        // places taken off last, nothing of it is lost.
        let step_q52 = i64::from((towards_q32 >> 20) as i32) * i64::from(limits.warming.to_bits());
        self.heat += I32F32::from_bits(step_q52 >> 20);
    }

    /// The largest torque that the heat allows, between the continuous one and the largest of all.
    pub(crate) fn allowed(&self) -> I16F16 {
        self.allowed
    }

    /// Reckons [`Self::allowed`] anew, where `most` is the largest torque of all.
    pub(crate) fn allow(&mut self, limits: &ThermalLimits, most: I16F16) {
        self.allowed = self.largest(limits, most);
    }

    fn largest(&self, limits: &ThermalLimits, most: I16F16) -> I16F16 {
        if most <= limits.continuous {
            return most;
        }
        // At most 180² (mN·m)².
        let left_q16 = ((limits.allowed - self.heat).max(I32F32::ZERO).to_bits() >> 16) as i32;
        let share =
            I2F30::from_bits(saturating_product(left_q16, limits.per_blend.to_bits(), 16)).min(I2F30::ONE);
        let more = truncating_product(most.saturating_sub(limits.continuous).to_bits(), share.to_bits(), 30);
        limits.continuous.saturating_add(I16F16::from_bits(more))
    }
}
