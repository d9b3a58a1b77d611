//! The exactness of concealing, judged by the generator's integrator: a machine without the effect
//! makes a recording; the effect is concealed in it; then a machine that *has* the effect in its
//! equations is driven with the concealed command and has to move as recorded. The laws that move
//! it are the generator's own.

use super::banded_recording::State;
use super::conceal::{Changed, Concealed, conceal};
use super::rig_file::RigFile;
use super::shapes::{Along, HiddenLaw, Wave};
use crate::dynamics::recording::Recording;
use crate::generator::drive::{Drive, Segment, Tones};
use crate::generator::plant::{
    Deadband, DeadbandKind, Drift, DriftLaw, Dry, Harmonic, Plant, Shape, Stribeck, StribeckLaw, Train,
};
use crate::generator::series::Series;
use crate::generator::simulate::{Believed, Row, Run, STEP, simulate};
use crate::rng::Rng;
use crate::signal::rms;
use std::cell::Cell;

const COUNTS: f64 = 1e6;
const ROW_S: f64 = 2e-3;
const ROWS: usize = 1500;
const INERTIA: f64 = 0.02;
const GAIN: f64 = 0.5;

fn plant() -> Plant {
    Plant {
        inertia: INERTIA,
        viscous: 0.05,
        viscous_asymmetry: 0.0,
        dry: Dry { coulomb: 0.1, ..Dry::default() },
        gain: GAIN,
        offset: 0.0,
        weight: 0.0,
        turn: std::f64::consts::TAU,
        delay: 0.0,
        lag: 0.0,
        deadband: None,
        clip: None,
        gain_drift: None,
        ripple: Vec::new(),
        cogging: Vec::new(),
        imbalance: None,
        spring: None,
        damping_profile: None,
        drag: 0.0,
        train: Train::Rigid,
        eccentricity: None,
        lost: None,
        counts_per_unit: COUNTS,
        foreign: Vec::new(),
    }
}

/// Plays commands, row by row, in open loop.
fn play(plant: &Plant, commands: &[f64]) -> Vec<Row> {
    let times: Vec<f64> = (0..commands.len()).map(|i| i as f64 * ROW_S).collect();
    // Each level begins half a row before its stamp, so that rounding cannot take the one before.
    let levels = commands.iter().enumerate().map(|(i, u)| (*u, if i == 0 { 0.5 } else { 1.0 } * ROW_S));
    let drive = Drive { levels: levels.collect(), ramps: false, tones: Tones::default(), profile: None };
    let run = Run {
        times,
        segments: vec![Segment { from: 0.0, length: 1e9, drive, control: None }],
        return_speed: 1.0,
        limit: 1e6,
        command_step: 1e-9,
        tilt: Series::default(),
        force: Series::default(),
        disturbance: Series::default(),
        offset: 0.0,
        start: 0.0,
        zero_counts: 0.5,
        noise_counts: 0.0,
        warm: 0.0,
        speed_bound: 1e6,
        random: Rng::new(1),
    };
    let believed =
        Believed { inertia: INERTIA, viscous: 0.05, coulomb: 0.1, gain: GAIN, offset: 0.0, weight: 0.0 };
    simulate(plant, &believed, &run, STEP).expect("the axis is damped")
}

fn recording(rows: &[Row]) -> Recording {
    let column = |f: fn(&Row) -> f64| rows.iter().map(f).collect::<Vec<f64>>();
    Recording {
        time: column(|r| r.time),
        command: column(|r| r.command),
        counts: column(|r| r.counts),
        tilt: column(|r| r.tilt),
        force: column(|r| r.force),
    }
}

struct Checked {
    /// Rms of the way off: with the effect in the plant, and without it.
    with: f64,
    without: f64,
}

/// Conceals the law in a recording of the plain plant and drives `other`, which has it.
fn check(law: HiddenLaw, size: f64, fast: f64, other: &dyn Fn(&mut Plant)) -> Checked {
    check_with(law, size, fast, &|plant, _| other(plant))
}

/// The same, for a plant that depends on the recorded motion.
fn check_with(law: HiddenLaw, size: f64, fast: f64, other: &dyn Fn(&mut Plant, &State)) -> Checked {
    let commands: Vec<f64> = (0..ROWS)
        .map(|i| {
            // At rest until a kick that no friction withstands: what a delay takes is nothing, and
            // no rest is left slowly.
            let t = (i as f64 - 20.0) * ROW_S;
            if t < 0.0 {
                0.0
            } else {
                1.2 * (4.0 * t).sin() + 0.5 * (11.0 * t + 0.4).sin() + 0.3 + 1.5 * (-8.0 * t).exp()
            }
        })
        .collect();
    let original = recording(&play(&plant(), &commands));
    let text = "kind = \"rotary\"\n[model]\ninertia = 0.02\nviscous = 0.05\ncoulomb = 0.1\n[actuator]\ngain = 0.5\n\
        [encoder]\ncounts_per_unit = 1e6\nabsolute = true\n";
    let rig = RigFile::parse(text).unwrap();
    let state = State::of(&original, &rig);
    let strongest = commands.iter().fold(0.0_f64, |m, u| m.max(u.abs()));
    let effect = Concealed { law, size, fast, travel: state.travel(), strongest, seed: 3 };
    let changed = conceal(&effect, &original, &state, &rig, 0);
    let away = |plant: &Plant| off(&original, &changed, &recording(&play(plant, &changed.command)));
    let mut has = plant();
    other(&mut has, &state);
    Checked { with: away(&has), without: away(&plant()) }
}

/// Rms of the difference between what is written and what the played machine reads, rad.
fn off(original: &Recording, changed: &Changed, played: &Recording) -> f64 {
    assert_eq!(original.time, played.time);
    let difference: Vec<f64> =
        changed.counts.iter().zip(&played.counts).map(|(a, b)| (a - b) / COUNTS).collect();
    rms(&difference)
}

fn assert_exact(name: &str, c: &Checked, part: f64) {
    assert!(
        c.with < part * c.without,
        "{name}: {:.2e} rad off, {:.2e} without the effect",
        c.with,
        c.without
    );
}

#[test]
fn forces_are_concealed_as_a_plant_with_them_moves() {
    let drag = check(HiddenLaw::Drag(2.0), 0.4, 4.0, &|p| p.drag = 0.4 / 16.0);
    assert_exact("drag", &drag, 0.02);
    let wave = Wave { order: 3.0, amplitude: 1.0, phase: 0.3 };
    let cogging = check(HiddenLaw::Cogging(vec![wave]), 0.08, 4.0, &|p| {
        p.cogging = vec![Harmonic { order: 3.0, amplitude: 0.08 * 2_f64.sqrt(), phase: 0.3 }];
    });
    assert_exact("cogging", &cogging, 0.05);
    let law = StribeckLaw::Exponential(1.5);
    let stribeck = check(HiddenLaw::Stribeck { speed: 0.8, power: 1.5 }, 0.15, 4.0, &|p| {
        p.dry.stribeck = Some(Stribeck { peak: 0.15, speed: 0.8, law });
    });
    assert_exact("stribeck", &stribeck, 0.1);
}

#[test]
fn frictions_are_concealed_as_a_plant_with_them_moves() {
    let viscous = check(HiddenLaw::Viscous, 0.1, 4.0, &|p| p.viscous += 0.1 / 4.0);
    assert_exact("viscous", &viscous, 0.02);
    let dry = check(HiddenLaw::Coulomb, 0.05, 4.0, &|p| p.dry.coulomb += 0.05);
    assert_exact("dry", &dry, 0.1);
    let one_way = check(HiddenLaw::OneWay(1.0), 0.1, 4.0, &|p| {
        // The same in both directions and an asymmetry that takes it off backward.
        let more = 0.5 * 0.1 / 4.0;
        p.viscous_asymmetry = more / (p.viscous + more);
        p.viscous += more;
    });
    assert_exact("one way", &one_way, 0.02);
    let ramp = Along { from: -1.0, to: 2.0, smooth: false };
    let shape = Shape::Ramp { from: -1.0, to: 2.0 };
    let along = check(HiddenLaw::FrictionAlong(ramp), 0.08, 4.0, &|p| p.dry.profile = Some((0.08, shape)));
    assert_exact("friction along the travel", &along, 0.1);
    let damping = check(HiddenLaw::DampingAlong(ramp), 0.1, 4.0, &|p| {
        p.damping_profile = Some((0.1 / 4.0, shape));
    });
    assert_exact("damping along the travel", &damping, 0.02);
    let cold = check(HiddenLaw::WarmingUp(1.5), 0.08, 4.0, &|p| {
        let start = p.dry.coulomb + 0.08;
        p.dry.warm = Some(Drift { change: -0.08 / start, time_constant: 1.5, law: DriftLaw::Exponential });
        p.dry.coulomb = start;
    });
    assert_exact("warming up", &cold, 0.1);
}

#[test]
fn springs_and_weights_are_concealed_as_a_plant_with_them_moves() {
    let travel = Cell::new(0.0);
    let spring = check_with(HiddenLaw::Spring(0.0), 0.1, 4.0, &|p, state| {
        travel.set(state.travel());
        p.spring = Some((0.1 / (0.5 * state.travel()), 0.0, 0.0));
    });
    assert!(travel.get() > 0.5, "{} rad of travel", travel.get());
    assert_exact("spring", &spring, 0.02);
    let weight = check(HiddenLaw::Imbalance, 0.1, 4.0, &|p| p.imbalance = Some((0.1, 0.0)));
    assert_exact("imbalance", &weight, 0.05);
}

#[test]
fn an_eccentric_encoder_is_concealed_as_a_plant_with_one_reads() {
    let read = check(HiddenLaw::Eccentric, 0.02, 4.0, &|p| p.eccentricity = Some((0.02, 0.0)));
    assert_exact("eccentric", &read, 0.02);
}

#[test]
fn maps_of_the_command_are_inverted_as_a_plant_with_them_moves() {
    let deadband = check(HiddenLaw::Deadband(0.0), 0.2, 4.0, &|p| {
        p.deadband = Some(Deadband { half_width: 0.2, kind: DeadbandKind::Offset });
    });
    assert_exact("deadband", &deadband, 0.02);
    let heating = check(HiddenLaw::Heating { seconds: 1.0, by_current: false }, 0.2, 4.0, &|p| {
        p.gain_drift = Some(Drift { change: -0.2, time_constant: 1.0, law: DriftLaw::Exponential });
    });
    assert_exact("heating", &heating, 0.02);
    let wave = Wave { order: 2.0, amplitude: 1.0, phase: 1.0 };
    let ripple = check(HiddenLaw::Ripple(vec![wave]), 0.1, 4.0, &|p| {
        p.ripple = vec![Harmonic { order: 2.0, amplitude: 0.1 * 2_f64.sqrt(), phase: 1.0 }];
    });
    assert_exact("ripple", &ripple, 0.05);
    assert_exact("delay", &check(HiddenLaw::Delay, 3.0, 4.0, &|p| p.delay = 3.0 * ROW_S), 0.1);
    assert_exact("lag", &check(HiddenLaw::Lag, 0.01, 4.0, &|p| p.lag = 0.01), 0.1);
}
