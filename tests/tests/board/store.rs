//! The configuration in flash: the old one or the new one, whenever the power goes.

use control_core::event::Fault;
use control_core::{Config, Device};
use emulator::board::flash::PROGRAM_NANOS;
use emulator::board::{Board, Wiring, plant};
use link::Command;
use link::crash::CrashKind;
use tests::laws;
use tests::pc::Pc;
use tests::rig::{Rig, task};

/// A configuration that differs from the default.
fn changed() -> Config {
    let mut config = Config::commissioned_virtual();
    config.device.limits.fade_in_ms = 400;
    config.patient.layers[0].friction.0 += fixed::types::I16F16::ONE / 64;
    config
}

/// Resets the device and asks which configuration it has.
fn hash_after_reset(board: &mut Board, pc: &mut Pc) -> (u32, Option<Fault>) {
    board.at_stop(|stopped| stopped.reset_by_pin());
    board.run_ms(20);
    pc.connect(board);
    let hello = pc.heard.hello.clone().expect("a hello");
    (hello.config_hash, hello.fault)
}

#[test]
fn a_configuration_outlives_a_reset() {
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant::held());
    let default = link::codec::hash(&Config::commissioned_virtual());
    assert_eq!(pc.heard.hello.as_ref().map(|hello| hello.config_hash), Some(default));
    pc.configure(&mut board, &changed());
    pc.run_ms(&mut board, 50);
    assert_eq!(hash_after_reset(&mut board, &mut pc), (link::codec::hash(&changed()), None));
    let violations = board.flash().array().violations.clone();
    assert!(violations.is_empty(), "{violations:?}");
}

/// Takes more than 5 s: a reset and a new port for every fourth write.
#[test]
fn power_lost_during_a_save_leaves_the_old_or_the_new() {
    power_lost_before_each(4);
}

#[test]
#[ignore = "nightly: a reset of the board for each write, 90 s"]
fn power_lost_before_any_write_leaves_the_old_or_the_new() {
    power_lost_before_each(1);
}

/// Cuts the power before every `step`th write of a save.
fn power_lost_before_each(step: usize) {
    let hash = |device, patient| link::codec::hash(&Config { device, patient });
    let (default, changed_one) = (Config::commissioned_virtual(), changed());
    let (old, new) = (
        hash(default.device, default.patient.clone()),
        hash(changed_one.device, changed_one.patient.clone()),
    );
    // The records are apart: the device's may be there and the patient's not yet.
    let half = hash(changed_one.device, default.patient);
    // How many writes a save takes.
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant::held());
    let before = board.flash().array().operations;
    pc.configure(&mut board, &changed());
    pc.run_ms(&mut board, 50);
    let writes = board.flash().array().operations - before;
    assert!(writes > 10, "{writes} writes");
    drop(board);

    let mut seen = [0, 0, 0];
    // Every write in turn, on a board that keeps its flash: each save finds what the cut left.
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant::held());
    for write in (0..writes).step_by(step) {
        pc.configure(&mut board, &Config::commissioned_virtual());
        pc.run_ms(&mut board, 30);
        {
            let flash = board.flash();
            let mut array = flash.array();
            array.cut_before = Some(array.operations + write);
        }
        pc.send(&mut board, Command::ConfigureDevice(changed().device));
        // Its plan is taken once the PC has been silent for a while.
        board.run_ms(4);
        pc.send(&mut board, Command::ConfigurePatient(changed().patient));
        board.run_ms(40);
        assert!(board.flash().array().cut_before.is_none(), "the power went before write {write}");
        board.run_ms(20);
        pc.connect(&mut board);
        let hello = pc.heard.hello.clone().expect("a hello");
        let which = [old, half, new].into_iter().position(|hash| hash == hello.config_hash);
        assert_ne!(hello.fault, Some(Fault::StoredConfig), "write {write}");
        seen[which.unwrap_or_else(|| panic!("none of them after a cut before write {write}"))] += 1;
    }
    println!(
        "{writes} writes a save; after a cut the old ones {} times, the new device alone {} times, both {} times",
        seen[0], seen[1], seen[2]
    );
    assert!(seen[0] > 0 && seen[1] > 0);
}

/// The largest patient, and a device that differs, on their way into a flash that takes its time.
fn saving(nanos: u64) -> (Rig, Config) {
    let mut rig = Rig::zeroed(Wiring::default());
    rig.board.flash().array().program_nanos = nanos;
    let mut config = laws::phantom();
    config.device.limits.fade_in_ms = 333;
    rig.pc.configure(&mut rig.board, &config);
    (rig, config)
}

/// DS8626: half a word takes 16 µs, and 100 µs at most. Tilt has the lowest priority and 11 ms.
#[test]
fn a_save_leaves_every_task_its_time() {
    for nanos in PROGRAM_NANOS {
        let (mut rig, config) = saving(nanos);
        let before = rig.board.flash().array().operations;
        rig.pc.run_ms(&mut rig.board, 300);
        let writes = rig.board.flash().array().operations - before;
        let resets = rig.board.at_stop(|stopped| stopped.resets());
        println!("| {nanos} ns for half a word | {writes} of them after the answer |");
        assert!(resets.is_empty(), "{nanos} ns for half a word: {resets:?}");
        let violations = rig.board.at_stop(|stopped| stopped.violations());
        assert!(violations.is_empty(), "{violations:?}");
        let found = hash_after_reset(&mut rig.board, &mut rig.pc);
        assert_eq!(found, (link::codec::hash(&config), None), "{nanos} ns for half a word");
    }
}

/// The PC was told that both parts are in force.
#[test]
fn a_save_outlives_the_pc_that_asked_for_it() {
    let (mut rig, config) = saving(PROGRAM_NANOS[1]);
    rig.board.at_stop(|stopped| stopped.usb().host.close());
    rig.board.run_ms(300);
    let found = hash_after_reset(&mut rig.board, &mut rig.pc);
    assert_eq!(found, (link::codec::hash(&config), None));
}

/// Tilt that hangs keeps telemetry waiting: whichever of the two has been silent for too long first
/// is named.
#[test]
fn a_task_that_hangs_during_a_save_is_found() {
    for (task, names) in [(task::TELEMETRY, 2..=2), (task::TILT, 2..=3)] {
        let (mut rig, _) = saving(PROGRAM_NANOS[1]);
        let hang = rig.hang();
        rig.upset(task, hang);
        rig.board.run_ms(60);
        assert_eq!(rig.board.at_stop(|stopped| stopped.resets().len()), 1, "the watchdog ends it");
        rig.wait_for_port();
        rig.pc.connect(&mut rig.board);
        rig.pc.run_ms(&mut rig.board, 20);
        let crash = rig.pc.heard.crash.0.clone().expect("a record");
        assert!(crash.kind == CrashKind::HungTask && names.contains(&crash.detail), "{crash}");
    }
}

#[test]
fn a_flipped_bit_in_flash_is_reported_and_costs_its_record() {
    let (default, other) = (Config::commissioned_virtual(), changed());
    // A word of the record that was written first, and one of the last.
    for is_patients in [false, true] {
        let mut rig = Rig::connected(Wiring::default(), plant::held());
        rig.pc.configure(&mut rig.board, &other);
        rig.pc.run_ms(&mut rig.board, 50);
        {
            let flash = rig.board.flash();
            let mut array = flash.array();
            let words = array.written();
            // The first record is the one that the board came with.
            let device = words.iter().position(|&word| word >= words[0] + 1024).expect("a second record");
            array.flip(words[if is_patients { words.len() - 3 } else { device + 4 }], 1 << 7);
        }
        let (hash, fault) = hash_after_reset(&mut rig.board, &mut rig.pc);
        let left = if is_patients {
            Config { patient: default.patient.clone(), ..other.clone() }
        } else {
            Config { device: Device::default(), ..other.clone() }
        };
        assert_eq!(hash, link::codec::hash(&left), "patient's: {is_patients}");
        assert_eq!(fault, Some(Fault::StoredConfig));
    }
}
