//! Ceilings that no command raises: those that a board's firmware was built with, and those of a
//! device that has been commissioned. It compares configurations; who may send which one is
//! `link`'s business.

use crate::config::{DacWidth, Device, Mechanism};
use crate::kinematics::mm_per_count;
use crate::refusal::{Field, Refusal, milli, within};
use crate::runaway::fastest;
use crate::units::{Grams, MillimetresPerSecond, MillinewtonMetres, Newtons};
use fixed::types::I16F16;

/// The most that a board may ever be configured for. They are constants of its firmware.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ceilings {
    /// The ceiling of [`crate::config::SafetyConfig::torque`].
    pub torque: MillinewtonMetres,
    /// The ceiling of the speed past which [`crate::event::Fault::Overspeed`] trips.
    pub speed: MillimetresPerSecond,
    /// The most that a record may claim of the mechanism, which decides how stiff a wall may be
    /// (`stability.rs`): the most mass and dry friction, and the least delay.
    pub mechanism: Mechanism,
    /// The board's converters, the narrower one first; one that is alone is there twice.
    pub converters: [DacWidth; 2],
}

impl Ceilings {
    /// The ceilings of a device without a motor that could hurt anybody: all that [`crate::Plan`]
    /// takes.
    pub const VIRTUAL: Self = Self {
        torque: MillinewtonMetres(I16F16::MAX),
        speed: MillimetresPerSecond(I16F16::MAX),
        mechanism: Mechanism { mass: Grams(I16F16::MAX), dry_friction: Newtons(I16F16::MAX), delay_us: 0 },
        converters: [DacWidth::BITS_8, DacWidth::BITS_12],
    };

    /// Ceilings of so many whole mN·m and mm/s, and a mechanism like those that the stiffness of
    /// walls was tested with: at most 200 g and 1 N along the needle, at least 30 µs from the
    /// reading of the encoder to the torque, of which 20 are the wait for the converter's instant.
    pub const fn new(torque_mnm: i16, speed_mm_per_s: i16) -> Self {
        Self {
            torque: MillinewtonMetres(I16F16::from_bits((torque_mnm as i32) << 16)),
            speed: MillimetresPerSecond(I16F16::from_bits((speed_mm_per_s as i32) << 16)),
            mechanism: Mechanism {
                mass: Grams(milli(200_000)),
                dry_friction: Newtons(milli(1_000)),
                delay_us: 30,
            },
            converters: [DacWidth::BITS_8, DacWidth::BITS_12],
        }
    }

    /// The same on a board with these converters, as in [`Self::converters`].
    pub const fn with_converters(self, converters: [DacWidth; 2]) -> Self {
        Self { converters, ..self }
    }

    /// Checks that `device` stays below them.
    pub fn check(&self, device: &Device) -> Result<(), Refusal> {
        let per_count = mm_per_count(device.roller_radius, device.counts_per_turn);
        let speed = fastest(per_count, device.limits.max_counts_per_tick);
        within(Field::TorqueLimit, device.limits.torque.0, milli(100), self.torque.0)?;
        within(Field::SpeedCeiling, speed.0, I16F16::ZERO, self.speed.0)?;
        if !self.converters.contains(&device.dac) {
            let bits = |width: DacWidth| I16F16::from_bits(i32::from(width.bits()) << 16);
            let [low, high] = self.converters.map(bits);
            return Err(Refusal::OutOfRange { field: Field::Converter, value: bits(device.dac), low, high });
        }
        let (claimed, most) = (&device.mechanism, &self.mechanism);
        within(Field::MovingMass, claimed.mass.0, I16F16::ZERO, most.mass.0)?;
        within(Field::MechanismFriction, claimed.dry_friction.0, I16F16::ZERO, most.dry_friction.0)?;
        let delay_us = |us: u16| I16F16::from_bits(i32::from(us.min(i16::MAX.unsigned_abs())) << 16);
        within(Field::DriveDelayUs, delay_us(claimed.delay_us), delay_us(most.delay_us), I16F16::MAX)
    }
}

/// Returns why a device that was commissioned as `before` may not become `after` without being
/// commissioned again: the first value that commissioning found and that is another one, or a
/// ceiling that is higher. What only makes the device gentler, or shows in nothing but the feel,
/// may change. Less mass and dry friction and more delay are gentler: with them a wall may be less
/// stiff (`stability.rs`).
pub fn changed(before: &Device, after: &Device) -> Option<Field> {
    let (old, new) = (&before.limits, &after.limits);
    let (moved, moves) = (&before.mechanism, &after.mechanism);
    let kept = [
        (Field::RollerRadius, after.roller_radius == before.roller_radius),
        (Field::CountsPerTurn, after.counts_per_turn == before.counts_per_turn),
        (Field::EncoderSign, after.encoder_reversed == before.encoder_reversed),
        (Field::FullScaleTorque, after.full_scale_torque == before.full_scale_torque),
        (Field::Converter, after.dac == before.dac),
        (Field::DacZero, after.dac_zero == before.dac_zero),
        (Field::MotorSign, after.motor_reversed == before.motor_reversed),
        (Field::TorqueLimit, new.torque <= old.torque),
        (Field::ContinuousTorque, new.continuous_torque <= old.continuous_torque),
        (Field::WindingTimeS, new.winding_time_s <= old.winding_time_s),
        (Field::SlewPerTick, new.slew_per_tick <= old.slew_per_tick),
        (Field::MaxCountsPerTick, new.max_counts_per_tick <= old.max_counts_per_tick),
        (Field::Travel, new.travel <= old.travel),
        (Field::StiffnessLimit, new.stiffness <= old.stiffness),
        (Field::HeartbeatMs, new.heartbeat_ms <= old.heartbeat_ms),
        (Field::MovingMass, moves.mass <= moved.mass),
        (Field::MechanismFriction, moves.dry_friction <= moved.dry_friction),
        (Field::DriveDelayUs, moves.delay_us >= moved.delay_us),
        (Field::Sensors, before.sensors.missing_in(after.sensors).is_none()),
    ];
    kept.into_iter().find_map(|(field, is_kept)| (!is_kept).then_some(field))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Sensors;
    use crate::units::Millimetres;

    const BOARD: Ceilings = Ceilings::new(40, 600);

    #[test]
    fn a_board_bounds_torque_and_the_speed_that_its_counts_make() {
        let mut device = Device::commissioned_virtual();
        assert_eq!(BOARD.check(&device), Ok(()));
        device.limits.max_counts_per_tick = 23;
        let refused = BOARD.check(&device);
        assert!(
            matches!(refused, Err(Refusal::OutOfRange { field: Field::SpeedCeiling, .. })),
            "{refused:?}"
        );
        // Half the roller, half the speed.
        device.roller_radius = Millimetres(I16F16::from_num(5));
        assert_eq!(BOARD.check(&device), Ok(()));
        device.limits.torque.0 = BOARD.torque.0 + I16F16::DELTA;
        let refused = BOARD.check(&device);
        assert!(matches!(refused, Err(Refusal::OutOfRange { field: Field::TorqueLimit, .. })), "{refused:?}");
        assert_eq!(Ceilings::VIRTUAL.check(&device), Ok(()));
    }

    /// A code for a converter that is not there would reach nobody, or another one.
    #[test]
    fn a_board_takes_the_widths_of_its_converters() {
        let refused = |ceilings: Ceilings, dac| {
            let device = Device { dac, ..Device::commissioned_virtual() };
            matches!(ceilings.check(&device), Err(Refusal::OutOfRange { field: Field::Converter, .. }))
        };
        let widths = [DacWidth::BITS_8, DacWidth::BITS_12, DacWidth::BITS_16];
        assert_eq!(widths.map(|dac| refused(BOARD, dac)), [false, false, true]);
        let alone = BOARD.with_converters([DacWidth::BITS_16; 2]);
        assert_eq!(widths.map(|dac| refused(alone, dac)), [true, true, false]);
    }

    /// More mass and friction, or less delay, would let a wall be stiffer than the mechanism bears.
    #[test]
    fn a_board_bounds_what_a_record_claims_of_its_mechanism() {
        let sound = Device::commissioned_virtual();
        let refused = |change: fn(&mut Mechanism)| {
            let mut device = sound;
            change(&mut device.mechanism);
            assert_eq!(Ceilings::VIRTUAL.check(&device), Ok(()));
            match BOARD.check(&device) {
                Err(Refusal::OutOfRange { field, .. }) => Some(field),
                _ => None,
            }
        };
        assert_eq!(refused(|m| m.mass = BOARD.mechanism.mass), None);
        assert_eq!(refused(|m| m.mass.0 = BOARD.mechanism.mass.0 + I16F16::DELTA), Some(Field::MovingMass));
        assert_eq!(refused(|m| m.dry_friction = BOARD.mechanism.dry_friction), None);
        let friction = refused(|m| m.dry_friction.0 = BOARD.mechanism.dry_friction.0 + I16F16::DELTA);
        assert_eq!(friction, Some(Field::MechanismFriction));
        assert_eq!(refused(|m| m.delay_us = 30), None);
        assert_eq!(refused(|m| m.delay_us = 29), Some(Field::DriveDelayUs));
    }

    /// Each value that is raised or exchanged alone.
    #[test]
    fn a_commissioned_device_may_be_lowered_but_not_raised() {
        type Change = (Field, fn(&mut Device));
        let changes: [Change; 19] = [
            (Field::RollerRadius, |d| d.roller_radius.0 -= I16F16::ONE),
            (Field::CountsPerTurn, |d| d.counts_per_turn += 4),
            (Field::EncoderSign, |d| d.encoder_reversed = true),
            (Field::FullScaleTorque, |d| d.full_scale_torque.0 += I16F16::ONE),
            (Field::Converter, |d| d.dac = crate::config::DacWidth::BITS_8),
            (Field::DacZero, |d| d.dac_zero = 1),
            (Field::MotorSign, |d| d.motor_reversed = true),
            (Field::TorqueLimit, |d| d.limits.torque.0 += I16F16::DELTA),
            (Field::ContinuousTorque, |d| d.limits.continuous_torque.0 += I16F16::DELTA),
            (Field::WindingTimeS, |d| d.limits.winding_time_s += 1),
            (Field::SlewPerTick, |d| d.limits.slew_per_tick.0 += I16F16::DELTA),
            (Field::MaxCountsPerTick, |d| d.limits.max_counts_per_tick += 1),
            (Field::Travel, |d| d.limits.travel.0 += I16F16::DELTA),
            (Field::StiffnessLimit, |d| d.limits.stiffness.0 += I16F16::DELTA),
            (Field::HeartbeatMs, |d| d.limits.heartbeat_ms += 1),
            (Field::MovingMass, |d| d.mechanism.mass.0 += I16F16::DELTA),
            (Field::MechanismFriction, |d| d.mechanism.dry_friction.0 += I16F16::DELTA),
            (Field::DriveDelayUs, |d| d.mechanism.delay_us -= 1),
            (Field::Sensors, |d| d.sensors.current = false),
        ];
        let before = Device {
            sensors: Sensors { encoder_supply: false, current: true },
            ..Device::commissioned_virtual()
        };
        for (field, change) in changes {
            let mut after = before;
            change(&mut after);
            assert_eq!(changed(&before, &after), Some(field));
        }
        let mut gentler = before;
        gentler.limits.torque.0 /= 2;
        gentler.limits.continuous_torque.0 /= 2;
        gentler.limits.winding_time_s = 5;
        gentler.limits.slew_per_tick.0 /= 2;
        gentler.limits.max_counts_per_tick = 8;
        gentler.limits.travel.0 /= 2;
        gentler.limits.stiffness.0 /= 2;
        gentler.limits.heartbeat_ms = 100;
        gentler.limits.fade_in_ms = 444;
        gentler.skin_tilt.0 = 70;
        gentler.mechanism.mass.0 /= 2;
        gentler.mechanism.dry_friction.0 /= 2;
        gentler.mechanism.delay_us *= 2;
        gentler.sensors.encoder_supply = true;
        assert_eq!(changed(&before, &gentler), None);
        assert_eq!(changed(&gentler, &before), Some(Field::TorqueLimit), "not back again");
    }
}
