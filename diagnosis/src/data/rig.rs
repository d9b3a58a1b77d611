//! The rig: the nominal simulation as its author believes it, read from and written to `rig.toml`.
//!
//! A patched rig is the same file with refitted values and an `[[effect]]` table per effect found.

use crate::data::error::InputError;
use crate::data::known_keys;
use crate::laws::{CommandLaw, Effect, EffectName};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// The kind of the rig's coordinate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// An angle in rad; forces are torques in N·m.
    Rotary,
    /// A length in m; forces in N.
    Linear,
}

impl Kind {
    /// The unit of the coordinate.
    pub fn length(self) -> &'static str {
        match self {
            Self::Rotary => "rad",
            Self::Linear => "m",
        }
    }
    /// The unit of the generalised force.
    pub fn force(self) -> &'static str {
        match self {
            Self::Rotary => "N·m",
            Self::Linear => "N",
        }
    }
}

/// Nominal values; a key that is missing is not in the nominal model.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Model {
    /// kg·m² or kg.
    pub inertia: f64,
    /// N·m·s/rad or N·s/m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscous: Option<f64>,
    /// N·m or N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coulomb: Option<f64>,
    /// N·m or N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// N·m or N, the load torque at a tilt of 90°.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// N·m: an off-centre mass adds −gravity·sin(q − gravity_zero); only with absolute counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<f64>,
    /// rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity_zero: Option<f64>,
}

/// Relative standard deviation of each nominal value (absolute for the offset).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Uncertainty {
    /// Relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia: Option<f64>,
    /// Relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub viscous: Option<f64>,
    /// Relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coulomb: Option<f64>,
    /// N·m or N.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset: Option<f64>,
    /// Relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub weight: Option<f64>,
    /// Relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gravity: Option<f64>,
    /// Relative.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub gain: Option<f64>,
}

/// The drive.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Actuator {
    /// N·m (or N) per unit of command.
    pub gain: f64,
    /// A label: A, V, N·m, N or dac.
    #[serde(default = "unit_of_command")]
    pub command_unit: String,
    /// The largest |command| that the drive accepts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub limit: Option<f64>,
    /// A delay already known between command and force, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub delay_s: Option<f64>,
    /// A first-order lag already known, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lag_s: Option<f64>,
}

fn unit_of_command() -> String {
    "1".into()
}

/// The encoder.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Encoder {
    /// Counts per rad or per m.
    pub counts_per_unit: f64,
    /// True if counts have the same zero in every recording.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub absolute: bool,
    /// Standard deviation of a reading beyond its quantisation, counts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noise_counts: Option<f64>,
    /// A first-order filter already known in the reading, s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub filter_s: Option<f64>,
    /// Travel per turn of the motor, rad or m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turn: Option<f64>,
    /// Recordings start at the same mechanical place within this, rad or m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start_spread: Option<f64>,
}

/// A rig file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Rig {
    /// The version of the format: 1.
    pub format: u32,
    /// A label.
    #[serde(default)]
    pub name: String,
    /// Rotary or linear.
    pub kind: Kind,
    /// The nominal values.
    pub model: Model,
    /// The uncertainty of the values.
    #[serde(default)]
    pub uncertainty: Uncertainty,
    /// The drive.
    pub actuator: Actuator,
    /// The encoder.
    pub encoder: Encoder,
    /// Effects in addition to the nominal model; in a patched rig only.
    #[serde(default, rename = "effect", skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<Effect>,
    /// Formulas that are searched too.
    #[serde(skip)]
    pub searched: Vec<EffectName>,
}

/// Uncertainty assumed where the rig declares none: a data-sheet value for what is easily measured,
/// a guess for friction.
const UNDECLARED_EASY: f64 = 0.1;
const UNDECLARED_FRICTION: f64 = 0.5;

impl Rig {
    /// Reads and checks a rig file.
    pub fn read(path: &Path) -> Result<Self, InputError> {
        let text = std::fs::read_to_string(path).map_err(|cause| {
            InputError::new(format!(
                "{}: the rig file cannot be read ({cause}); check its path",
                path.display()
            ))
        })?;
        Self::parse(&text, &path.display().to_string())
    }

    /// Checks the text of a rig file; `file` is what errors call it.
    pub fn parse(text: &str, file: &str) -> Result<Self, InputError> {
        // First, because a misspelt key is missing under its right name too.
        if let Some(what) = text.parse().ok().as_ref().and_then(known_keys::unknown) {
            return Err(InputError::new(format!("{file}: {what}")));
        }
        let rig: Self = toml::from_str(text).map_err(|cause| {
            let line =
                cause.span().map_or(1, |span| text[..span.start.min(text.len())].matches('\n').count() + 1);
            InputError::new(format!(
                "{file}, line {line}: {}; docs/guide/files.md has every key",
                cause.message()
            ))
        })?;
        rig.check().map_err(|what| InputError::new(format!("{file}: {what}")))?;
        Ok(rig)
    }

    fn check(&self) -> Result<(), String> {
        if self.format != 1 {
            return Err(format!("format is {}; this tool reads format 1", self.format));
        }
        let positive = [
            ("model.inertia", Some(self.model.inertia)),
            ("encoder.counts_per_unit", Some(self.encoder.counts_per_unit)),
            ("encoder.turn", self.encoder.turn),
            ("actuator.limit", self.actuator.limit),
        ];
        for (key, value) in positive {
            if value.is_some_and(f64::is_nan) {
                return Err(format!(
                    "{key} is not filled in, and recordings do not show it; enter the value of your simulation"
                ));
            }
            if let Some(x) = value.filter(|x| !(x.is_finite() && *x > 0.0 && *x < 1e30)) {
                return Err(format!("{key} is {x}; it must be a number above zero"));
            }
        }
        self.check_gain()?;
        self.check_signed_values()?;
        for effect in &self.effects {
            effect.check().map_err(|reason| format!("effect {}: {reason}; correct it", effect.name))?;
        }
        Ok(())
    }

    fn check_gain(&self) -> Result<(), String> {
        let gain = self.actuator.gain;
        if gain.is_nan() {
            return Err(
                "actuator.gain is not filled in: it is the force for one unit of command, and recordings do not show it".into(),
            );
        }
        if !(gain.is_finite() && gain != 0.0 && gain.abs() < 1e30) {
            return Err(format!("actuator.gain is {gain}; it must be a number other than zero"));
        }
        Ok(())
    }

    /// Checks the values that may be zero, and those that may have either sign.
    fn check_signed_values(&self) -> Result<(), String> {
        let u = &self.uncertainty;
        let not_negative = [
            ("model.viscous", self.model.viscous),
            ("model.coulomb", self.model.coulomb),
            ("encoder.start_spread", self.encoder.start_spread),
            ("encoder.noise_counts", self.encoder.noise_counts),
            ("encoder.filter_s", self.encoder.filter_s),
            ("actuator.delay_s", self.actuator.delay_s),
            ("actuator.lag_s", self.actuator.lag_s),
            ("uncertainty.gravity", u.gravity),
            ("uncertainty.inertia", u.inertia),
            ("uncertainty.viscous", u.viscous),
            ("uncertainty.coulomb", u.coulomb),
            ("uncertainty.offset", u.offset),
            ("uncertainty.weight", u.weight),
            ("uncertainty.gain", u.gain),
        ];
        for (key, value) in not_negative {
            if let Some(x) = value.filter(|x| !(x.is_finite() && (0.0..1e30).contains(x))) {
                return Err(format!("{key} is {x}; it must be a number not below zero"));
            }
        }
        if self.model.gravity.is_some_and(|x| x != 0.0) && !self.encoder.absolute {
            return Err(
                "model.gravity needs counts of one zero; set encoder.absolute = true or take it out".into()
            );
        }
        for (key, value) in [
            ("model.offset", self.model.offset),
            ("model.weight", self.model.weight),
            ("model.gravity", self.model.gravity),
            ("model.gravity_zero", self.model.gravity_zero),
        ] {
            if let Some(x) = value.filter(|x| !(x.is_finite() && x.abs() < 1e30)) {
                return Err(format!("{key} is {x}; it must be a finite number"));
            }
        }
        Ok(())
    }

    /// The text of a rig file.
    pub fn to_toml(&self) -> String {
        toml::to_string(self).expect("a rig has nothing that TOML cannot say")
    }

    /// Travel per turn of the motor where known: rad or m.
    pub fn turn(&self) -> Option<f64> {
        self.encoder.turn.or((self.kind == Kind::Rotary).then_some(std::f64::consts::TAU))
    }

    /// The delay and the lag between command and force that the rig already knows.
    pub(crate) fn known_command_laws(&self) -> Vec<CommandLaw> {
        let positive = |value: Option<f64>| value.filter(|x| *x > 0.0);
        let delay = positive(self.actuator.delay_s).map(CommandLaw::of_delay);
        let lag = positive(self.actuator.lag_s).map(CommandLaw::of_lag);
        delay.into_iter().chain(lag).collect()
    }

    /// Relative standard deviation of the inertia.
    pub(crate) fn inertia_sd(&self) -> f64 {
        self.uncertainty.inertia.unwrap_or(UNDECLARED_EASY).max(1e-4)
    }
    /// Relative standard deviation of the gain.
    pub(crate) fn gain_sd(&self) -> f64 {
        self.uncertainty.gain.unwrap_or(UNDECLARED_EASY).max(1e-4)
    }
    /// Relative standard deviation of the viscous friction.
    pub(crate) fn viscous_sd(&self) -> f64 {
        self.uncertainty.viscous.unwrap_or(UNDECLARED_FRICTION).max(1e-4)
    }
    /// Relative standard deviation of the dry friction.
    pub(crate) fn coulomb_sd(&self) -> f64 {
        self.uncertainty.coulomb.unwrap_or(UNDECLARED_FRICTION).max(1e-4)
    }
    /// Relative standard deviation of the gravity of an off-centre mass.
    pub(crate) fn gravity_sd(&self) -> f64 {
        self.uncertainty.gravity.unwrap_or(UNDECLARED_EASY).max(1e-4)
    }
    /// Relative standard deviation of the weight.
    pub(crate) fn weight_sd(&self) -> f64 {
        self.uncertainty.weight.unwrap_or(UNDECLARED_EASY).max(1e-4)
    }
}

#[cfg(test)]
impl Rig {
    /// A rotary rig of these values with a gain of 0.1 and a thousand counts per rad.
    pub(crate) fn of_values(inertia: f64, viscous: f64, coulomb: f64) -> Self {
        let text = format!(
            "format = 1\nkind = \"rotary\"\n[model]\ninertia = {inertia}\nviscous = {viscous}\ncoulomb = {coulomb}\n\
             [actuator]\ngain = 0.1\ncommand_unit = \"A\"\n[encoder]\ncounts_per_unit = 1000.0\n"
        );
        Self::parse(&text, "a test").expect("the rig is right")
    }
}
