//! The verdict. It rests on all that was weighed, not only on what is named; nothing here changes a model.

use crate::effects::CommandLaw;
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::model::Nominal;
use crate::io::schema::Verdict;
use crate::selection::excitation::Excitation;
use crate::thresholds::UNDERSTOOD;
use crate::validation::assess::Assessment;
use crate::validation::comparison::Shown;
use crate::validation::residual_maps::Map;
use crate::validation::residuals::{above, refit_matters};

/// Part of the force that must be left, on every recording, to say that the rig's model does not speak of these recordings.
const FOREIGN: f64 = 0.85;
/// Part of the force that a disturbance must make up before it is called one, beside the noise.
const DISTURBED: f64 = 0.05;
/// Part of the refit's mean square that doubtful effects must leave at the most for the mismatch to be called repeatable.
const REPEATS: f64 = 0.7;

/// Why the rig's model does not speak of these recordings at all, if it does not.
pub(crate) fn misfit(assessment: &Assessment, nominal: &Nominal) -> Option<String> {
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
    fits_not.then(|| {
        format!(
            "the rig's model with refitted values leaves {:.0} % of the force unexplained, as it does where a unit is off (seconds, counts, command) or where the axis is moved by something that was not recorded",
            100.0 * judged.holdout / force.holdout.max(1e-300)
        )
    })
}

/// The verdict, and what is left where no effect is named; `maps` are of what the whole model leaves,
/// `foreign` what physics without a name alone would explain.
pub(crate) fn verdict(
    assessment: &Assessment,
    maps: &[Map],
    holdout: &[BlockedRecording],
    excitation: &Excitation,
    foreign: Option<String>,
) -> (Verdict, Option<String>) {
    let Shown { on_holdout, table, .. } = &assessment.shown;
    let left = above(table.patched.holdout, assessment.floor, 0.0).sqrt();
    let disturbed = left > DISTURBED * table.force_rms.holdout;
    // What was found and is too unsure to be named still says that the mismatch repeats, if it explains much of it.
    let helps = !assessment.effects.is_empty()
        && table.patched.holdout.powi(2) < REPEATS * table.refit.holdout.powi(2);
    let repeats = maps.iter().any(|map| map.significant && map.carries > 0.1);
    let again = assessment.repeats.filter(|_| disturbed);
    let swings = assessment.swing.and_then(|swing| swing.in_words()).filter(|_| disturbed);
    if !assessment.named().is_empty() {
        (Verdict::MissingPhysics, None)
    } else if excitation.is_one_speed() {
        (Verdict::InsufficientExcitation, Some(excitation.one_speed()))
    } else if (assessment.understood && helps)
        || (disturbed && repeats)
        || swings.is_some()
        || foreign.is_some()
        || assessment.foreign().is_some()
        || again.is_some()
    {
        (
            Verdict::Unexplained,
            swings.or_else(|| assessment.foreign()).or(foreign).or_else(|| again.map(in_words)),
        )
    } else if disturbed {
        (Verdict::RandomDisturbance, None)
    } else if refit_matters(&assessment.estimator, holdout, on_holdout, table.force_rms.holdout) {
        (Verdict::ParametersOnly, None)
    } else {
        (Verdict::NoMismatch, None)
    }
}

fn in_words(correlation: f64) -> String {
    format!("what is left repeats where the motion does, with a correlation of {correlation:.2}")
}
