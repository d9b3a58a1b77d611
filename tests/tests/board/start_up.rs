//! Faults before the first tick: a peripheral that hangs, and states that a reset leaves.

use emulator::board::{MILLISECOND, Wiring, plant};
use link::frames::EventKind;
use tests::rig::Rig;
use tests::scenario::board_wired;

/// RM0090 34.16.2: `CSRST` is cleared by the core. Nothing bounds the wait of its driver.
#[test]
fn a_usb_core_that_stays_in_reset_ends_in_the_watchdog() {
    for wiring in [Wiring::default(), Wiring::nucleo_f429zi()] {
        let mut board = board_wired(wiring, plant::held());
        board.at_stop(|stopped| stopped.usb().core.hangs_in_reset = true);
        board.run_ms(100);
        let (lamps, resets, on) =
            board.at_stop(|stopped| (stopped.lamps(), stopped.resets(), stopped.log().enable.clone()));
        println!("| USB core hangs in its reset | {} resets in 100 ms, lamps {lamps:?} |", resets.len());
        assert!(resets.len() >= 3, "{resets:?}");
        let first = resets.first().map(|reset| reset.at.0);
        assert!(first.is_some_and(|at| at < 30 * MILLISECOND), "{first:?}");
        assert_eq!(lamps, [false; 3], "no lamp says that it runs");
        assert!(on.is_empty(), "{on:?}");
    }
}

/// RM0090 12.3.6: what is pending in `EXTI_PR` out of reset is undefined.
#[test]
fn an_edge_from_before_the_start_is_no_fault() {
    let mut board = board_wired(Wiring::default(), plant::held());
    board.run_ms(50);
    assert_eq!(board.at_stop(|stopped| stopped.lamps()), [true, false, false], "it runs, and no fault");
    let mut rig = Rig::connected(Wiring::default(), plant::held());
    rig.pc.run_ms(&mut rig.board, 50);
    assert_eq!(rig.pc.heard.hello.as_ref().and_then(|hello| hello.fault), None);
    let faults = rig.pc.heard_event(|kind| matches!(kind, EventKind::Fault { .. }));
    assert!(!faults, "{:?}", rig.pc.heard.events);
}

#[test]
fn start_up_keeps_the_parts_rules() {
    for wiring in [Wiring::default(), Wiring::nucleo_f429zi()] {
        let mut board = board_wired(wiring, plant::held());
        board.run_ms(50);
        let violations = board.at_stop(|stopped| stopped.violations());
        assert!(violations.is_empty(), "{violations:?}");
    }
}
