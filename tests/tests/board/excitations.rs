//! Tests of what a PC may have a device play by itself: within its bounds, in a session, and no
//! longer.

use control_core::event::State;
use control_core::excitation::{Excitation, SequenceRefusal, Servo, Signal};
use control_core::units::{Damping, Millimetres, MillimetresPerSecond, MillinewtonMetres, Stiffness};
use emulator::board::{Board, MILLISECOND, Nanos, Wiring};
use fixed::types::{I8F24, I16F16};
use link::Command;
use link::codec::{self, MAX_FRAME};
use link::device::LATE_TICKS;
use link::frames::{CommandRefusal, HostFrame};
use tests::pc;
use tests::rig::{Rig, ZERO_TORQUE};

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

fn has_given_torque(board: &mut Board) -> bool {
    board.at_stop(|stopped| {
        let log = stopped.log();
        log.enable.iter().any(|&(_, is_on)| is_on) || log.put_out.iter().any(|out| out.code != ZERO_TORQUE)
    })
}

/// When the amplifier was switched on and off since `since`.
fn switched(board: &mut Board, since: Nanos) -> Vec<(Nanos, bool)> {
    board
        .at_stop(move |stopped| stopped.log().enable.iter().copied().filter(|&(at, _)| at >= since).collect())
}

/// Every command that is refused here would move a roller if it were not.
#[test]
fn a_sequence_stays_in_bounds_and_ends_with_its_session() {
    let Rig { mut board, mut pc } = Rig::zeroed(Wiring::default());
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
        assert!(matches!(refused, CommandRefusal::Config(_)), "{what}: {refused:?}");
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
    assert!(!has_given_torque(&mut board), "a refused or damaged sequence gave torque");

    pc.must(&mut board, Command::Excite(sound.clone()));
    pc.run_ms(&mut board, 50);
    assert!(board.at_stop(|stopped| stopped.drive().enabled), "it plays");
    assert_eq!(pc.must_not(&mut board, Command::Excite(sound)), CommandRefusal::Powered, "one at a time");
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

/// A quarter of a second each: strokes, ramps of torque while the reference rests where they ended,
/// and strokes from there.
fn three_segments() -> Vec<Excitation> {
    let ramps = Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(2)), ramp_ms: 100 };
    vec![strokes(50.0, 250), Excitation { signal: ramps, ..strokes(50.0, 250) }, strokes(30.0, 250)]
}

#[test]
fn a_sequence_is_uploaded_torque_off_and_plays_without_a_rest() {
    let Rig { mut board, mut pc } = Rig::zeroed(Wiring::default());
    let segments = three_segments();
    let commands = pc::sequence(&segments);
    let (play, upload) = commands.split_last().expect("a command to play");
    upload.iter().for_each(|segment| pc.must(&mut board, segment.clone()));
    // Long enough for a report of the times.
    pc.run_ms(&mut board, 1_100);
    assert!(!has_given_torque(&mut board), "an upload gave torque");
    let before = pc.heard.timing.expect("once a second");
    pc.must(&mut board, play.clone());
    pc.run_ms(&mut board, 1_900);
    let [(on, true), (off, false)] = switched(&mut board, 0)[..] else {
        panic!("on and off once: {:?}", switched(&mut board, 0))
    };
    let played_us = (off - on) / 1_000;
    assert!(played_us.abs_diff(750_000) <= 100, "{played_us} µs of power for 750 ms");
    let samples = &pc.heard.samples;
    let played: Vec<u64> = samples
        .iter()
        .filter(|(_, sample)| sample.state == State::Excitation as u8)
        .map(|(tick, _)| *tick)
        .collect();
    assert_eq!(played.len(), 7_500);
    assert_eq!(played[7_499] - played[0], 7_499, "no tick between two segments is without it");
    let after = pc.heard.timing.expect("once a second");
    assert_eq!((after.missed_ticks, after.garbage_frames), (before.missed_ticks, 0), "{before:?} {after:?}");
    assert_eq!(pc.must_not(&mut board, play.clone()), CommandRefusal::Sequence(SequenceRefusal::Nothing));
}

#[test]
fn a_sequence_stops_at_once_and_nothing_of_it_is_left() {
    let Rig { mut board, mut pc } = Rig::zeroed(Wiring::default());
    let commands = pc::sequence(&three_segments());
    let play = commands.last().expect("a command to play");
    // In the second segment, as a person presses Stop.
    commands.iter().for_each(|command| pc.must(&mut board, command.clone()));
    pc.run_ms(&mut board, 350);
    assert!(board.at_stop(|stopped| stopped.drive().enabled), "it plays");
    assert_eq!(pc.must_not(&mut board, commands[0].clone()), CommandRefusal::Powered, "no upload meanwhile");
    let since = board.now();
    pc.must(&mut board, Command::Stop);
    pc.run_ms(&mut board, 1_000);
    let [(off, false)] = switched(&mut board, since)[..] else {
        panic!("off once: {:?}", switched(&mut board, since))
    };
    assert!(off - since <= 10 * MILLISECOND, "{} ns after the stop", off - since);
    assert_eq!(pc.must_not(&mut board, play.clone()), CommandRefusal::Sequence(SequenceRefusal::Nothing));
    // The PC falls silent in the second segment, and comes back.
    commands.iter().for_each(|command| pc.must(&mut board, command.clone()));
    pc.run_ms(&mut board, 300);
    pc.set_silent(true);
    let since = board.now();
    board.run_ms(350);
    let [(off, false)] = switched(&mut board, since)[..] else {
        panic!("off once: {:?}", switched(&mut board, since))
    };
    assert!(off - since <= 300 * MILLISECOND, "{} ns after the last word", off - since);
    pc.set_silent(false);
    [Command::Stop, Command::Clear].into_iter().for_each(|clear| pc.must(&mut board, clear));
    // Uploaded before the next session begins, it is not that session's.
    commands[..3].iter().for_each(|segment| pc.must(&mut board, segment.clone()));
    pc.hello(&mut board);
    assert_eq!(pc.must_not(&mut board, play.clone()), CommandRefusal::Sequence(SequenceRefusal::Nothing));
    pc.run_ms(&mut board, 100);
    assert!(!board.at_stop(|stopped| stopped.drive().enabled), "a new session starts no torque");
}

/// Takes as long as the image runs for the ten seconds after which a sequence is forgotten.
#[test]
fn a_late_sequence_is_refused_and_forgotten() {
    let Rig { mut board, mut pc } = Rig::zeroed(Wiring::default());
    let commands = pc::sequence(&three_segments());
    let (play, upload) = commands.split_last().expect("a command to play");
    upload.iter().for_each(|segment| pc.must(&mut board, segment.clone()));
    pc.run_ms(&mut board, LATE_TICKS / 10 + 1);
    let late = CommandRefusal::Sequence(SequenceRefusal::Late);
    assert_eq!(pc.must_not(&mut board, play.clone()), late);
    let nothing = CommandRefusal::Sequence(SequenceRefusal::Nothing);
    assert_eq!(pc.must_not(&mut board, play.clone()), nothing, "the late one is forgotten");
    assert!(!has_given_torque(&mut board), "a late sequence gave torque");
    // The same, uploaded anew.
    commands.iter().for_each(|command| pc.must(&mut board, command.clone()));
    pc.run_ms(&mut board, 50);
    assert!(board.at_stop(|stopped| stopped.drive().enabled), "it plays");
}

#[test]
fn a_damaged_or_unsound_sequence_gives_no_torque() {
    let Rig { mut board, mut pc } = Rig::zeroed(Wiring::default());
    let segments = three_segments();
    let commands = pc::sequence(&segments);
    let play = commands.last().expect("a command to play");
    let too_strong = Signal::BreakawayRamps { torque: MillinewtonMetres(I16F16::from_num(29)), ramp_ms: 100 };
    let too_strong = Excitation { signal: too_strong, ..strokes(50.0, 250) };
    let beyond: [(&str, u8, Excitation); 5] = [
        ("more torque than the device gives", 2, too_strong),
        ("too fast", 2, strokes(2_001.0, 250)),
        ("a stroke beyond the travel", 2, Excitation { travel: mm(19.0), ..strokes(50.0, 250) }),
        ("more than two minutes", 2, strokes(50.0, 119_501)),
        ("a segment that is missing", 3, strokes(50.0, 250)),
    ];
    for (what, index, excitation) in beyond {
        commands[..2].iter().for_each(|segment| pc.must(&mut board, segment.clone()));
        let refused = pc.must_not(&mut board, Command::Segment { index, excitation });
        assert!(matches!(refused, CommandRefusal::Sequence(_)), "{what}: {refused:?}");
        let left = pc.must_not(&mut board, play.clone());
        assert_eq!(left, CommandRefusal::Sequence(SequenceRefusal::Nothing), "{what}");
    }
    // Another segment than the one that was sent, and one that never arrived.
    let other = Command::Segment { index: 2, excitation: strokes(31.0, 250) };
    for (last, refusal) in
        [(Some(other), SequenceRefusal::Damaged), (None, SequenceRefusal::Count { found: 2, wanted: 3 })]
    {
        commands[..2].iter().cloned().chain(last).for_each(|segment| pc.must(&mut board, segment));
        assert_eq!(pc.must_not(&mut board, play.clone()), CommandRefusal::Sequence(refusal));
    }
    // A bit that turns on the way, of a segment and of the command that plays.
    for (id, command, whole) in [(77, &commands[2], 2), (78, play, 3)] {
        commands[..whole].iter().for_each(|segment| pc.must(&mut board, segment.clone()));
        let mut bytes = [0; MAX_FRAME];
        let length = codec::encode(&HostFrame { id, command: command.clone() }, &mut bytes).expect("it fits");
        for at in 1..length - 1 {
            let mut damaged = bytes;
            damaged[at] = if damaged[at] == 1 { 2 } else { damaged[at] ^ 1 };
            pc.send_bytes(&mut board, &damaged[..length]);
            pc.run_ms(&mut board, 1);
        }
        if whole == 2 {
            let refusal = SequenceRefusal::Count { found: 2, wanted: 3 };
            assert_eq!(pc.must_not(&mut board, play.clone()), CommandRefusal::Sequence(refusal));
        }
    }
    assert!(!has_given_torque(&mut board), "a refused or damaged sequence gave torque");
    // Whole and in time, it plays.
    commands.iter().for_each(|command| pc.must(&mut board, command.clone()));
    pc.run_ms(&mut board, 50);
    assert!(board.at_stop(|stopped| stopped.drive().enabled), "it plays");
}
