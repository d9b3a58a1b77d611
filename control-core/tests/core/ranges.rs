//! Each value of a configuration has a range, whose ends belong to it.

use super::refusals::{q, refusal, weak};
use control_core::config::{FrictionLaw, Law};
use control_core::plan::Field;
use control_core::units::{Damping, Millimetres, Newtons, Stiffness};
use control_core::{Config, Refusal};
use fixed::types::I8F24;

/// The field that is refused; any other reason is distinguished.
fn field(change: impl FnOnce(&mut Config)) -> Option<Field> {
    match refusal(change) {
        None => None,
        Some(Refusal::OutOfRange { field, .. }) => Some(field),
        Some(other) => panic!("{other:?}"),
    }
}

/// A value, a step beyond the least and the most that it may be, and how it is set.
type Range = (Field, [f64; 2], [f64; 2], fn(&mut Config, f64));

/// A change of the law of friction.
type ChangedLaw = fn(&mut FrictionLaw);

const RANGES: [Range; 20] = [
    (Field::RollerRadius, [4.0, 3.99], [25.0, 25.01], |c, v| c.device.roller_radius.0 = q(v)),
    (Field::CountsPerTurn, [256.0, 255.0], [65_535.0, f64::NAN], |c, v| c.device.counts_per_turn = v as u16),
    (Field::FullScaleTorque, [28.8, 9.99], [500.0, 500.01], |c, v| c.device.full_scale_torque.0 = q(v)),
    (Field::TorqueLimit, [0.1, 0.09], [28.79, 28.81], |c, v| c.device.limits.torque.0 = q(v)),
    (Field::ContinuousTorque, [3.0, 2.99], [180.0, 180.1], |c, v| c.device.limits.continuous_torque.0 = q(v)),
    (Field::WindingTimeS, [1.0, 0.0], [600.0, 601.0], |c, v| c.device.limits.winding_time_s = v as u16),
    (Field::SlewPerTick, [0.0011, 0.0009], [100.0, 100.1], |c, v| c.device.limits.slew_per_tick.0 = q(v)),
    (Field::FadeInMs, [10.0, 9.0], [5_000.0, 5_001.0], |c, v| c.device.limits.fade_in_ms = v as u16),
    (Field::MaxCountsPerTick, [2.0, 1.0], [1_000.0, 1_001.0], |c, v| {
        c.device.limits.max_counts_per_tick = v as u16
    }),
    (Field::Travel, [1.0, 0.99], [500.0, 500.1], |c, v| c.device.limits.travel.0 = q(v)),
    (Field::StiffnessLimit, [0.051, 0.049], [7.0, 7.01], |c, v| c.device.limits.stiffness.0 = q(v)),
    (Field::HeartbeatMs, [20.0, 19.0], [5_000.0, 5_001.0], |c, v| c.device.limits.heartbeat_ms = v as u16),
    (Field::Damping, [0.0, -0.0001], [0.0005, 0.0006], |c, v| c.device.damping = Damping(I8F24::from_num(v))),
    (Field::SkinTilt, [-1_571.0, -1_572.0], [1_571.0, 1_572.0], |c, v| c.device.skin_tilt.0 = v as i16),
    (Field::DacZero, [-127.0, -128.0], [127.0, 128.0], |c, v| c.device.dac_zero = v as i16),
    (Field::LargestForce, [0.011, 0.009], [2.87, f64::NAN], |c, v| {
        c.patient.largest_force = Some(Newtons(q(v)));
    }),
    (Field::MovingMass, [1.0, 0.99], [1_000.0, 1_000.1], |c, v| c.device.mechanism.mass.0 = q(v)),
    (Field::MechanismFriction, [0.02, -0.01], [10.0, 10.01], |c, v| c.device.mechanism.dry_friction.0 = q(v)),
    (Field::DriveDelayUs, [20.0, 19.0], [1_000.0, 1_001.0], |c, v| c.device.mechanism.delay_us = v as u16),
    (Field::PassivityDamping, [0.0, -0.001], [0.0199, 0.0201], |c, v| {
        c.device.passivity_damping = Damping(I8F24::from_num(v));
    }),
];

#[test]
fn each_value_has_a_range_and_its_ends_belong_to_it() {
    for (name, low, high, set) in RANGES {
        for [within, beyond] in [low, high] {
            // Gentle in all else, for a weak motor is refused for other reasons.
            let run = |value: f64| {
                field(|config| {
                    weak(config);
                    set(config, value);
                    if name == Field::StiffnessLimit && value < 0.05 {
                        config.patient.law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(value)) });
                    }
                })
            };
            assert_eq!(run(within), None, "{name:?} {within}");
            if !beyond.is_nan() {
                assert_eq!(run(beyond), Some(name), "{name:?} {beyond}");
            }
        }
    }
}

const CHANGED_LAWS: [(Field, ChangedLaw); 7] = [
    (Field::LevelLength, |l| {
        if let FrictionLaw::Paper { level_length, .. } = l {
            level_length.0 = q(0.9)
        }
    }),
    (Field::LevelCap, |l| {
        if let FrictionLaw::Paper { level_cap, .. } = l {
            *level_cap = q(0.9)
        }
    }),
    (Field::AnchorMs, |l| {
        if let FrictionLaw::Paper { anchor_ms, .. } = l {
            *anchor_ms = 4
        }
    }),
    (Field::AnchorMs, |l| {
        if let FrictionLaw::Paper { anchor_ms, .. } = l {
            *anchor_ms = 1_001
        }
    }),
    (Field::FrictionStiffness, |l| {
        if let FrictionLaw::Paper { stiffness, .. } = l {
            stiffness.0 = q(0.0)
        }
    }),
    (Field::FrictionLimit, |l| {
        if let FrictionLaw::Paper { limit, .. } = l {
            limit.0 = q(2.9)
        }
    }),
    (Field::FrictionLimitOut, |l| {
        if let FrictionLaw::Paper { limit_out, .. } = l {
            limit_out.0 = q(0.0)
        }
    }),
];

/// Changes a law of friction as the first paper prints it, which is sound before.
fn paper(config: &mut Config, change: fn(&mut FrictionLaw)) {
    let mut law = FrictionLaw::Paper {
        level_length: Millimetres(q(23.0)),
        level_cap: q(1.0),
        anchor_ms: 60,
        stiffness: Stiffness(q(0.5)),
        limit: Newtons(q(0.5)),
        limit_out: Newtons(q(0.3)),
    };
    change(&mut law);
    config.patient.law = Law::Jog(law);
}

#[test]
fn each_number_of_a_friction_law_has_a_range() {
    for (name, change) in CHANGED_LAWS {
        assert_eq!(field(|config| paper(config, change)), Some(name));
    }
    assert_eq!(field(|config| paper(config, |_| {})), None);
}

#[test]
fn the_numbers_of_cone_and_stick_slip_have_ranges() {
    assert_eq!(
        field(|c| c.patient.law = Law::Jog(FrictionLaw::Cone { stiffness: Stiffness(q(0.04)) })),
        Some(Field::FrictionStiffness)
    );
    let sticking = |stiffness: f64, sliding: f64| {
        let law = FrictionLaw::StickSlip { stiffness: Stiffness(q(stiffness)), sliding: q(sliding) };
        field(|c| c.patient.law = Law::Jog(law))
    };
    assert_eq!((sticking(1.0, 0.21), sticking(1.0, 1.0)), (None, None));
    assert_eq!(
        (sticking(1.0, 0.19), sticking(1.0, 1.01)),
        (Some(Field::SlidingShare), Some(Field::SlidingShare))
    );
    assert_eq!(sticking(0.04, 0.5), Some(Field::FrictionStiffness));
}
