//! What a tick costs in instructions, and how deep the stack gets.

use std::collections::BTreeMap;

use control_core::Config;
use control_core::config::{FrictionLaw, Layer, MAX_LAYERS, Parabola, SpeedMethod, Tissue, Wall};
use control_core::event::State;
use control_core::units::{
    Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillinewtonMetres, Newtons, Stiffness,
};
use fixed::types::{I8F24, I16F16};
use link::Command;
use tests::board::Board;
use tests::pc::Pc;
use tests::scenario::{board, venepuncture};

/// The tick's interrupt handler.
const TICK: &str = "TIM4";
/// From one tick to the next.
const CYCLES_PER_TICK: u32 = 16_800;
/// What the default configuration may take: five per cent.
const LONGEST: u32 = 5 * CYCLES_PER_TICK / 100;
const WORKING: [State; 5] =
    [State::Approach, State::Elastic, State::Puncture, State::Friction, State::Withdrawal];

/// A venepuncture under `config`, with the instructions of each of its ticks by what the tick was doing.
struct Profile {
    board: Board,
    by_state: BTreeMap<u8, Vec<u32>>,
}

impl Profile {
    fn of(config: Config) -> Self {
        let mut board = board(venepuncture(200_000_000));
        let mut pc = Pc::new();
        pc.connect(&mut board);
        pc.must(&mut board, Command::Configure(config));
        pc.must(&mut board, Command::Start);
        let handler = board.symbols().iter().find(|symbol| symbol.name == TICK);
        let handler = handler.expect("the image has the tick's handler").address;
        board.probe().tally().handler = Some(handler);
        while board.now() < 8_300_000_000 {
            pc.run_ms(&mut board, 100);
        }
        board.probe().tally().handler = None;
        pc.run_ms(&mut board, 10);
        let ticks = std::mem::take(&mut board.probe().tally().runs);
        // The last tick of the profile and the last sample are a few apart; the state changes slowly.
        let first = pc.heard.samples.len().checked_sub(100 + ticks.len()).expect("a sample for each tick");
        let mut by_state: BTreeMap<u8, Vec<u32>> = BTreeMap::new();
        for (run, (_, sample)) in ticks.iter().zip(&pc.heard.samples[first..]) {
            by_state.entry(sample.state).or_default().push(run.instructions);
        }
        by_state.values_mut().for_each(|instructions| instructions.sort_unstable());
        println!("the firmware's own times: {:?}", pc.heard.timing.map(|timing| timing.stages));
        Self { board, by_state }
    }

    /// Prints median and longest of each state, and answers the longest of all.
    fn longest(&self, what: &str) -> u32 {
        for (&state, instructions) in &self.by_state {
            let name =
                State::from_code(state).map_or_else(|| state.to_string(), |state| format!("{state:?}"));
            let (median, longest) =
                (instructions[instructions.len() / 2], instructions[instructions.len() - 1]);
            println!(
                "| {what}, {name} | {} ticks, median {median}, longest {longest} instructions |",
                instructions.len()
            );
        }
        for state in WORKING {
            assert!(self.by_state.contains_key(&(state as u8)), "{state:?} was not reached");
        }
        self.by_state.values().filter_map(|instructions| instructions.last().copied()).max().unwrap_or(0)
    }
}

/// As many walls as there may be, each of which is felt for good once it has given way, and of every choice the one that
/// costs more.
fn heaviest() -> Config {
    let q = |value: f64| I16F16::from_num(value);
    let parabola = |vertex: f64, compliance: f64, base: f64| Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons(q(base)),
    };
    let layer = |number: usize| Layer {
        tissue: Tissue::Other,
        top: Millimetres(q(1.2 * number as f64)),
        wall: Some(Wall {
            elastic: parabola(0.0, 9.0, 0.0),
            puncture_travel: Millimetres(q(1.0)),
            relief: parabola(1.2, 1.0, 0.05),
            unload: Stiffness(q(0.5)),
        }),
        friction: FrictionPerMillimetre(q(0.02)),
    };
    let mut config = Config {
        speed: SpeedMethod::EdgeTiming,
        damping: Damping(I8F24::from_num(0.0002)),
        friction: FrictionLaw::Paper {
            level_length: Millimetres(q(23.0)),
            level_cap: q(2.0),
            anchor_ms: 60,
            stiffness: Stiffness(q(0.5)),
            limit: Newtons(q(1.0)),
        },
        layers: (0..MAX_LAYERS).map(layer).collect(),
        ..Config::default()
    };
    config.limits.continuous_torque = MillinewtonMetres(q(10.0));
    config
}

#[test]
fn a_tick_takes_at_most_840_instructions() {
    let mut profile = Profile::of(Config::default());
    let longest = profile.longest("default");
    let (used, size) = profile.board.stack_use().expect("the image says where its stack is");
    println!("| stack | {used} of {size} bytes |");
    println!("tick_instructions_longest={longest}");
    assert!(longest <= LONGEST, "a tick of {longest} instructions");
    assert!(2 * used <= size, "less than half of the stack is left: {used} of {size} bytes");
}

#[test]
fn a_tick_of_the_heaviest_configuration_takes_at_most_seven_per_cent_of_its_period() {
    let longest = Profile::of(heaviest()).longest("heaviest");
    assert!(longest <= 7 * CYCLES_PER_TICK / 100, "a tick of {longest} instructions");
}
