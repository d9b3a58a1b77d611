//! The laws that the plain rival knows, each on a small grid of shapes, as one or two columns on
//! the same side of the equation as the drive's force: the additional force that the drive has to
//! give.

use std::f64::consts::TAU;

use super::banded_recording::BandedRecording;
use super::carrier::Carrier;
use crate::signal::derivative;

/// Columns on the grid of a recording, from what it shows and the drive's force that is predicted.
type Columns = Box<dyn Fn(&BandedRecording, &[f64]) -> Vec<Vec<f64>>>;

/// One law with one shape.
pub(crate) struct Candidate {
    pub(crate) name: &'static str,
    pub(crate) columns: Columns,
    pub(crate) periodic: bool,
    /// It acts on the command that is predicted.
    pub(crate) by_command: bool,
}

struct Builder(Vec<Candidate>);

impl Builder {
    /// A column of the motion: time, place, speed, direction by their index.
    fn motion(&mut self, name: &'static str, value: impl Fn(&BandedRecording, usize) -> f64 + 'static) {
        let columns: Columns = Box::new(move |s, _| vec![(0..s.time.len()).map(|i| value(s, i)).collect()]);
        self.0.push(Candidate { name, columns, periodic: false, by_command: false });
    }

    /// A column of the predicted force of the drive.
    fn command(
        &mut self,
        name: &'static str,
        value: impl Fn(&BandedRecording, &[f64]) -> Vec<f64> + 'static,
    ) {
        let columns: Columns = Box::new(move |s, u| vec![value(s, u)]);
        self.0.push(Candidate { name, columns, periodic: false, by_command: true });
    }

    /// A sine and a cosine of a multiple of the angle, times a factor.
    fn wave(&mut self, name: &'static str, order: f64, turn: f64, by_command: bool) {
        let columns: Columns = Box::new(move |s, u| {
            let at = |i: usize| order * TAU / turn * s.place[i];
            let factor = |i: usize| if by_command { u[i] } else { 1.0 };
            let all = || 0..s.time.len();
            vec![
                all().map(|i| factor(i) * at(i).sin()).collect(),
                all().map(|i| factor(i) * at(i).cos()).collect(),
            ]
        });
        self.0.push(Candidate { name, columns, periodic: true, by_command });
    }
}

/// Every law that the rig and the columns of the recordings allow.
pub(crate) fn candidates(carrier: &Carrier, sights: &[BandedRecording]) -> Vec<Candidate> {
    let mut b = Builder(Vec::new());
    friction(&mut b, carrier, sights);
    along(&mut b, carrier, sights);
    command(&mut b, sights);
    waves(&mut b, carrier, sights);
    b.0
}

fn top(sights: &[BandedRecording], of: impl Fn(&BandedRecording) -> &[f64]) -> f64 {
    let all: Vec<f64> = sights.iter().flat_map(|s| of(s).iter().map(|x| x.abs())).collect();
    crate::stats::quantile(&all, 0.98).unwrap_or(1.0)
}

fn friction(b: &mut Builder, carrier: &Carrier, sights: &[BandedRecording]) {
    let rig = &carrier.rig;
    let fast = top(sights, |s| &s.speed);
    let seconds = sights.iter().map(|s| s.time[s.time.len() - 1]).fold(f64::INFINITY, f64::min);
    let stroke = top(sights, |s| &s.since_reversal);
    if rig.viscous.is_none() {
        b.motion("viscous_friction", |s, i| s.speed[i]);
    }
    if rig.coulomb.is_none() {
        b.motion("coulomb_friction", |s, i| s.direction[i]);
    }
    b.motion("asymmetric_friction", |s, i| s.speed[i].abs());
    b.motion("quadratic_drag", |s, i| s.speed[i] * s.speed[i].abs());
    for share in [0.03, 0.06, 0.12, 0.25] {
        let scale = share * fast;
        b.motion("stribeck_friction", move |s, i| s.direction[i] * (-s.speed[i].abs() / scale).exp());
    }
    for share in [0.01, 0.03, 0.1, 0.3] {
        let length = share * stroke;
        b.motion("presliding_friction", move |s, i| -s.direction[i] * (-s.since_reversal[i] / length).exp());
    }
    for share in [0.1, 0.2, 0.4] {
        let scale = share * seconds;
        b.motion("friction_drift", move |s, i| s.direction[i] * (-s.time[i] / scale).exp());
    }
    if sights.iter().all(|s| s.load.iter().any(|f| *f != 0.0)) {
        b.motion("load_dependent_friction", |s, i| s.direction[i] * s.load[i].abs());
    }
}

fn along(b: &mut Builder, carrier: &Carrier, sights: &[BandedRecording]) {
    let rig = &carrier.rig;
    b.motion("position_spring", |s, i| s.place[i]);
    if rig.weight.is_none() && sights.iter().all(|s| s.tilt.iter().any(|t| *t != s.tilt[0])) {
        b.motion("tilt_gravity", |s, i| -s.tilt[i]);
    }
    if rig.absolute || rig.start_spread.is_some() {
        b.motion("position_dependent_friction", |s, i| s.direction[i] * s.place[i]);
        b.motion("position_dependent_damping", |s, i| s.speed[i] * s.place[i]);
    }
}

fn command(b: &mut Builder, sights: &[BandedRecording]) {
    let most = top(sights, |s| &s.drive);
    if most == 0.0 {
        return;
    }
    let seconds = sights.iter().map(|s| s.time[s.time.len() - 1]).fold(f64::INFINITY, f64::min);
    let band = sights.iter().map(BandedRecording::band).fold(f64::INFINITY, f64::min);
    for share in [0.05, 0.15, 0.4] {
        let width = share * most;
        b.command("command_deadband", move |_, u| u.iter().map(|u| u.clamp(-width, width)).collect());
    }
    for share in [0.4, 0.6, 0.8] {
        let limit = share * most;
        b.command("command_saturation", move |_, u| u.iter().map(|u| u - u.clamp(-limit, limit)).collect());
    }
    b.command("command_delay", |s, u| derivative(u, 1.0 / s.step()));
    for share in [0.1, 0.3] {
        let late = share / band;
        b.command("electrical_lag", move |s, u| {
            s.lagged(u, late).iter().zip(u).map(|(lag, u)| u - lag).collect()
        });
        b.command("command_delay", move |s, u| {
            s.delayed(u, late).iter().zip(u).map(|(late, u)| u - late).collect()
        });
    }
    for share in [0.1, 0.2, 0.4] {
        let scale = share * seconds;
        b.command("gain_drift", move |s, u| {
            u.iter().zip(&s.time).map(|(u, t)| u * (1.0 - (-t / scale).exp())).collect()
        });
    }
}

/// The orders that are tried, and the periods of each that a recording must hold.
const ORDERS: usize = 48;
const PERIODS: f64 = 1.5;

fn waves(b: &mut Builder, carrier: &Carrier, sights: &[BandedRecording]) {
    let Some(turn) = carrier.rig.turn else { return };
    let span = |s: &BandedRecording| {
        let (low, high) = s.place.iter().fold((f64::MAX, f64::MIN), |(l, h), &q| (l.min(q), h.max(q)));
        high - low
    };
    let turns = sights.iter().map(span).fold(f64::INFINITY, f64::min) / turn;
    let fast = top(sights, |s| &s.speed) / turn;
    let band = sights.iter().map(BandedRecording::band).fold(f64::INFINITY, f64::min);
    for order in 1..=ORDERS {
        let order = order as f64;
        if order * turns < PERIODS || order > 1.0 && order * fast > 2.0 * band {
            continue;
        }
        let gravity = order == 1.0 && carrier.rig.rotary;
        b.wave(if gravity { "mass_imbalance" } else { "cogging" }, order, turn, false);
        b.wave("torque_ripple", order, turn, true);
        if gravity {
            eccentricity(b, turn);
        }
    }
}

/// The error of the inertia's force due to a reading error once per turn.
fn eccentricity(b: &mut Builder, turn: f64) {
    let columns: Columns = Box::new(move |s, _| {
        let of = |f: fn(f64) -> f64| {
            let error: Vec<f64> = s.place.iter().map(|q| f(TAU / turn * q)).collect();
            derivative(&derivative(&error, 1.0 / s.step()), 1.0 / s.step())
        };
        vec![of(f64::sin), of(f64::cos)]
    });
    b.0.push(Candidate { name: "encoder_eccentricity", columns, periodic: true, by_command: false });
}
