//! The configuration in flash: the old one or the new one, whenever the power goes.

use control_core::Config;
use control_core::event::Fault;
use link::Command;
use tests::board::{Board, plant};
use tests::pc::Pc;
use tests::rig::Rig;
use tests::scenario::board;

/// A configuration that differs from the default.
fn changed() -> Config {
    let mut config = Config::default();
    config.limits.fade_in_ms = 400;
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
    let mut board = board(plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    let default = link::codec::hash(&Config::default());
    assert_eq!(pc.heard.hello.as_ref().map(|hello| hello.config_hash), Some(default));
    pc.must(&mut board, Command::Configure(changed()));
    pc.run_ms(&mut board, 50);
    assert_eq!(hash_after_reset(&mut board, &mut pc), (link::codec::hash(&changed()), None));
    let violations = board.flash().array().violations.clone();
    assert!(violations.is_empty(), "{violations:?}");
}

#[test]
fn power_that_goes_at_any_write_leaves_the_old_or_the_new() {
    let (old, new) = (link::codec::hash(&Config::default()), link::codec::hash(&changed()));
    // How many writes a save takes.
    let mut board = board(plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    let before = board.flash().array().operations;
    pc.must(&mut board, Command::Configure(changed()));
    pc.run_ms(&mut board, 50);
    let writes = board.flash().array().operations - before;
    assert!(writes > 10, "{writes} writes");
    drop(board);

    let mut seen = [0, 0];
    // Every write in turn, on a board that keeps its flash: each save finds what the cut left.
    let mut board = tests::scenario::board(plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    for write in 0..writes {
        pc.must(&mut board, Command::Configure(Config::default()));
        pc.run_ms(&mut board, 30);
        {
            let flash = board.flash();
            let mut array = flash.array();
            array.cut_before = Some(array.operations + write);
        }
        pc.send(&mut board, Command::Configure(changed()));
        board.run_ms(30);
        assert!(board.flash().array().cut_before.is_none(), "the power went before write {write}");
        board.run_ms(20);
        pc.connect(&mut board);
        let hello = pc.heard.hello.clone().expect("a hello");
        assert!([old, new].contains(&hello.config_hash), "neither after a cut before write {write}");
        assert_ne!(hello.fault, Some(Fault::StoredConfig), "write {write}");
        seen[usize::from(hello.config_hash == new)] += 1;
    }
    println!(
        "{writes} writes a save; after a cut the old one {} times, the new one {} times",
        seen[0], seen[1]
    );
    assert!(seen[0] > 0);
}

#[test]
fn a_flipped_bit_in_flash_is_reported_and_the_default_is_used() {
    let mut rig = {
        let mut board = board(plant::held());
        let mut pc = Pc::new();
        pc.connect(&mut board);
        Rig { board, pc }
    };
    rig.pc.must(&mut rig.board, Command::Configure(changed()));
    rig.pc.run_ms(&mut rig.board, 50);
    {
        let flash = rig.board.flash();
        let mut array = flash.array();
        let words = array.written();
        let middle = words[words.len() / 2];
        array.flip(middle, 1 << 7);
    }
    let (hash, fault) = hash_after_reset(&mut rig.board, &mut rig.pc);
    assert_eq!(hash, link::codec::hash(&Config::default()));
    assert_eq!(fault, Some(Fault::StoredConfig));
}
