//! The contract's effects, each as physics with variation: the machine that it needs, and how a
//! strength `s` scales it. `s` grows with the effect; its unit is the effect's own.

use std::f64::consts::TAU;

use super::family::Needs;
use super::forms;
use super::machine::Machine;
use super::plant::{Clip, Plant};
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

/// True if two effects may be hidden together: not if one can replace the other, nor if motor data
/// cannot distinguish them.
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

/// Puts the effect into `plant` at scale `s`. `rng` must be the same for every scale of one case:
/// it draws the form. `base` is a mechanical place from which the recordings work forward over the
/// machine's travel.
pub(crate) fn apply(name: &str, m: &Machine, plant: &mut Plant, base: f64, s: f64, rng: &mut Rng) {
    let coulomb = m.plant.dry.coulomb;
    let (v, travel, duration) = (m.top_speed, m.travel, m.duration);
    match name {
        "viscous_friction" => plant.viscous = s * coulomb / v,
        "coulomb_friction" => plant.dry.coulomb = s * coulomb,
        "asymmetric_friction" => forms::make_asymmetric(plant, s, rng),
        "stribeck_friction" => plant.dry.stribeck = Some(forms::stribeck(s * coulomb, v, rng)),
        // `s` is the length over which the bristles break away.
        "presliding_friction" => {
            plant.dry.presliding = Some(forms::presliding(coulomb / s, plant.inertia, rng));
        }
        "quadratic_drag" => plant.drag = s * coulomb / (v * v),
        "position_dependent_friction" => {
            let shape = forms::place_shape(base, travel, rng);
            let down = rng.chance(0.3);
            plant.dry.profile = Some((if down { -s.min(0.85) } else { s } * coulomb, shape));
        }
        "load_dependent_friction" => plant.dry.per_load = s,
        "friction_drift" => plant.dry.warm = Some(forms::friction_drift(s, duration, rng)),
        "cogging" => plant.cogging = forms::harmonics(m, s * coulomb, rng),
        "torque_ripple" => plant.ripple = forms::harmonics(m, s, rng),
        "command_deadband" => plant.deadband = Some(forms::deadband(s * coulomb / plant.gain, rng)),
        "command_saturation" => {
            let knee = if rng.chance(0.6) { 0.0 } else { rng.range(0.02, 0.08) };
            plant.clip = Some(Clip { limit: (m.peak_command / (0.9 + s)).min(m.limit), knee });
        }
        "command_delay" => plant.delay = s,
        "electrical_lag" => plant.lag = s,
        "gain_drift" => plant.gain_drift = Some(forms::gain_drift(s, duration, rng)),
        "backlash" => plant.train = forms::backlash(s, plant.inertia, rng),
        "drive_compliance" => {
            let antiresonance = TAU * m.residual_bandwidth() / s;
            plant.train = forms::compliance(antiresonance, plant.inertia, rng);
        }
        "roller_slip" => plant.train = forms::roller_slip(s, coulomb, v, rng),
        "mass_imbalance" => plant.imbalance = Some((s * coulomb, rng.range(0.0, TAU))),
        "tilt_gravity" => plant.weight = s * coulomb,
        "position_spring" => {
            let rest = base + travel * rng.range(-0.1, 1.1);
            let cubic = if rng.chance(0.5) { 0.0 } else { rng.range(0.1, 0.6) / (travel * travel) };
            plant.spring = Some((s * coulomb / (0.5 * travel), rest, cubic));
        }
        "position_dependent_damping" => {
            plant.damping_profile = Some((s * coulomb / v, forms::place_shape(base, travel, rng)));
        }
        "encoder_eccentricity" => plant.eccentricity = Some((s, rng.range(0.0, TAU))),
        "missed_counts" => plant.lost = Some(forms::lost_counts(s, v, rng)),
        other => unreachable!("`{other}` is not an effect of the contract"),
    }
}
