//! The boards' own test (`firmware/tests/board.rs`), wired as it says and with its cable in a PC:
//! the same program that `cargo xtask board-test` flashes, each of its tests after a reset.

use emulator::board::log::Log;
use emulator::board::semihosting::{self, Host};
use emulator::board::{Board, Wiring, flash, image_for, plant};

/// The status of a test that has ended well, and that of one that has not.
const PASSED: u32 = 0;
const ABORTED: u32 = 134;
/// No test of it takes longer: four erasures.
const LONGEST_MS: u64 = 20_000;

/// Runs the test at `address` of the program in `path`; its status, its log, and the resets of the
/// part meanwhile.
fn run(wiring: Wiring, address: u32) -> (Option<u32>, Vec<String>, usize, Board) {
    let path = own_test(wiring);
    let mut board = Board::on(&path, wiring, plant::held()).unwrap_or_else(|why| panic!("{why}"));
    let probe = board.probe();
    probe.tally().host = Some(Host::running(address));
    board.at_stop(|stopped| stopped.usb().host.plug());
    let ended = probe.clone();
    let status = move || ended.tally().host.as_ref().and_then(|host| host.status);
    let look = status.clone();
    board.run_while_not(LONGEST_MS, 1_000, move |_| look().is_some());
    // What it said last is read out.
    let status = status();
    board.run_ms(2);
    let image = std::fs::read(&path).expect("the program that runs");
    let (terminal, resets) = board.at_stop(|stopped| (stopped.log().rtt.clone(), stopped.resets().len()));
    let lines = Log::of(&image).lines(&terminal).into_iter().map(|(_, line)| line).collect();
    (status, lines, resets, board)
}

/// The path at which the test step leaves it: next to the board's image.
fn own_test(wiring: Wiring) -> std::path::PathBuf {
    let image = image_for(&wiring.pins);
    let name = image.file_name().expect("a file").to_string_lossy();
    image.with_file_name(format!("{name}-own-test"))
}

fn tests_of(wiring: Wiring) -> Vec<(String, u32)> {
    let path = own_test(wiring);
    let image = std::fs::read(&path)
        .unwrap_or_else(|why| panic!("{}: {why}; `cargo xtask test board` builds it", path.display()));
    semihosting::tests(&image)
}

fn address_of(wiring: Wiring, name: &str) -> u32 {
    let tests = tests_of(wiring);
    let test = tests.iter().find(|(test, _)| test == name);
    test.unwrap_or_else(|| panic!("{name} is not among {tests:?}")).1
}

/// Takes more than 5 s: eight programs from their start, four erasures and 80,000 ticks.
#[test]
fn every_test_passes_but_that_of_a_cache_there_is_none_of() {
    for wiring in [Wiring::default(), Wiring::nucleo_f429zi()] {
        let wiring = Wiring { loopback: true, ..wiring };
        let tests = tests_of(wiring);
        assert!(tests.len() >= 5, "{tests:?}");
        for (name, address) in tests {
            let (status, lines, resets, mut board) = run(wiring, address);
            let fails = name == "an_emptied_cache_costs_cycles";
            let ended = if fails { "fails: there is no cache to empty" } else { "passes" };
            let wanted = Some(if fails { ABORTED } else { PASSED });
            assert_eq!((status, resets), (wanted, 0), "{name}: {lines:#?}");
            let said = lines.iter().any(|line| line.contains("the cache was not emptied"));
            assert_eq!(said, fails, "{name}: {lines:#?}");
            let (on, violations) =
                board.at_stop(|stopped| (stopped.log().enable.clone(), stopped.violations()));
            assert!(on.is_empty() && violations.is_empty(), "{name}: {on:?} {violations:?}");
            let array = board.flash();
            let array = array.array();
            assert_eq!(array.option_writes, 0, "{name}");
            let touched = array.erased.iter().any(|(sector, _)| *sector >= flash::FIRST_OF_CONFIGURATION);
            assert!(!touched, "{name}: {:?}", array.erased);
            println!("| {}: {} | {ended} |", wiring.pins.own_test, name.replace('_', " "));
        }
    }
}

/// A wire that is not there, and a supply that is too low: each fails the test that looks at it, in
/// words.
#[test]
fn a_wrong_wire_fails_in_words() {
    let looped = Wiring { loopback: true, ..Wiring::default() };
    let cases = [
        (Wiring::default(), "the_converter_gives_code_for_code", "is not wired to 3 V"),
        (Wiring { supply: 2_600, ..looped }, "the_supply_is_high_enough_and_guarded", "below 2.66 V"),
    ];
    for (wiring, name, words) in cases {
        let (status, lines, resets, _) = run(wiring, address_of(wiring, name));
        assert_eq!((status, resets), (Some(ABORTED), 0), "{name}: {lines:#?}");
        assert!(lines.iter().any(|line| line.contains(words)), "{name}: {lines:#?}");
    }
}
