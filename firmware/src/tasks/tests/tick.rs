//! The control tick.

use super::super::queues::{Queued, TelemetryEnds, Ticked};
use super::fake::{order, run, tick, world};
use crate::timing;
use control_core::config::DacWidth;
use control_core::event::Fault;
use control_core::interlock::Interlock;
use control_core::units::Millimetres;
use control_core::{Device, LargeOrder, NeedleLine, Order, Patient, Plan};
use core::sync::atomic::Ordering::Relaxed;
use fixed::types::I16F16;
use std::vec::Vec;

/// As telemetry passes on the plan of a device with the converter of 8 bits.
fn configure_eight_bits(telemetry: &mut TelemetryEnds) {
    let eight = Device { dac: DacWidth::BITS_8, ..Device::commissioned_virtual() };
    let eight = Plan::new(&eight, &Patient::default()).unwrap();
    assert!(telemetry.large_orders.enqueue(LargeOrder::Configure(eight)).is_ok());
    assert!(telemetry.orders.enqueue(Queued { stops: 0, order: None }).is_ok());
}

#[test]
fn no_start_from_before_a_stop_gives_torque() {
    let (mut tick, shared, mut telemetry) = tick();
    shared.stop();
    order(&mut telemetry, 0, Order::Start);
    run(&mut tick, shared, 3);
    assert!(!world().enabled.get() && !shared.is_powered(), "a stop has come after it");
    order(&mut telemetry, 1, Order::Start);
    run(&mut tick, shared, 1);
    assert!(shared.is_powered(), "known before the next tick");
    assert_eq!(shared.starts_taken.load(Relaxed), 2);
    run(&mut tick, shared, 1);
    assert!(world().enabled.get() && shared.is_powered());
    (0..9).for_each(|_| order(&mut telemetry, 1, Order::Heartbeat));
    shared.stop();
    run(&mut tick, shared, 1);
    assert!(!world().enabled.get() && !shared.is_powered(), "a stop waits behind nothing");
    assert_eq!(world().codes.borrow().last(), Some(&2048));
}

/// The skin of the default patient, at depth 0, is 3 mm deep for the needle's line.
#[test]
fn the_tick_takes_the_latest_line() {
    let contact = |lines: &[i32]| {
        let (mut tick, shared, mut telemetry) = tick();
        for skin in lines {
            let depths = (0..4).map(|layer| Millimetres(I16F16::from_num(skin + 3 * layer)));
            shared.line.set(&NeedleLine { depths: depths.collect() });
        }
        world().count.set(-100);
        run(&mut tick, shared, 100);
        world().count.set(100);
        run(&mut tick, shared, 10);
        let outputs = core::iter::from_fn(|| telemetry.outputs.dequeue());
        outputs.fold(0, |all, ticked: Ticked| all | ticked.output.transitions.contact)
    };
    assert_eq!(contact(&[]) & 1, 1);
    assert_eq!(contact(&[0, 3]), 0);
    assert_eq!(contact(&[3, 0]) & 1, 1);
}

#[test]
fn a_line_that_is_half_written_is_not_read() {
    let (_, shared, _) = tick();
    let depth = Millimetres(I16F16::ONE);
    let line = NeedleLine { depths: core::iter::once(depth).collect() };
    let is_read = || shared.line.read().is_some_and(|(_, depths, layers)| (depths[0], layers) == (depth, 1));
    shared.line.set(&line);
    assert!(is_read());
    shared.line.begin();
    assert_eq!(shared.line.read(), None);
    shared.line.set(&line);
    assert!(is_read());
}

#[test]
fn the_tick_does_not_start_under_an_interlock_and_says_why() {
    let (mut tick, shared, mut telemetry) = tick();
    shared.conditions.set(Interlock::EmergencyStop, true);
    order(&mut telemetry, 0, Order::Start);
    run(&mut tick, shared, 2);
    assert!(!world().enabled.get());
    let tripped = core::iter::from_fn(|| telemetry.outputs.dequeue()).find_map(|t: Ticked| t.output.tripped);
    assert_eq!(tripped, Some(Fault::EmergencyStop));
}

#[test]
fn the_tick_takes_a_trip_at_once_and_a_plan_only_without_torque() {
    let (mut tick, shared, mut telemetry) = tick();
    order(&mut telemetry, 0, Order::Start);
    run(&mut tick, shared, 2);
    configure_eight_bits(&mut telemetry);
    run(&mut tick, shared, 2);
    assert_eq!(tick.width(), DacWidth::BITS_12, "torque is on");
    shared.trips.raise(Fault::Tilt);
    run(&mut tick, shared, 1);
    assert!(!world().enabled.get());
    configure_eight_bits(&mut telemetry);
    run(&mut tick, shared, 2);
    assert_eq!(tick.width(), DacWidth::BITS_8);
}

#[test]
fn the_tick_misses_its_supervisor() {
    let (mut tick, shared, mut telemetry) = tick();
    order(&mut telemetry, 0, Order::Start);
    run(&mut tick, shared, 2);
    for silent in 1..=timing::SUPERVISOR_SILENCE_TICKS {
        assert!(world().enabled.get(), "after {silent} ticks");
        world().cycles.set(world().cycles.get().wrapping_add(timing::TICK_CYCLES));
        tick.run();
    }
    run(&mut tick, shared, 1);
    assert!(!world().enabled.get());
}

#[test]
fn a_tick_that_comes_late_is_counted_and_takes_torque_away() {
    let (mut tick, shared, mut telemetry) = tick();
    run(&mut tick, shared, 3);
    assert_eq!(shared.missed_ticks.load(Relaxed), 0, "the first has none before it");
    // Three periods later: two are missing.
    world().cycles.set(world().cycles.get() + 2 * timing::TICK_CYCLES);
    run(&mut tick, shared, 1);
    assert_eq!((shared.missed_ticks.load(Relaxed), shared.trips.is_empty()), (2, true), "torque is off");
    order(&mut telemetry, 0, Order::Start);
    run(&mut tick, shared, 2);
    world().cycles.set(world().cycles.get() + timing::TICK_CYCLES);
    run(&mut tick, shared, 1);
    assert_eq!((shared.missed_ticks.load(Relaxed), shared.trips.take()), (3, Some(Fault::Overrun)));
    shared.conditions.set(Interlock::Saving, true);
    world().cycles.set(world().cycles.get() + 10 * timing::TICK_CYCLES);
    run(&mut tick, shared, 1);
    assert_eq!(shared.missed_ticks.load(Relaxed), 3, "an erasure stops the processor");
}

#[test]
fn a_code_written_after_the_latch_is_counted() {
    let (mut tick, shared, mut telemetry) = tick();
    world().since_edge.set(timing::OUTPUT_CYCLES - 1);
    run(&mut tick, shared, 2);
    assert_eq!(shared.late_codes.load(Relaxed), 0);
    world().since_edge.set(timing::OUTPUT_CYCLES);
    run(&mut tick, shared, 3);
    assert_eq!(shared.late_codes.load(Relaxed), 3);
    configure_eight_bits(&mut telemetry);
    run(&mut tick, shared, 3);
    assert_eq!(tick.width(), DacWidth::BITS_8);
    assert_eq!(shared.late_codes.load(Relaxed), 6, "without a latch it is late all the same");
    shared.conditions.set(Interlock::Saving, true);
    run(&mut tick, shared, 1);
    assert_eq!(shared.late_codes.load(Relaxed), 6, "an erasure stops the processor");
}

/// After 119 hours the number of ticks begins again; a tick that is missed then is missed.
#[test]
fn the_number_of_ticks_wraps_without_a_word() {
    let (mut tick, shared, mut telemetry) = tick();
    tick.set_number(u32::MAX - 1);
    run(&mut tick, shared, 2);
    world().cycles.set(world().cycles.get().wrapping_add(timing::TICK_CYCLES));
    run(&mut tick, shared, 1);
    assert_eq!(shared.missed_ticks.load(Relaxed), 1);
    let numbers: Vec<u32> = core::iter::from_fn(|| telemetry.outputs.dequeue()).map(|t| t.tick).collect();
    assert_eq!(numbers, [u32::MAX - 1, u32::MAX, 0]);
}

#[test]
fn the_tick_leaves_word_of_its_torque_and_of_the_motors_heat() {
    let (mut tick, shared, mut telemetry) = tick();
    // A needle 2 mm deep, that a wall pushes out.
    world().count.set(127);
    order(&mut telemetry, 0, Order::Start);
    for second in 0..20_000 {
        world().count.set(127 + [0, 1, 2, 1][second / 250 % 4]);
        order(&mut telemetry, 0, Order::Heartbeat);
        run(&mut tick, shared, 1);
        let _ = telemetry.outputs.dequeue();
    }
    let said = shared.last_words.take();
    assert!(said.torque && said.heat > Some(0), "{said:?}");
    assert!(shared.given().0 < 2048 - 100, "{:?}", shared.given());
}
