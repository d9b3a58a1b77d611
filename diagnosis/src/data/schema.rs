//! `diagnosis.json`: the words and the shape of the report, as the contract fixes them.

use crate::laws::{EffectName, Subsystem, Variable};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// The verdict of the recordings on the simulation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The nominal model explains the recordings down to their noise.
    NoMismatch,
    /// Values were wrong, the structure is right.
    ParametersOnly,
    /// One to three effects were left out.
    MissingPhysics,
    /// A repeatable mismatch that no known effect explains.
    Unexplained,
    /// A mismatch that does not repeat and depends on nothing recorded.
    RandomDisturbance,
    /// These recordings do not suffice for a verdict.
    InsufficientExcitation,
}

/// A fitted value with its interval.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Parameter {
    /// In `unit`.
    pub value: f64,
    /// 95 % interval.
    pub ci95: [f64; 2],
    /// The unit; "1" for a number without a unit.
    pub unit: String,
}

impl Parameter {
    /// The unit as people read it: empty for a number without a unit.
    pub(crate) fn unit_in_words(&self) -> &str {
        if self.unit == "1" { "" } else { &self.unit }
    }
}

/// A stretch of a recording in which something shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Stretch {
    /// The recording's file name.
    pub file: String,
    /// From and to, s from the first row's time stamp zero.
    pub intervals_s: Vec<[f64; 2]>,
}

/// In which states something shows.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// `speed`, `travel`, `angle`, `command`, `time` or `tilt`.
    pub variable: String,
    /// Lower end, SI or command units.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// The place where simulation and recording differ.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// In time.
    pub recordings: Vec<Stretch>,
    /// In state.
    pub states: Vec<Region>,
}

/// An effect that was left out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Its name.
    pub name: EffectName,
    /// Every effect that the data cannot distinguish from it, itself included.
    pub class: Vec<EffectName>,
    /// Returns the subsystem that it belongs to.
    pub subsystem: Subsystem,
    /// Probability that the class holds the truth.
    pub confidence: f64,
    /// Values by the contract's names.
    pub parameters: BTreeMap<String, Parameter>,
    /// The place where it shows.
    #[serde(rename = "where")]
    pub place: Place,
    /// The recording that would decide within the class.
    pub separating_experiment: Option<String>,
}

/// A number on both kinds of recordings; not a number, `null` in the file, where nothing was
/// fitted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct Both {
    /// On the recordings that were fitted.
    #[serde(deserialize_with = "null_is_nan")]
    pub fit: f64,
    /// On those that were held out.
    #[serde(deserialize_with = "null_is_nan")]
    pub holdout: f64,
}

impl Both {
    /// The errors if nothing was fitted.
    pub const NONE: Self = Self { fit: f64::NAN, holdout: f64::NAN };
}

fn null_is_nan<'de, D: serde::Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(from)?.unwrap_or(f64::NAN))
}

/// A length under the three models, root mean square; none where there is no such model or
/// simulation.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub struct ByModel {
    /// The rig as it is.
    pub nominal: Option<f64>,
    /// With its values refitted.
    pub refit: Option<f64>,
    /// With the effects found.
    pub patched: Option<f64>,
}

/// Windows of one length, started from the measured state.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WindowsOff {
    /// Their length, s.
    pub seconds: f64,
    /// Position error, rad or m.
    #[serde(flatten)]
    pub position: ByModel,
}

/// Position errors of the three models when they run forward along the held-out recordings.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Simulation {
    /// rad or m.
    pub unit: String,
    /// From each recording's first row to its last.
    pub free_run: ByModel,
    /// In windows.
    pub windows: Vec<WindowsOff>,
    /// A sentence if the patched simulation follows the motion less well than the refitted one.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub worse: Option<String>,
}

/// The fit of the three models.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitTable {
    /// `force_rmse`.
    pub metric: String,
    /// N·m or N.
    pub unit: String,
    /// The rig as it is.
    pub nominal: Both,
    /// With its values refitted.
    pub refit: Both,
    /// With the effects found.
    pub patched: Both,
    /// Root mean square of the force itself under the same estimator.
    pub force_rms: Both,
    /// Relative reduction of the held-out mean square from refit to patched, 95 %.
    pub holdout_gain_ci95: [f64; 2],
}

/// A hypothesis and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Hypothesis {
    /// The effect.
    pub name: EffectName,
    /// Log-likelihood of the held-out recordings that it brings over the model without it; none
    /// where it was not judged there.
    pub holdout_gain: Option<f64>,
    /// The evidence for and against it, as its confidence weighs it; only where it came through the
    /// search.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub evidence: Option<BTreeMap<String, f64>>,
    /// Every effect that the data cannot distinguish from it, itself included; only where it came
    /// through the search.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub class: Vec<EffectName>,
    /// The reason why it was rejected; absent if it was named.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub rejected_because: Option<String>,
}

/// A model that still contends for a name: a rig in the folder `contenders` of the report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Contending {
    /// The effect; none for the model without it.
    pub name: Option<EffectName>,
    /// Probability as far as these recordings show, 0 to 1.
    pub probability: f64,
    /// The rig's file, from the report's folder.
    pub rig: String,
}

/// An effect that these recordings could not show.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Untested {
    /// The effect.
    pub name: EffectName,
    /// The reason, with what a recording would need.
    pub because: String,
}

/// A force of any form: what is there and has no name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FreeForm {
    /// The variables that it depends on.
    pub inputs: Vec<Variable>,
    /// Its form in words.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub in_words: Option<String>,
    /// Gain of log-likelihood on the held-out recordings over the model without it; none where it
    /// was not fitted for them.
    pub holdout_gain: Option<f64>,
    /// The same on blocks of the fitted recordings that were left out, and its standard error.
    pub left_out_gain: f64,
    /// Its standard error.
    pub left_out_error: f64,
    /// Part of what the named effects and this force together take of left-out blocks that the
    /// named effects take, 0 to 1.
    pub share_of_ceiling: f64,
}

/// The kind of a fault of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FaultKind {
    /// The position is logged more often than it is read; the value is its new readings a second.
    HeldReadings,
    /// The command is logged more often than it is renewed; the value is its new values a second.
    SlowCommand,
    /// The command is logged after the motion that it makes; the value is the time between them.
    LateCommand,
    /// The axis moves one way only; the value is the part of its travel that goes the other way.
    OneWayMotion,
}

/// A fault of a recording, found before any law was searched.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct DataFault {
    /// Its kind.
    pub kind: FaultKind,
    /// Its size, in `unit`.
    pub value: f64,
    /// `Hz`, `s` or `1`.
    pub unit: String,
    /// The recording's file name.
    pub file: String,
}

/// The report.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// 1.
    pub format: u32,
    /// The verdict.
    pub verdict: Verdict,
    /// The verdict in one sentence that a technician understands.
    pub sentence: String,
    /// A clause: the residual compared with the sensor's noise.
    #[serde(default)]
    pub remains: String,
    /// A clause: the recording to make next.
    #[serde(default)]
    pub record_next: String,
    /// Effects left out, the largest first.
    pub effects: Vec<Named>,
    /// Before and after.
    pub fit: FitTable,
    /// Refitted nominal values that moved, by key.
    pub refitted: BTreeMap<String, f64>,
    /// Rows by which commands act after their time stamps, -1 to 1; none where the recordings show
    /// no skew.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub command_late_rows: Option<f64>,
    /// Faults of the recordings; each is taken out of what was diagnosed, or is the reason why
    /// nothing was.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub data_faults: Vec<DataFault>,
    /// Clauses that say what the refit did that a reader has to know.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub notes: Vec<String>,
    /// Bandwidth of the residuals, Hz.
    pub residual_bandwidth_hz: f64,
    /// Residual that the sensor's noise alone causes, root mean square.
    pub noise_floor: f64,
    /// Part of the held-out mean square above the noise that the patched model leaves.
    pub unexplained_fraction: f64,
    /// Every effect that was tested, with the outcome.
    pub hypotheses: Vec<Hypothesis>,
    /// Effects that these recordings could not show.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub untested: Vec<Untested>,
    /// The models that contend for the least decided name, the most probable first; empty where
    /// every name is single.
    #[serde(skip_serializing_if = "Vec::is_empty", default)]
    pub contenders: Vec<Contending>,
    /// The gain of a force of any form in addition to the named effects.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub free_form: Option<FreeForm>,
    /// The place of the mismatch, if nothing was named.
    #[serde(rename = "where", skip_serializing_if = "Option::is_none", default)]
    pub place: Option<Place>,
    /// The recording to make next, if the recordings do not suffice for a verdict.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub separating_experiment: Option<String>,
    /// The three models run forward and compared with the held-out recordings.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub simulation: Option<Simulation>,
    /// The reason why the recordings cannot decide, or the residual if no effect is named.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub reason: Option<String>,
}
