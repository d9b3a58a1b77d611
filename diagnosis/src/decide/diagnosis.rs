//! A finished diagnosis: everything that a report says, and nothing left to fit.

use crate::data::rig::Rig;
use crate::data::schema::{FitTable, Parameter, Place, Simulation, Verdict};
use crate::decide::confidence::Evidence;
use crate::decide::decisive::Decisive;
use crate::decide::evidence_table::EvidenceRow;
use crate::decide::out_of_library::UnnamedPhysics;
use crate::decide::rejection::{BetterExplanation, Rejection};
use crate::evidence::known_travel::BeyondFitted;
use crate::evidence::residual_maps::Map;
use crate::fit::blocked_recording::BlockedRecording;
use crate::laws::EffectName;
use crate::propose::free_form::{Inputs, Shape};
use crate::propose::untested::NotTested;
use crate::simulation::comparison::Comparison;
use std::collections::BTreeMap;

/// The result of the stages.
pub(crate) enum Diagnosis {
    /// The recordings do not suffice for a verdict, and nothing was named.
    CannotTell {
        rig: Box<Rig>,
        reason: Reason,
        /// Rows a second of the slowest recording, where the recordings were looked at.
        rate_hz: Option<f64>,
    },
    /// The recordings sufficed for a verdict.
    Complete(Box<Complete>),
}

/// The reason why recordings do not suffice for a verdict, or the residual where no effect is
/// named.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Reason {
    /// Something is wrong with the recordings, or they are too short: a sentence from where it was
    /// seen.
    Recordings(String),
    /// The rig's model does not describe these recordings at all; it leaves this part of the force.
    Misfit { left: f64 },
    /// No row of the fitted or of the held-out recordings shows a force, although the axis moves.
    NoForce,
    /// The sensor's noise hides the rest: this part of the held-out force remains.
    MostRemains { left: f64 },
    /// All motion is at about one speed, within this factor.
    OneSpeed { factor: f64 },
    /// A force that swings at a frequency of its own is this part of what a refit leaves.
    Swing { part: f64, hertz: f64 },
    /// The residual resembles an effect, but something without a name explains more.
    Resembles { effect: EffectName, rather: BetterExplanation },
    /// Physics without a name explains most of it.
    UnnamedPhysics(UnnamedPhysics),
    /// A force of any form explains it.
    FreeForm,
    /// The regression finds an effect that takes this part of the force error, too little for a
    /// name.
    Follows { effect: EffectName, share: f64 },
    /// The residual repeats where the motion does.
    Repeats { correlation: f64 },
}

/// The values of a rig and its recordings that a refit moved.
pub(crate) struct Moved {
    /// Rows by which commands act after their time stamps; none where the recordings show no skew.
    pub(crate) late_rows: Option<f64>,
    /// Inertia over gain, over the rig's own.
    pub(crate) inertia_by_gain: f64,
    /// Distance of that from 1, in standard deviations of the rig's uncertainty; zero where the
    /// rig's inertia hardly matters.
    pub(crate) deviations: f64,
    /// True if it stopped at the limit that the rig's uncertainty sets.
    pub(crate) is_at_limit: bool,
    /// True if the recordings do not show the inertia, so that the rig's was kept.
    pub(crate) is_hidden: bool,
    /// Standard deviation of a reading, counts, where the rig declares none.
    pub(crate) scatter: Option<f64>,
}

/// A diagnosis of recordings that sufficed for a verdict.
pub(crate) struct Complete {
    pub(crate) verdict: Verdict,
    pub(crate) reason: Option<Reason>,
    /// The named effects, the one that explains most first.
    pub(crate) effects: Vec<NamedEffect>,
    /// Every hypothesis that was looked at closely, each effect once.
    pub(crate) hypotheses: Vec<JudgedHypothesis>,
    /// The models that contend for the least decided name; none where every name is single.
    pub(crate) contenders: Vec<Contender>,
    /// Effects that these recordings could not show, with the reason.
    pub(crate) untested: Vec<(EffectName, NotTested)>,
    /// Force errors under the three models.
    pub(crate) errors: FitTable,
    /// The values that the refit moved.
    pub(crate) moved: Moved,
    /// Bandwidth of the residuals, Hz.
    pub(crate) bandwidth_hz: f64,
    /// Residual that the sensor's noise alone causes, N·m or N.
    pub(crate) noise_floor: f64,
    /// Part of the held-out mean square above the noise that the patched model leaves.
    pub(crate) unexplained_fraction: f64,
    /// The place of the mismatch, if nothing was named.
    pub(crate) place: Option<Place>,
    /// The gain of a force of any form: alone where nothing is named, otherwise in addition to the
    /// named effects.
    pub(crate) free_form: Option<FreeForce>,
    /// Travel that is to be recorded to fit on.
    pub(crate) beyond_fitted: Option<BeyondFitted>,
    /// The models run forward and compared with the held-out recordings, and their errors over all
    /// of them.
    pub(crate) simulated: Vec<Comparison>,
    pub(crate) simulation: Option<Simulation>,
    /// The residual over the state of the first named effect.
    pub(crate) decisive: Option<Decisive>,
    /// The evidence for every hypothesis.
    pub(crate) evidence: Vec<EvidenceRow>,
    /// Residuals of every recording, fitted ones first.
    pub(crate) series: Vec<Series>,
    /// Residuals over states.
    pub(crate) maps: Vec<Map>,
    pub(crate) rigs: Rigs,
    /// Rows a second of the slowest recording.
    pub(crate) rate_hz: Option<f64>,
}

/// The rig under the three models.
pub(crate) struct Rigs {
    /// As it was given.
    pub(crate) nominal: Rig,
    /// With refitted values alone.
    pub(crate) refit: Rig,
    /// With refitted values and the effects found.
    pub(crate) patched: Rig,
}

/// An effect that is named.
pub(crate) struct NamedEffect {
    pub(crate) name: EffectName,
    /// Every effect that the data cannot distinguish from it, itself first.
    pub(crate) class: Vec<EffectName>,
    pub(crate) confidence: f64,
    pub(crate) parameters: BTreeMap<String, Parameter>,
    pub(crate) place: Place,
}

/// A hypothesis and what became of it.
pub(crate) struct JudgedHypothesis {
    pub(crate) name: EffectName,
    /// Held-out gain over the model without it, nats; none where it was not judged there.
    pub(crate) holdout_gain: Option<f64>,
    /// The evidence, where the confidence decided.
    pub(crate) evidence: Option<Evidence>,
    pub(crate) class: Vec<EffectName>,
    /// Why it is not named; none if it is.
    pub(crate) rejection: Option<Rejection>,
}

/// A model that still contends for a name.
pub(crate) struct Contender {
    /// The effect; none for the model without it.
    pub(crate) name: Option<EffectName>,
    /// Probability as far as these recordings show.
    pub(crate) probability: f64,
    /// The whole machine with it, fitted.
    pub(crate) rig: Rig,
}

/// The gain of a force of any form.
pub(crate) struct FreeForce {
    pub(crate) inputs: Inputs,
    /// Its shape, where nothing is named.
    pub(crate) shape: Option<Shape>,
    /// Gain on held-out recordings, nats; none where it was not fitted for them.
    pub(crate) holdout_gain: Option<f64>,
    /// Gain on left-out blocks of the fitted recordings, and its standard error, nats.
    pub(crate) left_out_gain: f64,
    pub(crate) left_out_error: f64,
    /// Part of what the named effects and this force together take of left-out blocks that the
    /// named effects take.
    pub(crate) share_of_ceiling: f64,
}

/// Residuals of one recording over time, per block of at most 1 kHz.
#[derive(Debug, Clone)]
pub struct Series {
    /// The recording's file name.
    pub file: String,
    /// True if it was held out.
    pub held_out: bool,
    /// s since the first row.
    pub time_s: Vec<f64>,
    /// rad/s or m/s.
    pub velocity: Vec<f64>,
    /// Residual force, N·m or N; none at rest.
    pub nominal: Vec<Option<f64>>,
    /// After the refit.
    pub refit: Vec<Option<f64>>,
    /// With the effects found.
    pub patched: Vec<Option<f64>>,
    /// The drive's force under the same estimator.
    pub force: Vec<f64>,
}

impl Series {
    pub(crate) fn new(
        track: &BlockedRecording,
        held_out: bool,
        moves: &[bool],
        nominal: &[f64],
        refit: &[f64],
        patched: &[f64],
        force: &[f64],
    ) -> Self {
        let moving =
            |column: &[f64]| column.iter().zip(moves).map(|(x, moves)| moves.then_some(*x)).collect();
        Self {
            file: track.blocks.file.clone(),
            held_out,
            time_s: track
                .blocks
                .start
                .iter()
                .zip(&track.blocks.span)
                .map(|(t, h)| track.blocks.lead_s + t + 0.5 * h)
                .collect(),
            velocity: track.motion.v.clone(),
            nominal: moving(nominal),
            refit: moving(refit),
            patched: moving(patched),
            force: force.to_vec(),
        }
    }
}
