//! At the ends of every range that a configuration may have, the board computes what control-core
//! computes. The image is built without overflow checks and the host with them, down to those of
//! `fixed`: a number that overflows is another one on the board, and a panic here.

use control_core::Config;
use control_core::config::{FrictionLaw, Law, SpeedMethod};
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

const DEVICE: [Range; 17] = [
    ("roller radius", |c, v| c.device.roller_radius.0 = q(v), [[10.0, 3.0], [10.0, 30.0]]),
    ("counts a turn", |c, v| c.device.counts_per_turn = v as u16, [[4_000.0, 0.0], [4_000.0, 65_535.0]]),
    ("full scale", |c, v| c.device.full_scale_torque.0 = q(v), [[100.0, 1.0], [100.0, 600.0]]),
    ("torque", |c, v| c.device.limits.torque.0 = q(v), [[20.0, 0.0], [20.0, 600.0]]),
    ("continuous torque", |c, v| c.device.limits.continuous_torque.0 = q(v), [[9.0, 0.0], [9.0, 600.0]]),
    ("slew", |c, v| c.device.limits.slew_per_tick.0 = q(v), [[1.0, 0.0], [1.0, 600.0]]),
    ("damping", |c, v| c.device.damping = Damping(I8F24::from_num(v)), [[0.0, -0.1], [0.0, 0.1]]),
    ("passivity", |c, v| c.device.passivity_damping = Damping(I8F24::from_num(v)), [[0.0, -0.1], [0.0, 0.1]]),
    ("skin tilt", |c, v| c.device.skin_tilt.0 = v as i16, [[0.0, -3_000.0], [0.0, 3_000.0]]),
    ("converter's zero", |c, v| c.device.dac_zero = v as i16, [[0.0, -999.0], [0.0, 999.0]]),
    ("dry friction", |c, v| c.device.mechanism.dry_friction.0 = q(v), [[0.06, -1.0], [0.06, 20.0]]),
    ("moving mass", |c, v| c.device.mechanism.mass.0 = q(v), [[30.0, 0.0], [30.0, 2_000.0]]),
    ("delay", |c, v| c.device.mechanism.delay_us = v as u16, [[100.0, 0.0], [100.0, 2_000.0]]),
    ("stiffness", |c, v| c.device.limits.stiffness.0 = q(v), [[2.0, 0.0], [2.0, 99.0]]),
    ("winding time", |c, v| c.device.limits.winding_time_s = v as u16, [[30.0, 0.0], [30.0, 9_999.0]]),
    ("counts a tick", |c, v| c.device.limits.max_counts_per_tick = v as u16, [[5.0, 0.0], [5.0, 9_999.0]]),
    ("travel", |c, v| c.device.limits.travel.0 = q(v), [[60.0, 0.0], [60.0, 900.0]]),
];

const PATIENT: [Range; 6] = [
    ("scale", |c, v| c.patient.scale = q(v), [[0.6, 0.0], [0.6, 2.0]]),
    ("largest force", |c, v| c.patient.largest_force = Some(Newtons(q(v))), [[1.0, 0.0], [1.0, 99.0]]),
    ("friction of a layer", |c, v| c.patient.layers[0].friction.0 = q(v), [[0.02, -1.0], [0.02, 9.0]]),
    ("travel of a wall", |c, v| wall(c).puncture_travel.0 = q(v), [[3.0, 0.0], [3.0, 40.0]]),
    ("unloading", |c, v| wall(c).unload = Stiffness(q(v)), [[0.5, 0.0], [0.5, 99.0]]),
    ("hold", hold, [[0.5, 0.0], [0.5, 99.0]]),
];

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

/// The default patient under each law of friction, and the other laws.
fn patients() -> Vec<(&'static str, Config)> {
    let jog = |law| {
        let mut config = Config::commissioned_virtual();
        config.patient.law = Law::Jog(law);
        config
    };
    let half = Stiffness(q(0.5));
    vec![
        ("cone", jog(FrictionLaw::Cone { stiffness: half })),
        ("stick-slip", jog(FrictionLaw::StickSlip { stiffness: half, sliding: q(0.5) })),
        (
            "paper",
            jog(FrictionLaw::Paper {
                level_length: Millimetres(q(23.0)),
                level_cap: q(2.0),
                anchor_ms: 60,
                stiffness: half,
                limit: Newtons(q(1.0)),
                limit_out: Newtons(q(0.8)),
            }),
        ),
        ("sparte", laws::shoulder()),
        ("xr", laws::phantom()),
    ]
}

/// The configuration that is taken with the value nearest to the one that is not: both are halved
/// until there is nothing between them.
fn at_end(config: &Config, set: fn(&mut Config, f64), [mut taken, mut refused]: [f64; 2]) -> Config {
    let with = |value| {
        let mut config = config.clone();
        set(&mut config, value);
        config
    };
    let is_taken = |config: &Config| {
        config.plan().is_ok() && control_core::ceilings::Ceilings::new(100, 600).check(&config.device).is_ok()
    };
    if is_taken(&with(refused)) {
        return with(refused);
    }
    for _ in 0..40 {
        let middle = f64::midpoint(taken, refused);
        if is_taken(&with(middle)) { taken = middle } else { refused = middle }
    }
    let end = with(taken);
    assert!(is_taken(&end), "{taken} is taken");
    end
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
    rig.pc.run_ms(&mut rig.board, 60);
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

/// Takes more than 5 s: each end on a board of its own.
#[test]
fn at_the_ends_of_every_range_the_board_computes_the_same() {
    let default = Config::commissioned_virtual();
    for (name, set, ends) in DEVICE {
        for end in ends {
            computes_the_same(name, at_end(&default, set, end));
        }
    }
    for (law, mut config) in patients() {
        config.device.speed = SpeedMethod::EdgeTiming;
        for (name, set, ends) in PATIENT {
            for end in ends {
                computes_the_same(&format!("{law}, {name}"), at_end(&config, set, end));
            }
        }
    }
}
