//! Each reference against its description, in floating point, and each range at its ends.

use control_core::event::Fault;
use control_core::excitation::{Excitation, Reference, Servo, Signal, Target};
use control_core::plan::Field;
use control_core::units::{
    Counts, Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians, Stiffness,
};
use control_core::{Config, Controller, LargeOrder, Order, Refusal, TickInput};
use fixed::types::{I8F24, I16F16};

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);

const TICKS_PER_S: f64 = 10_000.0;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn targets(signal: &Signal, ticks: usize) -> Vec<Target> {
    let mut reference = Reference::new(signal);
    (0..ticks).map(|_| reference.tick()).collect()
}

fn positions(signal: &Signal, ticks: usize) -> Vec<f64> {
    targets(signal, ticks).iter().map(|target| target.position.0.to_num()).collect()
}

fn staircase(steps: u8, ratio: f64) -> Signal {
    let slowest = MillimetresPerSecond(q(4.0));
    Signal::SpeedStaircase { slowest, ratio: q(ratio), steps, dwell_ms: 100 }
}

fn ladder(steps: u8, ratio: f64) -> Signal {
    Signal::ReversalLadder {
        smallest: Millimetres(q(0.5)),
        ratio: q(ratio),
        steps,
        speed: MillimetresPerSecond(q(20.0)),
    }
}

#[test]
fn a_staircase_dwells_at_each_speed_and_repeats() {
    let seen = targets(&staircase(3, 2.0), 8_000);
    for (tick, target) in seen.iter().enumerate() {
        let (leg, step) = (tick / 1_000, tick / 2_000 % 3);
        let speed = 4.0 * 2.0_f64.powi(step as i32) * if leg % 2 == 0 { 1.0 } else { -1.0 };
        assert_eq!(target.speed.0.to_num::<f64>(), speed, "tick {tick}");
        let since = (tick % 1_000 + 1) as f64 / TICKS_PER_S;
        let from = if leg % 2 == 0 { 0.0 } else { -speed * 0.1 };
        let position = target.position.0.to_num::<f64>();
        assert!((position - (from + speed * since)).abs() < 1e-3, "tick {tick}: {position} mm");
        assert_eq!(target.torque.0, I16F16::ZERO);
    }
}

#[test]
fn a_triangle_goes_to_its_stroke_and_back_for_ever() {
    let triangle = Signal::Triangle { stroke: Millimetres(q(10.0)), speed: MillimetresPerSecond(q(50.0)) };
    for (tick, position) in positions(&triangle, 12_000).into_iter().enumerate() {
        // 0.2 s each way.
        let phase = (tick + 1) % 4_000;
        let wanted = if phase <= 2_000 { phase as f64 * 0.005 } else { (4_000 - phase) as f64 * 0.005 };
        assert!((position - wanted).abs() < 1e-3, "tick {tick}: {position} for {wanted} mm");
    }
}

#[test]
fn a_ladder_reverses_at_growing_amplitudes_and_begins_again() {
    let seen = positions(&ladder(3, 2.0), 8_000);
    let mut turns = vec![];
    for three in seen.windows(3) {
        if three[1] > three[0] && three[2] < three[1] {
            turns.push(three[1]);
        }
    }
    let wanted = [0.5, 1.0, 2.0, 0.5, 1.0, 2.0];
    assert!(turns.len() >= wanted.len(), "{turns:?}");
    assert!(turns.iter().zip(wanted).all(|(turn, wanted)| (turn - wanted).abs() < 3e-3), "{turns:?}");
}

#[test]
fn ramps_rise_evenly_in_one_direction_then_in_the_other() {
    let ramps = Signal::BreakawayRamps { torque: MillinewtonMetres(q(6.0)), ramp_ms: 100 };
    for (tick, target) in targets(&ramps, 5_000).into_iter().enumerate() {
        let rising = 6.0 * (tick % 1_000 + 1) as f64 / 1_000.0;
        let wanted = if tick / 1_000 % 2 == 0 { rising } else { -rising };
        let torque = target.torque.0.to_num::<f64>();
        assert!((torque - wanted).abs() < 1e-3, "tick {tick}: {torque} for {wanted} mN·m");
        assert_eq!((target.position.0, target.speed.0), (I16F16::ZERO, I16F16::ZERO));
    }
}

#[test]
fn a_multisine_is_the_sum_of_its_lines_with_schroeders_phases() {
    let frequencies = [7_u16, 40, 133];
    let signal = Signal::Multisine {
        torque: MillinewtonMetres(q(2.0)),
        frequencies: frequencies.into_iter().collect(),
    };
    for (tick, target) in targets(&signal, 20_000).into_iter().enumerate() {
        let line = |(i, frequency): (usize, &u16)| {
            let turns = (i * i) as f64 / (2.0 * frequencies.len() as f64);
            let phase = f64::from(*frequency) * tick as f64 / TICKS_PER_S + turns;
            2.0 * (std::f64::consts::TAU * phase).sin()
        };
        let wanted: f64 = frequencies.iter().enumerate().map(line).sum();
        let torque = target.torque.0.to_num::<f64>();
        assert!((torque - wanted).abs() < 3e-3, "tick {tick}: {torque} for {wanted} mN·m");
    }
}

#[test]
fn a_hold_asks_for_nothing() {
    assert!(targets(&Signal::Hold, 100).iter().all(|target| *target == Target::default()));
}

fn played(signal: Signal) -> Excitation {
    let servo = Servo { stiffness: Stiffness(q(0.1)), damping: Damping(I8F24::from_num(0.001)) };
    Excitation { signal, duration_ms: 1_000, servo, travel: Millimetres(q(10.0)), compensated: false }
}

fn refused(excitation: &Excitation) -> Option<Field> {
    match excitation.check(&Config::commissioned_virtual().plan().expect("sound")) {
        Ok(()) => None,
        Err(Refusal::OutOfRange { field, .. }) => Some(field),
        Err(other) => panic!("{other:?}"),
    }
}

#[test]
fn each_value_is_refused_beyond_its_range_and_not_at_its_end() {
    let hold = || played(Signal::Hold);
    let with = |change: fn(&mut Excitation)| {
        let mut excitation = hold();
        change(&mut excitation);
        refused(&excitation)
    };
    assert_eq!(with(|e| e.duration_ms = 10), None);
    assert_eq!(with(|e| e.duration_ms = 9), Some(Field::DurationSeconds));
    assert_eq!(with(|e| e.duration_ms = 600_000), None);
    assert_eq!(with(|e| e.duration_ms = 600_001), Some(Field::DurationSeconds));
    assert_eq!(with(|e| e.duration_ms = u32::MAX), Some(Field::DurationSeconds));
    assert_eq!(with(|e| e.travel.0 = q(1_000.1)), Some(Field::Travel));
    assert_eq!(with(|e| e.servo.stiffness.0 = q(2.0)), None);
    assert_eq!(with(|e| e.servo.stiffness.0 = q(2.001)), Some(Field::ServoStiffness));
    assert_eq!(with(|e| e.servo.damping.0 = I8F24::from_num(0.021)), Some(Field::Damping));

    let torque = MillinewtonMetres(q(9.5));
    let lines = |frequencies: &[u16]| {
        refused(&played(Signal::Multisine { torque, frequencies: frequencies.iter().copied().collect() }))
    };
    assert_eq!(lines(&[1, 2, 2_000]), None, "28.5 mN·m together");
    assert_eq!(lines(&[1, 2, 3, 4]), Some(Field::TorqueLimit));
    assert_eq!(lines(&[0]), Some(Field::Frequency));
    assert_eq!(lines(&[2_001]), Some(Field::Frequency));

    let ramps = |torque: f64, ramp_ms| {
        refused(&played(Signal::BreakawayRamps { torque: MillinewtonMetres(q(torque)), ramp_ms }))
    };
    assert_eq!(ramps(28.7, 50), None);
    assert_eq!(ramps(28.9, 50), Some(Field::TorqueLimit));
    assert_eq!((ramps(1.0, 49), ramps(1.0, 10_001)), (Some(Field::DwellMs), Some(Field::DwellMs)));
}

#[test]
fn the_last_step_of_a_series_is_what_has_to_fit() {
    // Twelve steps of 1.2 from 4 mm/s: 29.7 mm/s for 0.1 s are 3 mm.
    assert_eq!(refused(&played(staircase(12, 1.2))), None);
    // Five of 3: 324 mm/s for 0.1 s are 32 mm, and 10 are there; four of them are 10.8, three 3.6.
    assert_eq!(refused(&played(staircase(5, 3.0))), Some(Field::Travel));
    assert_eq!(refused(&played(staircase(4, 3.0))), Some(Field::Travel));
    assert_eq!(refused(&played(staircase(3, 3.0))), None);
    assert_eq!(refused(&played(staircase(32, 1.3))), Some(Field::Speed));
    assert_eq!(refused(&played(staircase(33, 1.0))), Some(Field::Steps));
    assert_eq!(refused(&played(staircase(2, 4.1))), Some(Field::Ratio));
    // 0.5 mm, 1, 2, 4, 8, 16.
    assert_eq!(refused(&played(ladder(5, 2.0))), None);
    assert_eq!(refused(&played(ladder(6, 2.0))), Some(Field::Travel));
    assert_eq!(refused(&played(ladder(17, 1.0))), Some(Field::Steps));
}

#[test]
fn the_servo_has_its_stiffness_and_damping() {
    let servo = Servo { stiffness: Stiffness(q(0.2)), damping: Damping(I8F24::from_num(0.002)) };
    let plan = Config::commissioned_virtual().plan().expect("sound");
    let mnm_per_step = 28.8 / 2047.0;
    let mm_per_count = plan.mm_per_count().to_num::<f64>();
    let zero = f64::from(plan.zero_torque_code().0);
    let mut c = Controller::new(plan);
    let excitation = Excitation { servo, duration_ms: 2_000, ..played(Signal::Hold) };
    // Longer than the speed window.
    for _ in 0..200 {
        c.tick(TickInput { count: Counts(300), tilt: STRAIGHT });
    }
    c.order(LargeOrder::Excite(excitation));
    // Held where it began until torque has faded in, then moved on at a count every four ticks.
    let mut window = std::collections::VecDeque::from([300; 128]);
    for tick in 0..9_000 {
        c.order(Order::Heartbeat);
        let count = 300 + ((tick - 5_000) / 4).clamp(0, 400);
        let output = c.tick(TickInput { count: Counts(count), tilt: STRAIGHT });
        window.push_back(count);
        let moved = count - window.pop_front().expect("never empty");
        let speed = f64::from(moved) * mm_per_count * TICKS_PER_S / 128.0;
        let force = -0.2 * f64::from(count - 300) * mm_per_count - 0.002 * speed;
        let torque = (f64::from(output.dac.0) - zero) * mnm_per_step;
        assert_eq!(output.tripped, None);
        assert!(
            (torque - force * 10.0).abs() < 1.5 * mnm_per_step,
            "tick {tick}: {torque} for {}",
            force * 10.0
        );
    }
}

/// Ticks until a motor that follows `signal` and then runs at `speed`, in mm/s, trips.
fn trips_at(signal: Signal, speed: f64) -> Option<(usize, Fault)> {
    let plan = Config::commissioned_virtual().plan().expect("sound");
    let mm_per_count = plan.mm_per_count().to_num::<f64>();
    let mut c = Controller::new(plan);
    let servo = Servo { stiffness: Stiffness(q(0.01)), damping: Damping(I8F24::from_num(0)) };
    c.tick(TickInput { count: Counts(0), tilt: STRAIGHT });
    let travel = Millimetres(q(900.0));
    c.order(LargeOrder::Excite(Excitation { servo, travel, duration_ms: 2_000, ..played(signal) }));
    (0..5_000).find_map(|tick| {
        c.order(Order::Heartbeat);
        let count = (speed * f64::from(tick) / TICKS_PER_S / mm_per_count) as i32;
        let output = c.tick(TickInput { count: Counts(count), tilt: STRAIGHT });
        output.tripped.map(|fault| (tick as usize, fault))
    })
}

/// An excitation may be faster than a hand, up to three times or to half as fast again as its own
/// reference.
#[test]
fn overspeed_trips_during_an_excitation() {
    let triangle = |speed: f64| Signal::Triangle {
        stroke: Millimetres(q(200.0)),
        speed: MillimetresPerSecond(q(speed)),
    };
    let ramps = Signal::BreakawayRamps { torque: MillinewtonMetres(q(1.0)), ramp_ms: 500 };
    for (signal, speed) in [
        (Signal::Hold, 1_310.0),
        (triangle(20.0), 1_310.0),
        (ramps.clone(), 1_310.0),
        (triangle(1_000.0), 1_550.0),
    ] {
        let tripped = trips_at(signal.clone(), speed);
        let (tick, fault) = tripped.unwrap_or_else(|| panic!("{signal:?} at {speed} mm/s"));
        // 3 ms and a look.
        assert!(fault == Fault::Overspeed && tick < 50, "{signal:?}: {fault:?} at tick {tick}");
    }
    for (signal, speed) in [(Signal::Hold, 1_230.0), (ramps, 1_230.0), (triangle(1_000.0), 1_460.0)] {
        assert_eq!(trips_at(signal.clone(), speed), None, "{signal:?} at {speed} mm/s");
    }
}

/// A needle of 14 g with 0.04 N of dry friction under a motor that gives `sign` times the torque
/// that was asked for `late` ticks ago: the fault that ends `signal`, and how far the needle has
/// then gone, in mm.
fn driven(signal: Signal, sign: f64, late: usize) -> Option<(Fault, f64)> {
    let plan = Config::commissioned_virtual().plan().expect("sound");
    let (mm_per_count, zero) = (plan.mm_per_count().to_num::<f64>(), f64::from(plan.zero_torque_code().0));
    let mut c = Controller::new(plan);
    c.tick(TickInput { count: Counts(0), tilt: STRAIGHT });
    let servo = Servo { stiffness: Stiffness(q(0.035)), damping: Damping(I8F24::from_num(0.001_26)) };
    let travel = Millimetres(q(500.0));
    c.order(LargeOrder::Excite(Excitation { servo, travel, duration_ms: 2_000, ..played(signal) }));
    let (mut at, mut speed) = (0.0_f64, 0.0_f64);
    let mut asked = std::collections::VecDeque::from(vec![0.0; late]);
    (0..20_000).find_map(|_| {
        c.order(Order::Heartbeat);
        let count = Counts((at / mm_per_count).floor() as i32);
        let output = c.tick(TickInput { count, tilt: STRAIGHT });
        if let Some(fault) = output.tripped {
            return Some((fault, at));
        }
        // N at 10 mm; mm/s in a tick for a N.
        asked.push_back((f64::from(output.dac.0) - zero) * 28.8 / 2047.0 / 10.0);
        let (force, per_newton) = (sign * asked.pop_front().expect("one is there"), 1e3 / 0.014 * 1e-4);
        let friction = (force + speed / per_newton).clamp(-0.04, 0.04);
        speed += (force - friction) * per_newton;
        at += speed * 1e-4;
        None
    })
}

fn sines(frequencies: &[u16]) -> Signal {
    Signal::Multisine {
        torque: MillinewtonMetres(q(1.33)),
        frequencies: frequencies.iter().copied().collect(),
    }
}

#[test]
fn swapped_leads_under_a_servo_are_found_in_every_signal() {
    let ramps = Signal::BreakawayRamps { torque: MillinewtonMetres(q(2.0)), ramp_ms: 250 };
    let triangle = |speed: f64| Signal::Triangle {
        stroke: Millimetres(q(200.0)),
        speed: MillimetresPerSecond(q(speed)),
    };
    let low = sines(&[3, 5, 9, 14, 21, 32]);
    for signal in [staircase(5, 2.0), ladder(5, 2.0), triangle(20.0), triangle(400.0), ramps, low] {
        let (fault, way) = driven(signal.clone(), -1.0, 0).unwrap_or_else(|| panic!("{signal:?}"));
        println!("{signal:?}: {fault:?} after {way:.1} mm");
        assert!(fault == Fault::WrongWay && way.abs() < 20.0, "{signal:?}: {fault:?} at {way} mm");
    }
}

/// Sines of a quarter of a period in 4 ms and less: the motor gives one way what is asked for the
/// other way.
#[test]
fn a_motor_that_obeys_late_is_not_wired_the_wrong_way() {
    for late in [10, 20, 28, 34, 40] {
        let signal = sines(&[5, 8, 11, 17, 24, 36, 59, 76, 116, 177, 286, 421]);
        assert_eq!(driven(signal, 1.0, late), None, "{late} ticks");
    }
}

/// Two counts to and fro at 0.5 kHz: an encoder with a dead channel, or a needle that sines shake
/// over one edge.
#[test]
fn counts_to_and_fro_are_a_dead_channel_unless_sines_shake() {
    let fault_of = |signal: Signal| {
        let mut c = Controller::new(Config::commissioned_virtual().plan().expect("sound"));
        c.tick(TickInput { count: Counts(0), tilt: STRAIGHT });
        c.order(LargeOrder::Excite(played(signal)));
        (0..5_000).find_map(|tick| {
            c.order(Order::Heartbeat);
            c.tick(TickInput { count: Counts(tick / 10 % 2), tilt: STRAIGHT }).tripped
        })
    };
    assert_eq!(fault_of(sines(&[62, 70, 88, 110, 492])), None);
    for signal in [Signal::Hold, ladder(5, 2.0), staircase(3, 2.0)] {
        assert_eq!(fault_of(signal.clone()), Some(Fault::EncoderChannel), "{signal:?}");
    }
}
