//! The firmware's log over RTT is readable with its image alone: the bytes decoded as `defmt`.

use emulator::board::log::Log;
use emulator::board::tilt::Health;
use emulator::board::{Board, MILLISECOND, firmware_path, plant};
use tests::rig::{Rig, task};
use tests::scenario::board;

/// Every line so far, after its time in ms, with its level before it.
fn stamped(board: &mut Board) -> Vec<(String, String)> {
    let image = std::fs::read(firmware_path()).expect("the image");
    Log::of(&image).lines(&board.at_stop(|stopped| stopped.log().rtt.clone()))
}

/// The same without the times.
fn log(board: &mut Board) -> Vec<String> {
    stamped(board).into_iter().map(|(_, line)| line).collect()
}

#[test]
fn a_start_is_one_readable_line() {
    let mut board = board(plant::held());
    board.run_ms(100);
    assert_eq!(log(&mut board), ["info: started; torque is off"]);
}

#[test]
fn a_fault_says_what_is_wrong_and_when_it_is_over() {
    let mut rig = Rig::pressed();
    rig.board.at_stop(|stopped| stopped.tilt().expect("an accelerometer").health = Health::Absent);
    let since_ms = rig.board.now() / MILLISECOND;
    rig.time_to_safe(60 * MILLISECOND);
    rig.board.run_ms(10);
    let (time, _) = stamped(&mut rig.board).pop().expect("a line");
    let time: u64 = time.parse().expect("a number of ms");
    // The stamp counts from the start of the tasks, which start-up comes before.
    assert!((since_ms..since_ms + 70).contains(&(time + 5)), "{time} ms for what came after {since_ms} ms");
    assert_eq!(
        log(&mut rig.board).last().map(String::as_str),
        Some("error: the tilt sensor does not answer")
    );
    rig.board.at_stop(|stopped| stopped.tilt().expect("an accelerometer").health = Health::Good);
    rig.board.run_ms(50);
    assert_eq!(log(&mut rig.board).last().map(String::as_str), Some("info: the tilt sensor measures"));
}

#[test]
fn a_hang_is_named_after_the_reset_that_ended_it() {
    let mut rig = Rig::pressed();
    let effect = rig.hang();
    rig.upset(task::TELEMETRY, effect);
    rig.board.run_ms(100);
    let lines = log(&mut rig.board);
    println!("{lines:#?}");
    assert!(lines.iter().any(|line| line.starts_with("error: ")), "{lines:?}");
}
