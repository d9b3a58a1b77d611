//! The sentence of every verdict, word for word: people read them, and whoever changes one sees it
//! here.

use crate::data::rig::{Kind, Rig};
use crate::data::schema::{Both, Named, Place, Region, Report, Verdict};
use crate::decide::diagnosis::Reason;
use crate::laws::EffectName as N;
use crate::report::outcome::{Outcome, sentence};
use std::collections::BTreeMap;

fn named(name: N, confidence: f64, class: &[N], states: Vec<Region>) -> Named {
    Named {
        name,
        class: class.to_vec(),
        subsystem: name.subsystem(),
        confidence,
        parameters: BTreeMap::new(),
        place: Place { recordings: Vec::new(), states },
        separating_experiment: None,
    }
}

/// A report of a verdict over a force of 1 N·m: 0.4 nominal, 0.2 refitted, and 0.05 patched where
/// there are effects.
fn report(verdict: Verdict, reason: Option<&str>, effects: Vec<Named>) -> Report {
    let mut report = Outcome::cannot_tell(
        &Rig::of_values(1e-3, 1e-3, 1e-2),
        &Reason::Recordings("nothing yet".into()),
        None,
    )
    .report;
    let left = if effects.is_empty() { 0.2 } else { 0.05 };
    (report.verdict, report.effects) = (verdict, effects);
    report.reason = reason.map(str::to_owned);
    let both = |x: f64| Both { fit: x, holdout: x };
    let fit = &mut report.fit;
    fit.holdout_gain_ci95 = [0.92, 0.95];
    (fit.nominal, fit.refit, fit.patched, fit.force_rms) = (both(0.4), both(0.2), both(left), both(1.0));
    report.noise_floor = left / 19.0;
    report
}

#[test]
fn every_verdict_says_its_sentence() {
    let region = Region { variable: "speed".into(), low: 0.02, high: 1.5 };
    let found = vec![
        named(N::CoulombFriction, 0.97, &[N::CoulombFriction, N::AsymmetricFriction], vec![region]),
        named(N::CommandDeadband, 0.91, &[N::CommandDeadband], Vec::new()),
    ];
    let rest = "a.csv is at rest: it moves by 0 counts in all; record a motion of some turns";
    let cases = [
        (
            report(Verdict::MissingPhysics, None, found),
            include_str!("sentence_snapshots/missing_physics.txt"),
        ),
        (report(Verdict::NoMismatch, None, Vec::new()), include_str!("sentence_snapshots/no_mismatch.txt")),
        (
            report(Verdict::ParametersOnly, None, Vec::new()),
            include_str!("sentence_snapshots/parameters_only.txt"),
        ),
        (
            report(Verdict::Unexplained, Some("a force that swings by itself at 50 Hz is left"), Vec::new()),
            include_str!("sentence_snapshots/unexplained.txt"),
        ),
        (
            report(Verdict::RandomDisturbance, None, Vec::new()),
            include_str!("sentence_snapshots/random_disturbance.txt"),
        ),
        (
            report(Verdict::InsufficientExcitation, Some(rest), Vec::new()),
            include_str!("sentence_snapshots/insufficient_excitation.txt"),
        ),
    ];
    for (report, golden) in cases {
        assert_eq!(sentence(&report, Kind::Rotary), golden.trim_end(), "{:?}", report.verdict);
    }
}

#[test]
fn a_gain_that_may_be_none_is_not_proven() {
    let found = vec![named(N::CommandDeadband, 0.91, &[N::CommandDeadband], Vec::new())];
    let mut report = report(Verdict::MissingPhysics, None, found);
    report.fit.holdout_gain_ci95 = [-0.43, 0.76];
    assert_eq!(
        sentence(&report, Kind::Rotary),
        "The simulation leaves out a deadband of the command (91 % sure); that this lowers the held-out force error, 20.0 %, is not proven"
    );
}
