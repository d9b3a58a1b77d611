//! Tests of the laws where a person would notice: at rest, on the way in, on the way out.

use control_core::config::{FrictionLaw, Law, Layer, Parabola, SPRING_BACK, SpeedMethod, Tissue, Wall};
use control_core::event::State;
use control_core::units::{
    Counts, FrictionPerMillimetre, JogCompliance, Millimetres, Milliradians, Newtons, Stiffness,
};
use control_core::{Config, Controller, Device, Order, Patient, TickInput, TickOutput};
use fixed::types::I16F16;

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

/// The default's.
fn cone() -> FrictionLaw {
    FrictionLaw::Cone { stiffness: Stiffness(I16F16::ONE) }
}

fn paper() -> FrictionLaw {
    FrictionLaw::Paper {
        level_length: Millimetres(I16F16::from_num(23)),
        level_cap: I16F16::from_num(2),
        anchor_ms: 60,
        stiffness: Stiffness(I16F16::from_num(0.5)),
        limit: Newtons(I16F16::from_num(1)),
        limit_out: Newtons(I16F16::from_num(1)),
    }
}

fn started(config: &Config) -> Controller {
    let mut controller = Controller::new(config.plan().expect("the configuration is sound"));
    controller.tick(TickInput { tilt: STRAIGHT, ..TickInput::default() });
    controller.order(Order::Start);
    controller
}

/// Moves to `mm` at `mm_per_s`, heartbeats included; gives every tick to `see`.
fn travel(c: &mut Controller, from: &mut f64, mm: f64, mm_per_s: f64, mut see: impl FnMut(&TickOutput)) {
    let per_count = c.plan().mm_per_count().to_num::<f64>();
    let step = mm_per_s / 10_000.0 * (mm - *from).signum();
    while (mm - *from).abs() > step.abs() {
        *from += step;
        see(&tick_at(c, (*from / per_count).round() as i32));
    }
}

fn hold(c: &mut Controller, mm: f64, seconds: f64) -> TickOutput {
    let per_count = c.plan().mm_per_count().to_num::<f64>();
    let count = (mm / per_count).round() as i32;
    (0..(seconds * 10_000.0) as usize).map(|_| tick_at(c, count)).last().expect("at least one tick")
}

fn tick_at(c: &mut Controller, count: i32) -> TickOutput {
    c.order(Order::Heartbeat);
    c.tick(TickInput { count: Counts(count), tilt: STRAIGHT })
}

#[test]
fn the_default_is_a_venepuncture_with_two_punctures() {
    let mut c = started(&Config::commissioned_virtual());
    let (mut at, mut punctures, mut peak) = (0.0, Vec::new(), 0.0_f64);
    travel(&mut c, &mut at, 7.7, 10.0, |out| {
        if out.transitions.puncture != 0 {
            punctures.push((out.transitions.puncture, out.depth.0.to_num::<f64>()));
        }
        peak = peak.max(out.force.0.to_num());
    });
    assert_eq!(punctures.iter().map(|p| p.0).collect::<Vec<_>>(), [0b001, 0b100]);
    assert!((punctures[0].1 - 3.0).abs() < 0.02 && (punctures[1].1 - 6.3).abs() < 0.02, "{punctures:?}");
    assert!((0.95..1.05).contains(&peak), "peak force {peak} N");
}

#[test]
fn a_wall_is_pressed_then_gives_way_then_rubs() {
    let mut c = started(&Config::commissioned_virtual());
    let (mut at, mut states) = (0.0, Vec::new());
    travel(&mut c, &mut at, 7.7, 10.0, |out| states.push(out.sample.state));
    states.dedup();
    let one_wall = [State::Elastic, State::Puncture, State::Friction].map(|state| state as u8);
    // The skin begins at depth zero, and behind it is the vessel.
    assert_eq!(states, [one_wall, one_wall].concat());
    assert_eq!(hold(&mut c, at, 0.1).sample.state, State::Friction as u8, "at rest");
}

#[test]
fn a_quarter_of_a_mm_back_is_a_withdrawal_however_slow() {
    for speed in [SpeedMethod::Window, SpeedMethod::EdgeTiming] {
        let device = Device { speed, ..Device::commissioned_virtual() };
        let mut c = started(&Config { device, ..Config::commissioned_virtual() });
        let mut at = 0.0;
        travel(&mut c, &mut at, 7.7, 10.0, |_| ());
        let mut drawn_back_by = |mm: f64, mm_per_s: f64| {
            let (mut last, to) = (State::Approach as u8, at - mm);
            travel(&mut c, &mut at, to, mm_per_s, |out| last = out.sample.state);
            last
        };
        assert_eq!(drawn_back_by(0.2, 1.5), State::Friction as u8, "{speed:?}");
        assert_eq!(drawn_back_by(0.4, 0.3), State::Withdrawal as u8, "{speed:?}");
    }
}

#[test]
fn a_tip_drawn_back_a_little_rubs_in_the_layer_above() {
    let layer = |top: i16, friction: f64| Layer {
        tissue: Tissue::Other,
        depth: Millimetres(I16F16::from_num(top)),
        wall: None,
        friction: FrictionPerMillimetre(I16F16::from_num(friction)),
    };
    let layers = [layer(0, 0.0), layer(2, 1.5)].into_iter().collect();
    let mut config =
        Config { patient: Patient { layers, ..Patient::default() }, ..Config::commissioned_virtual() };
    config.device.limits.travel = Millimetres(I16F16::from_num(3));
    let mut c = started(&config);
    let mut at = 0.0;
    travel(&mut c, &mut at, 2.05, 5.0, |_| ());
    assert_ne!(hold(&mut c, at, 0.01).force, Newtons::default());
    // Not so far as to have left the inner layer.
    travel(&mut c, &mut at, 1.9, 5.0, |_| ());
    assert_eq!(hold(&mut c, at, 0.01).force, Newtons::default());
}

#[test]
fn a_resting_needle_keeps_its_force_only_with_the_cone() {
    for (law, held) in [(cone(), true), (paper(), false)] {
        let mut c = started(&Config {
            patient: Patient { law: Law::Jog(law), ..Patient::default() },
            ..Config::commissioned_virtual()
        });
        let mut at = 0.0;
        let mut moving = 0.0;
        travel(&mut c, &mut at, 4.5, 10.0, |out| moving = out.force.0.to_num::<f64>());
        let rest = hold(&mut c, at, 1.0).force.0.to_num::<f64>();
        assert!(moving > 0.05, "{law:?}: {moving} N while moving");
        if held {
            assert!(
                (rest - moving).abs() < 0.002,
                "cone: {moving} N moving, {rest} N after a second of rest"
            );
        } else {
            assert!(rest.abs() < 0.000_5, "as printed: {rest} N after a second of rest");
        }
    }
}

#[test]
fn one_count_to_and_fro_is_no_withdrawal() {
    for speed in [SpeedMethod::Window, SpeedMethod::EdgeTiming] {
        let mut c = started(&Config {
            device: Device { speed, ..Device::commissioned_virtual() },
            ..Config::commissioned_virtual()
        });
        let mut at = 0.0;
        travel(&mut c, &mut at, 7.7, 10.0, |_| ());
        hold(&mut c, at, 0.1);
        let count = (at / c.plan().mm_per_count().to_num::<f64>()).round() as i32;
        let mut labels = Vec::new();
        // Slower than a dead channel's flicker, which is a fault.
        for period in [90, 150, 400] {
            labels.extend((0..4_000).map(|tick| tick_at(&mut c, count - tick / period % 2).sample.state));
        }
        labels.sort_unstable();
        labels.dedup();
        assert_eq!(labels, [State::Friction as u8], "{speed:?}");
        // Nor does a count end one: drawn out at 2 mm/s, counts come in twos and ones.
        let mm = at - 2.0;
        labels.clear();
        travel(&mut c, &mut at, mm, 2.0, |out| labels.push(out.sample.state));
        let changes = labels.windows(2).filter(|pair| pair[0] != pair[1]).count();
        assert_eq!((changes, labels.last()), (1, Some(&(State::Withdrawal as u8))), "{speed:?}");
    }
}

/// Beyond 10 mm a static level of 0.2 N and a dynamic one of 0.1 N, held with 1 N/mm.
fn sticking() -> Config {
    let layer = |top: i16, friction: f64| Layer {
        tissue: Tissue::Other,
        depth: Millimetres(I16F16::from_num(top)),
        wall: None,
        friction: FrictionPerMillimetre(I16F16::from_num(friction)),
    };
    let law = Law::Jog(FrictionLaw::StickSlip {
        stiffness: Stiffness(I16F16::ONE),
        sliding: I16F16::from_num(0.5),
    });
    let layers = [layer(0, 0.02), layer(10, 0.0)].into_iter().collect();
    Config { patient: Patient { law, layers, ..Patient::default() }, ..Config::commissioned_virtual() }
}

#[test]
fn a_needle_at_rest_sticks_and_a_sliding_one_is_rubbed_less() {
    for way in [1.0, -1.0] {
        let mut c = started(&sticking());
        let mut at = 0.0;
        travel(&mut c, &mut at, 20.0, 10.0, |_| ());
        let forces = |c: &mut Controller, at: &mut f64, mm: f64| {
            let (mut largest, mut last) = (0.0_f64, 0.0_f64);
            let to = *at + mm * way;
            travel(c, at, to, 5.0, |out| {
                last = out.force.0.to_num::<f64>() * way;
                largest = largest.max(last);
            });
            (largest, last)
        };
        // Sliding this way, whichever way it came.
        forces(&mut c, &mut at, 1.0);
        let near =
            |force: f64, level: f64| assert!((force - level).abs() < 0.02, "{way}: {force} N for {level} N");
        let rest = hold(&mut c, at, 0.1).force.0.to_num::<f64>() * way;
        near(rest, 0.1);
        let (largest, last) = forces(&mut c, &mut at, 1.0);
        near(largest, 0.2);
        near(last, 0.1);
        // A rest that is too short to stick.
        hold(&mut c, at, 0.01);
        near(forces(&mut c, &mut at, 1.0).0, 0.1);
    }
}

/// To and fro by drawn ways and rests: never more comes back than the hold stores, 0.02 mJ, and a
/// count of it for each turn.
#[test]
fn friction_that_sticks_gives_nothing_of_its_own() {
    let mut c = started(&sticking());
    let mut at = 0.0;
    travel(&mut c, &mut at, 25.0, 10.0, |_| ());
    let (mut energy, mut least, mut before) = (0.0_f64, 0.0_f64, None::<(f64, f64)>);
    let mut drawn = 12_345_u32;
    for _ in 0..300 {
        drawn = drawn.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let to = 18.0 + f64::from(drawn >> 16) / 65_536.0 * 12.0;
        travel(&mut c, &mut at, to, 5.0 + f64::from(drawn >> 8 & 31), |out| {
            let (depth, force) = (out.depth.0.to_num::<f64>(), out.force.0.to_num::<f64>());
            if let Some((from, with)) = before {
                energy += with * (depth - from);
                least = least.min(energy);
            }
            before = Some((depth, force));
        });
        hold(&mut c, at, f64::from(drawn & 63) * 1e-3 + 1e-4);
    }
    assert!(least > -0.03 && energy > 10.0, "the energy fell to {least} mJ and ended at {energy} mJ");
}

#[test]
fn friction_opposes_withdrawal() {
    for law in [cone(), paper()] {
        let mut c = started(&Config {
            patient: Patient { law: Law::Jog(law), ..Patient::default() },
            ..Config::commissioned_virtual()
        });
        let (mut at, mut inwards, mut outwards) = (0.0, 0.0, 0.0);
        travel(&mut c, &mut at, 5.0, 10.0, |o| inwards = o.force.0.to_num::<f64>());
        let mut state = State::Idle as u8;
        travel(&mut c, &mut at, 4.4, 10.0, |o| {
            outwards = o.force.0.to_num::<f64>();
            state = o.sample.state;
        });
        assert!(inwards > 0.03 && outwards < -0.03, "{law:?}: {inwards} N in, {outwards} N out");
        assert_eq!(state, State::Withdrawal as u8);
    }
}

#[test]
fn equation_2_has_a_limit_of_its_own_on_the_way_out() {
    let mut law = paper();
    if let FrictionLaw::Paper { limit_out, .. } = &mut law {
        limit_out.0 = I16F16::from_num(0.04);
    }
    let mut c = started(&Config {
        patient: Patient { law: Law::Jog(law), ..Patient::default() },
        ..Config::commissioned_virtual()
    });
    let (mut at, mut most, mut least) = (0.0, 0.0_f64, 0.0_f64);
    travel(&mut c, &mut at, 5.0, 10.0, |o| most = most.max(o.force.0.to_num()));
    travel(&mut c, &mut at, 4.2, 10.0, |o| least = least.min(o.force.0.to_num()));
    assert!((least + 0.04).abs() < 1e-4 && most > 0.06, "{most} N in, {least} N out");
}

#[test]
fn a_wall_stays_open_until_the_tip_has_left_it() {
    let mut c = started(&Config::commissioned_virtual());
    let (mut at, mut punctures, mut exits) = (0.0, 0, 0);
    let mut see = |o: &TickOutput| {
        punctures += u32::from(o.transitions.puncture & 1);
        exits += u32::from(o.transitions.exit & 1);
    };
    for target in [4.0, 0.1, 4.0, -1.0, 4.0] {
        travel(&mut c, &mut at, target, 20.0, &mut see);
    }
    assert_eq!((punctures, exits), (2, 1));
}

/// Six walls 1 mm apart that give way after 0.5 mm.
fn six_walls() -> Config {
    let parabola = |vertex: f64, compliance: f64| Parabola {
        vertex: Millimetres(I16F16::from_num(vertex)),
        compliance: JogCompliance(I16F16::from_num(compliance)),
        base: Newtons::default(),
    };
    let layer = |number: u8| Layer {
        tissue: Tissue::Other,
        depth: Millimetres(I16F16::from_num(number)),
        wall: Some(Wall {
            elastic: parabola(0.0, 1.0),
            puncture_travel: Millimetres(I16F16::from_num(0.5)),
            relief: parabola(4.0, 100.0),
            unload: Stiffness(I16F16::from_num(0.1)),
            spring_back: SPRING_BACK,
        }),
        friction: FrictionPerMillimetre::default(),
    };
    let mut config = Config {
        patient: Patient { layers: (0..6).map(layer).collect(), ..Patient::default() },
        ..Config::commissioned_virtual()
    };
    config.device.limits.max_counts_per_tick = 1_000;
    config
}

#[test]
fn a_needle_that_jumps_crosses_each_layer_on_its_way() {
    let mut c = started(&six_walls());
    let per_count = c.plan().mm_per_count().to_num::<f64>();
    // One layer a tick: all that is crossed until the tip has come to rest, and in which order.
    let mut to = |mm: f64| {
        let (mut crossed, mut order) = ([0; 3], Vec::new());
        for _ in 0..12 {
            let step = tick_at(&mut c, (mm / per_count).round() as i32).transitions;
            assert!(step.contact.count_ones() + step.exit.count_ones() <= 1, "one layer a tick: {step:?}");
            order.extend(
                [(step.puncture, 'p'), (step.contact, 'c')].into_iter().filter(|(layer, _)| *layer != 0),
            );
            crossed = [crossed[0] | step.contact, crossed[1] | step.puncture, crossed[2] | step.exit];
        }
        assert!(order.is_sorted(), "touched, then given way, from the outside inwards: {order:?}");
        crossed
    };
    assert_eq!(to(-1.0), [0, 0, 1], "it began at the first");
    assert_eq!(to(2.7), [0b111, 0b111, 0], "three layers and their walls");
    assert_eq!(to(4.2), [0b1_1000, 0b1000, 0], "the fifth is touched and has not given way");
    assert_eq!(to(9.0), [0b10_0000, 0b11_0000, 0]);
    assert_eq!(to(2.9), [0, 0, 0b11_0000], "0.1 mm outside the fourth it has not been left");
    assert_eq!(to(9.0), [0b11_0000, 0b11_0000, 0], "what was left was whole again");
    assert_eq!(to(-1.0), [0, 0, 0b11_1111]);
    assert_eq!(to(9.0), [0b11_1111, 0b11_1111, 0]);
}
