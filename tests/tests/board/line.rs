//! The line of a needle that has turned in tissue, on the flash image: what it does at the
//! converter, what the device answers, and what it costs the tick.

use super::instructions::{BEGIN, Profile};
use control_core::units::Millimetres;
use control_core::{Config, NeedleLine, Plan, Refusal};
use emulator::board::plant;
use emulator::board::{MILLISECOND, Nanos, Wiring};
use fixed::types::I16F16;
use link::Command;
use link::frames::{CommandRefusal, EventKind};
use tests::rig::{PRESSED, Rig};
use tests::scenario::venepuncture;

/// 50 lines a second.
const PERIOD_MS: u64 = 20;
/// The limit for a tick of the default patient while lines come: one that takes a line is up to 80
/// instructions longer than the 840 of the others.
const LONGEST: u32 = 930;

pub(super) fn line(depths: impl IntoIterator<Item = f64>) -> Command {
    let depths = depths.into_iter().map(|depth| Millimetres(I16F16::from_num(depth)));
    Command::Line(NeedleLine { depths: depths.collect() })
}

/// Codes of the converter for a newton at the roller.
fn codes_per_newton() -> f64 {
    let plan: Plan = Config::commissioned_virtual().plan().expect("sound");
    let device = plan.device();
    let newtons = device.full_scale_torque.0 / device.roller_radius.0;
    f64::from(device.dac.span()) / newtons.to_num::<f64>()
}

/// The least and the largest code that was out from one time to another.
fn codes(rig: &mut Rig, from: Nanos, to: Nanos) -> (u16, u16) {
    rig.board.at_stop(move |stopped| {
        let put_out = &stopped.log().put_out;
        let before = put_out.iter().rfind(|output| output.at < from);
        let within = put_out.iter().filter(|output| (from..to).contains(&output.at));
        let codes: Vec<u16> = before.into_iter().chain(within).map(|output| output.code).collect();
        (*codes.iter().min().expect("codes"), *codes.iter().max().expect("codes"))
    })
}

/// A needle that rests in skin that it presses, with its torque faded in, at an odd count: the
/// lines of its encoder differ, so that the device does not ask it for a count.
fn resting() -> Rig {
    let hand = plant::path(vec![(400 * MILLISECOND, 0), (700 * MILLISECOND, PRESSED | 1)]);
    let mut rig = Rig::connected(Wiring::default(), hand);
    rig.pc.must(&mut rig.board, Command::Start);
    let left = 1_000 - rig.board.now() / MILLISECOND;
    rig.pc.run_ms(&mut rig.board, left);
    rig
}

/// The needle rests in skin that it presses, and the line draws that away from under it.
#[test]
fn a_line_50_times_a_second_moves_the_force_by_10_mn_each() {
    let mut rig = resting();
    let (since, events) = (rig.board.now(), rig.pc.heard.events.len());
    let (_, before) = codes(&mut rig, since - 5 * MILLISECOND, since);
    // Rounded both ways.
    let most = (0.010 * codes_per_newton()).ceil() as u16 + 1;
    let (mut largest, mut steps, mut asked) = (0, 0, Vec::new());
    for _ in 0..80 {
        let sent = rig.board.now();
        asked.push(rig.pc.send(&mut rig.board, line([1.5, 3.0, 6.0, 9.0])));
        rig.pc.run_ms(&mut rig.board, PERIOD_MS);
        let (low, high) = codes(&mut rig, sent, sent + PERIOD_MS * MILLISECOND);
        largest = largest.max(high - low);
        steps += u32::from(high != low);
    }
    rig.pc.run_ms(&mut rig.board, 5);
    assert!(asked.iter().all(|id| rig.pc.heard.acks.get(id).is_some_and(|ack| ack.result == Ok(()))));
    let now = rig.board.now();
    let (after, _) = codes(&mut rig, now - 5 * MILLISECOND, now);
    let change = f64::from(before.abs_diff(after)) / codes_per_newton();
    println!(
        "| line at 50 Hz | {steps} steps, the largest {largest} codes of {most}, {change:.3} N together |"
    );
    assert!(largest <= most, "{largest} codes by a line, at most {most}");
    assert!(change > 0.3 && steps >= 50, "{change} N in {steps} steps");
    let told = &rig.pc.heard.events[events..];
    assert!(told.iter().all(|event| matches!(event.kind, EventKind::Limits { .. })), "{told:?}");
}

#[test]
fn a_line_that_is_refused_moves_nothing() {
    let mut rig = resting();
    let since = rig.board.now();
    let refused = [
        (line([1.5, 3.0, 3.0, 9.0]), Refusal::Overlap { layer: 2 }),
        (line([1.5, 3.0, 6.0, 60.0]), Refusal::BeyondTravel { layer: 3 }),
    ];
    for (line, why) in refused {
        assert_eq!(rig.pc.must_not(&mut rig.board, line), CommandRefusal::Config(why));
    }
    for depths in [vec![1.5, 3.0, 6.0], vec![-1.0, 3.0, 6.0, 9.0], vec![1.5, 3.0, 6.0, 9.0, 12.0]] {
        assert!(matches!(rig.pc.must_not(&mut rig.board, line(depths)), CommandRefusal::Config(_)));
    }
    rig.pc.run_ms(&mut rig.board, 50);
    let now = rig.board.now();
    let (low, high) = codes(&mut rig, since, now);
    assert!(high - low <= 1, "{low} to {high}");
}

/// The default test's insertion, with a line a millisecond: more than are followed.
#[test]
fn a_tick_that_takes_a_line_takes_at_most_930_instructions() {
    let (mut profile, mut lines) = (Profile::default(), 0_u32);
    let config = Config::commissioned_virtual();
    let end = BEGIN + 5_200 * MILLISECOND;
    let (_, pc) = profile.add(config, &[Command::Start], venepuncture(BEGIN), end, |pc, board| {
        lines += 1;
        let by = f64::from(lines % 40) / 40.0;
        pc.send(board, line([0.5 * by, 2.0 + by, 4.8 - by, 7.8 + by]));
    });
    let taken = pc.heard.acks.values().filter(|ack| ack.result.is_ok()).count();
    assert!(taken as u32 > lines / 2, "{taken} of {lines} lines");
    let longest = profile.longest("lines");
    println!("tick_instructions_lines={longest}");
    assert!(longest <= LONGEST, "a tick of {longest} instructions");
}
