//! The last stage before the motor: limits that may reduce torque and never turn it round, and the step to a DAC code.

use crate::config::DacWidth;
use crate::event::Limits;
use crate::math::times;
use crate::units::{DacCode, MillinewtonMetres};
use fixed::types::{I2F30, I16F16};

/// Limits ready for the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TorqueLimits {
    pub(crate) torque: I16F16,
    pub(crate) slew_per_tick: I16F16,
    /// Share of full torque that a tick of fading in adds.
    pub(crate) fade_per_tick: I2F30,
}

/// Remembers the torque given last and how far it has faded in.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Limiter {
    given: I16F16,
    faded: I2F30,
}

impl Limiter {
    /// From zero torque, to fade in.
    pub(crate) fn restart(&mut self) {
        *self = Self::default();
    }

    /// What was given last.
    pub(crate) fn given(&self) -> MillinewtonMetres {
        MillinewtonMetres(self.given)
    }

    /// Fades in and bounds the change in a tick; says what was in force. `wanted` is within the torque limit.
    pub(crate) fn tick(
        &mut self,
        limits: &TorqueLimits,
        wanted: MillinewtonMetres,
    ) -> (MillinewtonMetres, Limits) {
        let mut in_force = Limits::default();
        let mut torque = wanted.0;
        if self.faded < I2F30::ONE {
            self.faded = self.faded.saturating_add(limits.fade_per_tick).min(I2F30::ONE);
            torque = times(torque, self.faded);
            in_force = in_force.with(Limits::FADE_IN);
        }
        let lowest = self.given.saturating_sub(limits.slew_per_tick);
        let highest = self.given.saturating_add(limits.slew_per_tick);
        let slewed = torque.clamp(lowest, highest);
        if slewed != torque {
            in_force = in_force.with(Limits::SLEW);
        }
        self.given = slewed;
        (MillinewtonMetres(slewed), in_force)
    }
}

/// From torque to converter code.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DacScale {
    width: DacWidth,
    codes_per_mnm: I16F16,
}

impl DacScale {
    /// For a converter whose full scale is `full_scale` torque.
    pub(crate) fn new(width: DacWidth, full_scale: MillinewtonMetres) -> Self {
        Self { width, codes_per_mnm: I16F16::from_num(width.span()) / full_scale.0 }
    }

    /// The nearest code; never beyond the converter's span.
    pub(crate) fn code(&self, torque: MillinewtonMetres) -> DacCode {
        let steps_q32 = i64::from(torque.0.to_bits()) * i64::from(self.codes_per_mnm.to_bits());
        let nearest = ((steps_q32 + (1 << 31)) >> 32) as i32;
        let span = i32::from(self.width.span());
        // Mid-scale is a step more than the span: never below 1 and never above the width.
        DacCode((i32::from(self.width.mid_scale()) + nearest.clamp(-span, span)) as u16)
    }

    /// The code of zero torque.
    pub(crate) fn zero(&self) -> DacCode {
        DacCode(self.width.mid_scale())
    }
}
