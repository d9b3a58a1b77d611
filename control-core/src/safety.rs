//! The last stage before the motor: limits that may reduce torque and never turn it round, and the
//! step to a DAC code.

use crate::config::Device;
use crate::event::Limits;
use crate::math::truncating_product;
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

    /// The torque that was given last.
    pub(crate) fn given(&self) -> MillinewtonMetres {
        MillinewtonMetres(self.given)
    }

    /// Fades in and bounds the change in a tick; says what was in force. `wanted` is within the
    /// torque limit.
    pub(crate) fn tick(
        &mut self,
        limits: &TorqueLimits,
        wanted: MillinewtonMetres,
    ) -> (MillinewtonMetres, Limits) {
        let mut in_force = Limits::default();
        let mut torque = wanted.0;
        if self.faded < I2F30::ONE {
            self.faded = self.faded.saturating_add(limits.fade_per_tick).min(I2F30::ONE);
            torque = I16F16::from_bits(truncating_product(torque.to_bits(), self.faded.to_bits(), 30));
            in_force = in_force.with(Limits::FADE_IN);
        }
        let lowest = self.given.saturating_sub(limits.slew_per_tick);
        let highest = self.given.saturating_add(limits.slew_per_tick);
        let slewed = torque.min(highest).max(lowest);
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
    codes_per_mnm: I16F16,
    mid_scale: i32,
    /// The code of zero torque.
    zero: i32,
    /// −1 where a code above zero drives the needle outwards.
    sign: i32,
    span: i32,
}

/// A torque as codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Codes {
    /// For this converter.
    pub(crate) written: DacCode,
    /// For a converter whose zero is mid-scale, on a motor whose sign is right: what is streamed.
    pub(crate) plain: DacCode,
}

impl DacScale {
    /// For the converter, the zero and the sign of `device`.
    pub(crate) fn new(device: &Device) -> Self {
        let span = device.dac.span();
        let mid_scale = i32::from(device.dac.mid_scale());
        Self {
            codes_per_mnm: I16F16::from_num(span) / device.full_scale_torque.0,
            mid_scale,
            zero: mid_scale + i32::from(device.dac_zero),
            sign: if device.motor_reversed { -1 } else { 1 },
            // The same span both ways, wherever zero is.
            span: i32::from(span) - i32::from(device.dac_zero).abs(),
        }
    }

    /// The nearest code; never beyond the converter's span.
    pub(crate) fn codes(&self, torque: MillinewtonMetres) -> Codes {
        let steps_q32 = i64::from(torque.0.to_bits()) * i64::from(self.codes_per_mnm.to_bits());
        let nearest = ((steps_q32 + (1 << 31)) >> 32) as i32;
        let steps = nearest.min(self.span).max(-self.span);
        // Mid-scale is a step more than the span: never below 1 and never above the width.
        Codes {
            written: DacCode((self.zero + self.sign * steps) as u16),
            plain: DacCode((self.mid_scale + steps) as u16),
        }
    }

    /// The code of zero torque.
    pub(crate) fn zero(&self) -> DacCode {
        DacCode(self.zero as u16)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::DacWidth;

    fn mnm(torque: f64) -> MillinewtonMetres {
        MillinewtonMetres(I16F16::from_num(torque))
    }

    fn device(dac: DacWidth, full_scale: f64) -> Device {
        Device { dac, full_scale_torque: mnm(full_scale), ..Device::commissioned_virtual() }
    }

    #[test]
    fn the_code_is_the_nearest_and_stays_within_the_span() {
        // A step a mN·m.
        let scale = DacScale::new(&device(DacWidth::BITS_8, 127.0));
        let torques = [0.0, 0.49, 0.51, -0.49, -0.51, 126.4, 127.0, 200.0, -127.0, -200.0];
        let wanted = [128, 128, 129, 128, 127, 254, 255, 255, 1, 1];
        assert_eq!(torques.map(|torque| scale.codes(mnm(torque)).written.0), wanted);
        assert_eq!(torques.map(|torque| scale.codes(mnm(torque)).plain.0), wanted);
        assert_eq!(scale.zero(), DacCode(128));
        let wide = DacScale::new(&device(DacWidth::BITS_12, 20.47));
        assert_eq!(wide.codes(mnm(-20.47)).written, DacCode(1));
        let widest = DacScale::new(&device(DacWidth::BITS_16, 28.8));
        let torques = [-40.0, -28.8, -0.001, 0.0, 0.001, 28.8, 40.0];
        let wanted = [1, 1, 32_767, 32_768, 32_769, 65_535, 65_535];
        assert_eq!(torques.map(|torque| widest.codes(mnm(torque)).written.0), wanted);
    }

    #[test]
    fn zero_and_motor_direction_change_only_the_converters_code() {
        let beside = Device { dac_zero: 5, motor_reversed: true, ..device(DacWidth::BITS_8, 127.0) };
        let scale = DacScale::new(&beside);
        let torques = [0.0, 10.0, -10.0, 200.0, -200.0].map(|torque| scale.codes(mnm(torque)));
        assert_eq!(torques.map(|codes| codes.written.0), [133, 123, 143, 11, 255]);
        assert_eq!(torques.map(|codes| codes.plain.0), [128, 138, 118, 250, 6]);
        assert_eq!(scale.zero(), DacCode(133));
    }

    #[test]
    fn torque_fades_in_and_then_changes_as_fast_as_it_may() {
        let limits = TorqueLimits {
            torque: I16F16::from_num(30),
            slew_per_tick: I16F16::from_num(4),
            fade_per_tick: I2F30::ONE / 4,
        };
        let mut limiter = Limiter::default();
        let mut given = |wanted: f64| {
            let (torque, in_force) = limiter.tick(&limits, mnm(wanted));
            (torque.0.to_num::<f64>(), in_force)
        };
        let (fading, slewing) = (Limits::FADE_IN, Limits::SLEW);
        assert_eq!([given(8.0), given(8.0), given(8.0)], [(2.0, fading), (4.0, fading), (6.0, fading)]);
        assert_eq!(given(8.0), (8.0, fading), "the tick in which it is done");
        assert_eq!([given(12.0), given(12.5)], [(12.0, Limits::default()), (12.5, Limits::default())]);
        assert_eq!([given(20.0), given(20.0)], [(16.5, slewing), (20.0, Limits::default())]);
        assert_eq!([given(-9.0), given(-9.0)], [(16.0, slewing), (12.0, slewing)]);
        limiter.restart();
        assert_eq!(limiter.tick(&limits, mnm(8.0)), (mnm(2.0), fading), "anew after a start");
    }
}
