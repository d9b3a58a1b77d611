//! The brown-out reset, which a part from the factory has switched off: it is set when a person
//! asks for it, and counts once a reset has loaded it.

use control_core::interlock::Interlock;
use emulator::board::Wiring;
use emulator::board::flash::{FACTORY_OPTIONS, GUARDED_OPTIONS, OptionFault};
use link::Command;
use link::frames::{CommandRefusal, GuardRefusal};
use tests::rig::Rig;

/// A shadow that users have reported: read protection, and every reserved bit but two.
const REPORTED: u32 = 0xCFFF_FFFC;

/// A board whose option bytes are `options`, with a fault, after a reset.
fn with_options(options: u32, fault: OptionFault) -> Rig {
    let mut rig = Rig::zeroed(Wiring::default());
    {
        let flash = rig.board.flash();
        let mut array = flash.array();
        (array.options, array.option_fault) = (options, fault);
    }
    restart(&mut rig);
    rig
}

fn restart(rig: &mut Rig) {
    rig.board.at_stop(|stopped| stopped.reset_by_pin());
    rig.board.run_ms(50);
    rig.pc.connect(&mut rig.board);
    rig.pc.must(&mut rig.board, Command::Zero);
}

/// Asks for the brown-out reset, and waits for longer than its programming may take.
fn guard(rig: &mut Rig, set: bool) -> Result<(), CommandRefusal> {
    let id = rig.pc.send(&mut rig.board, Command::GuardSupply { set });
    (0..2_000).find(|_| {
        rig.pc.run_ms(&mut rig.board, 1);
        rig.pc.heard.acks.contains_key(&id)
    });
    rig.pc.heard.acks.get(&id).expect("an answer").result
}

fn guard_refusal(rig: &mut Rig, set: bool) -> GuardRefusal {
    match guard(rig, set) {
        Err(CommandRefusal::Guard(why)) => why,
        other => panic!("{other:?}"),
    }
}

fn is_refused(rig: &mut Rig) {
    let since = rig.board.now();
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(Interlock::Supply));
    rig.pc.run_ms(&mut rig.board, 20);
    assert!(rig.enabled_since(since).is_empty(), "the amplifier stayed off");
}

fn writes(rig: &Rig) -> u32 {
    rig.board.flash().array().option_writes
}

/// RM0090 3.9.10: `OPTCR` shows what was written to it, whether it was taken or not.
#[test]
fn without_the_brown_out_reset_nothing_starts() {
    let mut rig = with_options(FACTORY_OPTIONS, OptionFault::Worn);
    for _ in 0..2 {
        is_refused(&mut rig);
        restart(&mut rig);
    }
    assert_eq!(writes(&rig), 0, "nobody has asked for it");
}

/// RM0090 3.7.2 and 3.9.10.
#[test]
fn it_is_set_when_asked_and_counts_after_a_reset() {
    let mut rig = with_options(FACTORY_OPTIONS, OptionFault::None);
    assert_eq!(guard_refusal(&mut rig, false), GuardRefusal::Off);
    assert_eq!((writes(&rig), rig.board.flash().array().options), (0, FACTORY_OPTIONS));
    let resets = rig.board.at_stop(|stopped| stopped.resets().len());
    for _ in 0..2 {
        assert_eq!(guard_refusal(&mut rig, true), GuardRefusal::Restart);
        let after = (writes(&rig), rig.board.flash().array().options);
        assert_eq!(after, (1, GUARDED_OPTIONS), "level 2, once, and nothing else");
        is_refused(&mut rig);
    }
    assert_eq!(rig.board.at_stop(|stopped| stopped.resets().len()), resets, "the watchdog waits for it");
    restart(&mut rig);
    assert_eq!(guard(&mut rig, true), Ok(()));
    assert_eq!(writes(&rig), 1);
    rig.pc.must(&mut rig.board, Command::Start);
    assert_eq!(guard(&mut rig, true), Err(CommandRefusal::Powered));
    let violations = rig.board.at_stop(|stopped| stopped.violations());
    assert!(violations.is_empty(), "{violations:?}");
}

/// Takes more than 5 s: a flash that stays busy is waited for.
#[test]
fn option_bytes_that_do_not_take_give_no_torque() {
    let faults = [
        (OptionFault::Worn, GuardRefusal::Restart),
        (OptionFault::Refused, GuardRefusal::NotTaken),
        (OptionFault::Busy, GuardRefusal::NotTaken),
    ];
    for (fault, said) in faults {
        let mut rig = with_options(FACTORY_OPTIONS, fault);
        assert_eq!(guard_refusal(&mut rig, true), said, "{fault:?}");
        for _ in 0..2 {
            is_refused(&mut rig);
            restart(&mut rig);
        }
        assert_eq!(guard_refusal(&mut rig, false), GuardRefusal::Off, "{fault:?}");
        assert_eq!(rig.board.flash().array().options, FACTORY_OPTIONS);
    }
}

/// RM0090 3.7.3: a read protection that is written stays.
#[test]
fn an_implausible_shadow_is_never_written_back() {
    let mut rig = with_options(REPORTED, OptionFault::None);
    is_refused(&mut rig);
    assert_eq!(guard_refusal(&mut rig, true), GuardRefusal::Implausible(0xCFFF_FFFD));
    let violations = rig.board.at_stop(|stopped| stopped.violations());
    assert!(violations.is_empty(), "{violations:?}");
    assert_eq!((writes(&rig), rig.board.flash().array().options), (0, REPORTED));
}

#[test]
fn on_a_low_supply_no_option_byte_is_written() {
    let mut rig = with_options(FACTORY_OPTIONS, OptionFault::None);
    rig.board.at_stop(|stopped| stopped.set_supply(2_600));
    rig.pc.run_ms(&mut rig.board, 5);
    assert_eq!(guard_refusal(&mut rig, true), GuardRefusal::SupplyLow);
    assert_eq!(writes(&rig), 0);
}
