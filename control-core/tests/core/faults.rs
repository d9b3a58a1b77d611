//! A fault takes torque away within its tick, and only what is a fault does.

use crate::needle::Needle;
use control_core::event::{Fault, State};
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Counts, Damping, Millimetres, MillinewtonMetres, Milliradians, Stiffness};
use control_core::{Config, Controller, LargeOrder, Order, TickInput, TickOutput};
use fixed::types::I16F16;

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

/// A tick with a heartbeat.
fn tick_at(c: &mut Controller, count: i32) -> TickOutput {
    c.order(Order::Heartbeat);
    c.tick(TickInput { count: Counts(count), tilt: STRAIGHT })
}

#[test]
fn every_fault_takes_torque_away_within_the_tick_and_latches() {
    let pressed = || {
        let mut needle = Needle::new(&Config::commissioned_virtual(), STRAIGHT);
        needle.go(2.5, 10.0, |_| {});
        needle.core
    };
    let zero = pressed().plan().zero_torque_code();
    let deep = (2.5 / pressed().plan().mm_per_count().to_num::<f64>()) as i32;

    let mut c = pressed();
    let out = tick_at(&mut c, deep + 500);
    assert_eq!((out.tripped, out.enable, out.dac), (Some(Fault::EncoderJump), false, zero));
    let later = tick_at(&mut c, deep);
    assert_eq!((later.tripped, later.enable, later.dac), (None, false, zero), "it latches");

    let mut c = pressed();
    let silent = (0..2_100).map(|_| c.tick(TickInput { count: Counts(deep), tilt: STRAIGHT }));
    let tripped = silent.filter_map(|o| o.tripped.map(|f| (f, o.enable, o.dac))).collect::<Vec<_>>();
    assert_eq!(tripped, [(Fault::HostSilent, false, zero)]);

    c.order(Order::Clear);
    c.order(Order::Start);
    let again = tick_at(&mut c, deep);
    assert!(again.enable);
    assert!(again.dac.0.abs_diff(zero.0) <= 1, "torque fades in: {:?}", again.dac);
}

#[test]
fn an_excitation_stays_within_its_travel_and_ends_torque_off() {
    let ramps = Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(5)), ramp_ms: 200 };
    let excitation = Excitation {
        signal: ramps,
        duration_ms: 1_000,
        servo: Servo { stiffness: Stiffness::default(), damping: Damping::default() },
        travel: Millimetres(I16F16::from_num(20)),
        compensated: false,
    };
    let mut c = Controller::new(Config::commissioned_virtual().plan().expect("sound"));
    c.tick(TickInput { tilt: STRAIGHT, ..TickInput::default() });
    c.order(LargeOrder::Excite(excitation.clone()));
    let outputs = (0..11_000).map(|_| tick_at(&mut c, 0)).collect::<Vec<_>>();
    let zero = c.plan().zero_torque_code().0;
    let (most, least) = outputs.iter().fold((0, u16::MAX), |(a, b), o| (o.dac.0.max(a), o.dac.0.min(b)));
    // 5 mN·m of 28.8 mN·m over 2,047 steps.
    assert!(most.abs_diff(zero + 355) <= 2 && least.abs_diff(zero - 355) <= 2, "{least} to {most}");
    assert_eq!(outputs.iter().filter(|o| o.enable).count(), 10_000);
    assert!(outputs[10_000..].iter().all(|o| o.dac.0 == zero && o.sample.state == State::Idle as u8));

    c.order(LargeOrder::Excite(excitation));
    let trips = (0..2_000).filter_map(|t| tick_at(&mut c, t * 2).tripped).collect::<Vec<_>>();
    assert_eq!(trips, [Fault::Travel], "4,000 counts are 63 mm");
}

#[test]
fn no_count_under_torque_is_a_dead_encoder_but_rest_is_not() {
    let mut needle = Needle::new(&Config::commissioned_virtual(), STRAIGHT);
    needle.go(2.5, 10.0, |_| {});
    let mut c = needle.core;
    let count = (needle.at_mm / c.plan().mm_per_count().to_num::<f64>()).round() as i32;
    let dead = |c: &mut Controller| {
        (0..50_000).filter_map(|t| tick_at(c, count).tripped.map(|f| (t, f))).collect::<Vec<_>>()
    };
    // Torque is taken away after 4 s, and where that brings no count the encoder is dead.
    let trips = dead(&mut c);
    assert!(matches!(trips[..], [(40_490..=40_520, Fault::EncoderFrozen)]), "{trips:?}");
    // Lines at one level may be without power: 50 ms are long then.
    c.order(Order::Clear);
    c.order(Order::Start);
    c.set_lines_agree(true);
    let trips = dead(&mut c);
    // The fade-in comes first.
    assert!(matches!(trips[..], [(2_000..=4_100, Fault::EncoderFrozen)]), "{trips:?}");

    // Let go in tissue, where friction holds a fraction of a newton, the needle rests as long as it
    // likes.
    let mut needle = Needle::new(&Config::commissioned_virtual(), STRAIGHT);
    needle.go(4.5, 10.0, |_| {});
    assert_eq!(needle.rest(9.0).tripped, None);
    assert!(needle.rest(0.1).enable);
}
