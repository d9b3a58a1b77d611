//! Values of a rig fitted by what its free run is off, rather than by force: Levenberg–Marquardt on
//! the position, first in windows that a wrong value cannot leave, then over the whole. What is
//! fitted here predicts trajectories; what it says of physics is weaker, because errors of position
//! add up.

use super::replay::Beside;
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use numerics::linear::{Factor, Square, dot};
use numerics::parallel;

/// Most iterations, and change of the sum of squares below which it is over.
const ITERATIONS: usize = 30;
const ENOUGH: f64 = 1e-4;
/// Residuals of each recording, at most.
const MOST_ROWS: usize = 4000;
/// Change of a value, as a part of its size, over which derivatives are taken, and tries of a step.
const APART: f64 = 5e-4;
const TRIES: usize = 10;

/// One value of a rig that may move.
#[derive(Debug, Clone, PartialEq)]
enum Value {
    Inertia,
    Viscous,
    Coulomb,
    Offset,
    Coefficient(usize, String),
}

fn get(rig: &Rig, value: &Value) -> f64 {
    match value {
        Value::Inertia => rig.model.inertia,
        Value::Viscous => rig.model.viscous.unwrap_or(0.0),
        Value::Coulomb => rig.model.coulomb.unwrap_or(0.0),
        Value::Offset => rig.model.offset.unwrap_or(0.0),
        Value::Coefficient(index, name) => rig.effects[*index].coefficient(name),
    }
}

fn set(rig: &mut Rig, value: &Value, x: f64) {
    match value {
        Value::Inertia => rig.model.inertia = x,
        Value::Viscous => rig.model.viscous = Some(x.max(0.0)),
        Value::Coulomb => rig.model.coulomb = Some(x.max(0.0)),
        Value::Offset => rig.model.offset = Some(x),
        Value::Coefficient(index, name) => {
            rig.effects[*index].coefficients.insert(name.clone(), x);
        }
    }
}

/// The values that move: the drive's gain is fixed, because only ratios to it show.
fn values(rig: &Rig) -> Vec<Value> {
    let mut out = vec![Value::Inertia];
    out.extend(rig.model.viscous.map(|_| Value::Viscous));
    out.extend(rig.model.coulomb.map(|_| Value::Coulomb));
    out.extend(rig.model.offset.map(|_| Value::Offset));
    for (index, effect) in rig.effects.iter().enumerate() {
        // Waves are many and hardly show in a trajectory.
        if effect.waves().is_empty() {
            out.extend(effect.coefficients.keys().map(|name| Value::Coefficient(index, name.clone())));
        }
    }
    out
}

fn residuals(rig: &Rig, besides: &[Beside], seconds: f64) -> Vec<f64> {
    let every = |beside: &Beside| beside.motion.time.len().div_ceil(MOST_ROWS).max(1);
    besides.iter().flat_map(|beside| beside.off(rig, seconds, every(beside))).collect()
}

/// Lengths of the windows of one stage after the other, s: a wrong value leads a long run so far
/// astray that nothing near is better.
const STAGES_S: [f64; 3] = [1.0, 5.0, f64::INFINITY];

/// The rig whose free run is off least on `recordings`, beginning with `rig`; its structure is
/// kept.
pub fn fit(rig: &Rig, recordings: &[Recording]) -> Rig {
    let besides: Vec<Beside> = recordings.iter().map(|r| Beside::new(r, rig)).collect();
    let force = rig.actuator.gain.abs()
        * recordings.iter().flat_map(|r| &r.command).fold(0.0_f64, |m, u| m.max(u.abs()));
    STAGES_S.into_iter().fold(rig.clone(), |rig, seconds| stage(&rig, &besides, force, seconds))
}

/// One stage: windows of `seconds`. `force` is the largest that the drive was asked for.
fn stage(rig: &Rig, besides: &[Beside], force: f64, seconds: f64) -> Rig {
    let moved = values(rig);
    // A value's natural size: its own, or that of the force next to it.
    let scale: Vec<f64> = moved
        .iter()
        .map(|value| {
            let own = get(rig, value).abs();
            if own > 0.0 { own } else { 0.02 * force.max(1e-12) }
        })
        .collect();
    let rig_at = |theta: &[f64]| {
        let mut out = rig.clone();
        for ((value, scale), theta) in moved.iter().zip(&scale).zip(theta) {
            set(&mut out, value, get(rig, value) + scale * theta);
        }
        out
    };
    let usable = |theta: &[f64]| rig_at(theta).model.inertia > 0.05 * rig.model.inertia;
    let off = |theta: &[f64]| residuals(&rig_at(theta), besides, seconds);
    let (start, at_start) = (vec![0.0; moved.len()], residuals(rig, besides, seconds));
    rig_at(&least_squares((start, at_start), &off, &usable))
}

/// Half the Hessian of the sum of squares and half its negative gradient, from derivatives by
/// differences.
fn normal_equations(
    theta: &[f64],
    at_theta: &[f64],
    off: &(dyn Fn(&[f64]) -> Vec<f64> + Sync),
) -> (Square, Vec<f64>) {
    let n = theta.len();
    let columns: Vec<Vec<f64>> = parallel::map(n, |k| {
        let mut there = theta.to_vec();
        there[k] += APART;
        off(&there).iter().zip(at_theta).map(|(a, b)| (a - b) / APART).collect()
    });
    let mut information = Square::zero(n);
    let mut score = vec![0.0; n];
    for i in 0..n {
        score[i] = -dot(&columns[i], at_theta);
        for j in 0..n {
            information.add(i, j, dot(&columns[i], &columns[j]));
        }
    }
    (information, score)
}

/// Minimises the sum of squares of residuals by Levenberg–Marquardt, from values with their
/// residuals; `off` gives the residuals of other values, of which only those that are `usable` are
/// taken.
fn least_squares(
    (mut theta, mut at_theta): (Vec<f64>, Vec<f64>),
    off: &(dyn Fn(&[f64]) -> Vec<f64> + Sync),
    usable: &dyn Fn(&[f64]) -> bool,
) -> Vec<f64> {
    let mut damping = 1e-2;
    for _ in 0..ITERATIONS {
        let (information, score) = normal_equations(&theta, &at_theta, off);
        let before = dot(&at_theta, &at_theta);
        let mut better = false;
        for _ in 0..TRIES {
            let mut damped = information.clone();
            for i in 0..theta.len() {
                damped.add(i, i, damping * information.at(i, i) + 1e-30);
            }
            let step = Factor::new(&damped).solve(&score);
            let trial: Vec<f64> = theta.iter().zip(&step).map(|(a, b)| a + b.clamp(-0.5, 0.5)).collect();
            if usable(&trial) {
                let there = off(&trial);
                if dot(&there, &there) < before {
                    (theta, at_theta) = (trial, there);
                    damping = (0.3 * damping).max(1e-9);
                    better = true;
                    break;
                }
            }
            damping *= 5.0;
        }
        if !better || before - dot(&at_theta, &at_theta) < ENOUGH * before {
            break;
        }
    }
    theta
}
