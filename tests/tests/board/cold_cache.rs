//! A tick with none of its code in the flash's cache: other tasks have used the cache since the
//! tick before, and the tick's code is more than it holds (RM0090 3.5.2).

use super::instructions::{BEGIN, TICK, all_fed_forward, path};
use control_core::Config;
use emulator::board::plant::{self, PlantSide};
use emulator::board::{MILLISECOND, ToCode, Wiring, cache};
use link::Command;
use tests::laws;
use tests::rig::Rig;
use tests::scenario::{COUNTS_PER_MM, venepuncture};

/// The converter is latched so many cycles after the tick's edge.
const LATCH_CYCLES: u32 = 3_360;
/// The same under the largest xr patient with all fed forward as well: too many, by which its
/// longest tick would be one late.
const BOTH_CYCLES: u32 = 3_550;

/// Counts the lines of code of the ticks between two times, in ms from [`BEGIN`] on, of a needle
/// that the plant moves. With every line from the flash, without prefetch, and one and a half
/// cycles for an instruction, the code is written within `limit` cycles.
fn is_done_within(
    limit: u32,
    name: &str,
    config: &Config,
    plant: impl PlantSide + 'static,
    [from, to]: [u64; 2],
) {
    let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant);
    pc.configure(&mut board, config);
    pc.must(&mut board, Command::Index(Some(17)));
    pc.must(&mut board, Command::Start);
    while board.now() < BEGIN + from * MILLISECOND {
        pc.run_ms(&mut board, 1);
    }
    board.count_lines_of(TICK);
    while board.now() < BEGIN + to * MILLISECOND {
        pc.run_ms(&mut board, 1);
    }
    let runs = board.counted_runs();
    let cycles = |part: &ToCode| part.instructions * 3 / 2 + part.lines * cache::WAIT_CYCLES;
    let worst = runs.iter().filter_map(|run| run.to_code).max_by_key(cycles).expect("ticks");
    println!(
        "| {name}, nothing cached | {} instructions, {} lines from the flash, {} of {LATCH_CYCLES} cycles |",
        worst.instructions,
        worst.lines,
        cycles(&worst)
    );
    assert!(worst.lines > 64, "more lines than the cache has");
    assert!(cycles(&worst) < limit, "{name}: {worst:?}");
}

/// Takes more than 5 s: each instruction of 20,000 ticks by itself.
#[test]
fn a_tick_whose_code_is_not_cached_is_done_before_the_latch() {
    let default = Config::commissioned_virtual();
    // Through the skin, and its wall gives way.
    is_done_within(LATCH_CYCLES, "default", &default, venepuncture(BEGIN), [1_700, 2_600]);
    let mut fed_forward = default;
    fed_forward.device.compensation = all_fed_forward();
    is_done_within(LATCH_CYCLES, "all fed forward", &fed_forward, venepuncture(BEGIN), [1_700, 2_600]);
    // Through knots of all depths, in and out, with a rest on the way.
    let counts = |mm: i64| mm * COUNTS_PER_MM;
    let moves = [(0.0, 0), (50.0, counts(-2)), (100.0, counts(20)), (120.0, counts(20)), (170.0, counts(38))];
    let out = [(190.0, counts(38)), (300.0, counts(-2))];
    let hand = || plant::by_hand(plant::eased(path(moves.into_iter().chain(out))));
    let mut phantom = laws::phantom();
    is_done_within(LATCH_CYCLES, "xr", &phantom, hand(), [50, 320]);
    phantom.device.compensation = all_fed_forward();
    is_done_within(BOTH_CYCLES, "xr, all fed forward", &phantom, hand(), [50, 320]);
}
