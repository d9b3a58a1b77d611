//! The clauses of a report that say why an effect is not named, and why nothing is; `outcome` makes
//! the headline. Nothing reads one to decide.

use crate::decide::diagnosis::Reason;
use crate::decide::rejection::{BetterExplanation, Rejection, Weakness};
use crate::decide::thresholds::{CERTAIN_Z, LEAST_SHARE, MATERIAL, SURE_Z, UNLIKELY_Z, UNSURE_SHARE};
use crate::propose::untested::NotTested;
use numerics::bootstrap::Gain;
use numerics::digits::short;

/// Says why an effect is not named, as a clause.
pub(crate) fn rejection(why: &Rejection) -> String {
    match why {
        Rejection::SlowDisturbance => "a slow disturbance explains as much".into(),
        Rejection::NotSureInSearch { fit_z, filter_z, share } => format!(
            "the search found it unsure: its gain is {fit_z:.1} standard errors on stretches of the fitted recordings that were left out of the fit and {filter_z:.1} as a filter follows these recordings, and it explains {:.0} % of what the noise leaves",
            100.0 * share.max(0.0)
        ),
        Rejection::LessLikely { nats } => {
            format!("held-out recordings are less likely with it, by {nats:.0} nats")
        }
        Rejection::UnlikelyGain { z } => {
            format!("its gain on held-out recordings is {z:.1} standard errors, less than {UNLIKELY_Z}")
        }
        Rejection::MayGainNothing { gain: Gain { sum, low, high, .. } } => format!(
            "its gain on held-out recordings, {sum:.0} nats, may be zero (95 %: {low:.0} to {high:.0})"
        ),
        Rejection::NotSure { fit_z, holdout_z, share } => not_sure(*fit_z, *holdout_z, *share),
        Rejection::FewMoments { fit_z, holdout_z } => format!(
            "its gain rests on few moments of the fitted recordings: {fit_z:.1} standard errors there, less than {UNLIKELY_Z}, and {holdout_z:.1} on held-out ones, less than {SURE_Z}"
        ),
        Rejection::TooSmall { share } => format!(
            "it explains {:.1} % of what the noise leaves, less than {:.0} %",
            100.0 * share,
            100.0 * LEAST_SHARE
        ),
        Rejection::SmallAndUnsure { share, least, z } => small_and_unsure(*share, *least, *z),
        Rejection::Immaterial { part } => immaterial(*part),
        Rejection::NotPeriodic => {
            "its orders follow one another without a gap, as at places along the travel, not at teeth or poles"
                .into()
        }
        Rejection::AtLimit => "a fitted parameter reached its limit".into(),
        Rejection::NoSize => "its size cannot be distinguished from zero".into(),
        Rejection::Creeps { part } => {
            format!("it would bend over {:.0} % of the travel, as a spring that creeps does", 100.0 * part)
        }
        Rejection::BetterExplanation(what) => rather(what),
        Rejection::BesideUnknown => "a larger effect in the same model is not in the library".into(),
        Rejection::Undecided => "more effects explain it as well than a class may hold".into(),
        Rejection::Improbable { probability, weakness: weakest } => {
            format!("it is right with a probability of only {probability:.2}: {}", weakness(weakest))
        }
        Rejection::Indistinguishable { from } => {
            format!("the recordings cannot distinguish it from {}", from.in_words())
        }
        Rejection::LessInSearch => "not fitted in full: other effects explained more in the search".into(),
        Rejection::NotInMotion => "the force that the motion asks for shows nothing of it".into(),
        Rejection::LeavesMore => "what is named instead leaves less of the force error".into(),
        Rejection::Behind { winner, z } => {
            format!("{} explains more by {z:.1} standard errors", winner.in_words())
        }
    }
}

fn small_and_unsure(share: f64, least: f64, z: f64) -> String {
    format!(
        "it explains {:.1} % of what the noise leaves, and effects below {:.0} % need a gain of {CERTAIN_Z} standard errors; this one has {z:.1}",
        100.0 * share,
        100.0 * least
    )
}

fn immaterial(part: f64) -> String {
    format!(
        "it takes {:.1} % off the held-out force error, less than the {:.0} % that make it material",
        100.0 * part.max(0.0),
        100.0 * MATERIAL
    )
}

fn not_sure(fit_z: f64, holdout_z: f64, share: f64) -> String {
    format!(
        "its gain is {fit_z:.1} standard errors on left-out blocks of the fitted recordings and {holdout_z:.1} on held-out ones, not {SURE_Z} on both, and it explains {:.0} % of what the noise leaves, less than {:.0} %",
        100.0 * share.max(0.0),
        100.0 * UNSURE_SHARE
    )
}

fn rather(what: &BetterExplanation) -> String {
    match what {
        BetterExplanation::Unnamed { what } => format!("{what} would explain more"),
        BetterExplanation::FreeForm { over, form, effect } => {
            let own = if *effect > 0.0 { format!("{effect:.0}") } else { "nothing".to_owned() };
            format!(
                "a free-form force over {} gains {form:.0} nats on left-out blocks, and it gains {own}",
                over.in_words()
            )
        }
    }
}

fn weakness(weakest: &Weakness) -> String {
    match weakest {
        Weakness::UnsureGain { z } => format!(
            "its gain is {z:.1} standard errors on left-out blocks of the fitted or on held-out recordings"
        ),
        Weakness::SmallShare { share } => {
            format!("it explains {:.1} % of what the noise leaves", 100.0 * share)
        }
        Weakness::Unexplained { part } => {
            format!("{:.0} % of what the refit leaves beyond chance remains with it", 100.0 * part)
        }
    }
}

/// Says why an effect was not looked for, as a clause; `unit` is that of the travel.
pub(crate) fn not_tested(why: &NotTested, unit: &str) -> String {
    match why {
        NotTested::InertiaHardlyMatters => {
            "it shows only where the inertia matters, and in this motion it hardly does".into()
        }
        NotTested::TravelTooShort { travel, needed } => format!(
            "the travel is {} {unit}, and at least {} {unit} would be needed",
            short(*travel),
            short(*needed)
        ),
        NotTested::OrdersTooLong { turns, up_to } => {
            let (orders, shown) = match *up_to > 1.0 {
                true => (format!("orders 1 to {up_to}"), "all"),
                false => ("order 1".to_owned(), "it"),
            };
            format!(
                "a travel of {} turns is too short for {orders}; one turn would show {shown}",
                short(*turns)
            )
        }
        NotTested::NoColumn(column) => format!("a column `{column}` that changes would be needed"),
        NotTested::NoCommonStart => {
            "recordings that start at one place would be needed, with `start_spread` or `absolute` in the rig"
                .into()
        }
        NotTested::SameAsWeight => "the rig's weight under this tilt is the same force".into(),
        NotTested::NoMotion => "these recordings have no motion that would show it".into(),
    }
}

/// The reason why recordings do not suffice for a verdict, or the residual where no effect is
/// named; `form` is the force of any form, in words, where there is one.
pub(crate) fn reason(why: &Reason, form: Option<&str>) -> String {
    let sentence = match why {
        Reason::Recordings(sentence) => sentence.clone(),
        Reason::Misfit { left } => format!(
            "the rig's model with refitted values leaves {:.0} % of the force unexplained, as it does where a unit is wrong (seconds, counts, command) or where something that was not recorded moves the axis",
            100.0 * left
        ),
        Reason::NoForce => {
            "every row counts as rest although the axis moves, so that no force is seen: check that the position is read at every row, and its unit"
                .into()
        }
        Reason::MostRemains { left } => format!(
            "{:.0} % of the force on held-out recordings remains, which the sensor's noise hides",
            100.0 * left
        ),
        Reason::OneSpeed { factor } => format!(
            "all motion is at about one speed (nine tenths of it within a factor of {factor:.1}), so effects that depend on speed look like those that do not"
        ),
        Reason::Swing { part, hertz } => format!(
            "{:.0} % of what a refit leaves is a force that swings at {hertz:.1} Hz, whatever the axis does",
            100.0 * part
        ),
        Reason::Resembles { effect, rather: what } => {
            format!("it resembles {}, but {}", effect.in_words(), rather(what))
        }
        Reason::UnnamedPhysics(foreign) => {
            format!("{} would explain {:.0} % of it", foreign.what, 100.0 * foreign.share)
        }
        Reason::FreeForm => return format!("{} would explain it", form.unwrap_or("a force of some form")),
        Reason::Follows { effect, share } => {
            format!("{} would take {:.0} % of the force error, too little for a name", effect.in_words(), 100.0 * share)
        }
        Reason::Repeats { correlation } => {
            format!("the residual repeats where the motion does, with a correlation of {correlation:.2}")
        }
    };
    match form {
        Some(form) => format!("{sentence}; the residual is {form}"),
        None => sentence,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rejection_gives_the_figure_that_rejects() {
        let little = rejection(&Rejection::SmallAndUnsure { share: 0.03, least: 0.05, z: 4.2 });
        assert!(little.contains("3.0 %") && little.contains("5 %") && little.contains("4.2"), "{little}");
        let gain = Gain { sum: 661.0, low: -10.0, high: 1322.0, z: 2.4, clipped_z: 2.4 };
        let none = rejection(&Rejection::MayGainNothing { gain });
        assert!(none.contains("661 nats") && none.contains("-10 to 1322"), "{none}");
    }

    #[test]
    fn a_form_that_is_the_reason_is_said_once() {
        let form = "a force that grows with speed";
        assert_eq!(reason(&Reason::FreeForm, Some(form)), format!("{form} would explain it"));
        let other = reason(&Reason::Repeats { correlation: 0.8 }, Some(form));
        assert!(other.ends_with(&format!("; the residual is {form}")), "{other}");
    }
}
