//! Supervisor, tilt and USB.

use super::super::queues::{Ends, Packet};
use super::super::shared::{LINK_CONFIGURED, LINK_READY, Shared};
use super::super::supervisor::Watch;
use super::super::tilt::Tilt;
use super::super::usb::Port;
use super::fake::{Fake, Lines, Part, ends, shared, world};
use crate::monitor::Readings;
use crate::supervision::Task;
use crate::tilt::{Reading, TiltError};
use crate::wire_check::Pull;
use control_core::event::Fault;
use control_core::interlock::Interlock;
use control_core::units::Milliradians;
use core::sync::atomic::Ordering::Relaxed;
use std::vec::Vec;

/// A supervisor whose drive says that all is well.
fn supervisor() -> (Watch<Fake>, &'static Shared) {
    world().readings.set(Readings { ready: true, ..Readings::default() });
    let shared = shared();
    (Watch::new(shared, Part, Part, Lines(Pull::Up), Part), shared)
}

fn supervise(watch: &mut Watch<Fake>, shared: &Shared, ms: u32) {
    for _ in 0..ms {
        Task::ALL.into_iter().for_each(|task| shared.reports.alive(task));
        watch.run();
    }
}

#[test]
fn the_supervisor_feeds_while_all_report_and_wakes_everybody() {
    let (mut watch, shared) = supervisor();
    supervise(&mut watch, shared, 10);
    assert_eq!((world().fed.get(), world().woken.get()), (10, [10, 10, 2]));
    assert_eq!(shared.supervised_ms.load(Relaxed), 10);
    assert!(world().stops_on_debug.get() && shared.trips.is_empty());
    shared.powered.store(true, Relaxed);
    world().readings.set(Readings { ready: true, enable_line: true, ..Readings::default() });
    supervise(&mut watch, shared, 1);
    assert!(!world().stops_on_debug.get(), "a halt with torque on is ended by the watchdog");
    for _ in 0..20 {
        shared.reports.alive(Task::Tick);
        watch.run();
    }
    assert!(world().fed.get() < 20);
    assert_eq!(shared.trips.take(), Some(Fault::Watchdog));
    assert!(shared.last_words.take().crash.is_some());
}

#[test]
fn a_cause_is_an_interlock_and_under_torque_a_fault() {
    type Break = fn();
    let all: [(Break, Interlock); 5] = [
        (|| world().supply_low.set(true), Interlock::Supply),
        (|| world().wire_off.set(true), Interlock::EncoderWire),
        (
            || world().readings.set(Readings { stop_open: true, ..world().readings.get() }),
            Interlock::EmergencyStop,
        ),
        (
            || world().readings.set(Readings { ready: false, ..world().readings.get() }),
            Interlock::AmplifierNotReady,
        ),
        (|| world().tilt.set(Some(Reading::Failed(TiltError::Absent))), Interlock::TiltSensor),
    ];
    for powered in [false, true] {
        for (breaks, interlock) in all {
            world().supply_low.set(false);
            world().wire_off.set(false);
            let (mut watch, shared) = supervisor();
            let mut tilt: Tilt<Fake> = Tilt::new(shared, Part);
            world().tilt.set(Some(Reading::New(Milliradians(0))));
            tilt.run();
            shared.powered.store(powered, Relaxed);
            world().readings.set(Readings { enable_line: powered, ..world().readings.get() });
            supervise(&mut watch, shared, 10);
            assert_eq!((shared.conditions.get().first(), shared.trips.is_empty()), (None, true));
            breaks();
            (0..10).for_each(|_| tilt.run());
            supervise(&mut watch, shared, 2);
            assert_eq!(shared.conditions.get().first(), Some(interlock));
            assert_eq!(shared.trips.take(), powered.then_some(interlock.fault()), "{interlock:?}");
        }
    }
}

#[test]
fn a_low_enable_line_is_a_fault_only_under_torque() {
    let (mut watch, shared) = supervisor();
    supervise(&mut watch, shared, 5);
    assert!(shared.trips.is_empty());
    shared.powered.store(true, Relaxed);
    supervise(&mut watch, shared, 2);
    assert_eq!(shared.trips.take(), Some(Fault::AmplifierNotReady));
}

#[test]
fn a_device_starts_only_with_a_tilt_sensor_that_measures() {
    let shared = shared();
    let mut tilt: Tilt<Fake> = Tilt::new(shared, Part);
    let mut after = |readings: u32, reading| {
        world().tilt.set(Some(reading));
        (0..readings).for_each(|_| tilt.run());
        shared.conditions.get().first()
    };
    let (measures, absent) = (Reading::New(Milliradians(-321)), Reading::Failed(TiltError::Absent));
    let missing = Some(Interlock::TiltSensor);
    assert_eq!(shared.conditions.get().first(), missing, "it has not measured yet");
    assert_eq!(after(1, Reading::Unchanged), missing);
    assert_eq!(after(1, absent), missing);
    assert_eq!(after(1, measures), None);
    assert_eq!(shared.tilt(), Milliradians(-321));
    assert_eq!(after(9, absent), None, "one bad transfer is not enough");
    assert_eq!(after(1, absent), missing);
    assert_eq!(after(1, Reading::Unchanged), missing, "an answer is no measurement");
    assert_eq!(after(1, measures), None, "it has recovered");
    assert_eq!(after(100, Reading::Unchanged), missing, "stuck");
    assert!(shared.trips.is_empty(), "torque is off");
}

#[test]
fn the_port_passes_packets_on_both_ways_and_ends_a_full_one() {
    let shared = shared();
    let Ends { usb, telemetry: (mut telemetry, _), .. } = ends();
    let mut port: Port<Fake> = Port::new(shared, Part, usb);
    let packet = |bytes: &[u8]| Packet::from_slice(bytes).unwrap();
    world().incoming.borrow_mut().push_back([1, 2, 3].into());
    world().room.set(10);
    assert!(telemetry.to_pc.enqueue(packet(&[9; 64])).is_ok());
    port.run();
    assert_eq!(telemetry.from_pc.dequeue(), Some(packet(&[1, 2, 3])));
    assert_eq!(shared.link.load(Relaxed), 0);
    assert!(
        world().outgoing.borrow().is_empty() && telemetry.to_pc.is_empty(),
        "nobody is there: thrown away"
    );
    world().configured.set(true);
    world().open.set(true);
    assert!(telemetry.to_pc.enqueue(packet(&[9; 64])).is_ok());
    world().room.set(1);
    port.run();
    assert_eq!(shared.link.load(Relaxed), LINK_CONFIGURED | LINK_READY);
    assert_eq!(world().outgoing.borrow().len(), 1);
    world().room.set(1);
    port.run();
    assert_eq!(world().outgoing.borrow().last().map(Vec::len), Some(0), "the host waits for a shorter one");
    assert!(telemetry.to_pc.enqueue(packet(&[9; 64])).is_ok());
    shared.discard.store(true, Relaxed);
    world().room.set(10);
    port.run();
    assert_eq!(world().outgoing.borrow().len(), 2, "for a PC that is gone");
}

#[test]
fn a_port_without_room_keeps_its_interrupt_away() {
    let shared = shared();
    let Ends { usb, telemetry: (mut telemetry, _), .. } = ends();
    let mut port: Port<Fake> = Port::new(shared, Part, usb);
    world().usb_allowed.set(true);
    for _ in 0..40 {
        world().incoming.borrow_mut().push_back([7].into());
    }
    (0..40).for_each(|_| port.run());
    assert!(!world().usb_allowed.get());
    let taken = core::iter::from_fn(|| telemetry.from_pc.dequeue()).count();
    assert_eq!((taken, world().incoming.borrow().len()), (15, 25), "what there is no room for stays");
}
