//! What a tick costs in instructions, and how deep the stack gets.

use std::collections::BTreeMap;

use control_core::event::State;
use link::Command;
use tests::board::processor::FIRST_EXTERNAL;
use tests::pc::Pc;
use tests::scenario::{board, venepuncture};

/// The tick's interrupt: TIM4.
const TICK: u32 = FIRST_EXTERNAL + 30;
/// Five per cent of the 16,800 cycles between two ticks.
const WANTED: u32 = 840;

#[test]
fn a_tick_takes_at_most_five_per_cent_of_the_processor() {
    let mut board = board(venepuncture(200_000_000));
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Start);
    board.probe().tally().profile = true;
    while board.now() < 8_300_000_000 {
        pc.run_ms(&mut board, 100);
    }
    board.probe().tally().profile = false;
    pc.run_ms(&mut board, 10);
    let runs = std::mem::take(&mut board.probe().tally().runs);
    let ticks = &runs[&TICK];
    // The last tick of the profile and the last sample are a few apart; the state changes slowly.
    let last = pc.heard.samples.len().checked_sub(100 + ticks.len()).expect("a sample for each tick");
    let mut by_state: BTreeMap<u8, Vec<u32>> = BTreeMap::new();
    for (run, (_, sample)) in ticks.iter().zip(&pc.heard.samples[last..]) {
        by_state.entry(sample.state).or_default().push(run.instructions);
    }
    for (state, instructions) in &mut by_state {
        instructions.sort_unstable();
        let median = instructions[instructions.len() / 2];
        let longest = instructions[instructions.len() - 1];
        let name = State::from_code(*state).map_or_else(|| state.to_string(), |state| format!("{state:?}"));
        println!(
            "{name:<12} {:>6} ticks, median {median:>4}, longest {longest:>4} instructions",
            instructions.len()
        );
        assert!(longest <= WANTED, "{name}: {longest} instructions");
    }
    for (exception, runs) in &runs {
        let longest = runs.iter().map(|run| run.instructions).max().unwrap_or(0);
        println!("exception {exception}: {} runs, longest {longest} instructions", runs.len());
    }
    for state in [State::Approach, State::Elastic, State::Friction] {
        assert!(by_state.contains_key(&(state as u8)), "{state:?} was not reached");
    }
    let (used, size) = board.stack_use().expect("the image says where its stack is");
    println!("stack: {used} of {size} bytes");
    assert!(2 * used <= size, "less than half of the stack is left: {used} of {size} bytes");
}
