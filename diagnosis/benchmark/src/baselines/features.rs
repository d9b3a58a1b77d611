//! The library of the baselines that select: columns linear in their coefficients, each with the
//! contract's name for it.

use std::f64::consts::TAU;

use super::estimate::{BaselineTable, Row};
use crate::generator::case::Case;
use crate::generator::plant::sign;
use crate::signal::low_pass;

/// A column as a function of the row.
type Column = Box<dyn Fn(&Row) -> f64>;

/// One column.
pub(crate) struct Feature {
    pub(crate) name: &'static str,
    /// Columns of a group are taken together.
    pub(crate) group: usize,
    /// Part of the nominal model.
    pub(crate) nominal: bool,
    /// Only in this recording (offsets).
    recording: Option<usize>,
    /// Low-passed already.
    smooth: bool,
    value: Column,
}

/// The columns of recording `k` (`usize::MAX`: the held-out one) at the kept rows: one vector a
/// column, low-passed.
pub(crate) fn columns(features: &[Feature], k: usize, table: &BaselineTable) -> Vec<Vec<f64>> {
    features
        .iter()
        .map(|f| {
            if f.recording.is_some_and(|r| r != k) {
                return vec![0.0; table.kept.len()];
            }
            let raw: Vec<f64> = table.rows.iter().map(|r| (f.value)(r)).collect();
            let smooth = if f.smooth { raw } else { low_pass(&raw, table.rate, table.band) };
            table.kept.iter().map(|&i| smooth[i]).collect()
        })
        .collect()
}

struct Builder {
    list: Vec<Feature>,
    group: usize,
}

impl Builder {
    fn put(&mut self, name: &'static str, columns: Vec<Column>) {
        self.group += 1;
        for value in columns {
            self.list.push(Feature {
                name,
                group: self.group,
                nominal: false,
                recording: None,
                smooth: false,
                value,
            });
        }
    }

    fn one(&mut self, name: &'static str, value: impl Fn(&Row) -> f64 + 'static) {
        self.put(name, vec![Box::new(value)]);
    }

    fn nominal(&mut self, recording: Option<usize>, value: impl Fn(&Row) -> f64 + 'static) {
        let smooth = recording.is_some();
        self.list.push(Feature {
            name: "",
            group: 0,
            nominal: true,
            recording,
            smooth,
            value: Box::new(value),
        });
    }
}

/// The columns for a case; the nominal ones first. Target: acceleration, as in sparse
/// identification: a command as target would be explained by functions of the command.
pub(crate) fn library(case: &Case, tables: &[BaselineTable]) -> Vec<Feature> {
    let all = || tables[..2].iter().flat_map(|t| t.rows.iter());
    let top = all().map(|r| r.speed.abs()).fold(1e-12, f64::max);
    let most = all().map(|r| r.command.abs()).fold(1e-12, f64::max);
    let travel = all().map(|r| r.place.abs()).fold(1e-12, f64::max);
    let mut b = Builder { list: Vec::new(), group: 0 };
    put_nominal(&mut b, case);
    put_friction(&mut b, case, top, travel);
    if case.machine.turn_told {
        put_turn(&mut b, case.plant.turn);
    }
    put_command(&mut b, most);
    put_mechanism(&mut b, case, travel);
    b.list
}

/// The terms of the nominal model, and those of them that the rig file leaves out.
fn put_nominal(b: &mut Builder, case: &Case) {
    let n = &case.nominal;
    b.nominal(None, |r| r.command);
    if case.with_force {
        b.nominal(None, |r| r.load);
    }
    if n.viscous.is_some() {
        b.nominal(None, |r| r.speed);
    }
    if n.coulomb.is_some() {
        b.nominal(None, |r| sign(r.speed));
    }
    if n.weight.is_some() {
        b.nominal(None, |r| r.tilt);
    }
    if n.offset.is_some() {
        b.nominal(Some(0), |_| 1.0);
        b.nominal(Some(1), |_| 1.0);
    } else {
        b.one("asymmetric_friction", |_| 1.0);
    }
    if n.viscous.is_none() {
        b.one("viscous_friction", |r| r.speed);
    }
    if n.coulomb.is_none() {
        b.one("coulomb_friction", |r| sign(r.speed));
    }
}

/// Friction laws and drifts; `top` is the largest speed, in u/s, and `travel` the largest travel,
/// in u.
fn put_friction(b: &mut Builder, case: &Case, top: f64, travel: f64) {
    b.one("asymmetric_friction", |r| r.speed.abs());
    for share in [0.02, 0.05, 0.1, 0.2] {
        let scale = share * top;
        b.one("stribeck_friction", move |r| sign(r.speed) * (-r.speed.abs() / scale).exp());
    }
    b.one("quadratic_drag", |r| r.speed * r.speed.abs());
    b.put(
        "position_dependent_friction",
        vec![
            Box::new(move |r| sign(r.speed) * r.place / travel),
            Box::new(move |r| sign(r.speed) * (r.place / travel).powi(2)),
        ],
    );
    if case.with_force {
        b.one("load_dependent_friction", |r| sign(r.speed) * r.load.abs());
    }
    for share in [0.1, 0.3] {
        b.one("friction_drift", move |r| sign(r.speed) * (-r.progress / share).exp());
        b.one("gain_drift", move |r| r.command * (1.0 - (-r.progress / share).exp()));
    }
}

/// Effects that are periodic in the turn, of so many u.
fn put_turn(b: &mut Builder, turn: f64) {
    let wave = TAU / turn;
    let pair = |order: f64, factor: fn(&Row) -> f64| -> Vec<Column> {
        vec![
            Box::new(move |r| factor(r) * (order * wave * r.place).sin()),
            Box::new(move |r| factor(r) * (order * wave * r.place).cos()),
        ]
    };
    b.put("mass_imbalance", pair(1.0, |_| 1.0));
    b.put("encoder_eccentricity", pair(1.0, |r| r.speed * r.speed));
    for order in 2..=24 {
        b.put("cogging", pair(f64::from(order), |_| 1.0));
        b.put("torque_ripple", pair(f64::from(order), |r| r.command));
    }
}

/// Effects on the command, whose largest is `most`.
fn put_command(b: &mut Builder, most: f64) {
    for share in [0.05, 0.15, 0.4] {
        let width = share * most;
        b.one("command_deadband", move |r| r.command.clamp(-width, width));
    }
    for share in [0.4, 0.6, 0.8] {
        let limit = share * most;
        b.one("command_saturation", move |r| r.command - r.command.clamp(-limit, limit));
    }
    b.one("command_delay", |r| r.command_rate);
}

/// Play, springs and weight; `travel` is the largest travel, in u.
fn put_mechanism(b: &mut Builder, case: &Case, travel: f64) {
    for share in [0.003, 0.01, 0.03] {
        let length = share * travel;
        b.one("presliding_friction", move |r| sign(r.speed) * (-r.since_reversal / length).exp());
        b.one("backlash", move |r| if r.since_reversal < length { r.command } else { 0.0 });
    }
    b.one("drive_compliance", |r| r.command_bend);
    b.list.last_mut().expect("pushed on the line above").smooth = true;
    if case.nominal.weight.is_none() && case.machine.tilt {
        b.one("tilt_gravity", |r| r.tilt);
    }
    b.one("position_spring", |r| r.place);
    b.one("position_dependent_damping", |r| r.place * r.speed);
}
