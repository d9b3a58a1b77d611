//! The second and the third line of a report: how much remains against the sensor's noise, and what
//! to record next.

use crate::data::schema::{Report, Verdict};
use crate::decide::thresholds::UNDERSTOOD;

/// The residual over the sensor's noise from which there is more to be found, and below which there
/// is nothing.
pub(crate) const MORE: f64 = 3.0;
const NOTHING: f64 = 1.5;

/// The next recording where something is still missing.
const FURTHER: &str = "the same motion twice, then slower and faster: the differences show whether the force depends on time, speed or position";

/// The patched model's residual on held-out recordings, over the residual that the sensor's noise
/// alone causes; none where nothing was fitted, or the sensor has no noise to speak of.
pub(crate) fn of_noise(report: &Report) -> Option<f64> {
    let ratio = report.fit.patched.holdout / report.noise_floor;
    ratio.is_finite().then_some(ratio)
}

/// A ratio in words: `19 times`.
pub(crate) fn times(ratio: f64) -> String {
    if ratio < 9.95 { format!("{ratio:.1} times") } else { format!("{ratio:.0} times") }
}

/// Writes both lines into a report that is complete but for them.
pub(crate) fn complete(report: &mut Report) {
    report.remains = remains(report);
    report.record_next = record_next(report);
}

fn remains(report: &Report) -> String {
    let fit = &report.fit;
    if !fit.patched.holdout.is_finite() {
        return "not known, as nothing was fitted".into();
    }
    let percent = 100.0 * fit.patched.holdout / fit.force_rms.holdout.max(1e-300);
    let Some(ratio) = of_noise(report) else {
        return format!("{percent:.1} % of the force, on held-out recordings");
    };
    let means = match report.verdict {
        // The report shows the form of what repeats, however small it is.
        Verdict::Unexplained => "",
        _ if ratio < MORE && is_most(report) => ": noise hides most of the force",
        _ if ratio < NOTHING => ": nothing more can be learnt from these recordings",
        _ if ratio < MORE => ": there is little more to be found in them",
        Verdict::MissingPhysics => {
            ": a further effect is missing, or the form of this one is not quite right"
        }
        Verdict::RandomDisturbance => ": it follows nothing that was recorded",
        _ => "",
    };
    format!("{percent:.1} % of the force on held-out recordings, {} the sensor's noise{means}", times(ratio))
}

/// True if more of the held-out force remains than a model leaves that has understood it.
fn is_most(report: &Report) -> bool {
    report.fit.patched.holdout > UNDERSTOOD.1 * report.fit.force_rms.holdout
}

fn record_next(report: &Report) -> String {
    let experiments = report.effects.iter().filter_map(|e| e.separating_experiment.as_ref());
    if let Some(experiment) = experiments.chain(&report.separating_experiment).next() {
        return experiment.clone();
    }
    match report.verdict {
        Verdict::MissingPhysics if of_noise(report).is_some_and(|ratio| ratio >= MORE) => FURTHER,
        Verdict::MissingPhysics if is_most(report) => super::next_experiment::LOUDER,
        Verdict::MissingPhysics => {
            "nothing more is needed; to confirm, record again on another day, at other speeds and loads"
        }
        Verdict::NoMismatch | Verdict::ParametersOnly => {
            "nothing; keep a recording of another day to hold out, as machines change"
        }
        Verdict::Unexplained => FURTHER,
        Verdict::RandomDisturbance => {
            "the same motion twice, with what may move the axis (a hand, a load, the inclination) as `force` or `tilt_rad`"
        }
        Verdict::InsufficientExcitation => super::next_experiment::GENERAL,
    }
    .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::rig::Rig;
    use crate::data::schema::Both;
    use crate::decide::diagnosis::Reason;
    use crate::report::outcome::Outcome;

    /// A report whose patched model leaves 5 % of a force of 1 over a sensor's noise.
    fn report(verdict: Verdict, noise: f64) -> Report {
        let reason = Reason::Recordings("nothing yet".into());
        let mut report = Outcome::cannot_tell(&Rig::of_values(1e-3, 1e-3, 1e-2), &reason, None).report;
        let both = |x: f64| Both { fit: x, holdout: x };
        (report.verdict, report.noise_floor) = (verdict, noise);
        (report.fit.patched, report.fit.force_rms) = (both(0.05), both(1.0));
        complete(&mut report);
        report
    }

    #[test]
    fn the_rest_is_compared_with_the_sensors_noise() {
        let said = |noise| report(Verdict::MissingPhysics, noise).remains;
        assert!(said(0.05 / 19.0).starts_with(
            "5.0 % of the force on held-out recordings, 19 times the sensor's noise: a further"
        ));
        assert!(
            said(0.05 / 1.1)
                .ends_with("1.1 times the sensor's noise: nothing more can be learnt from these recordings")
        );
        let repeats = report(Verdict::Unexplained, 0.05 / 1.1).remains;
        assert!(repeats.ends_with("1.1 times the sensor's noise"), "{repeats}: the form is in the report");
        assert!(!said(0.0).contains("noise"), "a sensor without noise is no yardstick");
    }

    #[test]
    fn nothing_is_not_said_while_most_of_the_force_remains() {
        let mut report = report(Verdict::MissingPhysics, 0.58);
        report.fit.patched.holdout = 0.6;
        complete(&mut report);
        assert!(report.remains.ends_with("noise hides most of the force"), "{}", report.remains);
        assert!(!report.record_next.starts_with("nothing"), "{}", report.record_next);
    }

    #[test]
    fn every_verdict_says_what_to_record_next() {
        let all = [
            Verdict::NoMismatch,
            Verdict::ParametersOnly,
            Verdict::MissingPhysics,
            Verdict::Unexplained,
            Verdict::RandomDisturbance,
            Verdict::InsufficientExcitation,
        ];
        for verdict in all {
            let mut report = report(verdict, 0.01);
            assert!(!report.record_next.is_empty(), "{verdict:?}");
            let is_done = report.record_next.starts_with("nothing");
            assert!(!is_done || verdict != Verdict::MissingPhysics, "5 times the noise: {verdict:?}");
            report.separating_experiment = Some("a slow triangle".into());
            assert_eq!(record_next(&report), "a slow triangle", "what would decide goes first");
        }
    }
}
