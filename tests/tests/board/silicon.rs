//! Requirements of the part and the board that an emulator easily forgives: each test failed on the
//! previous image.

use control_core::Config;
use control_core::excitation::{Excitation, Servo, Signal};
use control_core::interlock::Interlock;
use control_core::units::{Damping, Millimetres, MillinewtonMetres, Stiffness};
use emulator::board::pins::{DISCOVERY, NUCLEO_F429ZI};
use emulator::board::wires::Wires;
use emulator::board::{Board, MILLISECOND, Wiring, elf, firmware_path, image_for, plant};
use fixed::types::{I8F24, I16F16};
use link::Command;
use link::frames::{CommandRefusal, EventKind, SaveError, Stage};
use tests::rig::Rig;
use tests::scenario::{board, board_wired};

fn is_allowed(board: &mut Board) {
    let violations = board.at_stop(|stopped| stopped.violations());
    assert!(violations.is_empty(), "{violations:?}");
}

/// RM0090 14.3.6 (the trigger is chosen before the converter is enabled) and 14.3.2 (its buffer
/// ends before the rails do).
#[test]
fn full_torque_both_ways_reaches_the_pin() {
    let mut rig = Rig::zeroed(Wiring::default());
    let servo =
        Servo { stiffness: Stiffness(I16F16::from_num(0.1)), damping: Damping(I8F24::from_num(0.0005)) };
    let torque = MillinewtonMetres(I16F16::from_num(28.7));
    let excitation = Excitation {
        signal: Signal::BreakawayRamps { torque, ramp_ms: 100 },
        duration_ms: 1_000,
        servo,
        travel: Millimetres(I16F16::from_num(50)),
        compensated: false,
    };
    rig.pc.must(&mut rig.board, Command::Excite(excitation));
    rig.pc.run_ms(&mut rig.board, 1_000);
    let codes: Vec<u16> =
        rig.board.at_stop(|stopped| stopped.log().put_out.iter().map(|output| output.code).collect());
    let (least, most) = (codes.iter().min().copied(), codes.iter().max().copied());
    assert!(least.is_some_and(|code| code < 80), "the lowest code is {least:?}");
    assert!(most.is_some_and(|code| code > 4_015), "the highest code is {most:?}");
    is_allowed(&mut rig.board);
}

/// RM0090 3.9.7: a control register that is written whole locks itself; 3.6: an erasure stops the
/// processor. Takes more than 5 s: as many saves as fill both sectors, so that one of them is
/// erased.
#[test]
fn three_hundred_configurations_are_all_saved() {
    let mut rig = Rig::zeroed(Wiring::default());
    let config = |number: u16| {
        let mut config = Config::commissioned_virtual();
        config.device.limits.fade_in_ms = 300 + number;
        config
    };
    for number in 1..=300 {
        // An erasure takes longer than a PC waits for an answer.
        rig.pc.send(&mut rig.board, Command::ConfigureDevice(config(number).device));
        let before = rig.pc.heard.acks.len();
        while rig.pc.heard.acks.len() == before {
            rig.pc.run_ms(&mut rig.board, 20);
            assert!(rig.board.now() < 60_000 * MILLISECOND, "configuration {number}");
        }
        rig.pc.run_ms(&mut rig.board, 5);
    }
    assert!(!rig.pc.heard_event(|kind| matches!(kind, EventKind::NotSaved { .. })), "all were saved");
    assert!(rig.board.at_stop(|stopped| stopped.resets()).is_empty(), "the watchdog waits for an erasure");
    assert!(!rig.board.flash().array().erased.is_empty(), "room was made while it ran");
    rig.board.at_stop(|stopped| stopped.reset_by_pin());
    rig.board.run_ms(3_000);
    rig.pc.connect(&mut rig.board);
    let hello = rig.pc.heard.hello.clone().expect("a hello");
    assert_eq!(hello.config_hash, link::codec::hash(&config(300)), "the last one outlives a reset");
    is_allowed(&mut rig.board);
}

/// A start that a stop overtakes, and a configuration for which there is no room: the processor may
/// not stop with torque on. Takes more than 5 s: as many saves as fill a sector.
#[test]
fn a_sector_is_erased_with_the_amplifier_off_only() {
    let mut rig = Rig::zeroed(Wiring::default());
    let mut config = Config::commissioned_virtual();
    for number in 1..=140 {
        rig.pc.send(&mut rig.board, Command::Start);
        rig.pc.run_ms(&mut rig.board, 3);
        rig.pc.send(&mut rig.board, Command::Stop);
        // By then the link knows that torque is off, and only just.
        rig.pc.run_ms(&mut rig.board, 2);
        config.device.limits.fade_in_ms = 300 + number;
        rig.pc.send(&mut rig.board, Command::ConfigureDevice(config.device));
        rig.pc.run_ms(&mut rig.board, 12);
    }
    rig.pc.run_ms(&mut rig.board, 2_000);
    let erased = rig.board.flash().array().erased.clone();
    assert!(!erased.is_empty(), "room was made");
    let enable = rig.board.at_stop(|stopped| stopped.log().enable.clone());
    assert!(enable.len() > 100, "it was started");
    for (sector, at) in erased {
        let is_on = enable.iter().rev().find(|(change, _)| *change <= at).is_some_and(|&(_, on)| on);
        assert!(!is_on, "sector {sector} at {at} ns");
    }
}

#[test]
fn a_configuration_that_is_not_saved_is_reported() {
    let mut rig = Rig::zeroed(Wiring::default());
    rig.board.flash().array().worn = true;
    let mut config = Config::commissioned_virtual();
    config.device.limits.fade_in_ms = 400;
    rig.pc.must(&mut rig.board, Command::ConfigureDevice(config.device));
    rig.pc.run_ms(&mut rig.board, 50);
    let cause = SaveError::Flash;
    assert!(rig.pc.heard_event(|kind| *kind == EventKind::NotSaved { cause }), "{:?}", rig.pc.heard.events);
    // It is in force all the same.
    rig.pc.must(&mut rig.board, Command::Start);
}

/// RM0090 5.2.3: the detector's interrupt is an edge; a supply that is low from the start has none.
#[test]
fn a_supply_that_is_low_from_the_start_is_seen() {
    let mut rig = Rig::zeroed(Wiring { supply: 2_600, ..Wiring::default() });
    rig.pc.run_ms(&mut rig.board, 20);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::Interlocked(Interlock::Supply));
    rig.board.at_stop(|stopped| stopped.set_supply(2_900));
    rig.pc.run_ms(&mut rig.board, 20);
    rig.pc.must(&mut rig.board, Command::Start);
}

/// RM0090 3.6.2: 32 bits at a time ask for 2.7 V. DS8626: the detector may not see a supply before
/// 2.59 V.
#[test]
fn a_configuration_is_saved_on_a_low_supply() {
    let mut rig = Rig::zeroed(Wiring { supply: 2_650, ..Wiring::default() });
    let mut config = Config::commissioned_virtual();
    config.device.limits.fade_in_ms = 333;
    rig.pc.must(&mut rig.board, Command::ConfigureDevice(config.device));
    rig.pc.run_ms(&mut rig.board, 50);
    assert!(!rig.pc.heard_event(|kind| matches!(kind, EventKind::NotSaved { .. })), "it was saved");
    is_allowed(&mut rig.board);
}

/// RM0090 3.5.1: 168 MHz take 5 wait states from 2.7 V on and 6 below, before the clock rises.
/// ST's start-up code prefetches from revision 0x1001 on; the first revision reads as its number in
/// the manual or, by the errata sheet, as an STM32F2.
#[test]
fn the_flash_has_time_on_the_lowest_supply() {
    const FLASH_ACR: u64 = 0x4002_3C00;
    const PREFETCH: u32 = 1 << 8;
    let parts = [(0x1000_6413, false), (0x2000_6411, false), (0x1001_6413, true), (0x2001_6419, true)];
    for (identity, prefetches) in parts {
        let mut board = board(plant::held());
        board.probe().tally().identity = Some(identity);
        board.run_ms(50);
        let access = board.at_stop(|stopped| stopped.register(FLASH_ACR)).expect("a register");
        assert!(access & 0xF >= 6, "{access:#x}");
        assert_eq!(access & PREFETCH != 0, prefetches, "{identity:#x}: {access:#x}");
        is_allowed(&mut board);
    }
}

/// UM1472: PC0 low would switch the 5 V of CN5 on, against the PC that feeds it, be it for the
/// microsecond from its mode to its level; so would PG6 high on the other board (UM1974).
#[test]
fn the_boards_own_usb_power_stays_off() {
    const GPIOC_ODR: u64 = 0x4002_0814;
    let mut board = board(plant::held());
    board.run_ms(50);
    let output = board.at_stop(|stopped| stopped.register(GPIOC_ODR)).expect("a register");
    assert!(output & 1 != 0, "{output:#x}");
    is_allowed(&mut board);
    let mut board = board_wired(Wiring::nucleo_f429zi(), plant::held());
    board.run_ms(50);
    is_allowed(&mut board);
}

/// ES0182 2.1.3: with `DBG_SLEEP` set, a core that wakes from a `wfi` or `wfe` in flash may carry
/// out what it never fetched. In RAM, with three `NOP`s behind it, it does not.
#[test]
fn no_image_waits_in_flash() {
    const RAM: std::ops::Range<u32> = 0x2000_0000..0x2003_0000;
    /// `wfi` and three `nop`.
    const SLEEP: [u8; 8] = [0x30, 0xBF, 0x00, 0xBF, 0x00, 0xBF, 0x00, 0xBF];
    for pins in [DISCOVERY, NUCLEO_F429ZI] {
        let image = std::fs::read(image_for(&pins)).expect("an image");
        let waits = elf::waits(&image, &elf::symbols(&image));
        assert!(waits.len() == 1 && RAM.contains(&waits[0]), "{}: {waits:#x?}", pins.image);
        let code = elf::code(&image, waits[0]).expect("its bytes");
        assert_eq!(code.get(..8), Some(&SLEEP[..]), "{}", pins.image);
    }
}

/// RM0090 8.3.9, DS8626: a pull of 40 kΩ takes its time.
#[test]
fn a_strap_that_is_not_there_is_not_seen() {
    let mut board = board(plant::held());
    board.run_ms(100);
    let transfers = board.at_stop(|stopped| stopped.tilt().map(|chip| chip.transfers()));
    assert!(transfers.is_some_and(|transfers| transfers > 100), "the accelerometer is asked: {transfers:?}");
}

/// RM0090 18.4.7: the filters of the encoder's inputs, off out of reset.
#[test]
fn a_glitch_of_the_motors_leads_is_no_count() {
    let mut rig = Rig::zeroed(Wiring::default());
    rig.pc.must(&mut rig.board, Command::Start);
    rig.pc.run_ms(&mut rig.board, 10);
    rig.board.at_stop(|stopped| stopped.set_wires(Wires { glitches: Some(150), ..Wires::default() }));
    rig.pc.run_ms(&mut rig.board, 200);
    assert!(rig.pc.heard.samples.iter().all(|(_, sample)| sample.count == 0), "a needle that is held");
    assert!(rig.board.at_stop(|stopped| stopped.drive().enabled), "no fault");
}

/// PRIMASK keeps the tick away, which no priority does: the driver of the USB core sets it while it
/// looks at the core. What it keeps it away for, the tick's way to the converter and the latch have
/// to agree.
#[test]
fn nothing_masks_the_tick_for_longer_than_the_latch_waits() {
    /// Instructions, at one a cycle, from the tick's edge to the latch.
    const LATCH: u64 = 3_360;
    let image = std::fs::read(firmware_path()).expect("an image");
    let mut rig = Rig::pressed();
    // `cpsid i`, and `msr primask, rn`.
    let masks = elf::instructions(&image, |word| word[..2] == [0x72, 0xB6]).into_iter().map(|at| (at, true));
    let restores = |[a, b, c, d]: [u8; 4]| a & 0xF0 == 0x80 && (b, c, d) == (0xF3, 0x10, 0x88);
    let restores = elf::instructions(&image, restores).into_iter().map(|at| (at, false));
    rig.board.probe().tally().masks = masks.chain(restores).collect();
    // The stream at full rate, and commands.
    for _ in 0..15 {
        rig.pc.send(&mut rig.board, Command::Heartbeat);
        rig.pc.run_ms(&mut rig.board, 10);
    }
    let (masked, place) = {
        let probe = rig.board.probe();
        let mut tally = probe.tally();
        tally.masks.clear();
        tally.longest_masked
    };
    rig.pc.run_ms(&mut rig.board, 1_200);
    let timing = rig.pc.heard.timing.expect("timing");
    let to_dac = u64::from(timing.stages[Stage::TickToDac as usize].longest);
    let symbol = rig.board.symbol_at(place).map_or("?", |symbol| &symbol.name).to_string();
    let microseconds = |instructions: u64| instructions as f64 / 168.0;
    println!(
        "| longest masked | {masked} instructions, {:.2} us, in {symbol}; tick to DAC {to_dac}, latch {LATCH} |",
        microseconds(masked)
    );
    println!("masked_longest_us={:.3}", microseconds(masked));
    assert!(masked > 20, "the measurement sees the driver: {masked}");
    // On silicon an instruction takes up to one and a half cycles.
    assert!(3 * (masked + to_dac) / 2 < LATCH, "{masked} masked and {to_dac} to the converter");
}

/// A request made before the PC left is not carried out afterwards.
#[test]
fn a_start_without_a_session_is_refused() {
    let mut rig = Rig::zeroed(Wiring::default());
    // Closed and opened again: nobody has said hello.
    rig.board.at_stop(|stopped| stopped.usb().host.close());
    rig.pc.set_silent(true);
    rig.board.run_ms(20);
    rig.board.at_stop(|stopped| stopped.usb().host.open());
    rig.board.run_ms(20);
    let why = rig.pc.must_not(&mut rig.board, Command::Start);
    assert_eq!(why, CommandRefusal::NoSession);
    rig.board.run_ms(100);
    assert!(rig.enabled_since(0).is_empty(), "the amplifier stayed off");
}

#[test]
fn a_start_that_was_under_way_when_the_pc_went_is_thrown_away() {
    for delay_us in (0..2_000).step_by(130) {
        let mut rig = Rig::zeroed(Wiring::default());
        rig.pc.send(&mut rig.board, Command::Start);
        let now = rig.board.now();
        rig.board.run_until(now + delay_us * 1_000);
        if !rig.enabled_since(0).is_empty() {
            // It was carried out while the PC was there.
            return;
        }
        rig.board.at_stop(|stopped| stopped.usb().host.close());
        let closed = rig.board.now();
        rig.board.run_ms(100);
        let on = rig.enabled_since(closed);
        // The tick that was already at it may be the last.
        let off = rig.board.at_stop(|stopped| stopped.log().enable.last().is_none_or(|&(_, on)| !on));
        assert!(off, "{delay_us} us: on at {on:?}, closed at {closed}");
        assert!(on.iter().all(|&at| at < closed + 3 * MILLISECOND), "{delay_us} us: {on:?}");
    }
}
