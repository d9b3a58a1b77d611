//! The forms in which an effect may occur, drawn at random.

use std::f64::consts::TAU;

use super::machine::Machine;
use super::plant::{
    Deadband, DeadbandKind, Drift, DriftLaw, Harmonic, LostCounts, Plant, Presliding, Shape, Stribeck,
    StribeckLaw, Train,
};
use crate::rng::Rng;

/// Makes dry friction, viscous friction or both differ by `s` between the two directions.
pub(super) fn make_asymmetric(plant: &mut Plant, s: f64, rng: &mut Rng) {
    let side = rng.sign();
    match rng.below(3) {
        0 => plant.dry.asymmetry = side * s,
        1 => plant.viscous_asymmetry = side * s,
        _ => {
            plant.dry.asymmetry = side * s;
            plant.viscous_asymmetry = side * s * rng.range(-0.5, 1.0);
        }
    }
}

/// Draws the law and the speed of a peak of friction at rest. `top_speed` in u/s.
pub(super) fn stribeck(peak: f64, top_speed: f64, rng: &mut Rng) -> Stribeck {
    let law = match rng.below(4) {
        0 => StribeckLaw::Exponential(2.0),
        1 => StribeckLaw::Lorentzian,
        _ => StribeckLaw::Exponential(rng.range(1.0, 2.0)),
    };
    Stribeck { peak, speed: top_speed * rng.log_range(0.02, 0.12), law }
}

/// Draws bristles of the given stiffness all together, as a force per unit of travel.
pub(super) fn presliding(stiffness: f64, inertia: f64, rng: &mut Rng) -> Presliding {
    if rng.chance(0.6) {
        let damping = 2.0 * rng.range(0.1, 0.4) * (stiffness * inertia).sqrt();
        return Presliding::LuGre { stiffness, damping };
    }
    // Break lengths spread over a decade about the middle one, shares by chance.
    let raw: Vec<(f64, f64)> =
        (0..8).map(|i| (rng.range(0.5, 1.5), 10_f64.powf(f64::from(i) / 7.0 - 0.7))).collect();
    let total: f64 = raw.iter().map(|e| e.0).sum();
    let elements = raw.iter().map(|&(w, length)| (w / total, w / total * stiffness / length)).collect();
    Presliding::MaxwellSlip { elements }
}

fn drift_law(rng: &mut Rng) -> DriftLaw {
    if rng.chance(0.7) { DriftLaw::Exponential } else { DriftLaw::Hyperbolic }
}

/// Draws a drift of dry friction by the share `s` over a recording of `duration` s, mostly
/// downwards.
pub(super) fn friction_drift(s: f64, duration: f64, rng: &mut Rng) -> Drift {
    let law = drift_law(rng);
    let up = rng.chance(0.25);
    let time_constant = duration * rng.range(0.12, 0.4);
    Drift { change: if up { s } else { -s }, time_constant, law }
}

/// Draws a drift of the gain by the share `s` over a recording of `duration` s, mostly downwards.
pub(super) fn gain_drift(s: f64, duration: f64, rng: &mut Rng) -> Drift {
    let law = drift_law(rng);
    let change = if rng.chance(0.8) { -s } else { s };
    Drift { change, time_constant: duration * rng.range(0.12, 0.4), law }
}

/// Draws a deadband; the half width is in units of the command.
pub(super) fn deadband(half_width: f64, rng: &mut Rng) -> Deadband {
    let kind =
        if rng.chance(0.6) { DeadbandKind::Offset } else { DeadbandKind::Smooth(rng.range(0.05, 0.4)) };
    Deadband { half_width, kind }
}

/// Draws a train with a gap of so many u, with a stiff contact.
pub(super) fn backlash(gap: f64, inertia: f64, rng: &mut Rng) -> Train {
    let (load_share, friction_share) = (rng.range(0.3, 0.7), rng.range(0.3, 0.7));
    let reduced = inertia * load_share * (1.0 - load_share);
    let stiffness = reduced * (TAU * rng.range(120.0, 300.0)).powi(2);
    let damping = 2.0 * rng.range(0.1, 0.5) * (stiffness * reduced).sqrt();
    Train::Gap { load_share, friction_share, gap, stiffness, damping }
}

/// Draws a train with a spring whose antiresonance is given, in rad/s.
pub(super) fn compliance(antiresonance: f64, inertia: f64, rng: &mut Rng) -> Train {
    let (load_share, friction_share) = (rng.range(0.3, 0.7), rng.range(0.2, 0.6));
    let load = inertia * load_share;
    let stiffness = load * antiresonance * antiresonance;
    let damping = 2.0 * rng.range(0.01, 0.08) * (stiffness * load).sqrt();
    Train::Spring { load_share, friction_share, stiffness, damping }
}

/// Draws a train that slips above a ceiling of the force, which falls with `s`. `top_speed` in u/s.
pub(super) fn roller_slip(s: f64, coulomb: f64, top_speed: f64, rng: &mut Rng) -> Train {
    let (load_share, friction_share) = (rng.range(0.4, 0.7), rng.range(0.3, 0.6));
    Train::Slip {
        load_share,
        friction_share,
        ceiling: 2.5 * coulomb * friction_share / s,
        creep: top_speed * rng.range(0.004, 0.012),
    }
}

/// Draws when and how often bursts of about `burst` counts are lost. `top_speed` in u/s.
pub(super) fn lost_counts(burst: f64, top_speed: f64, rng: &mut Rng) -> LostCounts {
    let above_speed = if rng.chance(0.5) { 0.0 } else { top_speed * rng.range(0.2, 0.5) };
    let rate = rng.range(0.8, 3.0);
    LostCounts { burst, both_ways: rng.chance(0.5), rate, above_speed }
}

/// Draws a shape along the travel, which begins at `base`; both in u.
pub(super) fn place_shape(base: f64, travel: f64, rng: &mut Rng) -> Shape {
    let at = |x: f64| base + travel * x;
    match rng.below(3) {
        0 => {
            let from = rng.range(0.0, 0.3);
            let (from, to) = (at(from), at(from + rng.range(0.4, 0.8)));
            if rng.chance(0.5) { Shape::Ramp { from, to } } else { Shape::Ramp { from: to, to: from } }
        }
        1 => Shape::Bump { centre: at(rng.range(0.2, 0.7)), width: travel * rng.range(0.07, 0.2) },
        _ => Shape::Step { centre: at(rng.range(0.25, 0.6)), width: travel * rng.range(0.05, 0.15) },
    }
}

/// Harmonics of a slotted machine (or of a magnet track, where linear): multiples of a slot or pole
/// number, falling, rms as asked.
pub(super) fn harmonics(m: &Machine, rms: f64, rng: &mut Rng) -> Vec<Harmonic> {
    // At the fastest rate of turning a wave must still be several rows long.
    let turns = m.top_speed / m.plant.turn;
    let most = (m.rate / (8.0 * turns)).max(2.0);
    let roots: Vec<f64> = [2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 9.0, 10.0, 12.0, 14.0]
        .iter()
        .copied()
        .filter(|&r| r <= most)
        .collect();
    let root = if m.rotary { *rng.pick(&roots) } else { *rng.pick(&[1.0, 2.0, 4.0]) };
    let count = 1 + rng.below(4);
    let mut list: Vec<Harmonic> = Vec::new();
    for i in 0..count {
        let order = root * (i as f64 + 1.0);
        let amplitude = rng.range(0.4, 1.0) / (i as f64 + 1.0).powf(0.8);
        if i == 0 || order <= most {
            list.push(Harmonic { order, amplitude, phase: rng.range(0.0, TAU) });
        }
    }
    let total = (list.iter().map(|h| h.amplitude * h.amplitude / 2.0).sum::<f64>()).sqrt();
    list.iter_mut().for_each(|h| h.amplitude *= rms / total);
    list
}
