//! A drive that holds its axis between moves: a fine encoder counts the jitter there, and what
//! friction does is a reaction.

use crate::axis::{diagnosed, names, rig};
use diagnosis::Outcome;
use diagnosis::laws::EffectName as N;
use diagnosis::recording::Recording;
use std::f64::consts::{PI, TAU};

const RATE: f64 = 250.0;
const INERTIA: f64 = 2.0;
const VISCOUS: f64 = 8.0;
const COULOMB: f64 = 3.0;
const COUNTS: f64 = 1e6;
/// Frequency of a frame that swings, Hz, and how far the axis follows it, rad.
const FRAME: (f64, f64) = (9.0, 2e-5);
/// Seconds that a move and the hold after it take.
const TURN_S: f64 = 2.0;

/// Place, speed and acceleration of moves to and fro over `far`, each a second long and followed by
/// a second's hold.
fn moves(t: f64, far: f64) -> [f64; 3] {
    let within = (t % TURN_S).min(1.0);
    let back = (t / TURN_S) as u32 % 2 == 1;
    let (sign, from) = if back { (-1.0, far) } else { (1.0, 0.0) };
    let place = within - (TAU * within).sin() / TAU;
    let speed = 1.0 - (TAU * within).cos();
    let bend = TAU * (TAU * within).sin();
    [from + sign * far * place, sign * far * speed, sign * far * bend]
}

/// A recording of 16 s by the equation of motion, with friction that falls from `peak` N·m more as
/// speed rises from zero. The command holds what the last move left of the friction.
fn recorded(seed: u64, peak: f64) -> Recording {
    let far = 0.4 + 0.15 * seed as f64;
    let mut out = Recording { file: format!("{seed}.csv"), ..Recording::default() };
    for row in 0..(16.0 * RATE) as u32 {
        let middle = (f64::from(row) + 0.5) / RATE;
        let [_, speed, bend] = moves(middle, far);
        let way = if (middle / TURN_S) as u32 % 2 == 1 { -1.0 } else { 1.0 };
        let swing = TAU * FRAME.0;
        let jitter = |t: f64| FRAME.1 * (swing * t + seed as f64).sin();
        let friction = match speed == 0.0 || middle % TURN_S > 1.0 {
            true => 0.6 * COULOMB * way,
            false => VISCOUS * speed + way * (COULOMB + peak * (-(speed.abs() / (0.05 * far)).powi(2)).exp()),
        };
        let frame = 0.5 * (2.9 * middle * PI + seed as f64).sin();
        let t = f64::from(row) / RATE;
        out.time_s.push(t);
        out.command.push(INERTIA * (bend - swing * swing * jitter(middle)) + friction + frame);
        out.position_counts.push(((moves(t, far)[0] + jitter(t)) * COUNTS).round());
    }
    out
}

fn said(peak: f64) -> Outcome {
    let model = format!("inertia = {INERTIA}\nviscous = {VISCOUS}\ncoulomb = {COULOMB}");
    let rig = rig(&model, "", "", COUNTS);
    diagnosed(&rig, &[recorded(1, peak), recorded(2, peak)], &[recorded(3, peak)])
}

#[test]
fn friction_at_the_start_of_moves_shows_despite_holds() {
    let outcome = said(6.0);
    assert!(names(&outcome).contains(&N::StribeckFriction), "{}", outcome.report.sentence);
    let peak = outcome.report.effects[0].parameters["peak"].value;
    assert!((4.5..7.5).contains(&peak), "{peak}");
}

#[test]
fn a_hold_between_moves_is_no_effect() {
    let outcome = said(0.0);
    assert!(names(&outcome).is_empty(), "{}", outcome.report.sentence);
}
