//! The cost of a tick in instructions, and the depth of the stack.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use control_core::Config;
use control_core::compensation::{Compensation, Friction, Gain, Gains, Wave};
use control_core::config::{
    DacWidth, FrictionLaw, Law, Layer, MAX_LAYERS, Parabola, SPRING_BACK, SpeedMethod, Tissue, Wall,
};
use control_core::event::State;
use control_core::excitation::{Excitation, MAX_LINES, MAX_SEGMENTS, Servo, Signal};
use control_core::units::{
    Damping, FrictionPerMillimetre, JogCompliance, Millimetres, MillimetresPerSecond, MillinewtonMetres,
    Newtons, Stiffness,
};
use emulator::board::plant::{self, PlantSide};
use emulator::board::{Board, MILLISECOND, Nanos, Wiring};
use fixed::types::{I8F24, I16F16};
use link::Command;
use tests::laws;
use tests::pc::{self, Pc};
use tests::rig::Rig;
use tests::scenario::{COUNTS_PER_MM, venepuncture};

/// The tick's interrupt handler.
pub(super) const TICK: &str = "TIM4";
/// The limit for a tick of the default patient without compensation: five per cent of its cycles.
const LONGEST: u32 = 840;
/// The same of six walls that are all met, and of excitations.
const HEAVIEST: u32 = 1_100;
const EXCITING: u32 = 910;
/// The limit for a tick of the laws of Papers 002 and 000.
const OTHER_LAWS: u32 = 1_260;
/// With all that can be fed forward.
const COMPENSATED: u32 = 1_260;
/// The largest patients of the other laws on such a device. 1,260 are wanted.
const BOTH: u32 = 1_470;
const WORKING: [State; 5] =
    [State::Approach, State::Elastic, State::Puncture, State::Friction, State::Withdrawal];
/// The time at which the hand begins to move.
pub(super) const BEGIN: Nanos = 200 * MILLISECOND;

/// The instructions of each tick by what the tick was doing.
#[derive(Default)]
pub(super) struct Profile {
    by_state: BTreeMap<u8, Vec<u32>>,
}

impl Profile {
    /// Adds the ticks until `end` of a board with `config`, started by `begin`, whose needle the
    /// plant moves. `meddle` is called every millisecond.
    pub(super) fn add(
        &mut self,
        config: Config,
        begin: &[Command],
        plant: impl PlantSide + 'static,
        end: Nanos,
        mut meddle: impl FnMut(&mut Pc, &mut Board),
    ) -> (Board, Pc) {
        let Rig { mut board, mut pc } = Rig::connected(Wiring::default(), plant);
        pc.configure(&mut board, &config);
        // The tick takes it once it is saved, not in one of these ticks.
        pc.run_ms(&mut board, 60);
        // Only with the rotor's angle is all of a compensation fed forward.
        pc.must(&mut board, Command::Index(Some(17)));
        begin.iter().for_each(|command| pc.must(&mut board, command.clone()));
        board.count_runs_of(TICK);
        while board.now() < end {
            pc.run_ms(&mut board, 1);
            meddle(&mut pc, &mut board);
        }
        let ticks = board.counted_runs();
        pc.run_ms(&mut board, 50);
        // The last tick of the profile and the last sample are a few apart; the state changes
        // slowly.
        let first = pc.heard.samples.len().checked_sub(500 + ticks.len()).expect("a sample for each tick");
        for (run, (_, sample)) in ticks.iter().zip(&pc.heard.samples[first..]) {
            self.by_state.entry(sample.state).or_default().push(run.instructions);
        }
        println!("the firmware's own times: {:?}", pc.heard.timing.map(|timing| timing.stages));
        (board, pc)
    }

    /// Prints median and longest of each state, and answers the longest of all.
    pub(super) fn longest(&mut self, what: &str) -> u32 {
        for (&state, instructions) in &mut self.by_state {
            instructions.sort_unstable();
            let name =
                State::from_code(state).map_or_else(|| state.to_string(), |state| format!("{state:?}"));
            let (median, longest) =
                (instructions[instructions.len() / 2], instructions[instructions.len() - 1]);
            println!(
                "| {what}, {name} | {} ticks, median {median}, longest {longest} instructions |",
                instructions.len()
            );
        }
        self.by_state.values().filter_map(|instructions| instructions.last().copied()).max().unwrap_or(0)
    }

    fn has_worked(&self) {
        for state in WORKING {
            assert!(self.by_state.contains_key(&(state as u8)), "{state:?} was not reached");
        }
    }
}

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

/// As many walls as there may be, `apart` from one another and twice that along a needle at 30°,
/// each of which gives way after five sixths of that and is felt for long after, along its relief
/// parabola.
fn walls(apart: f64) -> Vec<Layer> {
    let parabola = |vertex: f64, compliance: f64, base: f64| Parabola {
        vertex: Millimetres(q(vertex)),
        compliance: JogCompliance(q(compliance)),
        base: Newtons(q(base)),
    };
    let travel = apart * 5.0 / 6.0;
    // 0.2 N at the puncture, and less than that once the wall has given way.
    let layer = |number: usize| Layer {
        tissue: Tissue::Other,
        depth: Millimetres(q(apart * number as f64)),
        wall: Some(Wall {
            elastic: parabola(0.0, travel * travel / 0.2, 0.0),
            puncture_travel: Millimetres(q(travel)),
            relief: parabola(8.0, 1_000.0, 0.02),
            unload: Stiffness(q(0.05)),
            spring_back: SPRING_BACK,
        }),
        friction: FrictionPerMillimetre(q(0.02)),
    };
    (0..MAX_LAYERS).map(layer).collect()
}

/// Every switch both ways: the law of friction, how speed is estimated, the converter. Everything
/// that a value turns on is on: as many walls as there may be, damping, the passivity observer, a
/// thermal limit that is in force.
fn heaviest(apart: f64) -> impl Iterator<Item = Config> {
    let paper = FrictionLaw::Paper {
        level_length: Millimetres(q(23.0)),
        level_cap: q(2.0),
        anchor_ms: 60,
        stiffness: Stiffness(q(0.5)),
        limit: Newtons(q(1.0)),
        limit_out: Newtons(q(0.8)),
    };
    let cone = FrictionLaw::Cone { stiffness: Stiffness(q(0.5)) };
    let sticking = FrictionLaw::StickSlip { stiffness: Stiffness(q(0.5)), sliding: q(0.5) };
    (0..10_u8).map(move |choice| {
        let is = |bit: u8| choice & 1 << bit != 0;
        let mut config = Config::commissioned_virtual();
        config.patient.law = Law::Jog(match (is(3), is(0)) {
            (true, _) => sticking,
            (false, true) => paper,
            (false, false) => cone,
        });
        config.patient.layers = walls(apart).into_iter().collect();
        config.device.speed = if is(1) { SpeedMethod::EdgeTiming } else { SpeedMethod::Window };
        config.device.damping = Damping(I8F24::from_num(0.0002));
        config.device.encoder_reversed = is(0);
        config.device.motor_reversed = is(1);
        config.device.dac = if is(2) { DacWidth::BITS_8 } else { DacWidth::BITS_12 };
        config.device.limits.continuous_torque = MillinewtonMetres(q(10.0));
        config.device.limits.stiffness = Stiffness(q(3.0));
        config
    })
}

/// As much as can be fed forward.
pub(super) fn all_fed_forward() -> Compensation {
    let wave = |number: usize, amplitude: f64| Wave {
        order: 5 * number as u16 + 3,
        amplitude: q(amplitude),
        phase: 9_000 * number as u16,
    };
    let gain = Gain(180);
    let friction = Friction { dry: MillinewtonMetres(q(0.6)), viscous: Damping(I8F24::from_num(0.000_02)) };
    Compensation {
        angle: std::array::from_fn(|number| wave(number, 0.1)),
        ripple: std::array::from_fn(|number| wave(number, 0.02)),
        inwards: friction,
        outwards: friction,
        weight: MillinewtonMetres(q(1.5)),
        offset: MillinewtonMetres(q(-0.2)),
        deadband: MillinewtonMetres(q(0.1)),
        gains: Gains { angle: gain, friction: gain, weight: gain, drive: gain },
        ..Compensation::NONE
    }
}

/// Points of a path: a time in ms after [`BEGIN`] and a depth in counts.
pub(super) fn path(points: impl IntoIterator<Item = (f64, i64)>) -> Vec<(Nanos, i64)> {
    points.into_iter().map(|(ms, counts)| (BEGIN + (ms * 1e6) as Nanos, counts)).collect()
}

#[test]
fn a_tick_takes_at_most_840_instructions() {
    let mut profile = Profile::default();
    let end = 8_300 * MILLISECOND;
    let (mut board, _) =
        profile.add(Config::commissioned_virtual(), &[Command::Start], venepuncture(BEGIN), end, |_, _| ());
    profile.has_worked();
    let longest = profile.longest("default");
    let (used, size) = board.stack_use().expect("the image says where its stack is");
    println!("| stack | {used} of {size} bytes |");
    println!("stack_high_water_bytes={used}");
    println!("tick_instructions_longest={longest}");
    assert!(longest <= LONGEST, "a tick of {longest} instructions");
    assert!(2 * used <= size, "more than half of the stack was used: {used} of {size} bytes");
}

#[test]
fn a_tick_with_all_feedforward_takes_at_most_1260_instructions() {
    let mut config = Config::commissioned_virtual();
    config.device.compensation = all_fed_forward();
    let mut profile = Profile::default();
    let end = 8_300 * MILLISECOND;
    let (mut board, _) = profile.add(config, &[Command::Start], venepuncture(BEGIN), end, |_, _| ());
    profile.has_worked();
    let longest = profile.longest("all fed forward");
    let (used, size) = board.stack_use().expect("the image says where its stack is");
    println!("tick_instructions_compensated={longest}");
    assert!(longest <= COMPENSATED, "a tick of {longest} instructions");
    assert!(2 * used <= size, "more than half of the stack was used: {used} of {size} bytes");
}

/// In and out at 100 mm/s and more, with pauses; stopped and started again all the while the needle
/// comes out. Takes more than 5 s: ten configurations, each on a board of its own.
#[test]
fn a_tick_of_the_heaviest_configurations_takes_no_more() {
    let mm = |depth: i64| depth * COUNTS_PER_MM;
    // As fast as no watch takes for a motor that is wired wrongly.
    let moves = [
        (0.0, 0),
        (50.0, mm(-2)),
        (60.0, mm(-2)),
        (160.0, mm(4)),
        (190.0, mm(4)),
        (300.0, mm(15)),
        (330.0, mm(15)),
        (390.0, mm(13)),
        (470.0, mm(7)),
        (570.0, mm(-3)),
    ];
    let mut profile = Profile::default();
    for config in heaviest(0.6) {
        let restart = |pc: &mut Pc, board: &mut Board| {
            if board.now() > BEGIN + 390 * MILLISECOND {
                pc.must(board, Command::Stop);
                pc.must(board, Command::Start);
            }
        };
        let hand = plant::by_hand(plant::eased(path(moves)));
        profile.add(config, &[Command::Start], hand, BEGIN + 580 * MILLISECOND, restart);
    }
    profile.has_worked();
    let longest = profile.longest("heaviest");
    // More than is wanted, 840.
    assert!(longest <= HEAVIEST, "a tick of {longest} instructions");
}

/// In through `layers` layers, with a rest on the way, and out; the longest tick.
fn longest_through(
    name: &str,
    (make, layers): (fn(usize) -> Config, RangeInclusive<usize>),
    compensation: Compensation,
) -> u32 {
    let mut profile = Profile::default();
    for count in layers {
        let deepest = COUNTS_PER_MM * (6 * count as i64 + 2);
        let ms = 14.0 * count as f64;
        let moves = [
            (0.0, 0),
            (50.0, -2 * COUNTS_PER_MM),
            (60.0, -2 * COUNTS_PER_MM),
            (160.0 + ms, deepest / 2),
            (200.0 + ms, deepest / 2),
            (300.0 + 2.0 * ms, deepest),
            (340.0 + 2.0 * ms, deepest),
            (460.0 + 6.0 * ms, -2 * COUNTS_PER_MM),
        ];
        let hand = plant::by_hand(plant::eased(path(moves)));
        let end = BEGIN + (480.0 + 6.0 * ms) as u64 * MILLISECOND;
        let mut config = make(count);
        config.device.compensation = compensation;
        profile.add(config, &[Command::Start], hand, end, |_, _| ());
    }
    // The table has its walls in it.
    for state in WORKING.into_iter().filter(|&state| state != State::Puncture || name.starts_with("sparte")) {
        assert!(profile.by_state.contains_key(&(state as u8)), "{name}: {state:?} was not reached");
    }
    profile.longest(name)
}

/// In as many layers as there may be and in fewer. Takes more than 5 s: each number of layers on a
/// board of its own.
#[test]
fn a_tick_of_the_other_laws_takes_at_most_1260_instructions() {
    for (name, make) in [("sparte", laws::sparte as fn(usize) -> Config), ("xr", laws::xr)] {
        let longest = longest_through(name, (make, 1..=MAX_LAYERS), Compensation::NONE);
        println!("tick_instructions_longest_{name}={longest}");
        assert!(longest <= OTHER_LAWS, "{name}: a tick of {longest} instructions");
    }
}

/// Their largest patients on a device that has everything to feed forward.
#[test]
fn nor_does_one_with_all_feedforward_as_well() {
    for (name, make) in [("sparte", laws::sparte as fn(usize) -> Config), ("xr", laws::xr)] {
        let name = format!("{name}, all fed forward");
        let longest = longest_through(&name, (make, MAX_LAYERS..=MAX_LAYERS), all_fed_forward());
        assert!(longest <= BOTH, "{name}: a tick of {longest} instructions");
    }
}

/// Every signal, as much of it as there may be and its legs as short as they may be.
fn every_signal() -> [Signal; 6] {
    let speed = MillimetresPerSecond(q(50.0));
    [
        Signal::SpeedStaircase {
            slowest: MillimetresPerSecond(q(1.0)),
            ratio: q(1.1),
            steps: 32,
            dwell_ms: 50,
        },
        Signal::Triangle { stroke: Millimetres(q(1.0)), speed },
        Signal::ReversalLadder { smallest: Millimetres(q(0.1)), ratio: q(1.2), steps: 16, speed },
        multisine(),
        Signal::BreakawayRamps { torque: MillinewtonMetres(q(0.5)), ramp_ms: 50 },
        Signal::Hold,
    ]
}

fn multisine() -> Signal {
    let frequencies = (1..=MAX_LINES as u16).map(|line| 17 * line).collect();
    Signal::Multisine { torque: MillinewtonMetres(q(0.5)), frequencies }
}

fn played(signal: Signal, duration_ms: u32) -> Excitation {
    let servo = Servo { stiffness: Stiffness(q(0.5)), damping: Damping(I8F24::from_num(0.001)) };
    Excitation { signal, duration_ms, servo, travel: Millimetres(q(100.0)), compensated: false }
}

/// A motor that turns to and fro.
fn to_and_fro() -> Vec<(Nanos, i64)> {
    path((0..30).map(|turn| (f64::from(turn) * 20.0, i64::from(turn % 2) * 150)))
}

#[test]
fn nor_does_a_tick_that_plays_an_excitation() {
    let mut profile = Profile::default();
    for signal in every_signal() {
        let config = heaviest(0.6).last().expect("there are some");
        let begin = [Command::Excite(played(signal, 10_000))];
        profile.add(config, &begin, plant::path(to_and_fro()), BEGIN + 600 * MILLISECOND, |_, _| ());
    }
    assert!(profile.by_state.contains_key(&(State::Excitation as u8)), "nothing was played");
    let longest = profile.longest("excitations");
    assert!(longest <= EXCITING, "a tick of {longest} instructions");
}

/// One of every signal, and one of multisines alone, which take longest, in segments as short as
/// they may be: the ticks in which one segment gives way to the next are among them.
#[test]
fn nor_does_a_tick_that_plays_a_sequence() {
    let mut every: Vec<Excitation> = every_signal().map(|signal| played(signal, 60)).into();
    every.insert(3, played(multisine(), 10));
    let multisines = vec![played(multisine(), 10); MAX_SEGMENTS];
    let mut profile = Profile::default();
    for segments in [every, multisines] {
        let config = heaviest(0.6).last().expect("there are some");
        let end = BEGIN + 600 * MILLISECOND;
        profile.add(config, &pc::sequence(&segments), plant::path(to_and_fro()), end, |_, _| ());
    }
    let ticks = profile.by_state.get(&(State::Excitation as u8)).map_or(0, Vec::len);
    assert!(ticks > 4_000, "{ticks} of 4,500 ticks of two sequences");
    let longest = profile.longest("sequences");
    println!("tick_instructions_sequence={longest}");
    assert!(longest <= EXCITING, "a tick of {longest} instructions");
}
