//! Compares several models of one machine with one recording: the error of each, and the motions to
//! draw.

use super::frequency::FrequencyResponse;
use super::replay::{Beside, Deviation, Trajectory};
use super::{Motion, PositionLoop};
use crate::data::recording::Recording;
use crate::data::rig::{Kind, Rig};
use numerics::parallel;
use serde::Serialize;

/// One model compared with a recording.
#[derive(Debug, Clone)]
pub struct Simulated {
    /// Its name: nominal, refit, patched and so on.
    pub model: String,
    /// From the first row under the recorded command.
    pub free: Trajectory,
    /// Position at every row, started from the measured state every `AFRESH_S`, rad or m; none
    /// where the recording is shorter than two of these.
    pub afresh: Option<Vec<f64>>,
    /// Under the recorded reference, where there is one and the loop was recognised.
    pub under: Option<Trajectory>,
    /// Inertia times acceleration along the recorded motion, N·m or N.
    pub force: Vec<f64>,
    /// Its errors.
    pub figures: Figures,
}

/// Errors of a model, root mean square.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// The error over the whole recording.
    pub free_run: Off,
    /// The errors in windows started from the measured state.
    pub windows: Vec<Window>,
    /// Under the recorded reference.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub under_reference: Option<Off>,
    /// The first row's place on the mechanism, fitted if the model has periodic effects, rad or m.
    pub start: f64,
}

/// Root mean squares.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Off {
    /// rad or m.
    pub position_rms: f64,
    /// rad/s or m/s.
    pub velocity_rms: f64,
}

impl From<Deviation> for Off {
    fn from(d: Deviation) -> Self {
        Self { position_rms: d.position, velocity_rms: d.velocity }
    }
}

/// Windows of one length.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Window {
    /// Their length, s.
    pub seconds: f64,
    /// Their errors.
    #[serde(flatten)]
    pub off: Off,
}

/// Models compared with a recording.
#[derive(Debug, Clone)]
pub struct Comparison {
    /// The recording's file name.
    pub file: String,
    /// Rotary or linear.
    pub kind: Kind,
    /// As recorded.
    pub motion: Motion,
    /// Inertia of the first model times the recorded acceleration, N·m or N.
    pub force: Vec<f64>,
    /// The loop that ran, where it was recognised.
    pub feedback: Option<PositionLoop>,
    /// In the order given.
    pub models: Vec<Simulated>,
    /// The responses of the recording and of the models' free runs, where it is long enough.
    pub response: Option<FrequencyResponse>,
}

impl Simulated {
    /// Runs a model beside a recording; `feedback` is the loop that ran, if it was recognised, and
    /// `windows` are lengths in s.
    fn new(name: &str, rig: &Rig, beside: &Beside, feedback: Option<PositionLoop>, windows: &[f64]) -> Self {
        let free = beside.free_run(rig);
        let under = feedback.map(|feedback| beside.under_reference(rig, feedback));
        let whole = beside.motion.seconds();
        let windows = windows.iter().copied().filter(|seconds| *seconds <= whole);
        let figures = Figures {
            free_run: free.deviation(&beside.motion).into(),
            windows: windows
                .map(|seconds| Window { seconds, off: beside.windows(rig, seconds).into() })
                .collect(),
            under_reference: under.as_ref().map(|u| u.deviation(&beside.motion).into()),
            start: beside.start,
        };
        let afresh = (whole > 2.0 * AFRESH_S).then(|| beside.started_every(rig, AFRESH_S));
        Self { model: name.to_owned(), free, afresh, under, force: beside.force(rig), figures }
    }
}

impl Comparison {
    /// Runs every model and compares it with a recording; the first names kind, resolution and
    /// inertia. `windows` are lengths in s.
    pub fn new(recording: &Recording, models: &[(String, Rig)], windows: &[f64]) -> Self {
        let Some((_, first)) = models.first() else {
            unreachable!("a comparison is asked for with at least one model")
        };
        let motion = Motion::new(recording, first);
        let feedback = PositionLoop::fit(recording, &motion, first.actuator.gain);
        let simulated = |(name, rig): &(String, Rig)| {
            let has_same_counts = rig.encoder.counts_per_unit == first.encoder.counts_per_unit;
            let beside = match has_same_counts {
                true => Beside::in_motion(recording, motion.clone(), rig),
                false => Beside::new(recording, rig),
            };
            Simulated::new(name, rig, &beside, feedback, windows)
        };
        let models: Vec<Simulated> = parallel::map_all(models, simulated);
        let positions: Vec<(&str, &[f64])> =
            models.iter().map(|m| (m.model.as_str(), &m.free.position[..])).collect();
        let response =
            FrequencyResponse::new(recording, &motion, first.encoder.counts_per_unit.recip(), &positions);
        let force = motion.accelerations().iter().map(|a| a * first.model.inertia).collect();
        Self { file: recording.file.clone(), kind: first.kind, motion, force, feedback, models, response }
    }

    /// The figures of a model of this name.
    pub fn figures(&self, model: &str) -> Option<&Figures> {
        self.models.iter().find(|m| m.model == model).map(|m| &m.figures)
    }

    /// A sentence where the model that leaves the least force, the patched one or else the refit,
    /// is off by more in its trajectory than one before it; none where it is not.
    pub fn worse_for_less_force(&self) -> Option<String> {
        if self.figures("patched").is_some() {
            self.worse("patched", "refit").or_else(|| self.worse("patched", "nominal"))
        } else {
            self.worse("refit", "nominal")
        }
    }

    /// A sentence where a model is off by more in its trajectory than another, in the free run or
    /// in windows; none where not.
    pub fn worse(&self, model: &str, than: &str) -> Option<String> {
        let (a, b) = (self.figures(model)?, self.figures(than)?);
        let unit = self.kind.length();
        let mut said = Vec::new();
        if a.free_run.position_rms > MUCH * b.free_run.position_rms {
            said.push(format!(
                "over the whole of {} it is {} {unit} off instead of {}",
                self.file,
                numerics::digits::short(a.free_run.position_rms),
                numerics::digits::short(b.free_run.position_rms)
            ));
        }
        let worse: Vec<String> = a
            .windows
            .iter()
            .zip(&b.windows)
            .filter(|(a, b)| a.off.position_rms > MUCH * b.off.position_rms)
            .map(|(a, _)| format!("{}", a.seconds))
            .collect();
        if !worse.is_empty() {
            said.push(format!("it is further off in windows of {} s", worse.join(", ")));
        }
        (!said.is_empty()).then(|| {
            format!(
                "The {model} simulation follows the motion less well than the {than}: {}",
                said.join("; ")
            )
        })
    }
}

/// Time between two starts from the measured state in the motion that is drawn so, s.
pub(crate) const AFRESH_S: f64 = 0.5;
/// Ratio of errors from which a model counts as worse.
const MUCH: f64 = 1.05;
