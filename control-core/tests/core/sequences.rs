//! Uploaded sequences: what is taken, what is refused, and what plays when.

use control_core::event::{Fault, State};
use control_core::excitation::{
    Excitation, MAX_SEGMENTS, MAX_SEQUENCE_MS, Reach, Reference, Sequence, SequenceRefusal, Servo, Signal,
};
use control_core::plan::Field;
use control_core::units::{
    Counts, Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Milliradians, Stiffness,
};
use control_core::{Config, Controller, LargeOrder, Order, Plan, Refusal, TickInput, TickOutput};
use fixed::types::I16F16;
use proptest::prelude::*;

/// A needle straight into the skin: lengths along it are depths.
const STRAIGHT: Milliradians = Milliradians(1_571);
/// Stiffness of the servo in N/mm, and the roller's radius in mm.
const STIFFNESS: f64 = 0.05;
const RADIUS_MM: f64 = 10.0;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

fn plan() -> Plan {
    Config::commissioned_virtual().plan().expect("the default is sound")
}

fn segment(signal: Signal, duration_ms: u32) -> Excitation {
    let servo = Servo { stiffness: Stiffness(q(STIFFNESS)), damping: Damping::default() };
    Excitation { signal, duration_ms, servo, travel: Millimetres(q(100.0)), compensated: false }
}

fn triangle(stroke: f64, speed: f64) -> Signal {
    Signal::Triangle { stroke: Millimetres(q(stroke)), speed: MillimetresPerSecond(q(speed)) }
}

fn ramps(torque: f64) -> Signal {
    Signal::BreakawayRamps { torque: MillinewtonMetres(q(torque)), ramp_ms: 100 }
}

fn without_servo(signal: Signal, duration_ms: u32) -> Excitation {
    Excitation {
        servo: Servo { stiffness: Stiffness::default(), damping: Damping::default() },
        ..segment(signal, duration_ms)
    }
}

fn uploaded(segments: &[Excitation]) -> Result<Sequence, SequenceRefusal> {
    let mut sequence = Sequence::new();
    for (index, segment) in (0_u8..).zip(segments) {
        sequence.upload(index, segment.clone(), &plan())?;
    }
    Ok(sequence)
}

fn tick(c: &mut Controller, count: i32) -> TickOutput {
    c.tick(TickInput { count: Counts(count), tilt: STRAIGHT })
}

/// A controller at rest that has been ordered to play `segments`.
fn ordered(segments: &[Excitation]) -> Controller {
    let mut c = Controller::new(plan());
    for _ in 0..200 {
        tick(&mut c, 0);
    }
    let sequence = uploaded(segments).expect("sound");
    c.order(LargeOrder::Play(sequence.prepared(&plan()).expect("sound")));
    c
}

fn plays(output: &TickOutput) -> bool {
    output.enable && State::from_code(output.sample.state) == Some(State::Excitation)
}

fn torque(output: &TickOutput) -> f64 {
    (f64::from(output.dac.0) - f64::from(plan().zero_torque_code().0)) * 28.8 / 2047.0
}

/// The needle is held; what the servo pulls with shows where its reference is. The trembling of a
/// count keeps the encoder alive.
#[test]
fn a_segment_begins_on_the_tick_after_the_one_before() {
    // To 6 mm and back to 4; held there; from there to 9 and back to 8.
    let segments =
        [segment(triangle(6.0, 20.0), 400), segment(Signal::Hold, 123), segment(triangle(5.0, 20.0), 300)];
    let wanted = |tick: i32| match tick {
        0..4_000 if tick < 3_000 => 0.002 * f64::from(tick + 1),
        0..4_000 => 6.0 - 0.002 * f64::from(tick + 1 - 3_000),
        4_000..5_230 => 4.0,
        5_230..7_730 => 4.0 + 0.002 * f64::from(tick + 1 - 5_230),
        _ => 9.0 - 0.002 * f64::from(tick + 1 - 7_730),
    };
    let mut c = ordered(&segments);
    let mm_per_count: f64 = plan().mm_per_count().to_num();
    for at in 0..8_230 {
        c.order(Order::Heartbeat);
        let count = at / 100 % 2;
        let output = tick(&mut c, count);
        assert!(plays(&output), "tick {at}: {:?}", output.tripped);
        // Torque has faded in.
        if at > 3_500 {
            let pull = STIFFNESS * RADIUS_MM * (wanted(at) - f64::from(count) * mm_per_count);
            assert!((torque(&output) - pull).abs() < 0.03, "tick {at}: {} for {pull} mN·m", torque(&output));
        }
    }
    let output = tick(&mut c, 0);
    assert!(!output.enable && torque(&output) == 0.0, "over, to the tick");
    assert_eq!(State::from_code(output.sample.state), Some(State::Idle));
}

#[test]
fn a_servo_takes_over_where_the_motor_was_left_without_one() {
    let segments = [without_servo(Signal::Hold, 400), segment(Signal::Hold, 400)];
    let mut c = ordered(&segments);
    for at in 0..8_000 {
        c.order(Order::Heartbeat);
        // Pushed 3.9 mm away while no servo holds it.
        let output = tick(&mut c, (at / 10).min(250) + at / 100 % 2);
        assert!(plays(&output), "tick {at}: {:?}", output.tripped);
        assert!(torque(&output).abs() < 0.03, "tick {at}: {} mN·m", torque(&output));
    }
}

/// Its reference never passes its travel, which counts from where all of it began, and neither may
/// the motor.
#[test]
fn the_travel_counts_from_the_beginning_of_the_sequence() {
    let stroke = |travel: f64, duration_ms| Excitation {
        travel: Millimetres(q(travel)),
        ..segment(triangle(30.0, 100.0), duration_ms)
    };
    // It ends 20 mm out, and goes to 50 mm from there.
    let first = stroke(45.0, 200);
    assert!(uploaded(&[first.clone(), stroke(50.1, 600)]).is_ok());
    assert!(uploaded(&[first.clone(), stroke(45.0, 240)]).is_ok(), "over before it gets further than 44 mm");
    let refused = uploaded(&[first.clone(), stroke(49.0, 600)]).expect_err("it goes to 50 mm");
    assert!(
        matches!(
            refused,
            SequenceRefusal::Segment { index: 1, refusal: Refusal::OutOfRange { field: Field::Travel, .. } }
        ),
        "{refused:?}"
    );
    let begin = || {
        let mut c = ordered(&[first.clone(), stroke(50.1, 600)]);
        let mm_per_count: f64 = plan().mm_per_count().to_num();
        for at in 0..2_500 {
            c.order(Order::Heartbeat);
            let count = (0.01 * f64::from(at + 1) / mm_per_count) as i32;
            assert!(plays(&tick(&mut c, count)), "tick {at} of the second segment's five hundred");
        }
        (c, mm_per_count)
    };
    for (mm, fault) in [(49.9, None), (50.3, Some(Fault::Travel))] {
        let (mut c, mm_per_count) = begin();
        let from = (25.0 / mm_per_count) as i32;
        let tripped = (from..=(mm / mm_per_count) as i32).find_map(|count| {
            c.order(Order::Heartbeat);
            // A count in two ticks.
            tick(&mut c, count - 1).tripped.or_else(|| tick(&mut c, count).tripped)
        });
        assert_eq!(tripped, fault, "{mm} mm");
        assert_eq!(tick(&mut c, (mm / mm_per_count) as i32).enable, fault.is_none());
    }
}

#[test]
fn a_segment_over_a_ceiling_takes_the_whole_along() {
    let sound = || segment(ramps(1.0), 1_000);
    let mut strict = Config::commissioned_virtual();
    strict.device.limits.torque.0 = q(5.0);
    let low = Plan::new(&strict.device, &control_core::Patient::nobody()).expect("sound");
    for (what, bad) in [
        ("torque", segment(ramps(29.0), 1_000)),
        ("travel", segment(triangle(101.0, 20.0), 1_000)),
        ("speed", segment(triangle(10.0, 2_001.0), 1_000)),
        ("no time", segment(Signal::Hold, 9)),
    ] {
        let mut sequence = Sequence::new();
        assert_eq!(sequence.upload(0, sound(), &plan()), Ok(()));
        let refused = sequence.upload(1, bad, &plan());
        assert!(matches!(refused, Err(SequenceRefusal::Segment { index: 1, .. })), "{what}: {refused:?}");
        assert_eq!(sequence.segments(), [], "{what}: nothing is left of it");
        assert!(matches!(sequence.prepared(&plan()), Err(SequenceRefusal::Nothing)));
    }
    // Ceilings may have come down since.
    let strong = uploaded(&[sound(), segment(ramps(6.0), 1_000)]).expect("sound");
    assert!(strong.prepared(&plan()).is_ok());
    assert!(matches!(strong.prepared(&low), Err(SequenceRefusal::Segment { index: 1, .. })));
}

#[test]
fn a_sequence_has_a_most_of_length_and_of_segments() {
    let long = |duration_ms| segment(Signal::Hold, duration_ms);
    assert!(uploaded(&[long(MAX_SEQUENCE_MS)]).is_ok());
    assert_eq!(uploaded(&[long(MAX_SEQUENCE_MS + 1)]), Err(SequenceRefusal::TooLong { index: 0 }));
    assert!(uploaded(&[long(60_000), long(60_000)]).is_ok());
    assert_eq!(uploaded(&[long(60_000), long(60_001)]), Err(SequenceRefusal::TooLong { index: 1 }));
    assert!(uploaded(&vec![long(10); MAX_SEGMENTS]).is_ok());
    assert_eq!(uploaded(&vec![long(10); MAX_SEGMENTS + 1]), Err(SequenceRefusal::TooMany));
    let compensated = Excitation { compensated: true, ..long(10) };
    assert_eq!(uploaded(&[long(10), compensated]), Err(SequenceRefusal::Mixed { index: 1 }));
}

#[test]
fn segments_come_in_their_order_and_the_first_begins_anew() {
    let (mut sequence, hold) = (Sequence::new(), || segment(Signal::Hold, 100));
    assert_eq!(sequence.upload(1, hold(), &plan()), Err(SequenceRefusal::OutOfOrder { index: 1, due: 0 }));
    assert_eq!(sequence.upload(0, hold(), &plan()), Ok(()));
    assert_eq!(sequence.upload(2, hold(), &plan()), Err(SequenceRefusal::OutOfOrder { index: 2, due: 1 }));
    assert_eq!(sequence.segments(), []);
    for index in [0, 1, 0] {
        assert_eq!(sequence.upload(index, hold(), &plan()), Ok(()));
    }
    assert_eq!(sequence.segments(), [hold()]);
    assert_eq!(sequence.upload(u8::MAX, hold(), &plan()), Err(SequenceRefusal::TooMany));
}

#[test]
fn nothing_is_left_of_a_sequence_that_was_cut_short() {
    let segments = [segment(ramps(1.0), 500), segment(ramps(2.0), 500)];
    type Cut = fn(&mut Controller);
    let cuts: [(Cut, State); 3] = [
        (|c| c.order(Order::Stop), State::Idle),
        (|c| c.order(Order::Trip(Fault::Tilt)), State::Fault),
        // The PC says nothing for the time of a heartbeat.
        (
            |c| {
                let ticks = 10 * i32::from(plan().device().limits.heartbeat_ms);
                assert!((0..ticks - 1).all(|at| plays(&tick(c, at / 100 % 2))));
                let tripped = (0..3).find_map(|_| tick(c, 0).tripped);
                assert_eq!(tripped, Some(Fault::HostSilent));
            },
            State::Fault,
        ),
    ];
    for (cut, state) in cuts {
        for played in [1_000, 6_000] {
            let mut c = ordered(&segments);
            for at in 0..played {
                c.order(Order::Heartbeat);
                assert!(plays(&tick(&mut c, at / 100 % 2)));
            }
            cut(&mut c);
            for _ in 0..6_000 {
                c.order(Order::Heartbeat);
                let output = tick(&mut c, 0);
                assert!(!output.enable && torque(&output) == 0.0, "{state:?}: it goes on");
                assert_eq!(State::from_code(output.sample.state), Some(state));
            }
            // A start is a needle's, not the rest of a sequence.
            c.order(Order::Clear);
            c.order(Order::Start);
            let output = tick(&mut c, 0);
            assert!(output.enable && !plays(&output));
        }
    }
}

#[test]
fn a_sequence_needs_a_commissioned_device_with_torque_off() {
    let prepared = || uploaded(&[segment(ramps(1.0), 500)]).expect("sound").prepared(&plan()).expect("sound");
    let mut unknown = Controller::new(Config::default().plan().expect("the default is sound"));
    unknown.order(LargeOrder::Play(prepared()));
    assert!(!tick(&mut unknown, 0).enable);
    let mut running = Controller::new(plan());
    running.order(Order::Start);
    tick(&mut running, 0);
    running.order(LargeOrder::Play(prepared()));
    assert!(!plays(&tick(&mut running, 0)), "it runs on as it was");
}

fn any_signal() -> impl Strategy<Value = Signal> {
    let speed = || (1_i32..2_000 << 16).prop_map(|bits| MillimetresPerSecond(I16F16::from_bits(bits)));
    let length = || (655_i32..100 << 16).prop_map(|bits| Millimetres(I16F16::from_bits(bits)));
    let ratio = || (1_i32 << 16..4 << 16).prop_map(I16F16::from_bits);
    prop_oneof![
        (length(), speed()).prop_map(|(stroke, speed)| Signal::Triangle { stroke, speed }),
        (speed(), ratio(), 1..32_u8, 1..300_u16).prop_map(|(slowest, ratio, steps, dwell_ms)| {
            let slowest = MillimetresPerSecond(slowest.0 / 64);
            Signal::SpeedStaircase { slowest, ratio, steps, dwell_ms }
        }),
        (length(), ratio(), 1..16_u8, speed()).prop_map(|(smallest, ratio, steps, speed)| {
            Signal::ReversalLadder { smallest: Millimetres(smallest.0 / 64), ratio, steps, speed }
        }),
        Just(Signal::Hold),
        Just(ramps(1.0)),
    ]
}

proptest! {
    /// Leg by leg, and to the bit.
    #[test]
    fn the_reach_is_what_the_ticks_give(signal in any_signal(), ticks in 0_u32..40_000) {
        let mut reference = Reference::new(&signal);
        let mut walked = Reach::default();
        for _ in 0..ticks {
            walked.end = reference.tick().position;
            walked.furthest = walked.furthest.max(walked.end);
        }
        prop_assert_eq!(Reach::after(&signal, ticks), walked);
    }
}
