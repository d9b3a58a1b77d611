//! What a tick costs in instructions, and how deep the stack gets.

use std::collections::BTreeMap;

use control_core::event::State;
use link::Command;
use tests::board::Board;
use tests::pc::Pc;
use tests::scenario::{board, venepuncture};

/// The tick's interrupt handler.
const TICK: &str = "TIM4";
/// Wanted are five per cent of the 16,800 cycles between two ticks.
const WANTED: u32 = 840;
/// They are not reached yet: the tick may not grow beyond what it is today.
const NO_WORSE_THAN: u32 = 1_120;

/// The functions in which a tick spends its instructions, with how many on average.
fn print_where_they_go(board: &Board, ticks: usize) {
    let probe = board.probe();
    let mut by_function: BTreeMap<&str, u64> = BTreeMap::new();
    for (&place, &times) in &probe.tally().places {
        let name = board.symbol_at(place).map_or("?", |symbol| symbol.name.as_str());
        *by_function.entry(name).or_default() += times;
    }
    let mut functions: Vec<_> = by_function.into_iter().collect();
    functions.sort_unstable_by_key(|&(_, times)| std::cmp::Reverse(times));
    for (name, times) in functions.iter().take(12) {
        println!("{:>7.1} a tick in {name}", *times as f64 / ticks as f64);
    }
}

#[test]
fn a_tick_takes_no_longer_than_it_did() {
    let mut board = board(venepuncture(200_000_000));
    let mut pc = Pc::new();
    pc.connect(&mut board);
    pc.must(&mut board, Command::Start);
    let handler = board.symbols().iter().find(|symbol| symbol.name == TICK).map(|symbol| symbol.address);
    board.probe().tally().handler = Some(handler.expect("the image has the tick's handler"));
    while board.now() < 8_300_000_000 {
        pc.run_ms(&mut board, 100);
    }
    board.probe().tally().handler = None;
    pc.run_ms(&mut board, 10);
    let ticks = std::mem::take(&mut board.probe().tally().runs);
    // The last tick of the profile and the last sample are a few apart; the state changes slowly.
    let last = pc.heard.samples.len().checked_sub(100 + ticks.len()).expect("a sample for each tick");
    let mut by_state: BTreeMap<u8, Vec<u32>> = BTreeMap::new();
    for (run, (_, sample)) in ticks.iter().zip(&pc.heard.samples[last..]) {
        by_state.entry(sample.state).or_default().push(run.instructions);
    }
    let mut worst = (0, String::new());
    for (state, instructions) in &mut by_state {
        instructions.sort_unstable();
        let median = instructions[instructions.len() / 2];
        let longest = instructions[instructions.len() - 1];
        let name = State::from_code(*state).map_or_else(|| state.to_string(), |state| format!("{state:?}"));
        println!(
            "{name:<12} {:>6} ticks, median {median:>4}, longest {longest:>4} instructions",
            instructions.len()
        );
        worst = worst.max((longest, name));
    }
    print_where_they_go(&board, ticks.len());
    for state in [State::Approach, State::Elastic, State::Friction] {
        assert!(by_state.contains_key(&(state as u8)), "{state:?} was not reached");
    }
    let (used, size) = board.stack_use().expect("the image says where its stack is");
    println!("stack: {used} of {size} bytes");
    println!("the firmware's own times: {:?}", pc.heard.timing.map(|timing| timing.stages));
    println!("tick_instructions_longest={}", worst.0);
    if worst.0 > WANTED {
        println!("not there yet: {} instructions in state {}, {WANTED} wanted", worst.0, worst.1);
    }
    assert!(worst.0 <= NO_WORSE_THAN, "a tick of {} instructions in state {}", worst.0, worst.1);
    assert!(2 * used <= size, "less than half of the stack is left: {used} of {size} bytes");
}
