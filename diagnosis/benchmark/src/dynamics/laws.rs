//! The force of a patched rig's effects along a recording: the sum of coefficient times term for
//! every row.
//!
//! Periodic terms along the travel are separate: encoder zeros differ between recordings, so their
//! phase is found for each.

use std::f64::consts::TAU;

use super::joint::{Instant, Joint, Resonance};
use super::motion::{Motion, first, second};
use super::rig::{Entry, Rig};

/// A pair of columns for one spatial frequency, with its coefficients.
#[derive(Clone, Debug)]
pub(crate) struct Wave {
    /// rad per unit of travel.
    pub(crate) wave: f64,
    pub(crate) cos: Vec<f64>,
    pub(crate) sin: Vec<f64>,
    pub(crate) coefficients: [f64; 2],
}

/// The rig's forces on a recording, not filtered.
#[derive(Clone, Debug)]
pub(crate) struct Forces {
    /// Everything but inertia and waves.
    pub(crate) sum: Vec<f64>,
    pub(crate) waves: Vec<Wave>,
}

/// True if the effect depends on the position along the travel, apart from periodic terms.
pub(crate) fn is_along_travel(entry: &Entry) -> bool {
    matches!(
        entry.name.as_str(),
        "position_dependent_friction" | "position_dependent_damping" | "position_spring"
    ) || is_over(entry, "travel")
}

/// True if it is a table over this variable.
pub(crate) fn is_over(entry: &Entry, variable: &str) -> bool {
    entry.table.as_ref().is_some_and(|t| t.over.iter().any(|v| v == variable))
}

/// The command after the drive's own limit and the effects on it.
pub(crate) fn effective_command(rig: &Rig, m: &Motion) -> Vec<f64> {
    let mut u: Vec<f64> = m.command.iter().map(|u| u.clamp(-rig.limit, rig.limit)).collect();
    for entry in &rig.effects {
        match entry.name.as_str() {
            "command_deadband" => {
                let width = entry.shape("half_width", 0.0);
                let rest = if entry.is_set("shift") { width } else { 0.0 };
                for u in &mut u {
                    *u = if u.abs() <= width { 0.0 } else { *u - u.signum() * rest };
                }
            }
            "command_saturation" => {
                let limit = entry.shape("limit", f64::INFINITY);
                u.iter_mut().for_each(|u| *u = u.clamp(-limit, limit));
            }
            "command_delay" => {
                let late = entry.shape("delay", 0.0) / m.step();
                let (whole, part) = (late.floor(), late.fract());
                let before = |i: usize, k: f64| u[(i as f64 - k).max(0.0) as usize];
                u = (0..u.len())
                    .map(|i| (1.0 - part) * before(i, whole) + part * before(i, whole + 1.0))
                    .collect();
            }
            "electrical_lag" => {
                let ratio = m.step() / entry.shape("time_constant", 0.0).max(1e-12);
                let rest = (-ratio).exp();
                let mean = (1.0 - rest) / ratio;
                let mut state = u[0];
                for u in &mut u {
                    let before = state;
                    state = *u + (before - *u) * rest;
                    *u += (before - *u) * mean;
                }
            }
            _ => {}
        }
    }
    u
}

/// The rig's forces on the recording, places moved by `along` where the travel has no fixed zero.
///
/// # Errors
/// An effect that the judge cannot run.
pub(crate) fn forces(rig: &Rig, m: &Motion, command: &[f64], along: f64) -> Result<Forces, String> {
    let mut sum: Vec<f64> = (0..m.len())
        .map(|i| {
            rig.gain * command[i] + m.force[i] + rig.offset.unwrap_or(0.0)
                - rig.viscous.unwrap_or(0.0) * m.speed[i]
                - rig.coulomb.unwrap_or(0.0) * way(m, i)
                + rig.weight.unwrap_or(0.0) * m.tilt[i].sin()
        })
        .collect();
    let mut waves = Vec::new();
    for entry in &rig.effects {
        if let Some(found) = periodic(rig, entry, m, command) {
            waves.extend(found);
        } else if !entry.name.starts_with("command_") && entry.name != "electrical_lag" {
            let term = law(rig, entry, along)?;
            let mut term = term;
            for (i, sum) in sum.iter_mut().enumerate() {
                *sum += term(m, command, i);
            }
        }
    }
    Ok(Forces { sum, waves })
}

/// Direction of motion; none at rest.
fn way(m: &Motion, i: usize) -> f64 {
    if m.rest[i] { 0.0 } else { m.direction[i] }
}

/// The columns of an effect that is periodic along the travel; none where it is not.
fn periodic(rig: &Rig, entry: &Entry, m: &Motion, command: &[f64]) -> Option<Vec<Wave>> {
    let factor: Option<Vec<f64>> = match entry.name.as_str() {
        "cogging" | "mass_imbalance" | "encoder_eccentricity" => None,
        "torque_ripple" => Some(command.iter().map(|u| rig.gain * u).collect()),
        _ => return None,
    };
    let turn = entry.shape("turn", TAU);
    let mut list: Vec<(String, f64)> = entry
        .shape
        .iter()
        .filter_map(|(key, value)| {
            let order = key.strip_prefix("order_").map(|n| (n.to_string(), value * TAU / turn));
            order.or_else(|| key.strip_prefix("period_").map(|n| (n.to_string(), TAU / value)))
        })
        .collect();
    if list.is_empty() {
        list.push(("1".into(), TAU / turn));
    }
    let column = |f: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let raw: Vec<f64> = m.place.iter().map(|x| f(*x)).collect();
        match &factor {
            Some(factor) => raw.iter().zip(factor).map(|(x, f)| x * f).collect(),
            None if entry.name == "encoder_eccentricity" => {
                // A reading that is too far by e: inertia and viscosity of what is not there.
                let (h, b) = (m.step(), rig.viscous.unwrap_or(0.0));
                second(&raw, h).iter().zip(first(&raw, h)).map(|(a, v)| rig.inertia * a + b * v).collect()
            }
            None => raw,
        }
    };
    let waves = list.into_iter().map(|(name, wave)| Wave {
        wave,
        cos: column(&|x| (wave * x).cos()),
        sin: column(&|x| (wave * x).sin()),
        coefficients: [entry.coefficient(&format!("cos_{name}")), entry.coefficient(&format!("sin_{name}"))],
    });
    Some(waves.collect())
}

/// A term for every row in turn.
type Term<'a> = Box<dyn FnMut(&Motion, &[f64], usize) -> f64 + 'a>;

/// The law of an effect, places moved by `along`.
fn law<'a>(rig: &'a Rig, entry: &'a Entry, along: f64) -> Result<Term<'a>, String> {
    let c = |key: &str| entry.coefficient(key);
    let gain = rig.gain;
    Ok(match entry.name.as_str() {
        "viscous_friction" => {
            let b = c("viscous");
            Box::new(move |m, _, i| -b * m.speed[i])
        }
        "coulomb_friction" => {
            let f = c("coulomb");
            Box::new(move |m, _, i| -f * way(m, i))
        }
        "asymmetric_friction" => {
            let (b, f) = (c("viscous_difference"), c("coulomb_difference"));
            Box::new(move |m, _, i| -b * m.speed[i].abs() - f * way(m, i).abs())
        }
        "stribeck_friction" => {
            let (peak, speed) = (c("peak"), entry.shape("speed", 1.0));
            let power = entry.shape("exponent", 2.0);
            Box::new(move |m, _, i| -peak * way(m, i) * (-(m.speed[i].abs() / speed).powf(power)).exp())
        }
        "presliding_friction" => bristles(entry),
        "quadratic_drag" => {
            let k = c("coefficient");
            Box::new(move |m, _, i| -k * m.speed[i] * m.speed[i].abs())
        }
        "load_dependent_friction" => {
            let (k, of_drive) = (c("coefficient"), entry.is_set("of_drive"));
            Box::new(move |m, u, i| {
                let load = if of_drive { gain * u[i] } else { m.force[i] };
                -k * way(m, i) * load.abs()
            })
        }
        "position_dependent_friction" => profile(entry, along, way)?,
        "position_dependent_damping" => profile(entry, along, |m, i| m.speed[i])?,
        "friction_drift" => friction_drift(entry),
        "gain_drift" => gain_drift(rig, entry),
        "tilt_gravity" => {
            let weight = c("weight");
            Box::new(move |m, _, i| weight * m.tilt[i].sin())
        }
        "position_spring" => spring(entry, along),
        "backlash" | "roller_slip" => joint(rig, entry),
        "drive_compliance" => {
            let (ratio, mut resonance) = (c("inertia_ratio"), Resonance::new(entry));
            Box::new(move |m, u, i| ratio * resonance.term(gain * u[i], m.step()))
        }
        "table" => table(rig, entry, along)?,
        other => return Err(format!("the judge cannot run the effect `{other}`")),
    })
}

/// Dry and viscous friction that settle at other values.
fn friction_drift(entry: &Entry) -> Term<'_> {
    let (f, b) = (entry.coefficient("coulomb"), entry.coefficient("viscous"));
    let tau = entry.shape("time_constant", 1.0);
    Box::new(move |m, _, i| {
        let settled = 1.0 - (-m.time[i] / tau).exp();
        -(f * way(m, i) + b * m.speed[i]) * settled
    })
}

/// A gain that changes with time, at once, or with the heat of the winding.
fn gain_drift<'a>(rig: &Rig, entry: &Entry) -> Term<'a> {
    let (gain, change, tau) = (rig.gain, entry.coefficient("change"), entry.shape("time_constant", 1.0));
    let at_once = entry.shape("at_once_s", f64::INFINITY);
    let mean_square = entry.shape("mean_square", f64::INFINITY);
    let mut heat = 0.0;
    Box::new(move |m, u, i| {
        heat += (u[i] * u[i] / mean_square - heat) * m.step() / tau;
        let settled = match at_once.is_finite() {
            true => f64::from(u8::from(m.time[i] >= at_once)),
            false if mean_square.is_finite() => heat,
            false => 1.0 - (-m.time[i] / tau).exp(),
        };
        change * gain * u[i] * settled
    })
}

/// A spring along the travel, which may fade and may act on one side only.
fn spring<'a>(entry: &Entry, along: f64) -> Term<'a> {
    let (k, preload) = (entry.coefficient("stiffness"), entry.coefficient("preload"));
    let (from, one_sided) = (entry.shape("from", 0.0), entry.is_set("one_sided"));
    let fades = entry.shape("fades_s", f64::INFINITY);
    let mut faded = 0.0;
    Box::new(move |m, _, i| {
        let x = m.place[i] + along - from;
        faded += (x - faded) * (1.0 - (-m.step() / fades).exp());
        let bent = if one_sided { (x - faded).max(0.0) } else { x - faded };
        preload - k * bent
    })
}

/// A joint between motor and load with play or slip.
fn joint<'a>(rig: &Rig, entry: &'a Entry) -> Term<'a> {
    let (ratio, mut joint) = (entry.coefficient("inertia_ratio"), Joint::new(entry));
    let bias = rig.offset.unwrap_or(0.0) / rig.inertia;
    Box::new(move |m, u, i| {
        let at = Instant {
            command: u[i],
            speed: m.speed[i],
            external: m.force[i],
            tilt: m.tilt[i].sin(),
            bias,
            step: m.step(),
        };
        ratio * joint.term(&at)
    })
}

/// A force over one or two variables.
fn table<'a>(rig: &Rig, entry: &'a Entry, along: f64) -> Result<Term<'a>, String> {
    let table = entry.table.as_ref().ok_or("the effect `table` has no table")?;
    let turn = entry.shape.get("turn").copied().or(rig.turn).unwrap_or(TAU);
    let known = ["speed", "travel", "angle", "command", "since_reversal", "time"];
    if let Some(other) = table.over.iter().find(|v| !known.contains(&v.as_str())) {
        return Err(format!("the judge cannot run a table over `{other}`"));
    }
    let mut turned = 0.0;
    Ok(Box::new(move |m, u, i| {
        if i > 0 && m.speed[i] * m.speed[i - 1] < 0.0 {
            turned = m.time[i];
        }
        let value = |variable: &String| match variable.as_str() {
            "speed" => m.speed[i],
            "travel" => m.place[i] + along,
            "angle" => (m.place[i] + along).rem_euclid(turn),
            "command" => u[i],
            "since_reversal" => m.time[i] - turned,
            _ => m.time[i],
        };
        table.at(&table.over.iter().map(value).collect::<Vec<_>>())
    }))
}

/// A sum of Legendre polynomials along the travel, against `what` of the row.
fn profile<'a>(entry: &'a Entry, along: f64, what: fn(&Motion, usize) -> f64) -> Result<Term<'a>, String> {
    if entry.is_set("of_inertia") {
        return Err("the judge cannot run an inertia along the travel".into());
    }
    let (low, high) = (entry.shape("low", -1.0), entry.shape("high", 1.0));
    let degree = entry.shape("degree", 3.0) as usize;
    let weights: Vec<f64> = (1..=degree).map(|k| entry.coefficient(&format!("legendre_{k}"))).collect();
    Ok(Box::new(move |m, _, i| {
        let x = (2.0 * (m.place[i] + along - low) / (high - low).max(1e-300) - 1.0).clamp(-1.0, 1.0);
        let (mut before, mut now, mut sum) = (1.0, x, 0.0);
        for (k, weight) in weights.iter().enumerate() {
            sum += weight * now;
            let n = k as f64 + 1.0;
            (before, now) = (now, ((2.0 * n + 1.0) * x * now - n * before) / (n + 1.0));
        }
        -sum * what(m, i)
    }))
}

/// Bristles in place of the dry friction that the rig has: Dahl's for one length, Maxwell slip for
/// a spread of them.
fn bristles(entry: &Entry) -> Term<'_> {
    const ELEMENTS: usize = 6;
    let (middle, spread) = (entry.shape("deflection", 1.0), entry.shape("spread", 1.0));
    let lengths: Vec<f64> = if spread > 1.0 {
        let part = |i: usize| i as f64 / (ELEMENTS - 1) as f64 - 0.5;
        (0..ELEMENTS).map(|i| middle * spread.powf(part(i))).collect()
    } else {
        vec![middle]
    };
    let mut bent = vec![0.0; lengths.len()];
    let (coulomb, damping) = (entry.coefficient("coulomb"), entry.coefficient("damping"));
    Box::new(move |m, _, i| {
        let travel = m.speed[i] * m.step();
        let (mut sum, mut more) = (0.0, 0.0);
        for (bent, length) in bent.iter_mut().zip(&lengths) {
            let before = *bent;
            *bent = if lengths.len() > 1 {
                (before + travel / length).clamp(-1.0, 1.0)
            } else {
                let end = travel.signum();
                end + (before - end) * (-travel.abs() / length).exp()
            };
            sum += 0.5 * (before + *bent);
            more += *bent - before;
        }
        let n = lengths.len() as f64;
        coulomb * (way(m, i) - sum / n) - damping * more / n / m.step()
    })
}
