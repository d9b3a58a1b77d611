//! At the ends of every range that a configuration may have, the board computes what control-core
//! computes. The image is built without overflow checks and the host with them, down to those of
//! `fixed`: a number that overflows is another one on the board, and a panic here.

use control_core::Config;
use control_core::config::{ForceTable, FrictionLaw, Law, Sparte, SpeedMethod};
use control_core::event::{Fault, State};
use control_core::units::{Damping, Millimetres, Newtons, Stiffness};
use emulator::board::{MILLISECOND, Nanos, Wiring, plant};
use fixed::types::{I8F24, I16F16};
use link::Command;
use tests::follow::agrees;
use tests::laws;
use tests::rig::Rig;

fn q(value: f64) -> I16F16 {
    I16F16::from_num(value)
}

/// A value by its name, how it is set, and values between which each end of its range lies: one
/// that is taken and one that is not.
type Range = (&'static str, fn(&mut Config, f64), [[f64; 2]; 2]);

/// Ranges in groups, each on one board: the ends of values that do not hide one another.
const DEVICE: [&[Range]; 9] = [
    &[
        ("roller radius", |c, v| c.device.roller_radius.0 = q(v), [[10.0, 3.0], [10.0, 30.0]]),
        ("skin tilt", |c, v| c.device.skin_tilt.0 = v as i16, [[0.0, -3_000.0], [0.0, 3_000.0]]),
    ],
    &[("counts a turn", counts_a_turn, [[4_000.0, 0.0], [4_000.0, 65_535.0]])],
    &[("counts a tick", counts_a_tick, [[5.0, 0.0], [5.0, 9_999.0]])],
    &[
        ("full scale", |c, v| c.device.full_scale_torque.0 = q(v), [[100.0, 1.0], [100.0, 600.0]]),
        ("winding time", |c, v| c.device.limits.winding_time_s = v as u16, [[30.0, 0.0], [30.0, 9_999.0]]),
    ],
    &[
        ("torque", |c, v| c.device.limits.torque.0 = q(v), [[20.0, 0.0], [20.0, 600.0]]),
        ("converter's zero", |c, v| c.device.dac_zero = v as i16, [[0.0, -999.0], [0.0, 999.0]]),
    ],
    &[
        ("continuous torque", |c, v| c.device.limits.continuous_torque.0 = q(v), [[9.0, 0.0], [9.0, 600.0]]),
        ("damping", |c, v| c.device.damping = Damping(I8F24::from_num(v)), [[0.0, -0.1], [0.0, 0.1]]),
    ],
    &[
        ("slew", |c, v| c.device.limits.slew_per_tick.0 = q(v), [[1.0, 0.0], [1.0, 600.0]]),
        (
            "passivity",
            |c, v| c.device.passivity_damping = Damping(I8F24::from_num(v)),
            [[0.0, -0.1], [0.0, 0.1]],
        ),
    ],
    &[
        ("dry friction", |c, v| c.device.mechanism.dry_friction.0 = q(v), [[0.06, -1.0], [0.06, 20.0]]),
        ("moving mass", |c, v| c.device.mechanism.mass.0 = q(v), [[30.0, 0.0], [30.0, 2_000.0]]),
        ("delay", |c, v| c.device.mechanism.delay_us = v as u16, [[100.0, 0.0], [100.0, 2_000.0]]),
        ("stiffness", |c, v| c.device.limits.stiffness.0 = q(v), [[2.0, 0.0], [2.0, 99.0]]),
    ],
    &[("travel", |c, v| c.device.limits.travel.0 = q(v), [[60.0, 0.0], [60.0, 900.0]])],
];

const PATIENT: [&[Range]; 2] = [
    &[
        ("hold", hold, [[0.5, 0.0], [0.5, 99.0]]),
        ("largest force", |c, v| c.patient.largest_force = Some(Newtons(q(v))), [[2.8, 0.0], [2.8, 99.0]]),
        ("scale", |c, v| c.patient.scale = q(v), [[0.6, 0.0], [0.6, 2.0]]),
    ],
    &[
        ("friction of a layer", |c, v| c.patient.layers[0].friction.0 = q(v), [[0.02, -1.0], [0.02, 9.0]]),
        ("travel of a wall", |c, v| wall(c).puncture_travel.0 = q(v), [[3.0, 0.0], [3.0, 40.0]]),
        ("unloading", |c, v| wall(c).unload = Stiffness(q(v)), [[0.5, 0.0], [0.5, 99.0]]),
    ],
];

/// Those of the law of Paper 001 that releases a needle at rest.
const PAPER: [&[Range]; 1] = [&[
    ("level length", |c, v| paper(c).0.0 = q(v), [[23.0, 0.0], [23.0, 900.0]]),
    ("level cap", |c, v| *paper(c).1 = q(v), [[2.0, 0.0], [2.0, 99.0]]),
    ("anchor", |c, v| *paper(c).2 = v as u16, [[60.0, 0.0], [60.0, 65_535.0]]),
    ("limit outwards", |c, v| paper(c).3.0 = q(v), [[0.8, -1.0], [0.8, 99.0]]),
]];

/// Those of the law of Paper 002.
const SPARTE: [&[Range]; 2] = [
    &[
        ("tracking", |c, v| sparte(c).tracking.0 = q(v), [[0.8, 0.0], [0.8, 99.0]]),
        ("after a puncture", |c, v| sparte(c).after_puncture = q(v), [[0.6, -1.0], [0.6, 2.0]]),
        ("relaxing", |c, v| sparte(c).relax_ms = v as u16, [[300.0, 0.0], [300.0, 65_535.0]]),
        ("a wall's rate", |c, v| sparte(c).wall_rate = q(v), [[0.001, -1.0], [0.001, 1.0]]),
        ("cutting", |c, v| sparte(c).cutting[1].inwards.0 = q(v), [[1.5, -1.0], [1.5, 99.0]]),
    ],
    &[
        ("sliding", |c, v| sparte(c).friction.sliding.0 = q(v), [[0.3, -1.0], [0.3, 99.0]]),
        ("sticking", |c, v| sparte(c).friction.sticking.0 = q(v), [[0.35, -1.0], [0.35, 99.0]]),
        (
            "viscous",
            |c, v| sparte(c).friction.viscous = Damping(I8F24::from_num(v)),
            [[0.001, -1.0], [0.001, 1.0]],
        ),
        ("Stribeck's speed", |c, v| sparte(c).friction.speed.0 = q(v), [[2.0, 0.0], [2.0, 999.0]]),
        ("fixture", |c, v| sparte(c).fixture.per_mrad.0 = q(v), [[0.01, -1.0], [0.01, 99.0]]),
    ],
];

/// Those of the law of Paper 000.
const XR: [&[Range]; 1] = [&[
    ("withdrawal", |c, v| table(c).withdrawal = q(v), [[0.4, -1.0], [0.4, 2.0]]),
    ("first speed", |c, v| table(c).speeds[0].0 = q(v), [[2.0, -1.0], [2.0, 99.0]]),
    ("last angle", |c, v| table(c).angles[2].0 = v as i16, [[1_400.0, 0.0], [1_400.0, 9_999.0]]),
    ("force at a knot", |c, v| table(c).forces[45] = v as u16, [[300.0, -1.0], [300.0, 65_535.0]]),
]];

/// With as fast a needle as before.
fn counts_a_turn(config: &mut Config, value: f64) {
    config.device.counts_per_turn = value as u16;
    counts_a_tick(config, (value / 800.0).max(1.0));
}

fn counts_a_tick(config: &mut Config, value: f64) {
    config.device.limits.max_counts_per_tick = value as u16;
}

/// Level length, level cap, anchor and limit outwards.
fn paper(config: &mut Config) -> (&mut Millimetres, &mut I16F16, &mut u16, &mut Newtons) {
    match &mut config.patient.law {
        Law::Jog(FrictionLaw::Paper { level_length, level_cap, anchor_ms, limit_out, .. }) => {
            (level_length, level_cap, anchor_ms, limit_out)
        }
        law => panic!("another law: {law:?}"),
    }
}

fn sparte(config: &mut Config) -> &mut Sparte {
    match &mut config.patient.law {
        Law::Sparte(sparte) => sparte,
        law => panic!("another law: {law:?}"),
    }
}

fn table(config: &mut Config) -> &mut ForceTable {
    match &mut config.patient.law {
        Law::Xr(table) => table,
        law => panic!("another law: {law:?}"),
    }
}

fn wall(config: &mut Config) -> &mut control_core::config::Wall {
    config.patient.layers[0].wall.as_mut().expect("the skin has one")
}

/// Sets how stiffly each law holds the needle.
fn hold(config: &mut Config, value: f64) {
    let value = Stiffness(q(value));
    match &mut config.patient.law {
        Law::Jog(
            FrictionLaw::Cone { stiffness }
            | FrictionLaw::StickSlip { stiffness, .. }
            | FrictionLaw::Paper { stiffness, .. },
        ) => *stiffness = value,
        Law::Sparte(law) => law.friction.stiffness = value,
        Law::Xr(table) => table.stiffness = value,
    }
}

/// The default patient under each law of friction, and the other laws, with the ranges of each.
fn patients() -> [(&'static str, Config, &'static [&'static [Range]]); 5] {
    let jog = |law| {
        let mut config = Config::commissioned_virtual();
        config.patient.law = Law::Jog(law);
        config
    };
    let half = Stiffness(q(0.5));
    let paper = FrictionLaw::Paper {
        level_length: Millimetres(q(23.0)),
        level_cap: q(2.0),
        anchor_ms: 60,
        stiffness: half,
        limit: Newtons(q(1.0)),
        limit_out: Newtons(q(0.8)),
    };
    [
        ("cone", jog(FrictionLaw::Cone { stiffness: half }), &[]),
        ("stick-slip", jog(FrictionLaw::StickSlip { stiffness: half, sliding: q(0.5) }), &[]),
        ("paper", jog(paper), &PAPER),
        ("sparte", laws::shoulder(), &SPARTE),
        ("xr", laws::phantom(), &XR),
    ]
}

/// Moves a value of `config` to one end of its range: the values between one that is taken and one
/// that is not are halved until there are none.
fn to_end(config: &mut Config, &(name, set, ends): &Range, end: usize) {
    let [mut taken, mut refused] = ends[end];
    let with = |value| {
        let mut config = config.clone();
        set(&mut config, value);
        config
    };
    let check = |config: &Config| {
        config.plan()?;
        control_core::ceilings::Ceilings::new(100, 600).check(&config.device)
    };
    if check(&with(refused)).is_ok() {
        taken = refused;
    }
    for _ in 0..30 {
        let middle = f64::midpoint(taken, refused);
        if check(&with(middle)).is_ok() { taken = middle } else { refused = middle }
    }
    let ended = with(taken);
    assert_eq!(check(&ended), Ok(()), "{name} of {taken}");
    *config = ended;
}

/// Times in ms and depths in mm: in, as fast as no watch takes it for a motor that runs away, out
/// again, and in the end as fast as the encoder's lines can be.
fn moves(config: &Config) -> Vec<(u64, f64)> {
    let leap = f64::from(config.device.limits.travel.0) + 200.0;
    let moves =
        [(0, 0.0), (40, -2.0), (100, 7.0), (130, 7.0), (180, 21.0), (190, 21.0), (270, -2.0), (280, leap)];
    let fastest =
        f64::from(config.device.limits.max_counts_per_tick) * 10_000.0 / 6.0 / counts_per_mm(config);
    let slower = (400.0 / fastest).ceil() as u64;
    moves.map(|(ms, mm)| (slower * ms, mm)).to_vec()
}

fn counts_per_mm(config: &Config) -> f64 {
    let device = &config.device;
    f64::from(device.counts_per_turn) / (std::f64::consts::TAU * device.roller_radius.0.to_num::<f64>())
}

/// Runs `config` on a board through [`moves`] and compares each tick.
fn computes_the_same(name: &str, mut config: Config) {
    // As soon as may be: all of the force is given then.
    config.device.limits.fade_in_ms = 10;
    let (moves, per_mm) = (moves(&config), counts_per_mm(&config));
    let mut rig = Rig::zeroed(Wiring::default());
    rig.pc.configure(&mut rig.board, &config);
    // It is taken within 60 ms, and the edge timing forgets within 100 ms when that was.
    rig.pc.run_ms(&mut rig.board, 165);
    rig.pc.must(&mut rig.board, Command::Start);
    let begin: Nanos = rig.board.now();
    let end_ms = moves.last().map_or(0, |&(ms, _)| ms + 20);
    let path = moves.into_iter().map(|(ms, mm)| (begin + ms * MILLISECOND, (mm * per_mm) as i64)).collect();
    rig.board.at_stop(|stopped| stopped.set_plant(Box::new(plant::by_hand(plant::path(path)))));
    rig.pc.run_ms(&mut rig.board, end_ms);
    let (states, tripped) = agrees(&mut rig.board, &rig.pc, Some(config));
    println!("| {name} | {states:?}, {tripped:?} |");
    assert!(states[State::Approach as usize] > 100, "{name}: {states:?}");
    assert!(tripped.is_some_and(|fault| fault != Fault::HostSilent), "{name}: {tripped:?}");
}

/// Each group with its values at one end and at the other, which of them at the low one and which
/// at the high one in turns.
fn at_both_ends(of: &str, config: &Config, groups: &[&[Range]]) {
    for (group, first) in groups.iter().flat_map(|group| [(group, 0), (group, 1)]) {
        let mut config = config.clone();
        for (number, range) in group.iter().enumerate() {
            to_end(&mut config, range, (first + number) % 2);
        }
        let names: Vec<&str> = group.iter().map(|&(name, ..)| name).collect();
        computes_the_same(&format!("{of}, {}, {first}", names.join(", ")), config);
    }
}

/// Takes more than 5 s: each group of ends on a board of its own.
#[test]
fn at_the_ends_of_every_range_the_board_computes_the_same() {
    at_both_ends("device", &Config::commissioned_virtual(), &DEVICE);
    for (law, mut config, ranges) in patients() {
        config.device.speed = SpeedMethod::EdgeTiming;
        at_both_ends(law, &config, &PATIENT);
        at_both_ends(law, &config, ranges);
    }
}
