//! Forces and errors that repeat along the travel: sines of the place.

use super::{Law, Machine, Shape};
use crate::filters::{derivative, second_difference};
use numerics::golden_section::logarithmic;
use std::f64::consts::TAU;

/// The laws, each shaped by its period, rad or m.
pub(super) static LAWS: [Law; 4] = [
    Law::new("cogging", cogging_shapes, wave),
    Law::new("mass_imbalance", imbalance_shapes, wave),
    Law::new("encoder_eccentricity", eccentricity_shapes, eccentricity),
    Law::new("torque_ripple", ripple_shapes, ripple),
];

/// Highest order: 48 covers seven pole pairs times six, and twelve slots times four.
const ORDERS: usize = 48;

/// Orders of a turn that recordings can show: at least 1.5 periods, slower than the band.
fn orders(m: &Machine) -> Vec<Shape> {
    let Some(turn) = m.rig.turn else { return Vec::new() };
    let (turns, fast) = (m.scales.least_travel / turn, m.scales.fast / turn);
    let seen = |n: &usize| {
        let n = *n as f64;
        n * turns >= 1.5 && (n == 1.0 || n * fast <= 2.0 * m.scales.band_hz)
    };
    (1..=ORDERS).filter(seen).map(|n| Shape::fixed("order", turn / n as f64)).collect()
}
fn cogging_shapes(m: &Machine) -> Vec<Shape> {
    if m.rig.turn.is_some() {
        return orders(m);
    }
    let travel = m.scales.least_travel;
    let most = (4.0 * m.scales.band_hz * travel / m.scales.fast).min(60.0);
    let counts = if most > 2.0 { logarithmic(1.5, most, 36) } else { Vec::new() };
    let mut periods: Vec<f64> = counts.iter().map(|n| travel / n).collect();
    periods.reverse();
    Shape::grid("period", &periods)
}
fn imbalance_shapes(m: &Machine) -> Vec<Shape> {
    // Over a fifth of a turn, a sine bends by a tenth and differs from a spring; one recording that
    // goes so far is enough.
    let seen = m.rig.rotary && m.scales.most_travel > 0.2 * TAU;
    if seen { vec![Shape::fixed("order", TAU)] } else { Vec::new() }
}
fn wave(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    let angle = |k: usize| TAU * s.q[k] / shape.value;
    vec![s.each(|k| angle(k).sin()), s.each(|k| angle(k).cos())]
}

fn eccentricity_shapes(m: &Machine) -> Vec<Shape> {
    let turn = m.rig.turn.filter(|turn| m.rig.rotary && m.scales.least_travel > *turn);
    turn.map(|turn| Shape::fixed("order", turn)).into_iter().collect()
}
fn eccentricity(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    let damping = m.rig.viscous.map_or(0.0, |b| b.nominal) / m.rig.inertia.nominal;
    let force = |e: Vec<f64>| {
        let (first, second) = (derivative(&e, s.h), second_difference(&e, s.h));
        s.each(|k| second[k] + damping * first[k])
    };
    wave(m, i, shape).into_iter().map(force).collect()
}

fn ripple_shapes(m: &Machine) -> Vec<Shape> {
    if super::command::driven(m) { orders(m) } else { Vec::new() }
}
fn ripple(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let times = |x: Vec<f64>| x.iter().zip(&m.asked[i]).map(|(x, u)| x * u).collect();
    wave(m, i, shape).into_iter().map(times).collect()
}
