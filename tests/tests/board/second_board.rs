//! The image for the NUCLEO-F429ZI on its own pins: it is the same device, it takes torque away
//! there, and no image runs on the other's board.

use control_core::Config;
use control_core::event::{Fault, State};
use control_core::interlock::Interlock;
use emulator::board::pins::{Clock, DISCOVERY, NUCLEO_F429ZI, Pins};
use emulator::board::wires::{Wire, Wires};
use emulator::board::{Amplifier, Board, Effect, MILLISECOND, Nanos, Wiring, image_for, plant};
use emulator::usb_host::Port;
use link::Command;
use link::frames::CommandRefusal;
use tests::follow::follows;
use tests::pc::Pc;
use tests::rig::{Rig, ZERO_TORQUE, task};
use tests::scenario::{board_wired, venepuncture};

/// A fault that a tick can see ends within two ticks; looking at the pins adds 10 µs.
const TWO_TICKS: Nanos = 210_000;

fn connected() -> Rig {
    Rig::zeroed(Wiring::nucleo_f429zi())
}

fn refused(rig: &mut Rig, interlock: Interlock) {
    rig.pc.run_ms(&mut rig.board, 20);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(interlock));
}

/// However it was built: by `cargo xtask firmware`, not only by `dist`.
#[test]
fn each_image_says_of_which_commit_it_is() {
    let git = |arguments: &[&str]| {
        let output = std::process::Command::new("git").args(arguments).output().expect("git");
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_string())
    };
    let head = git(&["rev-parse", "--short=8", "HEAD"]).unwrap_or_else(|| "unknown build".into());
    let is_clean = git(&["status", "--porcelain"]).is_none_or(|changes| changes.is_empty());
    for wiring in [Wiring::default(), Wiring::nucleo_f429zi()] {
        let rig = Rig::connected(wiring, plant::held());
        let build = rig.pc.heard.hello.as_ref().expect("a hello").build;
        assert!(build.to_string().starts_with(&head), "built before the last commit, {head}? {build}");
        assert!(!is_clean || !build.is_changed, "nothing is changed");
    }
}

/// Takes more than 5 s: a whole insertion, as in `control.rs`.
#[test]
fn it_computes_what_control_core_computes() {
    /// 30° down, on the inclinometer, as the Discovery's accelerometer has it in `control.rs`.
    const MILLIVOLTS: u32 = 1_980;
    let mut board = board_wired(Wiring::nucleo_f429zi(), venepuncture(1_000_000_000));
    board.at_stop(|stopped| stopped.set_analogue(NUCLEO_F429ZI.inclinometer, MILLIVOLTS));
    let (states, punctures) = follows(board, None);
    for state in [State::Approach, State::Elastic, State::Friction, State::Withdrawal] {
        assert!(states[state as usize] > 500, "{state:?} was hardly reached: {states:?}");
    }
    assert_eq!(punctures, 2, "the skin and the vein");
}

#[test]
fn its_tick_takes_as_many_instructions_as_the_default_boards() {
    let mut rig = Rig::pressed_on(Wiring::nucleo_f429zi());
    rig.board.count_runs_of("TIM4");
    rig.pc.run_ms(&mut rig.board, 200);
    let longest = rig.board.counted_runs().iter().map(|run| run.instructions).max();
    println!("| NUCLEO-F429ZI, pressed | longest {longest:?} instructions |");
    assert!(longest.is_some_and(|longest| (300..=840).contains(&longest)), "{longest:?}");
    let (violations, stray) = rig.board.at_stop(|stopped| (stopped.violations(), stopped.stray_accesses()));
    assert!(violations.is_empty() && stray.is_empty(), "{violations:?} {stray:?}");
}

#[test]
fn each_of_its_lines_refuses_a_start() {
    let mut rig = connected();
    rig.board.at_stop(|stopped| stopped.set_emergency_stop(true));
    refused(&mut rig, Interlock::EmergencyStop);
    rig.board.at_stop(|stopped| {
        stopped.set_emergency_stop(false);
        stopped.set_amplifier_ready(false);
    });
    refused(&mut rig, Interlock::AmplifierNotReady);
    rig.board.at_stop(|stopped| {
        stopped.set_amplifier_ready(true);
        stopped.set_amplifier(Amplifier::LineHigh);
    });
    refused(&mut rig, Interlock::AmplifierStuckOn);
    for wires in [Wires { a: Wire::Off, ..Wires::default() }, Wires { b: Wire::Off, ..Wires::default() }] {
        let mut rig = connected();
        rig.board.at_stop(move |stopped| stopped.set_wires(wires));
        refused(&mut rig, Interlock::EncoderWire);
    }
}

/// The amplifier goes off before the converter goes to zero torque, as close as the two are.
fn is_off_before_zero(rig: &mut Rig, since: Nanos) {
    let (off, zero) = rig.board.at_stop(move |stopped| {
        let log = stopped.log();
        let off = log.enable.iter().find(|&&(at, on)| at >= since && !on).map(|&(at, _)| at);
        let zero = log.put_out.iter().find(|output| output.at >= since && output.code == ZERO_TORQUE);
        (off, zero.map(|output| output.at))
    });
    assert!(off.is_some() && off < zero, "off at {off:?}, zero torque at {zero:?}");
}

#[test]
fn a_panic_takes_torque_away_at_its_pins() {
    let mut rig = Rig::pressed_on(Wiring::nucleo_f429zi());
    let panics = rig.board.symbols().iter().find(|symbol| symbol.name.ends_with("rust_begin_unwind"));
    let panics = Effect::Jump(panics.expect("a panic handler").address);
    let since = rig.board.now();
    rig.upset(task::TICK, panics);
    rig.time_to_safe(TWO_TICKS);
    is_off_before_zero(&mut rig, since);
    rig.board.run_ms(50);
    assert_eq!(rig.board.at_stop(|stopped| stopped.resets().len()), 1, "it resets itself");
    rig.wait_for_port();
    rig.comes_back_after(Fault::Crash);
}

#[test]
fn a_supply_that_falls_takes_torque_away_at_its_pins() {
    let mut rig = Rig::pressed_on(Wiring::nucleo_f429zi());
    let since = rig.board.now();
    rig.board.at_stop(|stopped| stopped.set_supply(2_600));
    rig.time_to_safe(TWO_TICKS);
    is_off_before_zero(&mut rig, since);
    rig.board.at_stop(|stopped| stopped.set_supply(3_300));
    rig.comes_back_after(Fault::Brownout);
}

#[test]
fn losing_the_inclinometer_or_current_takes_torque_away() {
    let mut rig = Rig::pressed_on(Wiring::nucleo_f429zi());
    rig.board.at_stop(|stopped| stopped.set_analogue(NUCLEO_F429ZI.inclinometer, 0));
    rig.time_to_safe(60 * MILLISECOND);
    let mut rig = Rig::pressed_on(Wiring { current_monitor: true, ..Wiring::nucleo_f429zi() });
    rig.board.at_stop(|stopped| stopped.set_amplifier(Amplifier::Dead));
    rig.time_to_safe(25 * MILLISECOND);
    rig.board.at_stop(|stopped| stopped.set_amplifier(Amplifier::Sound));
    rig.comes_back_after(Fault::Current);
}

#[test]
fn a_configuration_outlives_a_reset() {
    let mut rig = connected();
    let mut config = Config::commissioned_virtual();
    config.device.limits.fade_in_ms = 400;
    rig.pc.must(&mut rig.board, Command::ConfigureDevice(config.device));
    rig.pc.run_ms(&mut rig.board, 50);
    rig.board.at_stop(|stopped| stopped.reset_by_pin());
    rig.board.run_ms(100);
    rig.pc.connect(&mut rig.board);
    let hello = rig.pc.heard.hello.clone().expect("a hello");
    assert_eq!(hello.config_hash, link::codec::hash(&config));
}

/// An image for `of` on a board wired as `on`, where it gets as far as the cable: on its own board
/// it does in 10 ms.
fn comes_up(of: &Pins, on: Pins) -> Option<Rig> {
    let wiring = Wiring { pins: on, ..Wiring::nucleo_f429zi() };
    let board = Board::on(&image_for(of), wiring, plant::held()).unwrap_or_else(|why| panic!("{why}"));
    let mut rig = Rig { board, pc: Pc::new() };
    rig.board.at_stop(|stopped| stopped.usb().host.plug());
    let is_there = rig.board.run_while_not(50, 1_000, |stopped| stopped.usb().host.port() != Port::Absent);
    is_there.then_some(rig)
}

/// The clock is the first difference, the pins the next: so both images really are for their own
/// board.
#[test]
fn no_image_runs_on_the_other_board() {
    assert!(comes_up(&NUCLEO_F429ZI, NUCLEO_F429ZI).is_some());
    assert!(comes_up(&DISCOVERY, NUCLEO_F429ZI).is_none(), "without a crystal");
    assert!(comes_up(&NUCLEO_F429ZI, DISCOVERY).is_none(), "past a crystal's oscillator");
    let with_a_crystal = Pins { clock: Clock::Crystal, ..NUCLEO_F429ZI };
    let mut rig = comes_up(&DISCOVERY, with_a_crystal).expect("it has its clock");
    rig.pc.connect(&mut rig.board);
    rig.pc.must(&mut rig.board, Command::Zero);
    refused(&mut rig, Interlock::EmergencyStop);
}
