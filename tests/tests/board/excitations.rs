//! What a PC may have a device play by itself: within its bounds, in a session, and no longer.

use control_core::excitation::{Excitation, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use fixed::types::{I8F24, I16F16};
use link::Command;
use link::codec::{self, MAX_FRAME};
use link::frames::{HostFrame, Rejection};
use tests::board::plant;
use tests::pc::Pc;
use tests::rig::ZERO_TORQUE;
use tests::scenario::board;

fn mm(length: f64) -> Millimetres {
    Millimetres(I16F16::from_num(length))
}

/// Strokes of 20 mm at some speed, for some time, with 100 mm of travel.
fn strokes(speed_mm_s: f64, duration_ms: u32) -> Excitation {
    let speed = MillimetresPerSecond(I16F16::from_num(speed_mm_s));
    Excitation {
        signal: Signal::Triangle { stroke: mm(20.0), speed },
        duration_ms,
        servo: Servo {
            stiffness: Stiffness(I16F16::from_num(0.1)),
            damping: Damping(I8F24::from_num(0.0005)),
        },
        travel: mm(100.0),
        compensated: false,
    }
}

/// Every command that is refused here would move a roller if it were not.
#[test]
fn a_sequence_beyond_its_bounds_moves_nothing_and_one_that_plays_ends_with_its_session() {
    let mut board = board(plant::held());
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Zero);
    let sound = strokes(50.0, 5_000);
    let too_strong = Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(29)), ramp_ms: 100 };
    let beyond = [
        ("too long", Excitation { duration_ms: 600_001, ..sound.clone() }),
        ("no time at all", Excitation { duration_ms: 0, ..sound.clone() }),
        ("too fast", strokes(2_001.0, 5_000)),
        ("a stroke beyond the travel", Excitation { travel: mm(19.0), ..sound.clone() }),
        ("travel without an end", Excitation { travel: mm(1_001.0), ..sound.clone() }),
        ("more torque than the device gives", Excitation { signal: too_strong, ..sound.clone() }),
    ];
    for (what, excitation) in beyond {
        let refused = pc.must_not(&mut board, Command::Excite(excitation));
        assert!(matches!(refused, Rejection::Config(_)), "{what}: {refused:?}");
    }
    // A bit that turns on the way.
    let mut bytes = [0; MAX_FRAME];
    let frame = HostFrame { id: 77, command: Command::Excite(sound.clone()) };
    let length = codec::encode(&frame, &mut bytes).expect("it fits");
    for at in 1..length - 1 {
        let mut damaged = bytes;
        // Zero ends a frame; any other byte leaves one whole frame with another content.
        damaged[at] = if damaged[at] == 1 { 2 } else { damaged[at] ^ 1 };
        pc.send_bytes(&mut board, &damaged[..length]);
        pc.run_ms(&mut board, 1);
    }
    let moved = board.at_stop(|stopped| {
        let log = stopped.log();
        log.enable.iter().any(|&(_, is_on)| is_on) || log.put_out.iter().any(|out| out.code != ZERO_TORQUE)
    });
    assert!(!moved, "a refused or damaged sequence gave torque");

    pc.must(&mut board, Command::Excite(sound.clone()));
    pc.run_ms(&mut board, 50);
    assert!(board.at_stop(|stopped| stopped.drive().enabled), "it plays");
    assert_eq!(pc.must_not(&mut board, Command::Excite(sound)), Rejection::Powered, "one at a time");
    // The program dies: no heartbeat, no goodbye.
    pc.set_silent(true);
    let since = board.now();
    board.run_ms(400);
    let off = board.at_stop(move |stopped| {
        stopped.log().enable.iter().find(|&&(at, is_on)| at >= since && !is_on).map(|&(at, _)| at - since)
    });
    let off_ms = off.expect("the amplifier goes off") / 1_000_000;
    println!("the amplifier goes off {off_ms} ms after the last word of the PC");
    assert!(off_ms <= 350, "{off_ms} ms");
    assert!(!board.at_stop(|stopped| stopped.drive().enabled), "and stays off");
    // Connected again, it goes on with nothing by itself.
    pc.set_silent(false);
    pc.connect(&mut board);
    pc.run_ms(&mut board, 50);
    assert!(!board.at_stop(|stopped| stopped.drive().enabled), "a new session starts no torque");
}
