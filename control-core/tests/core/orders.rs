//! Every order in every mode, and every bound at the last value within it and the first beyond.

use crate::needle::Needle;
use control_core::config::DacWidth;
use control_core::event::{Fault, Limits, State};
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Counts, Damping, Millimetres, MillinewtonMetres, Milliradians, Stiffness};
use control_core::{AnyOrder, Config, Controller, LargeOrder, Order, Plan, TickInput, TickOutput};
use fixed::types::{I8F24, I16F16};

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

fn controller() -> Controller {
    Controller::new(Config::commissioned_virtual().plan().expect("the default is sound"))
}

fn tick(c: &mut Controller, count: i32) -> TickOutput {
    c.tick(TickInput { count: Counts(count), tilt: STRAIGHT })
}

/// Powered at `count`.
fn started_at(count: i32) -> Controller {
    let mut c = controller();
    tick(&mut c, count);
    c.order(Order::Start);
    assert!(tick(&mut c, count).enable);
    c
}

/// Counts of a hand that holds still: the encoder lives.
fn tremor(tick: i32) -> i32 {
    [0, 1, 2, 1][(tick / 250 % 4) as usize]
}

fn other_plan() -> Plan {
    let mut config = Config::commissioned_virtual();
    config.device.dac = DacWidth::BITS_8;
    config.plan().expect("sound")
}

fn ramps(travel_mm: i32) -> Excitation {
    Excitation {
        signal: Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(1)), ramp_ms: 100 },
        duration_ms: 1_000,
        servo: Servo { stiffness: Stiffness::default(), damping: Damping::default() },
        travel: Millimetres(I16F16::from_num(travel_mm)),
        compensated: false,
    }
}

fn state(output: &TickOutput) -> Option<State> {
    State::from_code(output.sample.state)
}

/// The control law holds to it by itself, whatever the link lets through.
#[test]
fn an_uncommissioned_device_plays_only_gentle_excitations() {
    let unknown = Config::default();
    let mut c = Controller::new(unknown.plan().expect("the default is sound"));
    c.order(Order::Start);
    assert!(!tick(&mut c, 0).enable, "no start");
    let mut strong = ramps(50);
    strong.signal = Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(2.1)), ramp_ms: 100 };
    let mut servo = ramps(50);
    servo.servo.stiffness.0 = I16F16::from_num(0.1);
    for refused in [strong, servo] {
        c.order(LargeOrder::Excite(refused));
        assert!(!tick(&mut c, 0).enable, "no excitation that is not gentle");
    }
    c.order(LargeOrder::Excite(ramps(50)));
    assert!(tick(&mut c, 0).enable, "1 mN·m without a servo");
    c.order(Order::Stop);
    c.order(LargeOrder::Configure(Config::commissioned_virtual().plan().expect("sound")));
    c.order(Order::Start);
    assert!(tick(&mut c, 0).enable, "a commissioned one starts");
}

#[test]
fn a_fault_stays_latched_until_it_is_cleared() {
    let mut c = started_at(0);
    c.order(Order::Stop);
    let output = tick(&mut c, 0);
    assert_eq!((output.enable, state(&output)), (false, Some(State::Idle)));

    let mut c = started_at(0);
    c.order(Order::Trip(Fault::Tilt));
    c.order(Order::Stop);
    let output = tick(&mut c, 0);
    assert_eq!((output.enable, state(&output)), (false, Some(State::Fault)));
    for order in [LargeOrder::Excite(ramps(50)).into(), AnyOrder::from(Order::Start)] {
        c.order(order);
        assert!(!tick(&mut c, 0).enable, "neither a stop nor a start clears it");
    }
    c.order(Order::Clear);
    assert_eq!(state(&tick(&mut c, 0)), Some(State::Idle));
    c.order(Order::Start);
    assert!(tick(&mut c, 0).enable);
    c.order(Order::Clear);
    assert!(tick(&mut c, 0).enable, "without a fault there is nothing to clear");
}

#[test]
fn the_first_of_two_faults_is_reported() {
    let mut c = started_at(0);
    c.order(Order::Trip(Fault::Tilt));
    c.order(Order::Trip(Fault::Overrun));
    assert_eq!(tick(&mut c, 0).tripped, Some(Fault::Tilt));
    assert_eq!(tick(&mut c, 0).tripped, None, "and once");
}

#[test]
fn the_zero_moves_to_the_needle_only_while_torque_is_off() {
    let mut c = controller();
    tick(&mut c, 500);
    c.order(Order::Zero);
    assert_eq!(tick(&mut c, 510).sample.count, 10);
    c.order(Order::Start);
    tick(&mut c, 510);
    c.order(Order::Zero);
    assert_eq!(tick(&mut c, 512).sample.count, 12, "powered, it stays");
}

#[test]
fn a_plan_is_taken_only_while_torque_is_off() {
    let mut c = controller();
    c.order(LargeOrder::Configure(other_plan()));
    assert_eq!(c.plan().config().device.dac, DacWidth::BITS_8);
    let mut c = started_at(0);
    c.order(LargeOrder::Configure(other_plan()));
    assert_eq!(c.plan().config().device.dac, DacWidth::BITS_12);
}

#[test]
fn a_plan_taken_deep_inside_finds_a_needle_at_rest() {
    let mut c = controller();
    tick(&mut c, 400);
    c.order(LargeOrder::Configure(other_plan()));
    let output = tick(&mut c, 400);
    assert_eq!(output.speed.0, I16F16::ZERO, "no jump from zero is taken for speed");
    let met = (0..5).fold(output.transitions.contact, |met, _| met | tick(&mut c, 400).transitions.contact);
    assert_eq!(met, 0b111, "and the layers it is in are counted, one a tick");
}

#[test]
fn orders_that_do_not_fit_the_mode_change_nothing() {
    let mut needle = Needle::new(&Config::commissioned_virtual(), STRAIGHT);
    needle.go(2.5, 10.0, |_| {});
    let before = needle.rest(0.1);
    needle.core.order(Order::Zero);
    needle.core.order(LargeOrder::Configure(Config::commissioned_virtual().plan().expect("sound")));
    needle.core.order(Order::Start);
    let after = needle.rest(0.000_1);
    assert_eq!((before.sample, before.force), (after.sample, after.force));
}

#[test]
fn an_excitation_begins_at_the_motor_only_while_torque_is_off() {
    let mut c = controller();
    tick(&mut c, 1_000);
    c.order(LargeOrder::Excite(ramps(2)));
    let output = tick(&mut c, 1_000);
    assert_eq!(
        (output.tripped, state(&output)),
        (None, Some(State::Excitation)),
        "15.7 mm deep, 2 mm of travel"
    );

    let mut c = started_at(0);
    c.order(LargeOrder::Excite(ramps(2)));
    assert_eq!(state(&tick(&mut c, -100)), Some(State::Fault), "100 counts in a tick, running");
    let mut c = started_at(-100);
    c.order(LargeOrder::Excite(ramps(2)));
    assert_eq!(state(&tick(&mut c, -100)), Some(State::Approach), "it runs on");
}

#[test]
fn an_encoder_jump_beyond_the_limit_of_a_tick_trips() {
    let most = i32::from(Config::commissioned_virtual().device.limits.max_counts_per_tick);
    for direction in [-1, 1] {
        assert_eq!(tick(&mut started_at(0), direction * most).tripped, None);
        let further = tick(&mut started_at(0), direction * (most + 1)).tripped;
        assert_eq!(further, Some(Fault::EncoderJump));
    }
    let mut c = controller();
    tick(&mut c, 0);
    assert_eq!(tick(&mut c, 10_000).tripped, None, "with torque off a needle is moved as one likes");
}

#[test]
fn a_needle_may_go_to_the_end_of_its_travel_and_no_further() {
    // 60 mm at 15.708 µm a count, rounded up.
    let end = 3_820;
    for direction in [-1, 1] {
        let mut c = started_at(direction * (end - 1));
        assert_eq!(tick(&mut c, direction * end).tripped, None);
        assert_eq!(tick(&mut c, direction * (end + 1)).tripped, Some(Fault::Travel));
    }
}

#[test]
fn a_pc_silent_for_longer_than_the_heartbeat_time_trips() {
    let silence = i32::from(Config::commissioned_virtual().device.limits.heartbeat_ms) * 10;
    let mut c = started_at(0);
    c.order(Order::Heartbeat);
    for silent in 1..=silence {
        assert_eq!(tick(&mut c, tremor(silent)).tripped, None, "{silent} ticks");
    }
    assert_eq!(tick(&mut c, 0).tripped, Some(Fault::HostSilent));
    let mut off = controller();
    assert!(
        (0..3 * silence).all(|_| tick(&mut off, 0).tripped.is_none()),
        "with torque off nobody has to speak"
    );
}

#[test]
fn the_torque_limit_is_reported_when_it_reduces_torque() {
    let mut config = Config::commissioned_virtual();
    // 1.005 N; the wall alone asks for 1.0 N, and damping at 50 mm/s for 0.025 N.
    config.device.limits.torque = MillinewtonMetres(I16F16::from_num(10.05));
    config.device.limits.travel = Millimetres(I16F16::from_num(40));
    config.device.damping = Damping(I8F24::from_num(0.0005));
    for layer in &mut config.patient.layers {
        layer.friction = Default::default();
    }
    for (ticks_per_count, in_force) in [(3, true), (30, false)] {
        let mut c = Controller::new(config.plan().expect("sound"));
        tick(&mut c, 0);
        c.order(Order::Start);
        let mut told = Limits::default();
        for at in 0..190 * ticks_per_count {
            c.order(Order::Heartbeat);
            told = told.with(tick(&mut c, at / ticks_per_count).limits);
        }
        assert_eq!(told.contains(Limits::TORQUE), in_force, "{ticks_per_count} ticks a count: {told:?}");
        assert!(!told.contains(Limits::THERMAL), "the winding is cold: {told:?}");
    }
}

#[test]
fn torque_is_given_as_far_as_it_has_faded_in() {
    let mut c = started_at(0);
    let fade_ticks = i32::from(Config::commissioned_virtual().device.limits.fade_in_ms) * 10;
    for at in 1..=2 * fade_ticks {
        c.order(Order::Heartbeat);
        let in_force = tick(&mut c, -3 - tremor(at)).limits.contains(Limits::FADE_IN);
        // The start itself was the first tick of it; a share of a tick is rounded down.
        assert_eq!(in_force, at <= fade_ticks, "tick {at} of {fade_ticks}");
    }
}
