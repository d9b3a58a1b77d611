//! One model per effect, written once: the diagnosis evaluates its terms along a recording, the simulator runs it forward.
//!
//! [`Effect`] is data (what a patched rig holds), [`Law`] is the same effect with its internal state, and [`Plant`] runs a
//! whole patched rig. Nothing here may know how an effect is found.

mod bristles;
mod command;
mod law;
mod load;
mod name;
mod table;

pub(crate) use bristles::lengths as bristle_lengths;
pub use command::CommandLaw;
pub use law::{Law, State};
pub(crate) use law::{legendre, wave_mean};
pub use name::{EffectName, Subsystem};
pub use table::Variable;

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// An effect with its numbers: `shape` enters non-linearly (speeds, orders, delays), `coefficients` linearly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Effect {
    /// Which effect.
    pub name: EffectName,
    /// What enters non-linearly, by name; SI units, command units or cycles per turn.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub shape: BTreeMap<String, f64>,
    /// What enters linearly, by the name of its term; force units or relative.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub coefficients: BTreeMap<String, f64>,
}

impl Effect {
    /// An effect with its shape and without coefficients.
    pub fn shaped(name: EffectName, shape: &[(&str, f64)]) -> Self {
        let shape = shape.iter().map(|(key, value)| ((*key).to_owned(), *value)).collect();
        Self { name, shape, coefficients: BTreeMap::new() }
    }

    /// One value of the shape, or what stands for it where it is missing.
    pub fn shape_or(&self, key: &str, otherwise: f64) -> f64 {
        self.shape.get(key).copied().unwrap_or(otherwise)
    }

    /// One coefficient; zero where it is missing.
    pub fn coefficient(&self, key: &str) -> f64 {
        self.coefficients.get(key).copied().unwrap_or(0.0)
    }

    /// The spatial frequencies of a periodic effect, rad per unit of travel, with the suffix of their coefficients.
    pub fn waves(&self) -> Vec<(String, f64)> {
        let turn = self.shape_or("turn", std::f64::consts::TAU);
        let mut waves: Vec<(String, f64)> = Vec::new();
        for (key, value) in &self.shape {
            if let Some(order) = key.strip_prefix("order_") {
                waves.push((order.to_owned(), value * std::f64::consts::TAU / turn));
            } else if let Some(index) = key.strip_prefix("period_") {
                waves.push((index.to_owned(), std::f64::consts::TAU / value));
            }
        }
        waves.sort_by(|a, b| a.1.total_cmp(&b.1));
        waves
    }

    /// Whether the numbers can be run; the reason where not.
    pub(crate) fn check(&self) -> Result<(), String> {
        for (key, value) in self.shape.iter().chain(&self.coefficients) {
            if !value.is_finite() || value.abs() > 1e30 {
                return Err(format!("{key} must be a finite number"));
            }
        }
        let positive: &[&str] = match self.name {
            EffectName::StribeckFriction => &["speed"],
            EffectName::PreslidingFriction => &["deflection"],
            EffectName::FrictionDrift | EffectName::GainDrift | EffectName::ElectricalLag => {
                &["time_constant"]
            }
            EffectName::CommandSaturation => &["limit"],
            EffectName::RollerSlip => &["limit", "creep", "coast", "ratio"],
            EffectName::Backlash => &["gap", "coast", "contact_hz", "ratio"],
            EffectName::DriveCompliance => &["resonance_hz", "damping"],
            EffectName::CommandDelay => &["delay"],
            _ => &[],
        };
        for key in positive {
            if !self.shape.get(*key).is_some_and(|value| *value > 0.0) {
                return Err(format!("shape.{key} must stand there and be above zero"));
            }
        }
        for (key, value) in &self.shape {
            if (key.starts_with("period_") || key == "turn" || key == "per_command") && *value == 0.0 {
                return Err(format!("shape.{key} must not be zero"));
            }
        }
        Ok(())
    }
}
