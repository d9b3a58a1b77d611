//! One model per effect, written once: the diagnosis evaluates its terms along a recording, the
//! simulator runs it forward.
//!
//! [`Effect`] is data (what a patched rig holds), [`Law`] is the same effect with its internal
//! state. Each effect has a file of its own with its `Definition`; to add one, write its file and a
//! line in the registry below. Nothing here may know how an effect is found.

mod bristles;
mod command;
pub(crate) mod definition;
pub(crate) mod experiments;
mod formula;
pub(crate) mod joint_terms;
mod law;
mod load;
mod record;
mod shape;
mod state;
mod travel_profile;
mod variable;
mod waves;

pub(crate) use command::CommandLaw;
pub(crate) use formula::read_effects;
pub use formula::{Formula, FormulaId, FormulaText};
pub use law::Law;
pub(crate) use law::{sinc, wave_mean};
pub(crate) use load::WholeMachine;
pub use regression::laws::Subsystem;
pub use state::State;
pub use table::ForceTable;
pub use variable::Variable;

use definition::Definition;
use serde::{Deserialize, Deserializer, Serialize, Serializer};
use shape::{Missing, ShapeKey};
use std::collections::BTreeMap;
use std::fmt;

macro_rules! registry {
    ($($variant:ident $module:ident;)*) => {
        $(mod $module;)*

        /// The effects, by the name that the report uses: that of the file which defines it.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
        #[allow(missing_docs)]
        pub enum EffectName {
            $($variant,)*
            /// A formula of a user's own, under a name of its own.
            Formula(FormulaId),
        }

        impl EffectName {
            /// All that are built in.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The name in reports.
            pub fn as_str(self) -> &'static str { match self { $(Self::$variant => stringify!($module),)* Self::Formula(id) => id.get().name() } }

            /// Returns its definition.
            pub(crate) fn definition(self) -> &'static dyn Definition {
                match self { $(Self::$variant => &$module::$variant,)* Self::Formula(id) => id.get() }
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
    DriveLoss drive_loss;
    FrictionDrift friction_drift;
    Cogging cogging;
    TorqueRipple torque_ripple;
    CommandDeadband command_deadband;
    CommandSaturation command_saturation;
    SupplyLimit supply_limit;
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
    /// The effect of a name in a report: built in, or a formula that has been read.
    pub fn find(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|known| known.as_str() == name).or_else(|| formula::find(name))
    }

    /// The formula behind a name of a user's own.
    pub fn formula(self) -> Option<&'static Formula> {
        match self {
            Self::Formula(id) => Some(id.get()),
            _ => None,
        }
    }

    /// Returns a noun phrase for it that a technician understands.
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Formula(id) => id.get().words,
            _ => self.record().map_or("a force without a name", |record| record.words),
        }
    }
}

impl Serialize for EffectName {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_str(self.as_str())
    }
}

impl<'de> Deserialize<'de> for EffectName {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        let name = String::deserialize(from)?;
        Self::find(&name).ok_or_else(|| serde::de::Error::custom(format!("{name} is not a known effect")))
    }
}

impl fmt::Display for EffectName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str(self.as_str())
    }
}

/// An effect with its numbers: `shape` enters non-linearly (speeds, orders, delays), `coefficients`
/// linearly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "InFile", into = "InFile")]
pub struct Effect {
    /// The name of the effect.
    pub name: EffectName,
    /// Values that enter non-linearly, by name; SI units, command units or cycles per turn.
    pub shape: BTreeMap<String, f64>,
    /// Values that enter linearly, by the name of their term; force units or relative.
    pub coefficients: BTreeMap<String, f64>,
    /// The force itself, where it has no name.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<ForceTable>,
}

/// An effect as a rig file has it: a formula brings its text.
#[derive(Serialize, Deserialize)]
struct InFile {
    name: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    title: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    formula: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    words: Option<String>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    parameters: BTreeMap<String, [f64; 2]>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    shape: BTreeMap<String, f64>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    coefficients: BTreeMap<String, f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    table: Option<ForceTable>,
}

/// The name that a rig file gives to every formula.
const FORMULA: &str = "formula";

impl From<Effect> for InFile {
    fn from(effect: Effect) -> Self {
        let Effect { name, shape, coefficients, table } = effect;
        let text = name.formula().map(|formula| formula.text.clone());
        let plain = if text.is_some() { FORMULA } else { name.as_str() };
        let (title, formula) =
            (text.as_ref().map(|t| t.title.clone()), text.as_ref().map(|t| t.formula.clone()));
        let words = text.as_ref().map(|t| t.words.clone()).filter(|words| !words.is_empty());
        let parameters = text.map(|t| t.parameters).unwrap_or_default();
        Self { name: plain.to_owned(), title, formula, words, parameters, shape, coefficients, table }
    }
}

impl TryFrom<InFile> for Effect {
    type Error = String;

    fn try_from(file: InFile) -> Result<Self, String> {
        let InFile { name, title, formula, words, mut parameters, shape, coefficients, table } = file;
        if name != FORMULA {
            let known = EffectName::find(&name).ok_or_else(|| format!("{name} is not a known effect"))?;
            return Ok(Self { name: known, shape, coefficients, table });
        }
        let formula =
            formula.ok_or("an effect of name formula needs the formula itself, as formula = \"-a*v\"")?;
        let mut values = shape;
        values.extend(coefficients);
        for (key, value) in values.iter().filter(|(key, _)| *key != "scale") {
            // Values without bounds may be anything of their size.
            parameters.entry(key.clone()).or_insert([value - value.abs() - 1.0, value + value.abs() + 1.0]);
        }
        let title = title.unwrap_or_else(|| FORMULA.to_owned());
        let text = FormulaText { title, formula, parameters, words: words.unwrap_or_default() };
        let name = Formula::register(text)?;
        let mut effect = Self::shaped(name, &[]);
        let terms = name.formula().map(|f| f.terms()).unwrap_or_default();
        for (key, value) in values {
            let place = if terms.contains(&key) { &mut effect.coefficients } else { &mut effect.shape };
            place.insert(key, value);
        }
        if terms == ["scale"] {
            effect.coefficients.entry("scale".into()).or_insert(1.0);
        }
        Ok(effect)
    }
}

impl Effect {
    /// An effect with its shape and without coefficients.
    pub fn shaped(name: EffectName, shape: &[(&str, f64)]) -> Self {
        let shape = shape.iter().map(|(key, value)| ((*key).to_owned(), *value)).collect();
        Self { name, shape, coefficients: BTreeMap::new(), table: None }
    }

    /// A force without a name; `turn` is the travel of one turn where it is over the angle.
    pub(crate) fn tabled(table: ForceTable, turn: Option<f64>) -> Self {
        let mut effect = Self::shaped(EffectName::Table, &[]);
        effect.shape.extend(turn.map(|turn| ("turn".to_owned(), turn)));
        effect.table = Some(table);
        effect
    }

    /// One value of the shape. A missing one is what the effect's file declares, and not a number
    /// where that declares nothing.
    pub fn value(&self, key: &str) -> f64 {
        let declared = || match self.shape_key(key).map(|known| known.missing) {
            Some(Missing::Is(value)) => value,
            _ => f64::NAN,
        };
        self.shape.get(key).copied().unwrap_or_else(declared)
    }

    /// Returns what its file declares of a key of the shape.
    fn shape_key(&self, key: &str) -> Option<&'static ShapeKey> {
        self.name.definition().shape_keys().iter().copied().flatten().find(|known| known.is(key))
    }

    /// The travel of one turn, rad or m, where the effect repeats with a known one.
    pub fn turn(&self) -> Option<f64> {
        self.shape.get("turn").copied()
    }

    /// One coefficient; where it is missing, zero, and one of a table, which is a force by itself.
    pub fn coefficient(&self, key: &str) -> f64 {
        let missing = if self.name == EffectName::Table { 1.0 } else { 0.0 };
        self.coefficients.get(key).copied().unwrap_or(missing)
    }

    /// An effect that is made of whole orders of a turn, rad or m.
    pub(crate) fn of_orders(name: EffectName, turn: f64, orders: &[f64]) -> Self {
        let mut effect = Self::shaped(name, &[("turn", turn)]);
        effect.shape.extend(orders.iter().map(|order| (format!("order_{order}"), *order)));
        effect
    }

    /// An effect that is made of waves of these lengths, rad or m, the shortest first.
    pub(crate) fn of_periods(name: EffectName, periods: &[f64]) -> Self {
        let mut effect = Self::shaped(name, &[]);
        let numbered = periods.iter().enumerate();
        effect.shape.extend(numbered.map(|(i, period)| (format!("period_{}", i + 1), *period)));
        effect
    }

    /// The values of the shape that a fit may have slightly wrong: not the travel of a turn, and
    /// not the waves along it.
    pub fn uncertain_values(&self) -> impl Iterator<Item = (&str, f64)> {
        let is_of_waves =
            |key: &str| key == "turn" || key.starts_with("order_") || key.starts_with("period_");
        let values = self.shape.iter().map(|(key, value)| (key.as_str(), *value));
        values.filter(move |(key, value)| !is_of_waves(key) && *value != 0.0)
    }

    /// Returns the largest command that does nothing, in units of command, where a deadband shifts
    /// what is beyond it; `None` for every other effect.
    pub fn shifted_dead_band(&self) -> Option<f64> {
        let is_one = self.name == EffectName::CommandDeadband;
        (is_one && self.value("shift") != 0.0).then(|| self.value("half_width"))
    }

    /// The spatial frequencies of a periodic effect, rad per unit of travel, with the suffix of
    /// their coefficients.
    pub fn waves(&self) -> Vec<(String, f64)> {
        let turn = self.turn().unwrap_or(std::f64::consts::TAU);
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

    /// Checks that a law has every coefficient that is given: it would count as zero.
    fn check_coefficients(&self) -> Result<(), String> {
        let Some(law) = self.name.definition().law(self) else { return Ok(()) };
        let names = law.names();
        match self.coefficients.keys().find(|key| !names.contains(key)) {
            None => Ok(()),
            Some(other) => Err(format!(
                "coefficients.{other} is not a value of {}, which has {}",
                self.name,
                names.join(", ")
            )),
        }
    }

    /// Checks that the shape holds the values that the effect's file declares and no other.
    fn check_keys(&self) -> Result<(), String> {
        if self.name.formula().is_some() {
            return Ok(());
        }
        let keys: Vec<&ShapeKey> = self.name.definition().shape_keys().iter().copied().flatten().collect();
        if let Some(other) = self.shape.keys().find(|key| self.shape_key(key).is_none()) {
            let known = match keys.iter().map(|known| known.in_words()).collect::<Vec<_>>().split_last() {
                None => "none".to_owned(),
                Some((last, [])) => last.clone(),
                Some((last, others)) => format!("{} and {last}", others.join(", ")),
            };
            return Err(format!("shape.{other} is not a value of {}, which has {known}", self.name));
        }
        for ShapeKey { name, .. } in keys.iter().filter(|known| known.missing == Missing::Refused) {
            if !self.shape.get(*name).is_some_and(|value| *value > 0.0) {
                return Err(format!("shape.{name} is required and must be above zero"));
            }
        }
        Ok(())
    }

    /// Checks that the numbers can be run; the reason where not.
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
        if let Some(formula) = self.name.formula() {
            let missing = formula.shape().iter().find(|(key, _, _)| !self.shape.contains_key(*key));
            if let Some((key, _, _)) = missing {
                return Err(format!("its parameter {key} has no value; give it as shape.{key}"));
            }
        }
        self.check_keys()?;
        self.check_coefficients()?;
        for (key, value) in &self.shape {
            if (key.starts_with("period_") || key == "turn" || key == "per_command") && *value == 0.0 {
                return Err(format!("shape.{key} must not be zero"));
            }
        }
        Ok(())
    }
}
