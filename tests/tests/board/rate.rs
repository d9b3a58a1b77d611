//! Ten thousand ticks a second, each in time, none lost, whatever the PC does meanwhile.

use emulator::board::{Board, Nanos, Output, Wiring};
use link::Command;
use tests::pc::Pc;
use tests::scenario::{board_wired, venepuncture};

const TICK: Nanos = 100_000;
const TICKS_PER_S: u64 = 10_000;
/// The bytes that the cable may hold for the device: the host keeps it full.
const FLOOD_BYTES: usize = 4_096;

/// Bytes that are no frame, and many that end one.
fn garbage(seed: &mut u64) -> Vec<u8> {
    (0..512)
        .map(|_| {
            *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let byte = (*seed >> 56) as u8;
            if byte < 8 { 0 } else { byte }
        })
        .collect()
}

/// Sends valid commands and garbage in turn until `end`, faster than the cable carries them;
/// returns the number of commands.
fn flood(pc: &mut Pc, board: &mut Board, end: Nanos) -> u64 {
    let mut seed = 1;
    let mut commands = 0_u64;
    while board.now() < end {
        while board.at_stop(|stopped| stopped.usb().host.unsent()) < FLOOD_BYTES {
            let command = match commands % 4 {
                0 => Command::Zero,
                1 => Command::Start,
                _ => Command::Heartbeat,
            };
            pc.send(board, command);
            let noise = garbage(&mut seed);
            pc.send_bytes(board, &noise);
            // What follows the noise up to its next zero is part of it.
            pc.send_bytes(board, &[0]);
            commands += 1;
        }
        pc.run_ms(board, 1);
    }
    commands
}

/// The shortest and the longest time from a tick to its output, in ns.
fn spread(outputs: &[Output]) -> (Nanos, Nanos) {
    let times = outputs.iter().filter_map(|output| output.since_tick);
    times.fold((u64::MAX, 0), |(low, high), time| (low.min(time), high.max(time)))
}

/// Every second of it is like every other except for the timing that is reported once a second; the
/// nightly one waits for what is rare.
#[test]
fn a_flood_costs_no_tick_no_sample_and_no_time() {
    costs_nothing(12);
}

#[test]
#[ignore = "nightly: a minute of the board with its cable full, 90 s"]
fn a_minute_of_flood_costs_no_tick_no_sample_and_no_time() {
    costs_nothing(60);
}

/// Runs the board for so many seconds while the cable is kept full.
fn costs_nothing(seconds: u64) {
    let ticks = seconds * TICKS_PER_S;
    let wiring = Wiring { plant_period: TICK, ..Wiring::default() };
    let mut board = board_wired(wiring, venepuncture(1_000_000_000));
    let mut pc = Pc::counting();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Start);
    pc.run_ms(&mut board, 10);
    board.at_stop(|stopped| *stopped.log() = Default::default());
    let (start, counts_before) = (board.now(), pc.counts());
    let commands = flood(&mut pc, &mut board, start + ticks * TICK);
    // What is on its way arrives.
    let log = board.at_stop(|stopped| std::mem::take(stopped.log()));
    pc.run_ms(&mut board, 50);
    let counts = pc.counts();

    assert_eq!(log.encoder.len() as u64, ticks, "ticks in {seconds} s");
    assert_eq!(log.written.len() as u64, ticks, "codes in {seconds} s");
    let apart = log.encoder.windows(2).map(|pair| pair[1].at - pair[0].at);
    let (shortest, longest) =
        apart.fold((u64::MAX, 0), |(low, high), apart| (low.min(apart), high.max(apart)));
    assert!(
        shortest.abs_diff(TICK) < 2_000 && longest.abs_diff(TICK) < 2_000,
        "{shortest}..{longest} ns apart"
    );
    assert_eq!(counts.lost_samples - counts_before.lost_samples, 0, "lost samples");
    assert_eq!(counts.lost_frames - counts_before.lost_frames, 0, "lost frames");
    assert_eq!(counts.garbage, 0, "frames that arrived broken");
    let samples = counts.samples - counts_before.samples;
    assert!(samples >= ticks, "{samples} samples of {ticks}");
    let timing = pc.heard.timing.expect("timing is reported every second");
    assert_eq!((timing.missed_ticks, timing.dropped_samples), (0, 0));
    assert!(timing.garbage_frames > 1_000, "the flood arrived: {timing:?}");

    let (written, put_out) = (spread(&log.written), spread(&log.put_out));
    println!(
        "tick to the DAC's register {}..{} ns (spread {}), to its pin {}..{} ns (spread {}); {} commands, {} of them heard; {counts:?}",
        written.0,
        written.1,
        written.1 - written.0,
        put_out.0,
        put_out.1,
        put_out.1 - put_out.0,
        commands,
        pc.heard.acks.len(),
    );
    println!(
        "| {seconds} s of flood | {} ticks, {} samples, {} lost |",
        log.encoder.len(),
        samples,
        counts.lost_samples
    );
    println!("| tick to DAC at its pin | {} to {} ns |", put_out.0, put_out.1);
    println!("tick_to_dac_spread_us={}", (put_out.1 - put_out.0) as f64 / 1e3);
    assert!(put_out.1 - put_out.0 <= 1_000, "tick to DAC spreads over {put_out:?} ns");
    let (overruns, excess) = board.at_stop(|stopped| stopped.usb().core.misuse());
    assert_eq!((overruns, excess), (0, 0), "packet memory");
}
