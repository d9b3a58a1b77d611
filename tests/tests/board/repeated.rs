//! The same image, plant and orders give the same run, whatever the emulator has translated before,
//! and from a snapshot as well.

use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillinewtonMetres, Stiffness};
use emulator::board::{Board, EncoderRead, HandlerRun, Log, Output, Wiring, firmware_path, plant};
use fixed::types::{I8F24, I16F16};
use link::Command;
use std::fs;
use std::path::Path;
use tests::pc::Pc;
use tests::rig::Rig;

/// The record of the pins over a start, a cable plugged in and half a second of ramps; and the
/// least and most instructions of a tick.
fn pins_saw(image: &Path) -> (Vec<Output>, Vec<EncoderRead>, Option<u32>, Option<u32>) {
    let mut board = Board::on(image, Wiring::default(), plant::held()).expect("the image runs");
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Zero);
    let excitation = Excitation {
        signal: Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(20)), ramp_ms: 100 },
        duration_ms: 500,
        servo: Servo {
            stiffness: Stiffness(I16F16::from_num(0.1)),
            damping: Damping(I8F24::from_num(0.0005)),
        },
        travel: Millimetres(I16F16::from_num(50)),
        compensated: false,
    };
    pc.must(&mut board, Command::Excite(excitation));
    board.count_runs_of("TIM4");
    pc.run_ms(&mut board, 500);
    let ticks = board.counted_runs();
    let instructions = || ticks.iter().map(|tick| tick.instructions);
    let (least, most) = (instructions().min(), instructions().max());
    board.at_stop(move |stopped| (stopped.log().put_out.clone(), stopped.log().encoder.clone(), least, most))
}

/// A byte behind the image makes it one that nothing has run in this process. Takes more than 5 s:
/// all of it is translated.
#[test]
fn a_core_that_has_run_the_image_gives_the_same_run() {
    let image = std::env::temp_dir().join(format!("repeated-{}.elf", std::process::id()));
    let mut bytes = fs::read(firmware_path()).expect("the image that `cargo xtask firmware` builds");
    bytes.push(0);
    fs::write(&image, bytes).expect("a file for the image");
    let (first, second) = (pins_saw(&image), pins_saw(&image));
    let _ = fs::remove_file(&image);
    assert!(first.0.len() > 1_000 && first.2.is_some(), "codes went out and ticks were counted");
    assert_eq!(first, second);
}

/// The record of a board and its PC over half a second of torque, a reset and what follows it.
#[derive(PartialEq)]
struct Seen {
    ticks: Vec<HandlerRun>,
    pins: Log,
    /// The part's RAM, then the flash that the firmware writes.
    memory: Vec<Option<u32>>,
    flash: Vec<(u64, u32)>,
    /// Restarts, the counts of the cable, and all that the PC heard.
    heard: String,
}

/// Goes on with `rig`, with everything that a board has at work: torque, the stream, a save, a
/// reset.
fn goes_on(mut rig: Rig) -> Seen {
    let (board, pc) = (&mut rig.board, &mut rig.pc);
    board.count_runs_of("TIM4");
    pc.run_ms(board, 300);
    let ticks = board.counted_runs();
    pc.must(board, Command::Stop);
    pc.run_ms(board, 20);
    pc.must(board, Command::ConfigurePatient(control_core::Patient::nobody()));
    pc.run_ms(board, 50);
    board.at_stop(|stopped| stopped.reset_by_pin());
    board.run_ms(20);
    let heard = format!("{:?} {:?}", pc.heard, pc.counts());
    pc.connect(board);
    pc.must(board, Command::Zero);
    pc.must(board, Command::Start);
    pc.run_ms(board, 150);
    let flash = board.flash().array().configuration();
    let (pins, memory, cable) = board.at_stop(|stopped| {
        let ram = (0x1000_0000..0x1001_0000).chain(0x2000_0000..0x2003_0000).step_by(4);
        let memory = ram.map(|address| stopped.word(address)).collect();
        let cable = format!("{:?} {:?}", stopped.resets(), stopped.usb());
        (stopped.log().clone(), memory, cable)
    });
    let heard = format!("{heard} {cable} {:?} {:?}", pc.heard, pc.counts());
    Seen { ticks, pins, memory, flash, heard }
}

#[test]
fn a_board_from_a_snapshot_gives_the_run_of_one_booted() {
    for wiring in [Wiring::default(), Wiring::nucleo_f429zi()] {
        let seen =
            [Rig::pressed_on(wiring), Rig::pressed_on(wiring), Rig::pressed_afresh(wiring)].map(goes_on);
        let [first, second, afresh] = &seen;
        let (ticks, logged) = (afresh.ticks.len(), afresh.pins.rtt.len());
        assert!(ticks > 2_900 && logged > 0, "{ticks} ticks, {logged} bytes of log");
        for (name, other) in [("first", first), ("second", second)] {
            assert!(other.ticks == afresh.ticks, "{name}: ticks");
            assert!(other.pins == afresh.pins, "{name}: pins");
            assert!(other.memory == afresh.memory, "{name}: memory");
            assert!(other.flash == afresh.flash, "{name}: flash");
            assert!(other.heard == afresh.heard, "{name}: cable and PC");
        }
    }
}
