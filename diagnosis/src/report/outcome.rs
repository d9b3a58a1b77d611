//! The result of a diagnosis: the report, the evidence behind it, and the rigs.

use crate::data::rig::{Kind, Rig};
use crate::data::schema::{Both, Contending, FitTable, Hypothesis, Named, Report, Untested, Verdict};
use crate::decide::decisive::Decisive;
use crate::decide::diagnosis::{
    Complete, Contender, Diagnosis, JudgedHypothesis, NamedEffect, Reason, Rigs, Series,
};
use crate::decide::evidence_table::{self, EvidenceRow};
use crate::evidence::residual_maps::Map;
use crate::laws::EffectName;
use crate::propose::free_form::Shape;
use crate::report::{free_form, next_experiment, notes, remains, text};
use crate::simulation::comparison::Comparison;
use numerics::digits::in_sentence;
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// The data that `report.html` plots.
#[derive(Debug, Clone)]
pub struct Evidence {
    /// Every recording, fitted first.
    pub series: Vec<Series>,
    /// Residuals of the patched model over states.
    pub maps: Vec<Map>,
    /// The models run forward and compared with the held-out recordings.
    pub simulated: Vec<Comparison>,
    /// The residual over the state of the first named effect.
    pub decisive: Option<Decisive>,
    /// The force of any form, where nothing is named.
    pub(crate) form: Option<Shape>,
    /// Rotary or linear.
    pub kind: Kind,
    /// The rig's label.
    pub rig: String,
    /// Rows a second of the slowest recording, where they were looked at.
    pub rate_hz: Option<f64>,
    /// The limits of what the recordings can show, a sentence each, as [`crate::check`] says it.
    pub check: Vec<String>,
}

/// The sources and the program of a report, for its footer.
#[derive(Debug, Clone)]
pub struct Made {
    /// The program with its version.
    pub program: String,
    /// The date.
    pub date: String,
    /// The files with their SHA-256.
    pub files: Vec<(String, String)>,
}

/// The outcome of a diagnosis.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Its sources, if the caller gives them.
    pub made: Option<Made>,
    /// `diagnosis.json`.
    pub report: Report,
    /// The data that is plotted.
    pub evidence: Evidence,
    /// The evidence for every hypothesis; none where the recordings did not suffice.
    pub hypotheses: Vec<EvidenceRow>,
    /// The rig as it was given.
    pub nominal_rig: Rig,
    /// The rig with refitted values alone.
    pub refit_rig: Rig,
    /// The rig with refitted values and the effects found.
    pub patched_rig: Rig,
    /// The rigs of the report's contenders, in their order.
    pub contending_rigs: Vec<Rig>,
}

/// The verdict in one sentence that a technician understands.
pub(crate) fn sentence(report: &Report, kind: Kind) -> String {
    let fit = &report.fit;
    let percent = |x: f64| percent_of_force(report, x);
    match report.verdict {
        Verdict::MissingPhysics => left_out(report, kind),
        Verdict::NoMismatch => format!(
            "The simulation is right to within {:.1} % of the force{}",
            percent(fit.patched.holdout),
            match (times_noise(report, fit.patched.holdout), remains::of_noise(report)) {
                (Some(times), _) =>
                    format!(", {times}, and no known effect explains a material part of that"),
                (None, Some(_)) => ", which is the sensor's noise".into(),
                (None, None) => String::new(),
            }
        ),
        Verdict::ParametersOnly => format!(
            "The simulation has the right structure but wrong values: refitting them lowers the held-out force error from {:.1} % to {:.1} %{}",
            percent(fit.nominal.holdout),
            percent(fit.refit.holdout),
            still(report)
        ),
        Verdict::Unexplained => format!(
            "Simulation and recordings differ repeatably by {:.1} % of the force{}, and no effect is sure enough to be named{}",
            percent(fit.refit.holdout),
            times_noise(report, fit.refit.holdout).map_or(String::new(), |times| format!(", {times}")),
            report.reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"))
        ),
        Verdict::RandomDisturbance => format!(
            "A disturbance of {:.1} % of the force{} acts on the axis; it does not repeat and depends on nothing that was recorded",
            percent(fit.patched.holdout),
            times_noise(report, fit.patched.holdout).map_or(String::new(), |times| format!(", {times},"))
        ),
        Verdict::InsufficientExcitation => format!(
            "These recordings cannot tell: {}",
            report.reason.as_deref().unwrap_or("they excite too little")
        ),
    }
}

/// A force on the held-out recordings as a percentage of the force that moves them.
pub(crate) fn percent_of_force(report: &Report, force: f64) -> f64 {
    let whole = report.fit.force_rms.holdout;
    if whole > 0.0 { 100.0 * force / whole } else { 0.0 }
}

/// Returns a residual against the sensor's noise, where it is more than that: `19 times the
/// sensor's noise`.
fn times_noise(report: &Report, residual: f64) -> Option<String> {
    let ratio = residual / report.noise_floor;
    let is_more = ratio.is_finite() && ratio >= remains::MORE;
    is_more.then(|| format!("{} the sensor's noise", remains::times(ratio)))
}

/// The same of what the patched model leaves, at the end of a sentence that says how an error
/// falls.
fn still(report: &Report) -> String {
    times_noise(report, report.fit.patched.holdout).map_or(String::new(), |times| format!(", still {times}"))
}

/// The sentence of a verdict that names effects.
fn left_out(report: &Report, kind: Kind) -> String {
    let fit = &report.fit;
    let percent = |x: f64| percent_of_force(report, x);
    let mut out = String::new();
    for (i, effect) in report.effects.iter().enumerate() {
        if i > 0 {
            out.push_str(if i + 1 == report.effects.len() { " and " } else { ", " });
        }
        let _ = write!(out, "{} ({:.0} % sure", effect.name.in_words(), 100.0 * effect.confidence);
        if effect.class.len() > 1 {
            let others: Vec<&str> = effect.class[1..].iter().map(|n| n.in_words()).collect();
            let _ = write!(out, "; it could also be {}", others.join(" or "));
        }
        out.push(')');
    }
    let region = report.effects.first().and_then(|e| e.place.states.first());
    let region = region.map_or(String::new(), |r| {
        format!(
            "; strongest for {} {} to {}{}",
            r.variable,
            in_sentence(r.low),
            in_sentence(r.high),
            unit(&r.variable, kind)
        )
    });
    let (before, after) = (percent(fit.refit.holdout), percent(fit.patched.holdout));
    let rest = still(report);
    if fit.holdout_gain_ci95[0] > 0.0 {
        format!(
            "The simulation leaves out {out}{region}; with it the held-out force error falls from {before:.1} % to {after:.1} %{rest}"
        )
    } else {
        format!(
            "The simulation leaves out {out}{region}; that this lowers the held-out force error, {before:.1} %, is not proven"
        )
    }
}

/// The unit of a variable of a region, with a space before it.
pub(crate) fn unit(variable: &str, kind: Kind) -> String {
    match variable {
        "speed" => format!(" {}/s", kind.length()),
        "travel" | "angle" => format!(" {}", kind.length()),
        "time" => " s".into(),
        "tilt" => " rad".into(),
        _ => String::new(),
    }
}

impl Outcome {
    /// Makes the report and the evidence of a diagnosis.
    pub(crate) fn of(diagnosis: Diagnosis) -> Self {
        match diagnosis {
            Diagnosis::CannotTell { rig, reason, rate_hz } => Self::cannot_tell(&rig, &reason, rate_hz),
            Diagnosis::Complete(complete) => Self::complete(*complete),
        }
    }

    /// The outcome if recordings do not suffice for a verdict, with the reason.
    pub(crate) fn cannot_tell(rig: &Rig, reason: &Reason, rate_hz: Option<f64>) -> Self {
        let mut report = Report {
            format: 1,
            verdict: Verdict::InsufficientExcitation,
            sentence: String::new(),
            remains: String::new(),
            record_next: String::new(),
            effects: Vec::new(),
            fit: FitTable {
                metric: "force_rmse".into(),
                unit: rig.kind.force().into(),
                nominal: Both::NONE,
                refit: Both::NONE,
                patched: Both::NONE,
                force_rms: Both::NONE,
                holdout_gain_ci95: [0.0, 0.0],
            },
            refitted: BTreeMap::new(),
            command_late_rows: None,
            data_faults: Vec::new(),
            notes: Vec::new(),
            residual_bandwidth_hz: 0.0,
            noise_floor: 0.0,
            unexplained_fraction: 0.0,
            hypotheses: Vec::new(),
            untested: Vec::new(),
            contenders: Vec::new(),
            free_form: None,
            place: None,
            simulation: None,
            separating_experiment: Some(next_experiment::GENERAL.to_owned()),
            reason: Some(text::reason(reason, None)),
        };
        report.sentence = sentence(&report, rig.kind);
        remains::complete(&mut report);
        let evidence = Evidence {
            series: Vec::new(),
            maps: Vec::new(),
            form: None,
            decisive: None,
            simulated: Vec::new(),
            kind: rig.kind,
            rig: rig.name.clone(),
            rate_hz,
            check: Vec::new(),
        };
        let nominal = || rig.clone();
        let rigs = Rigs { nominal: nominal(), refit: nominal(), patched: nominal() };
        Self::with_rigs(report, evidence, rigs)
    }

    fn complete(diagnosis: Complete) -> Self {
        let contenders = diagnosis.contenders.iter().enumerate().map(contending).collect();
        let kind = diagnosis.rigs.nominal.kind;
        let form = diagnosis.free_form.as_ref().and_then(|force| force.shape.as_ref());
        let form = form.map(|shape| free_form::sentence(shape, kind.length()));
        let separating_experiment = separating(&diagnosis, kind);
        let notes = notes::notes(&diagnosis.moved, &diagnosis.effects);
        let Rigs { nominal, refit, patched } = diagnosis.rigs;
        let untested = diagnosis.untested.into_iter();
        let contending_rigs = diagnosis.contenders.into_iter().map(|one| one.rig).collect();
        let mut report = Report {
            format: 1,
            verdict: diagnosis.verdict,
            sentence: String::new(),
            remains: String::new(),
            record_next: String::new(),
            effects: diagnosis.effects.into_iter().map(named).collect(),
            fit: diagnosis.errors,
            refitted: refitted(&patched),
            command_late_rows: diagnosis.moved.late_rows,
            data_faults: Vec::new(),
            notes,
            residual_bandwidth_hz: diagnosis.bandwidth_hz,
            noise_floor: diagnosis.noise_floor,
            unexplained_fraction: diagnosis.unexplained_fraction,
            hypotheses: diagnosis.hypotheses.into_iter().map(hypothesis).collect(),
            untested: untested
                .map(|(name, why)| Untested { name, because: text::not_tested(&why, kind.length()) })
                .collect(),
            contenders,
            reason: diagnosis.reason.map(|reason| text::reason(&reason, form.as_deref())),
            free_form: diagnosis.free_form.as_ref().map(|force| free_form::entry(force, form)),
            place: diagnosis.place,
            separating_experiment,
            simulation: diagnosis.simulation,
        };
        report.sentence = sentence(&report, kind);
        remains::complete(&mut report);
        let evidence = Evidence {
            series: diagnosis.series,
            maps: diagnosis.maps,
            decisive: diagnosis.decisive,
            form: diagnosis.free_form.and_then(|force| force.shape),
            simulated: diagnosis.simulated,
            kind,
            rig: nominal.name.clone(),
            rate_hz: diagnosis.rate_hz,
            check: Vec::new(),
        };
        let rigs = Rigs { nominal, refit, patched };
        Self { hypotheses: diagnosis.evidence, contending_rigs, ..Self::with_rigs(report, evidence, rigs) }
    }

    fn with_rigs(report: Report, evidence: Evidence, rigs: Rigs) -> Self {
        Self {
            made: None,
            report,
            evidence,
            hypotheses: Vec::new(),
            nominal_rig: rigs.nominal,
            refit_rig: rigs.refit,
            patched_rig: rigs.patched,
            contending_rigs: Vec::new(),
        }
    }

    /// The evidence for every hypothesis as CSV, one row each, the first for none: what both
    /// proposers say, in numbers that mean the same on every machine.
    pub fn hypotheses_csv(&self) -> String {
        evidence_table::csv(&self.hypotheses)
    }
}

fn contending((place, one): (usize, &Contender)) -> Contending {
    Contending { name: one.name, probability: one.probability, rig: contender_file(place, one.name) }
}

/// The recording that would decide what these cannot.
fn separating(diagnosis: &Complete, kind: Kind) -> Option<String> {
    match diagnosis.verdict {
        Verdict::InsufficientExcitation => Some(enough(diagnosis.reason.as_ref()).to_owned()),
        _ => diagnosis.beyond_fitted.map(|beyond| next_experiment::strokes(beyond, kind.length())),
    }
}

/// A recording that would excite enough, where recordings did not for a reason.
fn enough(reason: Option<&Reason>) -> &'static str {
    match reason {
        Some(Reason::MostRemains { .. }) => next_experiment::LOUDER,
        _ => next_experiment::SPEEDS,
    }
}

/// The file of a contender's rig, from the report's folder.
fn contender_file(place: usize, name: Option<EffectName>) -> String {
    format!("contenders/{}-{}.toml", place + 1, name.map_or("none", EffectName::as_str))
}

/// A named effect as the report has it.
fn named(effect: NamedEffect) -> Named {
    let NamedEffect { name, class, confidence, parameters, place } = effect;
    let separating_experiment = next_experiment::separating(&class);
    Named { name, class, subsystem: name.subsystem(), confidence, parameters, place, separating_experiment }
}

/// A hypothesis as the report has it.
fn hypothesis(judged: JudgedHypothesis) -> Hypothesis {
    let JudgedHypothesis { name, holdout_gain, evidence, class, rejection } = judged;
    let rejected_because = rejection.as_ref().map(text::rejection);
    Hypothesis { name, holdout_gain, evidence, class, rejected_because }
}

/// The values of the rig that a refit may move.
fn refitted(patched: &Rig) -> BTreeMap<String, f64> {
    let model = &patched.model;
    [
        ("inertia", Some(model.inertia)),
        ("gain", Some(patched.actuator.gain)),
        ("viscous", model.viscous),
        ("coulomb", model.coulomb),
        ("offset", model.offset),
        ("weight", model.weight),
        ("gravity", model.gravity),
    ]
    .into_iter()
    .filter_map(|(key, value)| Some((key.to_owned(), value?)))
    .collect()
}
