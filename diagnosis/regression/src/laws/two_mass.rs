//! A load that follows the motor through a spring, a gap or a grip.

use super::{Law, Machine, Shape, States};
use numerics::golden_section::logarithmic;
use std::f64::consts::TAU;

/// The laws; each column is the load's acceleration less the motor's, for the load's inertia.
/// Comments say what shapes them.
pub(super) static LAWS: [Law; 3] = [
    Law::new("drive_compliance", spring_shapes, spring), // antiresonance, Hz
    Law::new("backlash", gap_shapes, gap),               // gap, rad or m
    Law::new("roller_slip", slip_shapes, slip),          // largest acceleration of the load over the hard one
];

/// Moves a load through a recording; `push` gives its acceleration from its place and speed beside
/// the motor's, and `brake` the largest that its own dry friction takes.
fn follow(s: &States, fastest: f64, brake: f64, push: impl Fn(f64, f64, f64) -> f64) -> Vec<f64> {
    // Steps of at most a fifth of the contact's own period over 2π.
    let steps = (fastest * s.h / 0.2).ceil().max(1.0) as usize;
    let h = s.h / steps as f64;
    let (mut x, mut u) = (s.q[0], s.v[0]);
    let mut between_points = |k: usize| {
        let next = (k + 1).min(s.q.len() - 1);
        let mut sum = 0.0;
        for part in 0..steps {
            let f = (part as f64 + 0.5) / steps as f64;
            let between = |y: &[f64]| y[k] + (y[next] - y[k]) * f;
            let a = push(between(&s.q) - x, between(&s.v) - u, h);
            u += a * h;
            u -= u.clamp(-brake * h, brake * h);
            x += u * h;
            sum += a;
        }
        sum / steps as f64
    };
    // The mean about a point; that of the interval after it would come half a step early.
    let mut last = 0.0;
    let mut about = |k: usize| {
        let next = between_points(k);
        let mean = 0.5 * (std::mem::replace(&mut last, next) + next);
        mean - s.a[k]
    };
    (0..s.q.len()).map(&mut about).collect()
}

/// A load that could let go of an axis that nothing drives would explain all of its force.
fn if_driven(m: &Machine, shapes: Vec<Shape>) -> Vec<Shape> {
    if m.scales.driven { shapes } else { Vec::new() }
}

fn spring_shapes(m: &Machine) -> Vec<Shape> {
    let (low, high) = (m.scales.lowest_hz.max(2.0), (2.5 * m.scales.band_hz).min(0.2 * m.scales.rate_hz));
    if_driven(m, Shape::grid("", &logarithmic(low, high, 5)))
}
fn spring(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    const DAMPING: f64 = 0.06;
    let w = TAU * shape.value;
    vec![follow(&m.states[i], w, 0.0, |x, v, _| w * w * x + 2.0 * DAMPING * w * v)]
}

fn gap_shapes(m: &Machine) -> Vec<Shape> {
    let (low, high) = ((7.0 * m.scales.noise).max(2e-4 * m.scales.short_stroke), 0.1 * m.scales.short_stroke);
    if_driven(m, Shape::grid("", &logarithmic(low, high, 4)))
}
fn gap(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    const DAMPING: f64 = 0.3;
    // Stiff beside the band, slow beside the grid.
    let w = TAU * (0.12 * m.scales.rate_hz).min(4.0 * m.scales.band_hz);
    let half = 0.5 * shape.value;
    let push = |x: f64, v: f64, _: f64| {
        let into = x - x.clamp(-half, half);
        let a = w * w * into + 2.0 * DAMPING * w * v;
        // A contact pushes and never pulls.
        if into * a > 0.0 { a } else { 0.0 }
    };
    // Friction of the load itself: a few parts of a hundred of what it takes to move it.
    vec![follow(&m.states[i], w, 0.06 * m.scales.hard, push)]
}

fn slip_shapes(m: &Machine) -> Vec<Shape> {
    if_driven(m, Shape::grid("", &[0.12, 0.25, 0.5]))
}
fn slip(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let most = shape.value * m.scales.hard;
    vec![follow(&m.states[i], 0.8 / m.states[i].h, 0.0, |_, v, h| (v / h).clamp(-most, most))]
}
