//! The contract's parameters of the hidden effects as they truly are.

use std::f64::consts::TAU;

use super::plant::{Drift, DriftLaw, Harmonic, Plant, Presliding, Shape, StribeckLaw, Train};
use super::simulate::Row;
use crate::key::Parameter;

/// The contract's parameters of the effect as they truly are, where the form drawn has them. `rows`
/// are the fit recordings. `cold`: they begin before anything has warmed.
pub(crate) fn truth(name: &str, plant: &Plant, rows: &[&[Row]], cold: bool) -> Vec<Parameter> {
    let mut truths = Truths { effect: name, list: Vec::new() };
    match name {
        "viscous_friction" => truths.put_force("viscous", plant.viscous),
        "coulomb_friction" => truths.put_force("coulomb", plant.dry.coulomb),
        "tilt_gravity" => truths.put_force("weight", plant.weight),
        "asymmetric_friction" => truths.put_asymmetry(plant),
        "stribeck_friction" => truths.put_stribeck(plant),
        "presliding_friction" => {
            if let Some(Presliding::LuGre { stiffness, .. }) = plant.dry.presliding {
                truths.put_force("stiffness", stiffness);
            }
        }
        "quadratic_drag" => truths.put_force("coefficient", plant.drag),
        "position_dependent_friction" => truths.put_span(plant.dry.profile, rows),
        "position_dependent_damping" => truths.put_span(plant.damping_profile, rows),
        "load_dependent_friction" => truths.put("coefficient", plant.dry.per_load),
        "friction_drift" => truths.put_drift(plant.dry.warm, cold),
        "gain_drift" => truths.put_drift(plant.gain_drift, cold),
        "cogging" => truths.put_harmonics(&plant.cogging, true),
        "torque_ripple" => truths.put_harmonics(&plant.ripple, false),
        "command_deadband" => {
            plant.deadband.iter().for_each(|d| truths.put("half_width", d.half_width));
        }
        "command_saturation" => plant.clip.iter().for_each(|c| truths.put("limit", c.limit)),
        "command_delay" => truths.put("delay", plant.delay),
        "electrical_lag" => truths.put("time_constant", plant.lag),
        "backlash" | "drive_compliance" | "roller_slip" => truths.put_train(plant),
        "mass_imbalance" => truths.put_force("amplitude", plant.imbalance.map_or(0.0, |x| x.0)),
        "encoder_eccentricity" => truths.put("amplitude", plant.eccentricity.map_or(0.0, |x| x.0)),
        "position_spring" => {
            if let Some((stiffness, _, 0.0)) = plant.spring {
                truths.put_force("stiffness", stiffness);
            }
        }
        // `lost`, counts all together, does not say over which recordings: left out of the
        // coverage.
        _ => {}
    }
    truths.list
}

/// The parameters of one effect.
struct Truths<'a> {
    effect: &'a str,
    list: Vec<Parameter>,
}

impl Truths<'_> {
    fn push(&mut self, name: &str, value: f64, force: bool) {
        self.list.push(Parameter { effect: self.effect.into(), name: name.into(), value, force });
    }

    /// Adds a parameter that does not scale with the forces.
    fn put(&mut self, name: &str, value: f64) {
        self.push(name, value, false);
    }

    /// Adds a parameter that scales with the forces.
    fn put_force(&mut self, name: &str, value: f64) {
        self.push(name, value, true);
    }

    fn put_asymmetry(&mut self, plant: &Plant) {
        if plant.dry.asymmetry != 0.0 {
            self.put("coulomb_asymmetry", plant.dry.asymmetry);
        }
        if plant.viscous_asymmetry != 0.0 {
            self.put("viscous_asymmetry", plant.viscous_asymmetry);
        }
    }

    fn put_stribeck(&mut self, plant: &Plant) {
        let Some(s) = plant.dry.stribeck else { return };
        self.put_force("peak", s.peak);
        // The scale of another law is not the exponential's.
        if let StribeckLaw::Exponential(_) = s.law {
            self.put("speed", s.speed);
        }
    }

    /// The difference between the largest and the smallest value of (height, shape) over the places
    /// of the recordings.
    fn put_span(&mut self, profile: Option<(f64, Shape)>, rows: &[&[Row]]) {
        let Some((height, shape)) = profile else { return };
        let places = rows.iter().flat_map(|r| r.iter()).map(|r| r.q);
        let (low, high) =
            places.fold((f64::MAX, f64::MIN), |(l, h), q| (l.min(shape.at(q)), h.max(shape.at(q))));
        self.put_force("span", height.abs() * (high - low));
    }

    fn put_drift(&mut self, drift: Option<Drift>, cold: bool) {
        if let Some(Drift { change, time_constant, law: DriftLaw::Exponential }) = drift {
            // From where a warm start begins it is another change in every recording.
            if cold {
                self.put("change", change);
            }
            self.put("time_constant", time_constant);
        }
    }

    fn put_harmonics(&mut self, list: &[Harmonic], force: bool) {
        let rms = (list.iter().map(|h| h.amplitude * h.amplitude / 2.0).sum::<f64>()).sqrt();
        self.push("rms", rms, force);
        for h in list {
            self.push(&format!("order_{}", h.order), h.amplitude, force);
        }
    }

    fn put_train(&mut self, plant: &Plant) {
        match plant.train {
            Train::Rigid => {}
            Train::Gap { gap, .. } => self.put("gap", gap),
            Train::Spring { load_share, stiffness, .. } => {
                let antiresonance = (stiffness / (plant.inertia * load_share)).sqrt();
                self.put("antiresonance_hz", antiresonance / TAU);
            }
            Train::Slip { ceiling, .. } => self.put_force("ceiling", ceiling),
        }
    }
}
