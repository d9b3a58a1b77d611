//! Tests of the feedforward: fixed point against its floating-point twin, when it is on, and what
//! is refused.

mod twin;

use control_core::compensation::{Compensation, Friction, Gain, Gains, Wave};
use control_core::config::Device;
use control_core::controller::TickOutput;
use control_core::event::{Fault, Limits};
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::plan::Field;
use control_core::units::{
    Counts, Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians, Stiffness,
};
use control_core::{Controller, LargeOrder, Order, Patient, Plan, Refusal, TickInput};
use fixed::types::{I8F24, I16F16};
use proptest::prelude::*;
use twin::Twin;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn gains(share: f64) -> Gains {
    let gain = Gain((share * 256.0) as u8);
    Gains { angle: gain, friction: gain, weight: gain, drive: gain }
}

/// A device on which much is found, and every gain is 0.8.
fn found() -> Compensation {
    let mut found = Compensation {
        inwards: Friction { dry: MillinewtonMetres(q(0.4)), viscous: Damping(I8F24::from_num(2e-5)) },
        outwards: Friction { dry: MillinewtonMetres(q(0.6)), viscous: Damping(I8F24::from_num(1e-5)) },
        weight: MillinewtonMetres(q(1.5)),
        offset: MillinewtonMetres(q(-0.3)),
        deadband: MillinewtonMetres(q(0.1)),
        gains: gains(0.8),
        ..Compensation::NONE
    };
    found.angle[0] = Wave { order: 1, amplitude: q(0.5), phase: 20_000 };
    found.angle[1] = Wave { order: 14, amplitude: q(0.8), phase: 60_000 };
    found.ripple[0] = Wave { order: 7, amplitude: q(0.1), phase: 1_000 };
    found
}

fn plan(compensation: Compensation) -> Result<Plan, Refusal> {
    Plan::new(&Device { compensation, ..Device::commissioned_virtual() }, &Patient::nobody())
}

fn running(compensation: Compensation) -> Controller {
    let mut controller = Controller::new(plan(compensation).expect("it may run"));
    controller.order(Order::Start);
    controller
}

fn tick(controller: &mut Controller, count: i32, tilt: i16) -> TickOutput {
    controller.order(Order::Heartbeat);
    controller.tick(TickInput { count: Counts(count), tilt: Milliradians(tilt) })
}

/// Codes past zero torque after so many ticks at a place.
fn code_after(controller: &mut Controller, ticks: usize, count: i32, tilt: i16) -> i32 {
    let zero = i32::from(controller.plan().zero_torque_code().0);
    let last = (0..ticks).map(|_| tick(controller, count, tilt)).last().expect("some ticks");
    i32::from(last.dac.0) - zero
}

/// Codes for a torque on the default device.
fn codes(torque_mnm: f64) -> f64 {
    torque_mnm * 2_047.0 / 28.8
}

fn waves<const N: usize>(most: f64) -> impl Strategy<Value = [Wave; N]> {
    let wave = (1..=60_u16, 0.0..most, any::<u16>());
    prop::collection::vec(wave, 0..=N).prop_map(|found| {
        let mut waves = [Wave::default(); N];
        for (place, (order, amplitude, phase)) in waves.iter_mut().zip(found) {
            *place = Wave { order, amplitude: q(amplitude), phase };
        }
        waves
    })
}

fn friction() -> impl Strategy<Value = Friction> {
    (0.0..1.0_f64, 0.0..1e-4_f64).prop_map(|(dry, viscous)| Friction {
        dry: MillinewtonMetres(q(dry)),
        viscous: Damping(I8F24::from_num(viscous)),
    })
}

/// Devices that may feed forward what was found on them.
fn device() -> impl Strategy<Value = Device> {
    let parts = (waves::<8>(0.3), waves::<4>(0.1), friction(), friction(), 1.3..5.0_f64, 1.0..10.0_f64);
    let scalars = (-2.0..2.0_f64, -0.5..0.5_f64, prop_oneof![Just(0.0), 0.01..0.3_f64]);
    let gain = || 0..=200_u8;
    (parts, scalars, [gain(), gain(), gain(), gain()], 0.5..2.0_f64).prop_filter_map(
        "refused",
        |((angle, ripple, inwards, outwards, rest, blend), (weight, offset, deadband), gains, stiffness)| {
            let [angle_gain, friction_gain, weight_gain, drive_gain] = gains.map(Gain);
            let compensation = Compensation {
                angle,
                ripple,
                inwards,
                outwards,
                rest_speed: MillimetresPerSecond(q(rest)),
                full_speed: MillimetresPerSecond(q(rest + blend)),
                weight: MillinewtonMetres(q(weight)),
                offset: MillinewtonMetres(q(offset)),
                deadband: MillinewtonMetres(q(deadband)),
                gains: Gains {
                    angle: angle_gain,
                    friction: friction_gain,
                    weight: weight_gain,
                    drive: drive_gain,
                },
                ..Compensation::NONE
            };
            let mut device = Device { compensation, ..Device::commissioned_virtual() };
            device.limits.stiffness = Stiffness(q(stiffness));
            // A tilt that jumps is no matter here.
            device.limits.slew_per_tick = MillinewtonMetres(q(50.0));
            Plan::new(&device, &Patient::nobody()).is_ok().then_some(device)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, max_global_rejects: 100_000, ..ProptestConfig::default() })]

    #[test]
    fn fixed_point_follows_its_twin(
        device in device(),
        // Five turns. Each turn more, the angle is off by 3e-7 of one.
        index in -20_000..20_000_i32,
        legs in prop::collection::vec((-0.9..0.9_f64, 1..900_u32), 1..8),
        tilts in prop::collection::vec(-1_571..=1_571_i16, 1..4),
    ) {
        let plan = Plan::new(&device, &Patient::nobody()).expect("filtered");
        let mut controller = Controller::new(plan);
        controller.order(LargeOrder::Index(Some(Counts(index))));
        controller.order(Order::Start);
        let mut twin = Twin::new(&device, index);
        let (mut at, mut speed, mut number) = (0.0_f64, 0.0_f64, 0);
        // As a hand joins speeds, after a rest in which the gains rise.
        let walk = std::iter::once((0.0, 5_000)).chain(legs).chain(std::iter::once((0.0, 500)));
        for (wanted, ticks) in walk {
            for _ in 0..ticks {
                let wanted = if at.abs() > 3_000.0 && at * wanted > 0.0 { 0.0 } else { wanted };
                speed += (wanted - speed).clamp(-0.004, 0.004);
                at += speed;
                number += 1;
                let (count, tilt) = (at.round() as i32, tilts[number as usize / 1_500 % tilts.len()]);
                let output = tick(&mut controller, count, tilt);
                prop_assert_eq!(output.tripped, None);
                prop_assert!(!output.limits.contains(Limits::PASSIVITY), "tick {}", number);
                let wanted = twin.tick(number, count, output.speed.0.to_num(), tilt);
                if number > 5_000 {
                    let got = f64::from(output.dac.0) - 2_048.0;
                    let wanted = codes(wanted);
                    prop_assert!((got - wanted).abs() <= 1.0, "tick {number}, count {count}: {got} for {wanted}");
                }
            }
        }
    }

    /// Whatever is counted and ordered: no panic, and no torque beyond the ceiling.
    #[test]
    fn nothing_overflows(
        device in device(),
        steps in prop::collection::vec((any::<i32>(), 0_u32..32, 0_u8..10, any::<i16>()), 1..400),
    ) {
        let plan = Plan::new(&device, &Patient::nobody()).expect("filtered");
        let mut controller = Controller::new(plan.clone());
        for (count, shift, order, tilt) in steps {
            match order {
                0 => controller.order(Order::Zero),
                1 => controller.order(LargeOrder::Configure(plan.clone())),
                2 => controller.order(LargeOrder::Index(Some(Counts(count)))),
                3 => controller.order(Order::Compensate(gains(0.7))),
                4..=6 => controller.order(Order::Start),
                _ => controller.order(Order::Heartbeat),
            }
            let output = controller.tick(TickInput { count: Counts(count >> shift), tilt: Milliradians(tilt) });
            prop_assert!(output.enable || output.dac.0 == 2_048, "torque without the amplifier");
        }
    }
}

#[test]
fn a_device_on_which_nothing_was_found_feeds_nothing_forward() {
    let mut controller = running(Compensation { gains: gains(0.9), ..Compensation::NONE });
    controller.order(LargeOrder::Index(Some(Counts(0))));
    assert!((0..10_000).all(|step| tick(&mut controller, step / 8, 800).dac.0 == 2_048));
}

#[test]
fn weight_needs_no_angle_and_waves_wait_for_it() {
    let weight = Compensation { weight: MillinewtonMetres(q(1.5)), gains: gains(0.8), ..Compensation::NONE };
    let held = code_after(&mut running(weight), 4_000, 0, 1_571);
    assert!((f64::from(held) + codes(1.5 * 204.0 / 256.0)).abs() < 1.0, "{held} codes hold the weight");
    let up = code_after(&mut running(weight), 4_000, 0, -1_571);
    assert_eq!(up, -held, "needle up: the other way");

    let mut wave = Compensation { gains: gains(0.8), ..Compensation::NONE };
    // The whole of it at a rotor's angle of zero.
    wave.angle[0] = Wave { order: 3, amplitude: q(1.0), phase: 16_384 };
    let mut controller = running(wave);
    assert_eq!(code_after(&mut controller, 4_000, 0, 0), 0, "the rotor's angle is not known");
    controller.order(LargeOrder::Index(Some(Counts(0))));
    assert_eq!(code_after(&mut controller, 4_000, 0, 0), 0, "nor taken while torque is on");
    controller.order(Order::Stop);
    controller.order(LargeOrder::Index(Some(Counts(0))));
    controller.order(Order::Start);
    let here = code_after(&mut controller, 4_000, 0, 0);
    assert!((f64::from(here) + codes(204.0 / 256.0)).abs() < 1.0, "{here}");
    // Zeroed elsewhere the rotor's angle is the same.
    controller.order(Order::Stop);
    controller.order(Order::Zero);
    controller.order(Order::Start);
    assert_eq!(code_after(&mut controller, 4_000, 0, 0), here);
    // Another wave is another rotor.
    wave.angle[0].order = 4;
    controller.order(Order::Stop);
    controller.order(LargeOrder::Configure(plan(wave).expect("it may run")));
    controller.order(Order::Start);
    assert_eq!(code_after(&mut controller, 4_000, 0, 0), 0);
}

#[test]
fn gains_change_without_a_step_and_a_fault_ends_feedforward() {
    let weight = Compensation { weight: MillinewtonMetres(q(3.0)), gains: gains(0.9), ..Compensation::NONE };
    let mut controller = running(weight);
    let all = code_after(&mut controller, 4_000, 0, 1_571);
    assert!(all < -150, "{all}");
    controller.order(Order::Compensate(gains(0.45)));
    let mut last = all;
    for _ in 0..4_000 {
        let code = i32::from(tick(&mut controller, 0, 1_571).dac.0) - 2_048;
        assert!((code - last).abs() <= 2, "a step from {last} to {code}");
        last = code;
    }
    assert!((2 * last - all).abs() <= 3, "{last} is half of {all}");
    controller.order(Order::Compensate(Gains::OFF));
    assert_eq!(code_after(&mut controller, 4_000, 0, 1_571), 0);

    controller.order(Order::Compensate(gains(0.9)));
    assert_eq!(code_after(&mut controller, 4_000, 0, 1_571), all);
    controller.order(Order::Trip(Fault::EmergencyStop));
    let output = tick(&mut controller, 0, 1_571);
    assert_eq!((output.enable, output.dac.0), (false, 2_048), "off in the same tick");
    // A person starts it again: from nothing.
    controller.order(Order::Clear);
    controller.order(Order::Start);
    let first = code_after(&mut controller, 100, 0, 1_571);
    assert!(first.abs() < all.abs() / 10, "{first} after 10 ms");
    assert_eq!(code_after(&mut controller, 4_000, 0, 1_571), all);
}

#[test]
fn an_excitation_plays_without_compensation_unless_asked() {
    let weight = Compensation { weight: MillinewtonMetres(q(1.5)), gains: gains(0.8), ..Compensation::NONE };
    for compensated in [false, true] {
        let servo = Servo { stiffness: Stiffness::default(), damping: Damping::default() };
        let travel = Millimetres(q(10.0));
        let excitation = Excitation { signal: Signal::Hold, duration_ms: 1_000, servo, travel, compensated };
        let mut controller = Controller::new(plan(weight).expect("it may run"));
        controller.order(LargeOrder::Excite(excitation));
        assert_eq!(code_after(&mut controller, 9_000, 0, 1_571) != 0, compensated);
    }
}

/// A needle at rest on the edge of a count, a needle that creeps: no friction is given back, so
/// nothing starts to move.
#[test]
fn a_count_to_and_fro_is_rest() {
    let mut controller = running(Compensation {
        inwards: Friction { dry: MillinewtonMetres(q(1.0)), ..Friction::default() },
        outwards: Friction { dry: MillinewtonMetres(q(1.0)), ..Friction::default() },
        gains: gains(0.7),
        ..Compensation::NONE
    });
    for step in 0..20_000 {
        assert_eq!(tick(&mut controller, (step / 300) % 2, 0).dac.0, 2_048, "tick {step}");
    }
    for step in 0..20_000 {
        assert_eq!(tick(&mut controller, step / 130, 0).dac.0, 2_048, "1.2 mm/s");
    }
}

fn refused(change: impl FnOnce(&mut Device)) -> Option<Refusal> {
    let mut device = Device { compensation: found(), ..Device::commissioned_virtual() };
    device.compensation.gains = gains(0.5);
    change(&mut device);
    Plan::new(&device, &Patient::nobody()).err()
}

#[test]
fn what_may_not_be_fed_forward_is_refused_with_the_reason() {
    assert_eq!(refused(|_| ()), None);
    let field = |change: fn(&mut Compensation)| match refused(|device| change(&mut device.compensation)) {
        Some(Refusal::OutOfRange { field, .. }) => field,
        other => panic!("{other:?}"),
    };
    assert_eq!(field(|c| c.version = 2), Field::CompensationVersion);
    assert_eq!(field(|c| c.angle[1].order = 501), Field::WaveOrder);
    assert_eq!(field(|c| c.angle[1].amplitude = q(-0.1)), Field::WaveAmplitude);
    assert_eq!(field(|c| c.ripple[1] = Wave { order: 3, amplitude: q(0.41), phase: 0 }), Field::Ripple);
    assert_eq!(field(|c| c.outwards.dry.0 = q(-0.01)), Field::DryFriction);
    assert_eq!(field(|c| c.inwards.viscous.0 = I8F24::from_num(-0.01)), Field::ViscousFriction);
    // A count a window is 1.227 mm/s.
    assert_eq!(field(|c| c.rest_speed.0 = q(1.22)), Field::RestSpeed);
    assert_eq!(field(|c| c.full_speed.0 = q(2.9)), Field::FullSpeed);
    assert_eq!(field(|c| c.weight.0 = q(29.0)), Field::Weight);
    assert_eq!(field(|c| c.offset.0 = q(-29.0)), Field::DriveOffset);
    assert_eq!(field(|c| c.deadband.0 = q(0.0001)), Field::Deadband);
    assert_eq!(field(|c| c.gains.angle = Gain(244)), Field::AngleGain);
    assert_eq!(field(|c| c.gains.friction = Gain(255)), Field::FrictionGain);
    assert_eq!(field(|c| c.gains.weight = Gain(244)), Field::WeightGain);
    assert_eq!(field(|c| c.gains.drive = Gain(244)), Field::DriveGain);
    assert_eq!(refused(|device| device.compensation.gains.weight = Gain(243)), None);
}

#[test]
fn too_strong_and_unstable_compensations_are_refused() {
    // A quarter of 28.8 mN·m is 7.2. At a half, waves ask for 0.65, friction for 0.3 and the drive
    // for 0.2.
    assert_eq!(refused(|device| device.compensation.weight.0 = q(12.0)), None);
    let strong = refused(|device| device.compensation.weight.0 = q(12.2));
    assert!(matches!(strong, Some(Refusal::CompensationTooStrong { .. })), "{strong:?}");
    // Half of 0.06 N, late by 150 µs: 6.06 N/mm, less 0.5·(0.5·1 + 0.8·14)/100.
    let allowed = |stiffness: f64| refused(|device| device.limits.stiffness.0 = q(stiffness));
    assert_eq!(allowed(5.98), None);
    assert!(matches!(allowed(6.03), Some(Refusal::CompensationUnstable { .. })), "{:?}", allowed(6.03));
    // Without friction there is nothing to take away.
    let without = |device: &mut Device| {
        device.limits.stiffness.0 = q(6.9);
        (device.compensation.inwards, device.compensation.outwards) =
            (Friction::default(), Friction::default());
    };
    assert_eq!(refused(without), None);
}
