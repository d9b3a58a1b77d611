//! Laws of the drive, which act on the force that the motion asks for.

use super::motion::bristle;
use super::{Law, Machine, Shape, States};
use crate::filters::{derivative, quantile};
use crate::grid;
use numerics::linear::{Factor, Square, dot};
use numerics::spread::spread;
use std::f64::consts::TAU;

/// The laws, as maps from the force û to what has to be commanded beyond it; comments say what
/// shapes them.
pub(super) static LAWS: [Law; 7] = [
    Law::new("command_deadband", deadband_shapes, deadband), // x over the large force
    Law::new("command_saturation", clip_shapes, clip),       // L over the large force
    Law::new("supply_limit", supply_shapes, supply), // L over the large force; v over the fast speed in the form
    Law::new("command_delay", delay_shapes, delay),  // τ, s
    Law::new("electrical_lag", lag_shapes, lag),
    Law::new("gain_drift", drift_shapes, drift), // time constant over the duration
    Law::new("drive_loss", loss_shapes, loss),
];

/// Returns the force that the motion asks for: least squares of the recorded force on functions of
/// the motion, recording by recording. `periods` are those of waves that lead.
pub(crate) fn asked_by_motion(m: &Machine, periods: &[f64]) -> Vec<Vec<f64>> {
    m.states.iter().map(|s| asked(s, m, periods)).collect()
}

fn asked(s: &States, m: &Machine, periods: &[f64]) -> Vec<f64> {
    let middle = s.q.iter().sum::<f64>() / s.q.len() as f64;
    let sine = |period: f64| s.each(|k| (TAU * s.q[k] / period).sin());
    let cosine = |period: f64| s.each(|k| (TAU * s.q[k] / period).cos());
    let mut columns = vec![
        s.each(|_| 1.0),
        s.seen_a.clone(),
        s.v.clone(),
        s.direction.clone(),
        s.each(|k| s.v[k].abs()),
        s.each(|k| s.v[k] * s.v[k].abs()),
        s.each(|k| s.q[k] - middle),
        s.each(|k| (s.q[k] - middle).powi(2)),
        bristle(&s.q, 0.05 * m.scales.stroke),
    ];
    let turn = m.rig.rotary.then_some(TAU);
    for period in turn.iter().chain(periods) {
        columns.extend([sine(*period), cosine(*period)]);
    }
    columns.extend(s.load.clone());
    columns.extend(s.tilt.clone());
    let moving = |x: &[f64]| {
        x.iter().zip(&s.moving).map(|(x, w)| if *w > 0.5 { *x } else { 0.0 }).collect::<Vec<f64>>()
    };
    for column in &mut columns {
        let rms = (dot(column, column) / column.len() as f64).sqrt() + 1e-300;
        column.iter_mut().for_each(|x| *x /= rms);
    }
    let seen: Vec<Vec<f64>> = columns.iter().map(|c| moving(c)).collect();
    let mut gram = Square::zero(seen.len());
    for i in 0..seen.len() {
        for j in 0..seen.len() {
            gram.add(i, j, dot(&seen[i], &seen[j]));
        }
    }
    let trace: f64 = (0..gram.n).map(|i| gram.at(i, i)).sum();
    (0..gram.n).for_each(|i| gram.add(i, i, 1e-6 * trace / seen.len() as f64));
    let right: Vec<f64> = seen.iter().map(|c| dot(c, &s.force)).collect();
    let weights = Factor::new(&gram).solve(&right);
    s.each(|k| columns.iter().zip(&weights).map(|(c, w)| w * c[k]).sum())
}

/// The force that 98 % of the time is not reached, over the fit recordings' motion.
fn large(m: &Machine) -> f64 {
    m.scales.large_asked.max(1e-30)
}
/// True if every drive was on most of the time and was moved.
pub(super) fn driven(m: &Machine) -> bool {
    let is_used = |s: &States| {
        let used = s.force.iter().filter(|f| **f != 0.0).count();
        2 * used > s.force.len() && spread(&s.force) > 0.0
    };
    !m.asked.is_empty() && m.scales.driven && m.states.iter().all(is_used)
}
fn if_driven(m: &Machine, shapes: Vec<Shape>) -> Vec<Shape> {
    if driven(m) { shapes } else { Vec::new() }
}

fn deadband_shapes(m: &Machine) -> Vec<Shape> {
    if_driven(m, Shape::grid("", &[0.01, 0.03, 0.08, 0.2, 0.4]))
}
fn deadband(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let width = shape.value * large(m);
    vec![m.asked[i].iter().map(|u| (u / width).clamp(-1.0, 1.0)).collect()]
}

fn clip_shapes(m: &Machine) -> Vec<Shape> {
    let limits = [1.0, 1.15];
    let all =
        [Shape::grid("6", &limits), Shape::grid("12", &limits), Shape::grid("hinge", &[0.7, 0.85, 0.95])];
    if_driven(m, all.concat())
}
fn clip(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let limit = shape.value * large(m);
    let hinge = |u: &f64| u.signum() * (u.abs() - limit).max(0.0);
    // Beyond 97 % of the limit the inverse map runs away: the force is not known so well.
    let inverse = |u: &f64, p: i32| {
        let part = (u.abs() / limit).min(0.97);
        u * ((1.0 - part.powi(p)).powf(-1.0 / f64::from(p)) - 1.0)
    };
    let beyond = |u: &f64| match shape.form {
        "hinge" => hinge(u),
        "6" => inverse(u, 6),
        _ => inverse(u, 12),
    };
    vec![m.asked[i].iter().map(beyond).collect()]
}

/// Speeds without load over the fast speed: beyond twice that, the limit hardly falls.
const NO_LOAD: [(&str, f64); 3] = [("1.1", 1.1), ("1.4", 1.4), ("2", 2.0)];

fn supply_shapes(m: &Machine) -> Vec<Shape> {
    let limits = |(form, _): &(&'static str, f64)| Shape::grid(form, &[0.6, 0.85, 1.2, 1.7]);
    if_driven(m, NO_LOAD.iter().flat_map(limits).collect())
}
fn supply(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let (s, u) = (&m.states[i], &m.asked[i]);
    let speed = NO_LOAD.iter().find(|one| one.0 == shape.form).map_or(1.0, |one| one.1) * m.scales.fast;
    let limit = |k: usize| shape.value * large(m) * (1.0 - s.v[k] * u[k].signum() / speed);
    vec![s.each(|k| u[k].signum() * (u[k].abs() - limit(k)).max(0.0))]
}

fn delay_shapes(m: &Machine) -> Vec<Shape> {
    // From a five-hundredth to nearly half a period of the band, beyond which a delay has no sign.
    let (least, most) = (2e-3 / m.scales.band_hz, 0.4 / m.scales.band_hz);
    if_driven(m, Shape::grid("", &numerics::golden_section::logarithmic(least, most, 8)))
}
fn delay(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let (s, u) = (&m.states[i], &m.asked[i]);
    let later: Vec<f64> = s.t.iter().map(|t| t + shape.value).collect();
    let moved = grid::linear(&s.t, u, &later);
    vec![s.each(|k| (moved[k] - u[k]) / shape.value)]
}
fn lag_shapes(m: &Machine) -> Vec<Shape> {
    if_driven(m, vec![Shape::fixed("", 0.0)])
}
fn lag(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    vec![derivative(&m.asked[i], m.states[i].h)]
}

/// A loss in proportion to the force that the motion asks for, as a gear has.
fn loss_shapes(m: &Machine) -> Vec<Shape> {
    if_driven(m, vec![Shape::fixed("", 0.0)])
}
fn loss(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    let (s, u) = (&m.states[i], &m.asked[i]);
    vec![s.each(|k| u[k].abs() * s.direction[k])]
}

fn drift_shapes(m: &Machine) -> Vec<Shape> {
    let times = [0.1, 0.25, 0.7];
    if_driven(m, [Shape::grid("time", &times), Shape::grid("heat", &times)].concat())
}
fn drift(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let (s, u) = (&m.states[i], &m.asked[i]);
    let time = shape.value * m.scales.seconds;
    if shape.form == "time" {
        return vec![s.each(|k| u[k] * (1.0 - (-s.t[k] / time).exp()))];
    }
    // A first-order heat of the power over its mean, which bursts exceed twentyfold at most.
    let (mean, keep) = (dot(u, u) / u.len() as f64 + 1e-300, (-s.h / time).exp());
    let mut heat = 0.0;
    let next = |u: &f64| {
        let last = heat;
        heat = keep * heat + (1.0 - keep) * (u * u / mean).min(20.0);
        u * 0.5 * (last + heat)
    };
    vec![u.iter().map(next).collect()]
}

/// Sets the scale of the force asked for, from the fit recordings alone.
pub(crate) fn large_of(asked: &[Vec<f64>], fit: usize) -> f64 {
    quantile(asked.iter().take(fit).flatten().map(|u| u.abs()), 0.98)
}
