//! It cannot run away: what is wired wrongly, breaks or is pressed takes the amplifier off before a
//! hand is hurt. Each on the flash image with a plant that does it.

use control_core::event::Fault;
use control_core::interlock::Interlock;
use emulator::board::wires::{Wire, Wires};
use emulator::board::{Amplifier, Board, Effect, MILLISECOND, Nanos, Wiring};
use link::Command;
use link::frames::{CommandRefusal, EventKind};
use tests::needle::Needle;
use tests::pc::Pc;
use tests::rig::{Rig, ZERO_TORQUE, task};
use tests::scenario::board_wired;
use tests::start::Start;

/// The time limits for every fault of the drive, and for a dead channel.
const SOON: Nanos = 5 * MILLISECOND;
const DEAD_CHANNEL: Nanos = 20 * MILLISECOND;
/// The time limit for an encoder that has lost its supply or its ground, if nothing senses it.
const WITHOUT_POWER: Nanos = 110 * MILLISECOND;
/// The largest travel of the needle by then, in m.
const FAR: f64 = 0.002;

/// A needle held 2.5 mm deep in skin, with torque on it.
fn pressed_on(wiring: Wiring) -> (Rig, Needle) {
    let start = Start::of("held needle, pressed", wiring, pressed_afresh);
    let needle = start.kept::<Needle>().apart();
    let (board, pc) = start.on(needle.plant());
    (Rig { board, pc }, needle)
}

fn pressed_afresh(wiring: Wiring) -> (Board, Pc, Needle) {
    let needle = Needle::held_at(0.0);
    let mut rig = Rig { board: board_wired(wiring, needle.plant()), pc: Pc::new() };
    rig.pc.connect(&mut rig.board);
    rig.pc.must(&mut rig.board, Command::Zero);
    needle.change(|state| state.hand_speed = 0.0125);
    rig.pc.run_ms(&mut rig.board, 200);
    needle.change(|state| state.hand_speed = 0.0);
    rig.pc.must(&mut rig.board, Command::Start);
    rig.pc.run_ms(&mut rig.board, 500);
    let drive = rig.board.at_stop(|stopped| stopped.drive());
    let code = drive.code.unwrap_or(ZERO_TORQUE);
    assert!(drive.enabled && code < ZERO_TORQUE - 200, "torque is on: {drive:?}");
    (rig.board, rig.pc, needle)
}

fn pressed() -> (Rig, Needle) {
    pressed_on(Wiring::default())
}

/// Runs until the amplifier is off: how long that took, and how far the needle has gone.
fn off(rig: &mut Rig, needle: &Needle, limit: Nanos) -> (Nanos, f64) {
    let from = needle.state().depth;
    let time = rig.time_to_safe(limit);
    (time, (needle.state().depth - from).abs())
}

fn report(what: &str, (time, way): (Nanos, f64), limit: Nanos) {
    println!("| {what} | {:.2} ms, {:.2} mm |", time as f64 / 1e6, way * 1e3);
    assert!(time <= limit && way < FAR, "{what}: {time} ns, {way} m");
}

fn tripped(rig: &mut Rig, cause: Fault) {
    tripped_by(rig, &[cause]);
}

/// One of `causes` was reported within 60 ms.
fn tripped_by(rig: &mut Rig, causes: &[Fault]) {
    rig.pc.run_ms(&mut rig.board, 60);
    let kinds: Vec<_> = rig.pc.heard.events.iter().map(|event| event.kind).collect();
    assert!(causes.iter().any(|&cause| kinds.contains(&EventKind::Fault { cause })), "{kinds:?}");
}

#[test]
fn reversed_motor_leads() {
    let (mut rig, needle) = pressed();
    needle.change(|state| (state.reversed, state.hand) = (true, None));
    let gone = off(&mut rig, &needle, 10 * SOON);
    report("motor leads reversed, the needle let go", gone, SOON);
    tripped(&mut rig, Fault::WrongWay);
}

#[test]
fn swapped_encoder_channels() {
    let (mut rig, needle) = pressed();
    // What it holds is let go, and what it counts runs the other way from here on.
    rig.board.at_stop(|stopped| stopped.set_wires(Wires { swapped: true, ..Wires::default() }));
    needle.change(|state| state.hand = None);
    let gone = off(&mut rig, &needle, 10 * SOON);
    report("encoder channels swapped, the needle let go", gone, SOON);
    tripped(&mut rig, Fault::WrongWay);
}

#[test]
fn a_dead_encoder_channel() {
    for (name, wire) in [("A", 0), ("B", 1)] {
        for level in [false, true] {
            let (mut rig, needle) = pressed();
            let dead = Wire::Stuck(level);
            let wires = if wire == 0 {
                Wires { a: dead, ..Wires::default() }
            } else {
                Wires { b: dead, ..Wires::default() }
            };
            rig.board.at_stop(move |stopped| stopped.set_wires(wires));
            // A hand at 20 mm/s.
            needle.change(|state| state.hand_speed = 0.02);
            let gone = off(&mut rig, &needle, 5 * DEAD_CHANNEL);
            report(&format!("channel {name} dead at {level}, 20 mm/s"), gone, DEAD_CHANNEL);
            tripped(&mut rig, Fault::EncoderChannel);
        }
    }
}

#[test]
fn a_dead_encoder_channel_on_a_needle_that_is_let_go() {
    let (mut rig, needle) = pressed();
    rig.board.at_stop(|stopped| stopped.set_wires(Wires { b: Wire::Stuck(true), ..Wires::default() }));
    needle.change(|state| state.hand = None);
    let gone = off(&mut rig, &needle, 5 * DEAD_CHANNEL);
    report("channel B dead, the needle let go", gone, DEAD_CHANNEL);
    tripped(&mut rig, Fault::EncoderChannel);
}

#[test]
fn an_encoder_wire_that_comes_off_a_needle_at_rest() {
    for (a, b) in [(Wire::Off, Wire::Sound), (Wire::Sound, Wire::Off), (Wire::Off, Wire::Off)] {
        let (mut rig, needle) = pressed();
        rig.board.at_stop(move |stopped| stopped.set_wires(Wires { a, b, ..Wires::default() }));
        let gone = off(&mut rig, &needle, 5 * SOON);
        report(&format!("wires {a:?} and {b:?}"), gone, SOON);
        tripped(&mut rig, Fault::EncoderWire);
        let why = rig.pc.must_not(&mut rig.board, Command::Start);
        assert_eq!(why, CommandRefusal::Interlocked(Interlock::EncoderWire));
    }
}

#[test]
fn an_encoder_unplugged_while_friction_is_rendered() {
    let (mut rig, needle) = pressed();
    // Through skin, into what holds the needle by friction.
    needle.change(|state| state.hand_speed = 0.01);
    rig.pc.run_ms(&mut rig.board, 190);
    needle.change(|state| state.hand_speed = 0.0);
    rig.pc.run_ms(&mut rig.board, 100);
    let off_both = Wires { a: Wire::Off, b: Wire::Off, ..Wires::default() };
    rig.board.at_stop(move |stopped| stopped.set_wires(off_both));
    needle.change(|state| state.hand = None);
    let gone = off(&mut rig, &needle, 5 * SOON);
    report("encoder unplugged under friction", gone, SOON);
    tripped(&mut rig, Fault::EncoderWire);
}

/// Its outputs are held at one level and do not float, so that no pull reveals the loss. A needle
/// that is let go runs free meanwhile.
#[test]
fn an_encoder_that_loses_its_power() {
    let supply_off = Wires { supply_off: true, ..Wires::default() };
    let ground_off = Wires { ground_off: true, ..Wires::default() };
    for (name, wires) in [("supply", supply_off), ("ground", ground_off)] {
        for is_held in [true, false] {
            let (mut rig, needle) = pressed();
            rig.board.at_stop(move |stopped| stopped.set_wires(wires));
            if !is_held {
                needle.change(|state| state.hand = None);
            }
            let (time, way) = off(&mut rig, &needle, 200 * MILLISECOND);
            let how = if is_held { "held" } else { "let go" };
            println!(
                "| encoder without its {name}, {how} | {:.2} ms, {:.2} mm |",
                time as f64 / 1e6,
                way * 1e3
            );
            assert!(time <= WITHOUT_POWER, "{name}: {time} ns");
            tripped(&mut rig, Fault::EncoderFrozen);
        }
    }
}

#[test]
fn an_encoder_whose_supply_is_sensed() {
    let (mut rig, needle) = pressed_on(Wiring { supply_sense: true, ..Wiring::default() });
    rig.board.at_stop(|stopped| stopped.set_wires(Wires { supply_off: true, ..Wires::default() }));
    needle.change(|state| state.hand = None);
    let gone = off(&mut rig, &needle, 5 * SOON);
    report("encoder without its supply, which is sensed", gone, SOON);
    tripped(&mut rig, Fault::EncoderWire);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(Interlock::EncoderWire));
}

#[test]
fn an_amplifier_that_is_not_ready() {
    let (mut rig, needle) = pressed();
    rig.board.at_stop(|stopped| stopped.set_amplifier_ready(false));
    let gone = off(&mut rig, &needle, 5 * SOON);
    report("amplifier not ready", gone, SOON);
    tripped(&mut rig, Fault::AmplifierNotReady);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(Interlock::AmplifierNotReady));
    rig.board.at_stop(|stopped| stopped.set_amplifier_ready(true));
    rig.pc.run_ms(&mut rig.board, 5);
    rig.pc.must(&mut rig.board, Command::Start);
}

#[test]
fn the_emergency_stop() {
    let (mut rig, needle) = pressed();
    rig.board.at_stop(|stopped| stopped.set_emergency_stop(true));
    let gone = off(&mut rig, &needle, 5 * SOON);
    report("emergency stop", gone, SOON);
    tripped(&mut rig, Fault::EmergencyStop);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(Interlock::EmergencyStop));
    rig.board.at_stop(|stopped| stopped.set_emergency_stop(false));
    rig.pc.run_ms(&mut rig.board, 300);
    assert!(!rig.board.at_stop(|stopped| stopped.drive().enabled), "it does not start by itself");
    rig.pc.must(&mut rig.board, Command::Start);
}

/// A contact that closes to ground would be closed for ever by this.
#[test]
fn a_stop_whose_wire_is_shorted_to_ground() {
    let (mut rig, needle) = pressed();
    rig.board.at_stop(|stopped| stopped.short_emergency_stop());
    let gone = off(&mut rig, &needle, 5 * SOON);
    report("emergency stop shorted to ground", gone, SOON);
    tripped(&mut rig, Fault::EmergencyStop);
}

/// The enable line is high whatever the device does: only the converter at zero torque remains.
#[test]
fn an_enable_line_that_is_stuck_on() {
    let (mut rig, needle) = pressed();
    rig.board.at_stop(|stopped| stopped.set_amplifier(Amplifier::LineHigh));
    rig.pc.run_ms(&mut rig.board, 20);
    rig.pc.must(&mut rig.board, Command::Stop);
    let from = needle.state().depth;
    rig.pc.run_ms(&mut rig.board, 10);
    let drive = rig.board.at_stop(|stopped| stopped.drive());
    assert_eq!(
        (drive.enabled, drive.code),
        (true, Some(ZERO_TORQUE)),
        "no torque through a line that is stuck"
    );
    assert!((needle.state().depth - from).abs() < FAR);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(Interlock::AmplifierStuckOn));
}

#[test]
fn a_current_that_is_not_the_command() {
    let monitored = Wiring { current_monitor: true, ..Wiring::default() };
    // Full torque also drives the needle against what was asked for: whichever look comes first.
    let full = &[Fault::Current, Fault::WrongWay][..];
    for (amplifier, name, causes) in
        [(Amplifier::Dead, "no current", &[Fault::Current][..]), (Amplifier::Full, "full current", full)]
    {
        let (mut rig, needle) = pressed_on(monitored);
        rig.pc.run_ms(&mut rig.board, 300);
        rig.board.at_stop(move |stopped| stopped.set_amplifier(amplifier));
        let gone = off(&mut rig, &needle, 5 * SOON);
        report(name, gone, SOON);
        tripped_by(&mut rig, causes);
    }
    let (mut rig, _) = pressed_on(monitored);
    rig.pc.run_ms(&mut rig.board, 1_000);
    assert!(rig.board.at_stop(|stopped| stopped.drive().enabled), "a sound amplifier is left alone");
    rig.board.at_stop(|stopped| stopped.set_amplifier(Amplifier::Full));
    rig.pc.run_ms(&mut rig.board, 20);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(Interlock::AmplifierStuckOn), "current without a command");
}

#[test]
fn too_fast() {
    let (mut rig, needle) = pressed();
    needle.change(|state| {
        state.hand = None;
        state.speed = -0.6;
    });
    let gone = off(&mut rig, &needle, 10 * SOON);
    report("600 mm/s", gone, SOON);
    // At an edge every 26 µs the look at the wires may be the first to see that something is wrong.
    tripped_by(&mut rig, &[Fault::Overspeed, Fault::EncoderWire]);
}

#[test]
fn a_crystal_that_stops() {
    let (mut rig, needle) = pressed();
    let handler = rig.board.symbols().iter().find(|symbol| symbol.name == "NonMaskableInt");
    let address = handler.expect("the image serves its clock security").address;
    rig.upset(task::TELEMETRY, Effect::Jump(address));
    let gone = off(&mut rig, &needle, SOON);
    report("crystal stops", gone, SOON);
    rig.board.run_ms(50);
    rig.wait_for_port();
    let control = rig.board.at_stop(|stopped| stopped.register(0x4002_3800));
    assert!(control.is_some_and(|bits| bits & 1 << 19 != 0), "clock security watches: {control:?}");
    rig.comes_back_after(Fault::Clock);
}
