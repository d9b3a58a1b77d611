//! The record that a crash leaves in RAM outlives the reset, and a PC receives it after its hello.

use emulator::board::{Effect, MILLISECOND};
use link::Command;
use link::crash::{Crash, CrashKind};
use link::frames::EventKind;
use tests::rig::{Rig, task};

/// Memory that the part has and the firmware does not know of.
const BEYOND: u32 = 0x2002_0100;
/// Nothing answers there: reserved, past the part's RAM (RM0090 2.3).
const NOWHERE: u32 = 0x2010_0000;
/// `PRECISERR` and `BFARVALID` of the fault status, `IBUSERR` (ARMv7-M B3.2.15), and `FORCED` of
/// the hard fault's (B3.2.16).
const PRECISE: u32 = 1 << 9;
const ADDRESS_VALID: u32 = 1 << 15;
const INSTRUCTION_BUS: u32 = 1 << 8;
const FORCED: u32 = 1 << 30;

/// Crashes in `exception` by `effect`, under torque, and returns what the next PC to say hello
/// receives.
fn record_of(rig: &mut Rig, exception: u32, effect: Effect) -> Crash {
    rig.upset(exception, effect);
    rig.time_to_safe(6 * MILLISECOND);
    rig.board.run_ms(50);
    assert_eq!(rig.board.at_stop(|stopped| stopped.resets().len()), 1, "it resets itself");
    rig.wait_for_port();
    rig.pc.connect(&mut rig.board);
    rig.pc.run_ms(&mut rig.board, 50);
    let (crash, times) = rig.pc.heard.crash.clone();
    assert_eq!(times, 1, "once for each hello");
    let crash = crash.expect("a record");
    println!("| {crash} |");
    crash
}

/// A load from where nothing is, as from a wild pointer.
fn wild_pointer(rig: &mut Rig) -> Effect {
    // `ldr r0, [pc, #4]`, `ldr r1, [r0]`, `b .`, `nop`, the address.
    let program = [0x6801_4801, 0xBF00_E7FE, NOWHERE];
    rig.board.at_stop(move |stopped| {
        for (at, word) in (BEYOND..).step_by(4).zip(program) {
            assert!(stopped.set_word(at.into(), word), "memory for a program");
        }
    });
    Effect::Jump(BEYOND)
}

#[test]
fn a_wild_pointer_names_its_instruction_and_its_address() {
    for exception in [task::TICK, task::TILT] {
        let mut rig = Rig::pressed();
        let effect = wild_pointer(&mut rig);
        let crash = record_of(&mut rig, exception, effect);
        assert_eq!((crash.kind, crash.detail & FORCED), (CrashKind::HardFault, FORCED));
        assert_eq!(crash.pc, BEYOND + 2, "{crash}");
        assert_eq!(crash.fault_status, PRECISE | ADDRESS_VALID, "{crash}");
        assert_eq!(crash.failed_address(), Some(NOWHERE));
        // It came from code of the image.
        assert!(rig.board.symbol_at(crash.lr & !1).is_some() || crash.lr > 0xFFFF_FF00, "{crash}");
    }
}

/// Stores `value` to both addresses, as a stray write that makes an exception pending.
fn stray_write(rig: &mut Rig, addresses: [u32; 2], value: u32) -> Effect {
    // `ldr r0, [pc, #8]`, `ldr r1, [pc, #12]`, `str r1, [r0]`, `ldr r0, [pc, #12]`, `str r1, [r0]`,
    // `b .`, what they load.
    let program = [0x4903_4802, 0x4803_6001, 0xE7FE_6001, addresses[0], value, addresses[1]];
    rig.board.at_stop(move |stopped| {
        for (at, word) in (BEYOND..).step_by(4).zip(program) {
            assert!(stopped.set_word(at.into(), word), "memory for a program");
        }
    });
    Effect::Jump(BEYOND)
}

/// The core's `PendSV` is exception 14, two below interrupt 0; interrupt 2 is the tamper's (ARMv7-M
/// B1.5.2, RM0090 12.2). Nothing here serves either.
#[test]
fn an_exception_and_an_interrupt_are_distinguished() {
    const ICSR: u32 = 0xE000_ED04;
    const PENDSVSET: u32 = 1 << 28;
    const ISER0: u32 = 0xE000_E100;
    const ISPR0: u32 = 0xE000_E200;
    let strays = [
        ([ICSR, ICSR], PENDSVSET, 14, "exception 14 of the core"),
        ([ISER0, ISPR0], 1 << 2, 18, "interrupt 2,"),
    ];
    for (addresses, value, exception, name) in strays {
        let mut rig = Rig::pressed();
        let effect = stray_write(&mut rig, addresses, value);
        let crash = record_of(&mut rig, task::TILT, effect);
        assert_eq!((crash.kind, crash.detail), (CrashKind::StrayInterrupt, exception));
        assert!(crash.to_string().contains(name), "{crash}");
    }
}

#[test]
fn a_jump_to_nowhere_names_the_place() {
    let mut rig = Rig::pressed();
    let crash = record_of(&mut rig, task::TELEMETRY, Effect::Jump(NOWHERE));
    assert_eq!((crash.kind, crash.pc), (CrashKind::HardFault, NOWHERE));
    assert_eq!((crash.fault_status, crash.failed_address()), (INSTRUCTION_BUS, None));
}

/// The record stays until a person has started the device, for the first hello may be lost.
#[test]
fn every_hello_brings_the_record_until_a_start() {
    let mut rig = Rig::pressed();
    let effect = wild_pointer(&mut rig);
    let crash = record_of(&mut rig, task::TELEMETRY, effect);
    rig.pc.hello(&mut rig.board);
    rig.pc.run_ms(&mut rig.board, 50);
    assert_eq!(rig.pc.heard.crash, (Some(crash), 1));
    rig.pc.must(&mut rig.board, Command::Start);
    rig.pc.run_ms(&mut rig.board, 50);
    assert!(rig.pc.heard_event(|kind| *kind == EventKind::Started));
    rig.pc.hello(&mut rig.board);
    rig.pc.run_ms(&mut rig.board, 50);
    assert_eq!(rig.pc.heard.crash, (None, 0));
}

#[test]
fn a_damaged_record_is_not_sent() {
    let mut rig = Rig::pressed();
    let words = rig.board.symbols().iter().find(|symbol| symbol.name.contains("LAST_WORDS"));
    let (address, size) = words.map(|symbol| (symbol.address, symbol.size)).expect("the record's place");
    let effect = wild_pointer(&mut rig);
    rig.upset(task::TELEMETRY, effect);
    // As soon as it is written, which is before the next start-up reads it.
    let damaged = rig.board.run_while_not(10, 5, move |stopped| {
        (address..address + size).step_by(4).any(|at| {
            let word = stopped.word(at.into());
            word == Some(BEYOND + 2) && stopped.set_word(at.into(), BEYOND + 6)
        })
    });
    assert!(damaged, "the record holds the instruction's address");
    rig.board.run_ms(50);
    rig.wait_for_port();
    rig.pc.connect(&mut rig.board);
    rig.pc.run_ms(&mut rig.board, 50);
    assert_eq!(rig.pc.heard.crash, (None, 0));
}
