//! The same image, plant and orders give the same run, whatever the emulator has translated before.

use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillinewtonMetres, Stiffness};
use fixed::types::{I8F24, I16F16};
use link::Command;
use std::fs;
use std::path::Path;
use tests::board::{Board, EncoderRead, Output, Wiring, firmware_path, plant};
use tests::pc::Pc;

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

/// A byte behind the image makes it one that nothing has run in this process.
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
