//! A board that nobody has commissioned gives no torque but two millinewton metres, and says why; one that has been switched
//! on does not start before it knows its depth.

use control_core::Device;
use control_core::event::State;
use control_core::excitation::{Excitation, GENTLE_TORQUE, Servo, Signal};
use control_core::interlock::Interlock;
use control_core::units::{Damping, Millimetres, MillinewtonMetres, Stiffness};
use fixed::types::I16F16;
use link::Command;
use link::frames::Rejection;
use tests::board::{Wiring, plant};
use tests::needle::Needle;
use tests::pc::Pc;
use tests::rig::ZERO_TORQUE;
use tests::scenario::{board, board_wired};

const NOT_COMMISSIONED: Rejection = Rejection::Interlocked(Interlock::NotCommissioned);

fn ramps(torque: MillinewtonMetres, stiffness: f64) -> Command {
    Command::Excite(Excitation {
        signal: Signal::BreakawayRamps { torque, ramp_ms: 100 },
        duration_ms: 400,
        servo: Servo { stiffness: Stiffness(I16F16::from_num(stiffness)), damping: Damping::default() },
        travel: Millimetres(I16F16::from_num(200)),
        compensated: false,
    })
}

#[test]
fn a_board_without_a_record_starts_only_once_it_is_commissioned() {
    let unknown = Wiring { commissioned: false, ..Wiring::default() };
    let needle = Needle::held_at(0.0);
    needle.change(|state| state.hand = None);
    let mut board = board_wired(unknown, needle.plant(0));
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Zero);
    assert_eq!(pc.must_not(&mut board, Command::Start), NOT_COMMISSIONED);
    let strong = MillinewtonMetres(GENTLE_TORQUE.0 + I16F16::ONE / 8);
    assert_eq!(pc.must_not(&mut board, ramps(strong, 0.0)), NOT_COMMISSIONED);
    assert_eq!(pc.must_not(&mut board, ramps(GENTLE_TORQUE, 0.1)), NOT_COMMISSIONED, "a servo");

    board.at_stop(|stopped| stopped.log().written.clear());
    pc.must(&mut board, ramps(GENTLE_TORQUE, 0.0));
    pc.run_ms(&mut board, 600);
    let played =
        pc.heard.samples.iter().filter(|(_, sample)| sample.state == State::Excitation as u8).count();
    assert_eq!(played, 4_000, "the pulses are played");
    let furthest = board.at_stop(|stopped| {
        let written = stopped.log().written.iter();
        written.map(|output| output.code.abs_diff(ZERO_TORQUE)).max()
    });
    // 2 mN·m of 28.8 on 2,047 codes.
    assert!(furthest.is_some_and(|codes| (100..=143).contains(&codes)), "{furthest:?} codes");

    let turned = Device { encoder_reversed: true, ..Device::default() };
    pc.must(&mut board, Command::ConfigureDevice(turned));
    pc.must(&mut board, Command::ConfigureDevice(Device::default()));
    assert_eq!(
        pc.must_not(&mut board, Command::Start),
        Rejection::Interlocked(Interlock::NotZeroed),
        "counts that ran the other way are another depth"
    );
    pc.must(&mut board, Command::Zero);
    pc.must(&mut board, Command::Start);
    pc.must(&mut board, Command::Stop);
    pc.run_ms(&mut board, 20);

    // The record is the device's own and outlives a reset; the depth does not.
    board.at_stop(|stopped| stopped.reset_by_pin());
    board.run_ms(20);
    pc.connect(&mut board);
    assert_eq!(pc.must_not(&mut board, Command::Start), Rejection::Interlocked(Interlock::NotZeroed));
    pc.must(&mut board, Command::Zero);
    pc.must(&mut board, Command::Start);
}

#[test]
fn a_patient_does_not_commission_a_device() {
    let mut board = board_wired(Wiring { commissioned: false, ..Wiring::default() }, plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::ConfigurePatient(control_core::Patient::default()));
    pc.must(&mut board, Command::Zero);
    assert_eq!(pc.must_not(&mut board, Command::Start), NOT_COMMISSIONED);
}

#[test]
fn a_zero_outlives_a_cable_that_is_pulled() {
    let mut board = board(plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Zero);
    board.at_stop(|stopped| stopped.usb().host.unplug());
    board.run_ms(50);
    pc.connect(&mut board);
    assert_eq!(pc.command(&mut board, Command::Start).result, Ok(()));
}
