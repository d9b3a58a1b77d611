//! The share of a device's compensation that is active, adjustable while a person feels the
//! difference. It lasts until the device is configured or restarted: the stored gains do not
//! change.

use control_core::Device;
use control_core::compensation::{Gain, Gains};

/// The gains that a device has stored, and the share of them in force.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LiveGains {
    stored: Option<Gains>,
    share: f64,
}

impl LiveGains {
    /// Takes the device's own report: all of its gains are active.
    pub(crate) fn learn(&mut self, device: &Device) {
        self.stored = device.compensation.is_some().then_some(device.compensation.gains);
        self.share = 1.0;
    }

    /// Nothing is known of the device any more.
    pub(crate) fn forget(&mut self) {
        *self = Self::default();
    }

    /// The share in force, 0 to 1; none where there is nothing to compensate.
    pub(crate) fn share(&self) -> Option<f64> {
        self.stored.map(|_| self.share)
    }

    /// The gains for `share` (0 to 1) of the stored ones, where there are any.
    pub(crate) fn at(&mut self, share: f64) -> Option<Gains> {
        let stored = self.stored?;
        self.share = share.clamp(0.0, 1.0);
        let of = |gain: Gain| Gain((f64::from(gain.0) * self.share).round() as u8);
        Some(Gains {
            angle: of(stored.angle),
            friction: of(stored.friction),
            weight: of(stored.weight),
            drive: of(stored.drive),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use control_core::compensation::Compensation;
    use control_core::units::MillinewtonMetres;

    #[test]
    fn a_share_is_of_what_the_device_has_stored_and_never_more() {
        let mut gains = LiveGains::default();
        assert_eq!((gains.share(), gains.at(0.5)), (None, None), "nothing is known");
        gains.learn(&Device::commissioned_virtual());
        assert_eq!(gains.at(0.5), None, "nothing to compensate");
        let stored = Gains { angle: Gain(235), friction: Gain(205), weight: Gain(0), drive: Gain(1) };
        let weight = MillinewtonMetres(fixed::types::I16F16::ONE);
        let compensation = Compensation { weight, gains: stored, ..Compensation::NONE };
        gains.learn(&Device { compensation, ..Device::commissioned_virtual() });
        assert_eq!(gains.share(), Some(1.0));
        let half = Gains { angle: Gain(118), friction: Gain(103), weight: Gain(0), drive: Gain(1) };
        assert_eq!((gains.at(0.5), gains.share()), (Some(half), Some(0.5)));
        assert_eq!(gains.at(7.0), Some(stored));
        assert_eq!(gains.at(0.0), Some(Gains::OFF));
        gains.forget();
        assert_eq!(gains.share(), None);
    }
}
