//! Laws of friction, drag, springs and readings that rest on the motion alone.

use super::{Law, Machine, Shape};
use numerics::spread::spread;

/// The laws; comments say what shapes them.
pub(super) static LAWS: [Law; 13] = [
    Law::new("viscous_friction", viscous_shapes, viscous),
    Law::new("coulomb_friction", coulomb_shapes, coulomb),
    Law::new("asymmetric_friction", asymmetric_shapes, asymmetric),
    Law::new("quadratic_drag", always, quadratic),
    Law::new("stribeck_friction", stribeck_shapes, stribeck), // v over the fast speed; δ is 1 or 2
    Law::new("presliding_friction", presliding_shapes, presliding), // x over the stroke
    Law::new("friction_drift", drift_shapes, drift),          // τ over the duration
    Law::new("load_dependent_friction", load_shapes, load_friction),
    Law::new("position_spring", spring_shapes, spring), // the side
    Law::new("position_dependent_friction", place_shapes, place_friction), // place of a step, in half travels
    Law::new("position_dependent_damping", place_shapes, place_damping), // place of a step, in half travels
    Law::new("tilt_gravity", tilt_shapes, tilt),
    Law::new("missed_counts", missed_shapes, missed),
];

fn always(_: &Machine) -> Vec<Shape> {
    vec![Shape::fixed("", 0.0)]
}
fn only_if(allowed: bool, form: &'static str) -> Vec<Shape> {
    if allowed { vec![Shape::fixed(form, 0.0)] } else { Vec::new() }
}

fn viscous_shapes(m: &Machine) -> Vec<Shape> {
    only_if(m.rig.viscous.is_none(), "")
}
fn viscous(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    vec![m.states[i].v.clone()]
}
fn coulomb_shapes(m: &Machine) -> Vec<Shape> {
    only_if(m.rig.coulomb.is_none(), "")
}
fn coulomb(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    vec![m.states[i].direction.clone()]
}

/// The form "dry" is a constant: it is compared with a model without offsets, by the regression.
fn asymmetric_shapes(m: &Machine) -> Vec<Shape> {
    let mut shapes = only_if(true, "viscous");
    // Motion in one direction cannot tell it from symmetric friction.
    let both_ways = |s: &super::States| {
        let sum = s.direction.iter().sum::<f64>().abs();
        sum < 0.6 * s.direction.iter().map(|d| d.abs()).sum::<f64>()
    };
    if !m.rig.has_offset && m.states.iter().all(both_ways) {
        shapes.extend([Shape::fixed(DRY_FORM, 0.0), Shape::fixed("both", 0.0)]);
    }
    shapes
}
/// The form of asymmetric friction that is a constant while the axis moves.
pub(crate) const DRY_FORM: &str = "dry";
fn asymmetric(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    let viscous = s.each(|k| s.v[k].abs());
    match shape.form {
        "viscous" => vec![viscous],
        "both" => vec![viscous, s.each(|_| 1.0)],
        _ => vec![s.each(|_| 1.0)],
    }
}

fn quadratic(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    vec![s.each(|k| s.v[k] * s.v[k].abs())]
}

fn stribeck_shapes(_: &Machine) -> Vec<Shape> {
    let speeds = [0.015, 0.03, 0.06, 0.11, 0.2];
    [Shape::grid("1", &speeds), Shape::grid("2", &speeds)].concat()
}
fn stribeck(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    let speed = shape.value * m.scales.fast;
    let power = if shape.form == "2" { 2 } else { 1 };
    vec![s.each(|k| s.direction[k] * (-(s.v[k].abs() / speed).powi(power)).exp())]
}

fn presliding_shapes(_: &Machine) -> Vec<Shape> {
    let lengths = [0.004, 0.015, 0.05, 0.15];
    [Shape::grid("bristle", &lengths), Shape::grid("slips", &lengths)].concat()
}
fn presliding(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    let length = shape.value * m.scales.stroke;
    let z = if shape.form == "bristle" { bristle(&s.q, length) } else { slips(&s.q, length) };
    vec![s.each(|k| z[k] - s.direction[k])]
}
/// Dahl's bristle, dz = dq/x − |dq|·z/x, exact for straight pieces of travel.
pub(super) fn bristle(q: &[f64], length: f64) -> Vec<f64> {
    let mut z = 0.0;
    let mut last = q[0];
    let next = |q: &f64| {
        let d = q - last;
        last = *q;
        if d != 0.0 {
            z = d.signum() + (z - d.signum()) * (-d.abs() / length).exp();
        }
        z
    };
    q.iter().map(next).collect()
}
/// Eight elastic elements that slip at travels spread over a decade about `length`.
fn slips(q: &[f64], length: f64) -> Vec<f64> {
    const ELEMENTS: usize = 8;
    let limit: Vec<f64> = (0..ELEMENTS).map(|k| length * 10_f64.powf(k as f64 / 7.0 - 0.5)).collect();
    let mut stretch = [0.0; ELEMENTS];
    let mut last = q[0];
    let next = |q: &f64| {
        let d = q - last;
        last = *q;
        let all = stretch.iter_mut().zip(&limit);
        let sum: f64 = all
            .map(|(s, l)| {
                *s = (*s + d).clamp(-l, *l);
                *s / l
            })
            .sum();
        sum / ELEMENTS as f64
    };
    q.iter().map(next).collect()
}

fn drift_shapes(_: &Machine) -> Vec<Shape> {
    let mut shapes = Shape::grid("decay", &[0.08, 0.17, 0.4]);
    shapes.push(Shape::fixed("line", 0.0));
    shapes
}
fn drift(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    let time = |k: usize| s.t[k] / m.scales.seconds;
    let line = shape.form == "line";
    vec![s.each(|k| s.direction[k] * if line { time(k) - 0.5 } else { (-time(k) / shape.value).exp() })]
}

fn load_shapes(m: &Machine) -> Vec<Shape> {
    only_if(m.states.iter().all(|s| s.load.as_ref().is_some_and(|l| spread(l) > 0.0)), "")
}
fn load_friction(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    let load = s.load.as_deref().unwrap_or(&[]);
    vec![s.each(|k| s.direction[k] * load[k].abs())]
}

/// True if a place means the same in every recording.
fn has_places(m: &Machine) -> bool {
    m.rig.absolute || m.rig.start_spread.is_some()
}
/// The travel from the middle in half travels; beyond the fit's travel it is held.
fn place(m: &Machine, i: usize) -> Vec<f64> {
    let s = &m.states[i];
    s.each(|k| ((s.q[k] - m.scales.middle) / m.scales.half_travel).clamp(-1.3, 1.3))
}
fn spring_shapes(m: &Machine) -> Vec<Shape> {
    let mut shapes = vec![Shape::fixed("straight", 0.0)];
    if has_places(m) {
        shapes.push(Shape::fixed("cubic", 0.0));
        shapes.extend([1.0, -1.0].map(|side| Shape::fixed("one side", side)));
    }
    shapes
}
fn spring(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let x = place(m, i);
    match shape.form {
        "straight" => vec![m.states[i].each(|k| m.states[i].q[k] / m.scales.half_travel)],
        "cubic" => vec![x.clone(), x.iter().map(|x| x.powi(3)).collect()],
        // Pulls back on its side.
        _ => vec![x.iter().map(|x| shape.value * (shape.value * x).max(0.0)).collect()],
    }
}

fn place_shapes(m: &Machine) -> Vec<Shape> {
    if !has_places(m) {
        return Vec::new();
    }
    let mut shapes =
        vec![Shape::fixed("ramp", 0.0), Shape::fixed("parabola", 0.0), Shape::fixed("four", 0.0)];
    shapes.extend([-0.4, 0.4].map(|at| Shape::fixed("step", at)));
    shapes
}
fn over_places(m: &Machine, i: usize, shape: &Shape, base: &[f64]) -> Vec<Vec<f64>> {
    let x = place(m, i);
    let times = |g: &dyn Fn(f64) -> f64| x.iter().zip(base).map(|(x, b)| b * g(*x)).collect::<Vec<f64>>();
    match shape.form {
        "ramp" => vec![times(&|x| x)],
        "parabola" => vec![times(&|x| x), times(&|x| x * x)],
        "step" => vec![times(&|x| ((x - shape.value) / 0.25).tanh())],
        // Chebyshev's polynomials.
        _ => (1..=5).map(|n| times(&|x| (f64::from(n) * x.clamp(-1.0, 1.0).acos()).cos())).collect(),
    }
}
fn place_friction(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    over_places(m, i, shape, &m.states[i].direction)
}
fn place_damping(m: &Machine, i: usize, shape: &Shape) -> Vec<Vec<f64>> {
    let s = &m.states[i];
    over_places(m, i, shape, &s.each(|k| s.v[k] / m.scales.fast))
}

fn tilt_shapes(m: &Machine) -> Vec<Shape> {
    let tilts = |tilt: &Vec<f64>| spread(tilt) > 0.03;
    only_if(m.rig.weight.is_none() && m.states.iter().all(|s| s.tilt.as_ref().is_some_and(tilts)), "")
}
fn tilt(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    vec![m.states[i].tilt.as_deref().unwrap_or(&[]).iter().map(|x| -x).collect()]
}

fn missed_shapes(m: &Machine) -> Vec<Shape> {
    only_if(m.states.iter().any(|s| s.jumps.iter().any(|x| *x != 0.0)), "")
}
fn missed(m: &Machine, i: usize, _: &Shape) -> Vec<Vec<f64>> {
    vec![m.states[i].jumps.clone()]
}
