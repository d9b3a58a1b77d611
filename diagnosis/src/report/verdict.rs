//! The verdict. It rests on all that was weighed, not only on what is named; nothing here changes a model.

use crate::effects::{CommandLaw, EffectName};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::model::Nominal;
use crate::io::schema::Verdict;
use crate::selection::excitation::Excitation;
use crate::thresholds::UNDERSTOOD;
use crate::validation::assess::Assessment;
use crate::validation::comparison::Shown;
use crate::validation::out_of_library::Foreign;
use crate::validation::rejection::Rather;
use crate::validation::residual_maps::Map;
use crate::validation::residuals::{above, refit_matters};

/// Part of the force that must be left, on every recording, to say that the rig's model does not speak of these recordings.
const FOREIGN: f64 = 0.85;
/// Part of the force that a disturbance must make up before it is called one, beside the noise.
const DISTURBED: f64 = 0.05;
/// Part of the refit's mean square that doubtful effects must leave at the most for the mismatch to be called repeatable.
const REPEATS: f64 = 0.7;

/// Why recordings cannot tell, or what is left where no effect is named.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Reason {
    /// Something is wrong with the recordings, or they are too short: a sentence from where it was seen.
    Recordings(String),
    /// The rig's model does not describe these recordings at all; it leaves this part of the force.
    Misfit { left: f64 },
    /// All motion is at about one speed, within this factor.
    OneSpeed { factor: f64 },
    /// A force that swings at a frequency of its own is this part of what a refit leaves.
    Swing { part: f64, hertz: f64 },
    /// The residual resembles an effect, but something without a name explains more.
    Resembles { effect: EffectName, rather: Rather },
    /// Physics without a name explains most of it.
    Foreign(Foreign),
    /// A force of any form explains it.
    FreeForm,
    /// The residual repeats where the motion does.
    Repeats { correlation: f64 },
}

/// Why the rig's model does not describe these recordings at all; none if it does.
pub(crate) fn misfit(assessment: &Assessment, nominal: &Nominal) -> Option<Reason> {
    let table = &assessment.shown.table;
    let force = table.force_rms;
    // Where the inertia is hardly known the refit alone says little; elsewhere it must explain something, unless what was
    // found explains nearly all.
    // A command that is another one explains anything; a plain force that was left out explains what it should.
    let is_another = assessment.effects.iter().any(|e| CommandLaw::new(&e.found.effect).is_some());
    let refitted = nominal.anchor.is_none() && (is_another || assessment.effects.is_empty());
    let judged = if refitted { table.refit } else { table.patched };
    let fits_not = judged.holdout > FOREIGN * force.holdout
        && judged.fit > FOREIGN * force.fit
        && (is_another || table.patched.holdout > UNDERSTOOD.0 * force.holdout);
    fits_not.then(|| Reason::Misfit { left: judged.holdout / force.holdout.max(1e-300) })
}

/// The verdict, and what is left where no effect is named; `maps` are of what the whole model leaves,
/// `foreign` what physics without a name alone would explain.
pub(crate) fn verdict(
    assessment: &Assessment,
    maps: &[Map],
    holdout: &[BlockedRecording],
    excitation: &Excitation,
    foreign: Option<Reason>,
) -> (Verdict, Option<Reason>) {
    let Shown { on_holdout, table, .. } = &assessment.shown;
    let left = above(table.patched.holdout, assessment.floor, 0.0).sqrt();
    let disturbed = left > DISTURBED * table.force_rms.holdout;
    // What was found and is too unsure to be named still says that the mismatch repeats, if it explains much of it.
    let helps = !assessment.effects.is_empty()
        && table.patched.holdout.powi(2) < REPEATS * table.refit.holdout.powi(2);
    let repeats = maps.iter().any(|map| map.significant && map.carries > 0.1);
    let again = assessment.repeats.filter(|_| disturbed);
    let swings = assessment
        .swing
        .filter(|swing| disturbed && swing.is_left_out())
        .map(|swing| Reason::Swing { part: swing.part, hertz: swing.hertz });
    let resembles = assessment.resembled().map(|(effect, rather)| Reason::Resembles { effect, rather });
    if !assessment.named().is_empty() {
        (Verdict::MissingPhysics, None)
    } else if excitation.is_one_speed() {
        (Verdict::InsufficientExcitation, Some(Reason::OneSpeed { factor: excitation.speeds }))
    } else if (assessment.understood && helps)
        || (disturbed && repeats)
        || swings.is_some()
        || foreign.is_some()
        || resembles.is_some()
        || again.is_some()
    {
        let again = again.map(|correlation| Reason::Repeats { correlation });
        (Verdict::Unexplained, swings.or(resembles).or(foreign).or(again))
    } else if disturbed {
        (Verdict::RandomDisturbance, None)
    } else if refit_matters(&assessment.estimator, holdout, on_holdout, table.force_rms.holdout) {
        (Verdict::ParametersOnly, None)
    } else {
        (Verdict::NoMismatch, None)
    }
}
