//! One model per effect, written once: the diagnosis evaluates its terms along a recording, the simulator runs it forward.
//!
//! [`Effect`] is data (what a patched rig holds), [`Law`] is the same effect with its internal state. What an effect is stands in
//! a file of its own, as a [`definition::Definition`]; to add one, write its file and a line in the registry below. Nothing here
//! may know how an effect is found.

mod bristles;
mod command;
pub(crate) mod definition;
pub(crate) mod experiments;
mod law;
mod load;
mod travel_profile;
mod waves;

pub use command::CommandLaw;
pub(crate) use law::wave_mean;
pub use law::{Law, State};
pub use table::{Table, Variable};

use definition::Definition;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// Where an effect sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs)]
pub enum Subsystem {
    Transmission,
    Actuator,
    Load,
    Sensor,
}

macro_rules! registry {
    ($($variant:ident $module:ident;)*) => {
        $(mod $module;)*

        /// The effects, by the name that the report uses: that of the file which defines it.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        #[allow(missing_docs)]
        pub enum EffectName { $($variant,)* }

        impl EffectName {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The name in reports.
            pub fn as_str(self) -> &'static str { match self { $(Self::$variant => stringify!($module),)* } }

            /// What it is.
            pub(crate) fn definition(self) -> &'static dyn Definition {
                match self { $(Self::$variant => &$module::Defined,)* }
            }
        }
    };
}

// In the order in which near ties are looked through.
registry! {
    ViscousFriction viscous_friction;
    CoulombFriction coulomb_friction;
    AsymmetricFriction asymmetric_friction;
    StribeckFriction stribeck_friction;
    PreslidingFriction presliding_friction;
    QuadraticDrag quadratic_drag;
    PositionDependentFriction position_dependent_friction;
    LoadDependentFriction load_dependent_friction;
    FrictionDrift friction_drift;
    Cogging cogging;
    TorqueRipple torque_ripple;
    CommandDeadband command_deadband;
    CommandSaturation command_saturation;
    CommandDelay command_delay;
    ElectricalLag electrical_lag;
    GainDrift gain_drift;
    Backlash backlash;
    DriveCompliance drive_compliance;
    RollerSlip roller_slip;
    MassImbalance mass_imbalance;
    TiltGravity tilt_gravity;
    PositionSpring position_spring;
    PositionDependentDamping position_dependent_damping;
    EncoderEccentricity encoder_eccentricity;
    MissedCounts missed_counts;
    Table table;
}

impl EffectName {
    /// Where it sits.
    pub fn subsystem(self) -> Subsystem {
        self.definition().subsystem()
    }

    /// What it is, in words a technician uses.
    pub fn in_words(self) -> &'static str {
        self.definition().words()
    }
}

impl fmt::Display for EffectName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.as_str())
    }
}

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
    /// The force itself, where it has no name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<Table>,
}

impl Effect {
    /// An effect with its shape and without coefficients.
    pub fn shaped(name: EffectName, shape: &[(&str, f64)]) -> Self {
        let shape = shape.iter().map(|(key, value)| ((*key).to_owned(), *value)).collect();
        Self { name, shape, coefficients: BTreeMap::new(), table: None }
    }

    /// A force without a name; `turn` is the travel of one turn where it is over the angle.
    pub fn tabled(table: Table, turn: Option<f64>) -> Self {
        let mut effect = Self::shaped(EffectName::Table, &[]);
        effect.shape.extend(turn.map(|turn| ("turn".to_owned(), turn)));
        effect.table = Some(table);
        effect
    }

    /// One value of the shape, or what stands for it where it is missing.
    pub fn shape_or(&self, key: &str, otherwise: f64) -> f64 {
        self.shape.get(key).copied().unwrap_or(otherwise)
    }

    /// Whether a value of the shape that is a yes or no is a yes.
    pub(crate) fn is_set(&self, key: &str) -> bool {
        self.shape_or(key, 0.0) > 0.5
    }

    /// One coefficient; where it is missing, zero, and one of a table, which is a force as it stands.
    pub fn coefficient(&self, key: &str) -> f64 {
        let missing = if self.name == EffectName::Table { 1.0 } else { 0.0 };
        self.coefficients.get(key).copied().unwrap_or(missing)
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
        match (&self.table, self.name) {
            (Some(table), EffectName::Table) => table.check()?,
            (None, EffectName::Table) => return Err("it needs a table with over, grid and force".into()),
            (Some(_), _) => return Err("only an effect of the name table may have a table".into()),
            (None, _) => {}
        }
        for (key, value) in self.shape.iter().chain(&self.coefficients) {
            if !value.is_finite() || value.abs() > 1e30 {
                return Err(format!("{key} must be a finite number"));
            }
        }
        for key in self.name.definition().needed() {
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
