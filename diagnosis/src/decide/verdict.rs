//! The verdict. It rests on all that was weighed, not only on what is named; nothing here changes a
//! model.

use crate::data::schema::Verdict;
use crate::decide::diagnosis::Reason;
use crate::decide::thresholds::{DOMINANT, MATERIAL, UNDERSTOOD};
use crate::decide::weighed_model::WeighedModel;
use crate::evidence::comparison::ModelComparison;
use crate::evidence::residual_maps::Map;
use crate::evidence::residuals::{above, refit_matters};
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::nominal::Nominal;
use crate::laws::CommandLaw;
use crate::propose::excitation::Excitation;

/// Part of the force that must be left, on every recording, to say that the rig's model does not
/// speak of these recordings.
const MISFIT_PART: f64 = 0.85;
/// Part of the force, above the noise, that a disturbance must make up before it is called one.
const DISTURBED: f64 = 0.05;
/// Part of the refit's mean square that doubtful effects must leave at most for the mismatch to be
/// called repeatable.
const REPEATS: f64 = 0.7;

/// Returns why the rig's model does not describe these recordings at all; none if it does.
/// `is_driven` says whether the command drives the motion.
pub(crate) fn misfit(weighed: &WeighedModel, nominal: &Nominal, is_driven: bool) -> Option<Reason> {
    let table = &weighed.shown.table;
    let force = table.force_rms;
    if !(force.fit > 0.0 && force.holdout > 0.0) {
        return Some(Reason::NoForce);
    }
    // Where the inertia is hardly known the refit alone says little; elsewhere it must explain
    // something, unless what was found explains nearly all. A command that is another one explains
    // anything; a plain force that was left out explains what it should.
    let is_another = weighed.effects.iter().any(|e| CommandLaw::new(&e.found.effect).is_some());
    let refitted = nominal.anchor.is_none() && (is_another || weighed.effects.is_empty());
    let judged = if refitted { table.refit } else { table.patched };
    let fits_not = judged.holdout > MISFIT_PART * force.holdout
        && judged.fit > MISFIT_PART * force.fit
        && (is_another || table.patched.holdout > UNDERSTOOD.0 * force.holdout);
    (fits_not && is_driven).then(|| Reason::Misfit { left: judged.holdout / force.holdout.max(1e-300) })
}

/// The verdict, and the residual where no effect is named; `maps` are of the residual of the whole
/// model, `foreign` what physics without a name alone would explain, `follows` what a plain
/// regression would.
pub(crate) fn verdict(
    weighed: &WeighedModel,
    maps: &[Map],
    holdout: &[BlockedRecording],
    excitation: &Excitation,
    foreign: Option<Reason>,
    follows: &dyn Fn() -> Option<Reason>,
) -> (Verdict, Option<Reason>) {
    let ModelComparison { on_holdout, table, .. } = &weighed.shown;
    let left = above(table.patched.holdout, weighed.floor, 0.0).sqrt();
    let disturbed = left > DISTURBED * table.force_rms.holdout;
    // What was found and is too unsure to be named still says that the mismatch repeats, if it
    // explains much of it.
    let helps =
        !weighed.effects.is_empty() && table.patched.holdout.powi(2) < REPEATS * table.refit.holdout.powi(2);
    let repeats = maps.iter().any(|map| map.significant && map.carries > 0.1);
    let again = weighed.repeats.filter(|_| disturbed);
    let swings = weighed
        .swing
        .filter(|swing| disturbed && swing.part > DOMINANT)
        .map(|swing| Reason::Swing { part: swing.part, hertz: swing.hertz });
    // What the noise of reading counts hides almost whole is no mismatch, whatever it resembles.
    let is_seen = weighed.floor < (1.0 - MATERIAL) * table.refit.holdout;
    let foreign = foreign.filter(|_| is_seen);
    let resembles = weighed.resembled().filter(|_| is_seen);
    let resembles = resembles.map(|(effect, rather)| Reason::Resembles { effect, rather });
    if !weighed.named().is_empty() {
        (Verdict::MissingPhysics, None)
    } else if excitation.is_one_speed() {
        (Verdict::InsufficientExcitation, Some(Reason::OneSpeed { factor: excitation.speeds }))
    } else if (weighed.understood && helps)
        || (disturbed && repeats)
        || swings.is_some()
        || foreign.is_some()
        || resembles.is_some()
        || again.is_some()
    {
        let again = again.map(|correlation| Reason::Repeats { correlation });
        (Verdict::Unexplained, swings.or(resembles).or(foreign).or(again))
    } else if disturbed {
        // Only what no regression on what was recorded predicts depends on nothing.
        match follows() {
            Some(reason) => (Verdict::Unexplained, Some(reason)),
            None => (Verdict::RandomDisturbance, None),
        }
    } else if table.patched.holdout > UNDERSTOOD.1 * table.force_rms.holdout {
        let left = table.patched.holdout / table.force_rms.holdout;
        (Verdict::InsufficientExcitation, Some(Reason::MostRemains { left }))
    } else if refit_matters(&weighed.estimator, holdout, on_holdout, table.force_rms.holdout) {
        (Verdict::ParametersOnly, None)
    } else {
        (Verdict::NoMismatch, None)
    }
}
