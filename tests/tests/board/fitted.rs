//! Alternative parts: the 8-bit converter that a configuration names, the analogue inclinometer
//! that a strap names. The image is the same one.

use control_core::Config;
use control_core::config::DacWidth;
use control_core::event::Fault;
use emulator::board::{MILLISECOND, Nanos, SetValue, Wiring, plant};
use link::Command;
use tests::pc::Pc;
use tests::rig::{PRESSED, Rig, ZERO_TORQUE};
use tests::scenario::{board_wired, venepuncture};

/// Zero torque of the 8-bit converter.
const ZERO_TORQUE_OF_LINES: u16 = 128;
/// The pin of the analogue inclinometer: PC1.
const INCLINOMETER: u8 = 11;
/// Half of the supply.
const LEVEL_MILLIVOLTS: u32 = 1_650;

/// Each value once, as long as it lasts.
fn changes(codes: impl Iterator<Item = u16>) -> Vec<u16> {
    let mut codes: Vec<u16> = codes.collect();
    codes.dedup();
    codes
}

#[test]
fn eight_lines_carry_only_the_codes_of_their_configuration() {
    let wiring = Wiring { set_value: SetValue::Lines, ..Wiring::default() };
    let mut board = board_wired(wiring, venepuncture(1_000 * MILLISECOND));
    let mut pc = Pc::new();
    pc.connect(&mut board);
    let mut config = Config::commissioned_virtual();
    config.device.dac = DacWidth::BITS_8;
    pc.configure(&mut board, &config);
    pc.run_ms(&mut board, 50);
    board.at_stop(|stopped| stopped.log().put_out.clear());
    let first = pc.heard.samples.len();
    pc.must(&mut board, Command::Start);
    pc.run_ms(&mut board, 8_000);
    pc.must(&mut board, Command::Stop);
    pc.run_ms(&mut board, 20);
    assert!(board.at_stop(|stopped| !stopped.drive().enabled), "off after a stop");

    let (lines, on_chip) = board.at_stop(|stopped| {
        let log = std::mem::take(stopped.log());
        let codes = |outputs: Vec<emulator::board::Output>| outputs.into_iter().map(|output| output.code);
        (changes(codes(log.put_out)), changes(codes(log.written)))
    });
    let mut wanted = changes(pc.heard.samples[first..].iter().map(|(_, sample)| sample.dac));
    assert_eq!(wanted.remove(0), ZERO_TORQUE_OF_LINES, "the first is no change");
    assert_eq!(lines, wanted, "each change of the eight lines, and no code between two");
    let (least, most) = (lines.iter().min(), lines.iter().max());
    println!("{} changes of the lines, codes {least:?} to {most:?}", lines.len());
    assert!(
        lines.len() > 200 && lines.iter().all(|&code| (1..=255).contains(&code)),
        "{least:?} to {most:?}"
    );
    assert_eq!(lines.last(), Some(&ZERO_TORQUE_OF_LINES));
    assert_eq!(on_chip, [ZERO_TORQUE], "the other converter stays at zero torque");
}

/// A needle pressed into skin on a board with the inclinometer instead of the accelerometer.
fn with_inclinometer() -> Rig {
    let wiring = Wiring { tilt: None, inclinometer: true, ..Wiring::default() };
    let hand = plant::path(vec![(400 * MILLISECOND, 0), (700 * MILLISECOND, PRESSED)]);
    let mut rig = Rig { board: board_wired(wiring, plant::by_hand(hand)), pc: Pc::new() };
    rig.board.at_stop(|stopped| stopped.set_analogue(INCLINOMETER, LEVEL_MILLIVOLTS));
    rig.pc.connect(&mut rig.board);
    rig.pc.must(&mut rig.board, Command::Start);
    rig.pc.run_ms(&mut rig.board, 900);
    assert!(rig.board.at_stop(|stopped| stopped.drive().enabled));
    rig
}

#[test]
fn an_inclinometer_gives_the_angle_whose_sine_it_measures() {
    let mut rig = with_inclinometer();
    // 0.66 V are 1 g: its sine is 0, a half, and minus a half.
    for (millivolts, mrad) in [(LEVEL_MILLIVOLTS, 0_i32), (1_980, 524), (1_320, -524)] {
        rig.board.at_stop(move |stopped| stopped.set_analogue(INCLINOMETER, millivolts));
        rig.pc.run_ms(&mut rig.board, 500);
        let tilt = rig.pc.heard.pose.expect("a pose").tilt.0;
        println!("{millivolts} mV: {tilt} mrad");
        assert!((i32::from(tilt) - mrad).abs() <= 3, "{millivolts} mV: {tilt} mrad");
    }
}

#[test]
fn a_broken_wire_of_the_inclinometer_takes_torque_away() {
    const LIMIT: Nanos = 60 * MILLISECOND;
    let mut rig = with_inclinometer();
    rig.board.at_stop(|stopped| stopped.set_analogue(INCLINOMETER, 0));
    let time = rig.time_to_safe(LIMIT);
    println!("| inclinometer's wire breaks | {:.2} ms |", time as f64 / 1e6);
    rig.board.at_stop(|stopped| stopped.set_analogue(INCLINOMETER, LEVEL_MILLIVOLTS));
    rig.comes_back_after(Fault::Tilt);
}
