//! The laws of the effects that are concealed, written from the physics; the diagnosis has its own.
//! Each law but for its size, and how a machine's recordings draw it.

use std::f64::consts::TAU;

use super::banded_recording::State;
use super::carrier::Carrier;
use crate::rng::Rng;

/// A wave along the travel: cycles a turn, share of the amplitude, phase at the recording's zero,
/// rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Wave {
    pub(crate) order: f64,
    pub(crate) amplitude: f64,
    pub(crate) phase: f64,
}

/// A height from 0 to 1 along the travel, from one place to another, straight or as a smooth step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Along {
    pub(crate) from: f64,
    pub(crate) to: f64,
    pub(crate) smooth: bool,
}

impl Along {
    pub(crate) fn at(&self, q: f64) -> f64 {
        let x = ((q - self.from) / (self.to - self.from)).clamp(0.0, 1.0);
        if self.smooth { x * x * (3.0 - 2.0 * x) } else { x }
    }
}

/// A law without its size.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum HiddenLaw {
    /// Force on the axis: size in N·m or N unless said.
    Viscous,
    Coulomb,
    /// More viscous friction in one direction: +1 forward, −1 backward.
    OneWay(f64),
    Stribeck {
        speed: f64,
        power: f64,
    },
    /// Bristles that share the dry friction, break lengths spread about this one, rad or m.
    Bristles {
        length: f64,
    },
    /// Power of the speed.
    Drag(f64),
    FrictionAlong(Along),
    DampingAlong(Along),
    /// Size without unit: dry friction per external load.
    Load,
    /// Dry friction that is gone after so many s.
    WarmingUp(f64),
    Cogging(Vec<Wave>),
    Imbalance,
    /// Share of the stiffness that grows with the square of the distance, at the ends of the
    /// travel.
    Spring(f64),
    Weight,
    /// Maps of the command: size is the share of the force, …
    Ripple(Vec<Wave>),
    /// … half a width in the command's unit; the part of a small command that passes, …
    Deadband(f64),
    /// … how near the limit comes; how sharp the knee is, …
    Clip(f64),
    /// … rows, …
    Delay,
    /// … s, …
    Lag,
    /// … the part that the gain loses; its time constant, s, and whether it follows the heat of the
    /// current.
    Heating {
        seconds: f64,
        by_current: bool,
    },
    /// Errors of reading: size is an amplitude, rad or m, …
    Eccentric,
    /// … counts a burst; bursts a second above a speed.
    LostCounts {
        rate: f64,
        above: f64,
    },
}

/// The side of the equation on which a law acts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Force,
    Command,
    Reading,
}

/// The names of the contract that are concealed. Gaps, springs and slip between two masses are not
/// concealed: a recording of the motor does not show what the load did.
pub(crate) const NAMES: [&str; 22] = [
    "viscous_friction",
    "coulomb_friction",
    "asymmetric_friction",
    "stribeck_friction",
    "presliding_friction",
    "quadratic_drag",
    "position_dependent_friction",
    "position_dependent_damping",
    "load_dependent_friction",
    "friction_drift",
    "cogging",
    "mass_imbalance",
    "position_spring",
    "tilt_gravity",
    "torque_ripple",
    "command_deadband",
    "command_saturation",
    "command_delay",
    "electrical_lag",
    "gain_drift",
    "encoder_eccentricity",
    "missed_counts",
];

impl HiddenLaw {
    pub(crate) fn side(&self) -> Side {
        match self {
            HiddenLaw::Ripple(_)
            | HiddenLaw::Deadband(_)
            | HiddenLaw::Clip(_)
            | HiddenLaw::Delay
            | HiddenLaw::Lag
            | HiddenLaw::Heating { .. } => Side::Command,
            HiddenLaw::Eccentric | HiddenLaw::LostCounts { .. } => Side::Reading,
            _ => Side::Force,
        }
    }

    /// True if forces grow in proportion to the size.
    pub(crate) fn is_linear(&self) -> bool {
        self.side() == Side::Force || *self == HiddenLaw::Eccentric
    }

    /// Smallest and largest size, where it is not in proportion.
    pub(crate) fn bounds(&self, strongest: f64, row_s: f64) -> (f64, f64) {
        match self {
            HiddenLaw::Ripple(_) => (1e-4, 0.5),
            HiddenLaw::Deadband(_) => (1e-4 * strongest, 0.5 * strongest),
            HiddenLaw::Clip(_) => (0.02, 1000.0),
            HiddenLaw::Delay => (1.0, 40.0),
            HiddenLaw::Lag => (0.2 * row_s, 40.0 * row_s),
            HiddenLaw::Heating { .. } => (1e-3, 0.6),
            HiddenLaw::LostCounts { .. } => (1.0, 1e6),
            _ => (0.0, f64::INFINITY),
        }
    }
}

/// Draws a law of the effect for the carrier; nothing where its recordings cannot hold it.
pub(crate) fn draw(name: &str, carrier: &Carrier, states: &[State], rng: &mut Rng) -> Option<HiddenLaw> {
    let rig = &carrier.rig;
    let fast = states.iter().map(|s| s.fast).fold(0.0, f64::max);
    let travel = states.iter().map(State::travel).fold(f64::INFINITY, f64::min);
    let seconds = states.iter().map(State::seconds).fold(f64::INFINITY, f64::min);
    let turns = rig.turn.map(|turn| travel / turn);
    let driven = is_driven(carrier);
    let one_place = rig.absolute || rig.start_spread.is_some_and(|s| s < 0.3 * travel);
    let along = |rng: &mut Rng| {
        let places = || states.iter().flat_map(|s| s.place.iter());
        let low = places().copied().fold(f64::INFINITY, f64::min);
        let (a, b) = (low + travel * rng.range(0.0, 0.3), low + travel * rng.range(0.6, 1.0));
        let (from, to) = if rng.chance(0.5) { (a, b) } else { (b, a) };
        Along { from, to, smooth: rng.chance(0.5) }
    };
    let law = match name {
        "viscous_friction" if rig.viscous.is_none() => HiddenLaw::Viscous,
        "coulomb_friction" if rig.coulomb.is_none() => HiddenLaw::Coulomb,
        "asymmetric_friction" => HiddenLaw::OneWay(rng.sign()),
        "stribeck_friction" => {
            HiddenLaw::Stribeck { speed: fast * rng.log_range(0.03, 0.2), power: rng.range(1.0, 2.0) }
        }
        "presliding_friction" if rig.coulomb.is_some() => {
            HiddenLaw::Bristles { length: typical_stroke(states) * rng.log_range(0.02, 0.2) }
        }
        "quadratic_drag" => HiddenLaw::Drag(rng.range(1.9, 2.1)),
        "position_dependent_friction" if one_place => HiddenLaw::FrictionAlong(along(rng)),
        "position_dependent_damping" if one_place => HiddenLaw::DampingAlong(along(rng)),
        "load_dependent_friction" if carrier.recordings().all(|r| r.force.iter().any(|f| *f != 0.0)) => {
            HiddenLaw::Load
        }
        "friction_drift" if seconds >= 4.0 => HiddenLaw::WarmingUp(seconds * rng.range(0.12, 0.4)),
        "cogging" => HiddenLaw::Cogging(waves(turns?, fast / rig.turn?, carrier, rng)?),
        "torque_ripple" if driven => HiddenLaw::Ripple(waves(turns?, fast / rig.turn?, carrier, rng)?),
        "mass_imbalance" if rig.rotary && turns? > 0.6 => HiddenLaw::Imbalance,
        "position_spring" => HiddenLaw::Spring(if rng.chance(0.5) { 0.0 } else { rng.range(0.1, 0.6) }),
        "tilt_gravity" if rig.weight.is_none() => carrier
            .recordings()
            .all(|r| r.tilt.iter().any(|t| *t != r.tilt[0]))
            .then_some(HiddenLaw::Weight)?,
        "command_deadband" if driven => {
            HiddenLaw::Deadband(if rng.chance(0.5) { 0.0 } else { rng.range(0.05, 0.3) })
        }
        "command_saturation" if driven => HiddenLaw::Clip(rng.range(6.0, 14.0)),
        "command_delay" if driven => HiddenLaw::Delay,
        "electrical_lag" if driven => HiddenLaw::Lag,
        "gain_drift" if driven && seconds >= 4.0 => {
            HiddenLaw::Heating { seconds: seconds * rng.range(0.12, 0.4), by_current: rng.chance(0.5) }
        }
        "encoder_eccentricity" if rig.rotary && turns? > 1.0 => HiddenLaw::Eccentric,
        "missed_counts" if seconds >= 4.0 => {
            let above = if rng.chance(0.5) { 0.0 } else { fast * rng.range(0.2, 0.5) };
            HiddenLaw::LostCounts { rate: rng.range(0.5, 2.0), above }
        }
        _ => return None,
    };
    Some(law)
}

/// True if most rows of every recording have a command.
fn is_driven(carrier: &Carrier) -> bool {
    carrier.recordings().all(|r| {
        let on = r.command.iter().filter(|u| **u != 0.0).count();
        on * 2 > r.command.len()
    })
}

/// Median travel between two reversals, over all recordings, rad or m.
fn typical_stroke(states: &[State]) -> f64 {
    let mut strokes = Vec::new();
    for state in states {
        let (mut start, mut direction) = (state.place[0], 0.0);
        for (q, v) in state.place.iter().zip(&state.speed) {
            if v.abs() > state.slow && v.signum() != direction {
                strokes.push((q - start).abs());
                (start, direction) = (*q, v.signum());
            }
        }
        strokes.push((state.place[state.place.len() - 1] - start).abs());
    }
    let most = strokes.iter().copied().fold(0.0, f64::max);
    strokes.retain(|s| *s > 0.05 * most);
    crate::stats::quantile(&strokes, 0.5).unwrap_or(most)
}

/// One to three harmonics of a slot or pole number, of which a recording shows three periods and
/// the rows show the wave.
fn waves(turns: f64, turns_a_second: f64, carrier: &Carrier, rng: &mut Rng) -> Option<Vec<Wave>> {
    let rate = |r: &crate::dynamics::recording::Recording| {
        (r.time.len() - 1) as f64 / (r.time[r.time.len() - 1] - r.time[0])
    };
    let slowest = carrier.recordings().map(rate).fold(f64::INFINITY, f64::min);
    let (least, most) = (3.0 / turns, 0.05 * slowest.max(100.0) / turns_a_second);
    const ROOTS: [f64; 11] = [1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 9.0, 12.0, 14.0, 28.0];
    let roots: Vec<f64> = ROOTS.iter().copied().filter(|r| *r >= least && *r <= most).collect();
    if roots.is_empty() {
        return None;
    }
    let root = *rng.pick(&roots);
    let mut list: Vec<Wave> = Vec::new();
    for i in 0..=rng.below(3) {
        let order = root * (i as f64 + 1.0);
        if order <= most {
            let amplitude = rng.range(0.4, 1.0) / (i as f64 + 1.0).powf(0.8);
            list.push(Wave { order, amplitude, phase: rng.range(0.0, TAU) });
        }
    }
    Some(list)
}
