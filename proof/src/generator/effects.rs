//! The contract's effects, each as physics with variation: what it needs, what shows it, how a strength `s` scales it, and
//! what its contract parameters truly are. `s` grows with the effect; its unit is the effect's own.

use std::f64::consts::TAU;

use super::machine::{Machine, Needs};
use super::plant::{
    Clip, Deadband, DeadbandKind, Drift, DriftLaw, Harmonic, LostCounts, Plant, Presliding, Shape, Stribeck,
    StribeckLaw, Train,
};
use super::simulate::Row;
use crate::key::Parameter;
use crate::rng::Rng;

/// The 25 names of the contract.
pub(crate) const EFFECTS: [&str; 25] = [
    "viscous_friction",
    "coulomb_friction",
    "asymmetric_friction",
    "stribeck_friction",
    "presliding_friction",
    "quadratic_drag",
    "position_dependent_friction",
    "load_dependent_friction",
    "friction_drift",
    "cogging",
    "torque_ripple",
    "command_deadband",
    "command_saturation",
    "command_delay",
    "electrical_lag",
    "gain_drift",
    "backlash",
    "drive_compliance",
    "roller_slip",
    "mass_imbalance",
    "tilt_gravity",
    "position_spring",
    "position_dependent_damping",
    "encoder_eccentricity",
    "missed_counts",
];

/// Returns the effect's requirements on the machine.
pub(crate) fn needs(name: &str) -> Needs {
    let mut needs = Needs::default();
    match name {
        "asymmetric_friction" => needs.no_offset = true,
        "position_dependent_friction" | "position_spring" | "position_dependent_damping" => {
            needs.place = true
        }
        "mass_imbalance" => {
            needs.rotary = Some(true);
            needs.direct = true;
        }
        "encoder_eccentricity" => {
            needs.rotary = Some(true);
            needs.fast = true;
        }
        "tilt_gravity" => needs.tilt = Some(true),
        _ => {}
    }
    needs
}

/// True if two effects may be hidden together: not if one can replace the other, nor if motor data cannot distinguish
/// them.
pub(crate) fn go_together(a: &str, b: &str) -> bool {
    const APART: [&[&str]; 8] = [
        &["backlash", "drive_compliance", "roller_slip", "presliding_friction"],
        &["command_delay", "electrical_lag"],
        &["gain_drift", "friction_drift"],
        &["mass_imbalance", "encoder_eccentricity", "cogging"],
        &["mass_imbalance", "position_spring"],
        &["coulomb_friction", "presliding_friction", "friction_drift", "command_deadband"],
        &["viscous_friction", "friction_drift"],
        &["position_spring", "position_dependent_friction", "position_dependent_damping"],
    ];
    a != b && !APART.iter().any(|list| list.contains(&a) && list.contains(&b))
}

/// (smallest, largest, first guess) of `s`.
pub(crate) fn bounds(name: &str, m: &Machine) -> (f64, f64, f64) {
    match name {
        "viscous_friction" | "quadratic_drag" | "position_dependent_damping" => (0.005, 3.0, 0.3),
        "coulomb_friction" => (0.01, 2.0, 0.3),
        "asymmetric_friction" => (0.002, 0.6, 0.1),
        "stribeck_friction" => (0.01, 2.0, 0.4),
        // Not stiffer than a 300 Hz resonance, not softer than a tenth of the travel.
        "presliding_friction" => {
            let stiffest = m.friction_acceleration() / (TAU * 300.0).powi(2);
            (stiffest, 0.02 * m.top_speed * m.duration / 24.0, 10.0 * stiffest)
        }
        "position_dependent_friction" | "position_spring" => (0.01, 2.0, 0.3),
        "load_dependent_friction" => (0.003, 0.6, 0.1),
        "friction_drift" => (0.01, 0.85, 0.2),
        "cogging" | "mass_imbalance" => (0.005, 0.8, 0.15),
        "torque_ripple" => (0.003, 0.5, 0.05),
        "command_deadband" => (0.01, 2.5, 0.2),
        // The limit stays above what friction alone asks for.
        "command_saturation" => {
            let lowest = 1.25 * m.plant.dry.coulomb / m.plant.gain;
            (0.02, (m.peak_command / lowest - 0.9).max(0.03), 0.3)
        }
        "roller_slip" => (0.15, 1.7, 0.7),
        "command_delay" | "electrical_lag" => (2e-5, (0.3 / m.bandwidth).min(0.03), 1e-3),
        "gain_drift" => (0.003, 0.4, 0.06),
        "backlash" => {
            let count = 1.0 / m.plant.counts_per_unit;
            (0.5 * count, (0.03 * m.top_speed).max(30.0 * count), 8.0 * count)
        }
        "drive_compliance" => (0.25, m.residual_bandwidth() * TAU / (3.0 * m.bandwidth).min(TAU * 40.0), 1.0),
        "tilt_gravity" => (0.005, 1.0, 0.2),
        "encoder_eccentricity" => (1e-4, 0.12, 0.01),
        "missed_counts" => (1.0, 2000.0, 12.0),
        _ => (0.01, 1.0, 0.1),
    }
}

/// Puts the effect into `plant` at scale `s`. `rng` must be the same for every scale of one case: it draws the form.
/// `base` is a mechanical place from which the recordings work forward over the machine's travel.
pub(crate) fn apply(name: &str, m: &Machine, plant: &mut Plant, base: f64, s: f64, rng: &mut Rng) {
    let coulomb = m.plant.dry.coulomb;
    let (v, travel, duration) = (m.top_speed, m.travel, m.duration);
    match name {
        "viscous_friction" => plant.viscous = s * coulomb / v,
        "coulomb_friction" => plant.dry.coulomb = s * coulomb,
        "asymmetric_friction" => {
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
        "stribeck_friction" => {
            let law = match rng.below(4) {
                0 => StribeckLaw::Exponential(2.0),
                1 => StribeckLaw::Lorentzian,
                _ => StribeckLaw::Exponential(rng.range(1.0, 2.0)),
            };
            let speed = v * rng.log_range(0.02, 0.12);
            plant.dry.stribeck = Some(Stribeck { peak: s * coulomb, speed, law });
        }
        "presliding_friction" => {
            // `s` is the length over which the bristles break away.
            let stiffness = coulomb / s;
            plant.dry.presliding = Some(if rng.chance(0.6) {
                let damping = 2.0 * rng.range(0.1, 0.4) * (stiffness * plant.inertia).sqrt();
                Presliding::LuGre { stiffness, damping }
            } else {
                // Break lengths spread over a decade about s, shares by chance.
                let raw: Vec<(f64, f64)> =
                    (0..8).map(|i| (rng.range(0.5, 1.5), 10_f64.powf(f64::from(i) / 7.0 - 0.7))).collect();
                let total: f64 = raw.iter().map(|e| e.0).sum();
                let elements =
                    raw.iter().map(|&(w, length)| (w / total, w / total * stiffness / length)).collect();
                Presliding::MaxwellSlip { elements }
            });
        }
        "quadratic_drag" => plant.drag = s * coulomb / (v * v),
        "position_dependent_friction" => {
            let shape = place_shape(base, travel, rng);
            let down = rng.chance(0.3);
            plant.dry.profile = Some((if down { -s.min(0.85) } else { s } * coulomb, shape));
        }
        "load_dependent_friction" => plant.dry.per_load = s,
        "friction_drift" => {
            let law = if rng.chance(0.7) { DriftLaw::Exponential } else { DriftLaw::Hyperbolic };
            let up = rng.chance(0.25);
            let time_constant = duration * rng.range(0.12, 0.4);
            plant.dry.warm = Some(Drift { change: if up { s } else { -s }, time_constant, law });
        }
        "cogging" => plant.cogging = harmonics(m, s * coulomb, rng),
        "torque_ripple" => plant.ripple = harmonics(m, s, rng),
        "command_deadband" => {
            let kind = if rng.chance(0.6) {
                DeadbandKind::Offset
            } else {
                DeadbandKind::Smooth(rng.range(0.05, 0.4))
            };
            plant.deadband = Some(Deadband { half_width: s * coulomb / plant.gain, kind });
        }
        "command_saturation" => {
            let knee = if rng.chance(0.6) { 0.0 } else { rng.range(0.02, 0.08) };
            plant.clip = Some(Clip { limit: (m.peak_command / (0.9 + s)).min(m.limit), knee });
        }
        "command_delay" => plant.delay = s,
        "electrical_lag" => plant.lag = s,
        "gain_drift" => {
            let law = if rng.chance(0.7) { DriftLaw::Exponential } else { DriftLaw::Hyperbolic };
            let change = if rng.chance(0.8) { -s } else { s };
            plant.gain_drift = Some(Drift { change, time_constant: duration * rng.range(0.12, 0.4), law });
        }
        "backlash" => {
            let (load_share, friction_share) = (rng.range(0.3, 0.7), rng.range(0.3, 0.7));
            let reduced = plant.inertia * load_share * (1.0 - load_share);
            let stiffness = reduced * (TAU * rng.range(120.0, 300.0)).powi(2);
            let damping = 2.0 * rng.range(0.1, 0.5) * (stiffness * reduced).sqrt();
            plant.train = Train::Gap { load_share, friction_share, gap: s, stiffness, damping };
        }
        "drive_compliance" => {
            let (load_share, friction_share) = (rng.range(0.3, 0.7), rng.range(0.2, 0.6));
            let load = plant.inertia * load_share;
            let antiresonance = TAU * m.residual_bandwidth() / s;
            let stiffness = load * antiresonance * antiresonance;
            let damping = 2.0 * rng.range(0.01, 0.08) * (stiffness * load).sqrt();
            plant.train = Train::Spring { load_share, friction_share, stiffness, damping };
        }
        "roller_slip" => {
            let (load_share, friction_share) = (rng.range(0.4, 0.7), rng.range(0.3, 0.6));
            plant.train = Train::Slip {
                load_share,
                friction_share,
                ceiling: 2.5 * coulomb * friction_share / s,
                creep: v * rng.range(0.004, 0.012),
            };
        }
        "mass_imbalance" => plant.imbalance = Some((s * coulomb, rng.range(0.0, TAU))),
        "tilt_gravity" => plant.weight = s * coulomb,
        "position_spring" => {
            let rest = base + travel * rng.range(-0.1, 1.1);
            let cubic = if rng.chance(0.5) { 0.0 } else { rng.range(0.1, 0.6) / (travel * travel) };
            plant.spring = Some((s * coulomb / (0.5 * travel), rest, cubic));
        }
        "position_dependent_damping" => {
            plant.damping_profile = Some((s * coulomb / v, place_shape(base, travel, rng)));
        }
        "encoder_eccentricity" => plant.eccentricity = Some((s, rng.range(0.0, TAU))),
        "missed_counts" => {
            let above = if rng.chance(0.5) { 0.0 } else { v * rng.range(0.2, 0.5) };
            let rate = rng.range(0.8, 3.0);
            let both_ways = rng.chance(0.5);
            plant.lost = Some(LostCounts { burst: s, both_ways, rate, above_speed: above });
        }
        other => unreachable!("`{other}` is not an effect of the contract"),
    }
}

fn place_shape(base: f64, travel: f64, rng: &mut Rng) -> Shape {
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

/// Harmonics of a slotted machine (or of a magnet track, where linear): multiples of a slot or pole number, falling, rms
/// as asked.
fn harmonics(m: &Machine, rms: f64, rng: &mut Rng) -> Vec<Harmonic> {
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

/// The contract's parameters of the effect as they truly are, where the form drawn has them. `rows` are the fit recordings.
/// `cold`: they begin before anything has warmed.
pub(crate) fn truth(name: &str, plant: &Plant, rows: &[&[Row]], cold: bool) -> Vec<Parameter> {
    let mut list = Vec::new();
    let mut put = |parameter: &str, value: f64, force: bool| {
        list.push(Parameter { effect: name.into(), name: parameter.into(), value, force });
    };
    let places = || rows.iter().flat_map(|r| r.iter()).map(|r| r.q);
    let span = |shape: &Shape| {
        let (low, high) =
            places().fold((f64::MAX, f64::MIN), |(l, h), q| (l.min(shape.at(q)), h.max(shape.at(q))));
        high - low
    };
    match name {
        "viscous_friction" => put("viscous", plant.viscous, true),
        "coulomb_friction" => put("coulomb", plant.dry.coulomb, true),
        "tilt_gravity" => put("weight", plant.weight, true),
        "asymmetric_friction" => {
            if plant.dry.asymmetry != 0.0 {
                put("coulomb_asymmetry", plant.dry.asymmetry, false);
            }
            if plant.viscous_asymmetry != 0.0 {
                put("viscous_asymmetry", plant.viscous_asymmetry, false);
            }
        }
        "stribeck_friction" => {
            if let Some(s) = plant.dry.stribeck {
                put("peak", s.peak, true);
                // The scale of another law is not the exponential's.
                if let StribeckLaw::Exponential(_) = s.law {
                    put("speed", s.speed, false);
                }
            }
        }
        "presliding_friction" => {
            if let Some(Presliding::LuGre { stiffness, .. }) = plant.dry.presliding {
                put("stiffness", stiffness, true);
            }
        }
        "quadratic_drag" => put("coefficient", plant.drag, true),
        "position_dependent_friction" => {
            if let Some((height, shape)) = plant.dry.profile {
                put("span", height.abs() * span(&shape), true);
            }
        }
        "position_dependent_damping" => {
            if let Some((height, shape)) = plant.damping_profile {
                put("span", height.abs() * span(&shape), true);
            }
        }
        "load_dependent_friction" => put("coefficient", plant.dry.per_load, false),
        "friction_drift" | "gain_drift" => {
            let drift = if name == "gain_drift" { plant.gain_drift } else { plant.dry.warm };
            if let Some(Drift { change, time_constant, law: DriftLaw::Exponential }) = drift {
                // From where a warm start begins it is another change in every recording.
                if cold {
                    put("change", change, false);
                }
                put("time_constant", time_constant, false);
            }
        }
        "cogging" | "torque_ripple" => {
            let cogging = name == "cogging";
            let list = if cogging { &plant.cogging } else { &plant.ripple };
            put("rms", (list.iter().map(|h| h.amplitude * h.amplitude / 2.0).sum::<f64>()).sqrt(), cogging);
            for h in list {
                put(&format!("order_{}", h.order), h.amplitude, cogging);
            }
        }
        "command_deadband" => {
            if let Some(d) = plant.deadband {
                put("half_width", d.half_width, false);
            }
        }
        "command_saturation" => {
            if let Some(c) = plant.clip {
                put("limit", c.limit, false);
            }
        }
        "command_delay" => put("delay", plant.delay, false),
        "electrical_lag" => put("time_constant", plant.lag, false),
        "backlash" => {
            if let Train::Gap { gap, .. } = plant.train {
                put("gap", gap, false);
            }
        }
        "drive_compliance" => {
            if let Train::Spring { load_share, stiffness, .. } = plant.train {
                put("antiresonance_hz", (stiffness / (plant.inertia * load_share)).sqrt() / TAU, false);
            }
        }
        "roller_slip" => {
            if let Train::Slip { ceiling, .. } = plant.train {
                put("ceiling", ceiling, true);
            }
        }
        "mass_imbalance" => put("amplitude", plant.imbalance.map_or(0.0, |x| x.0), true),
        "encoder_eccentricity" => put("amplitude", plant.eccentricity.map_or(0.0, |x| x.0), false),
        "position_spring" => {
            if let Some((stiffness, _, 0.0)) = plant.spring {
                put("stiffness", stiffness, true);
            }
        }
        // `lost`, counts all together, does not say over which recordings: left out of the coverage.
        _ => {}
    }
    list
}
