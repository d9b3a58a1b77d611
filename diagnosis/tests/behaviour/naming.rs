//! Faults of naming that recordings of real machines and a second generator showed, each on a small
//! simulated machine: names given where another cause, wrong values or chance were there, and what
//! was said instead.

use crate::axis::{self, AXIS, BENCH, Machine, Taken, WHOLE, diagnosed, mixed, names, rig};
use crate::common::{self, Setup, WARM_SQUARE};
use diagnosis::laws::EffectName as N;
use diagnosis::{Outcome, Verdict, diagnose_recordings};
use std::f64::consts::TAU;

fn bench(effect: &'static str) -> Setup {
    Setup { effect, size: 1.0, closed: false, rate: 1000.0, seconds: 12.0, disturbance: 0.05, seed: 5 }
}

/// Two recordings to fit and one to judge.
fn on_bench(fit: &Setup, holdout: &Setup) -> Outcome {
    let rig = common::rig([0.1, -0.3, 0.3, -0.05], "offset = 0.0");
    let fit = [common::record(fit, 1), common::record(fit, 3)];
    diagnose_recordings(&rig, &fit, &[common::record(holdout, 2)], &|_, _| ()).expect("usable")
}

#[test]
fn wrong_values_of_an_axis_are_not_presliding() {
    wrong_values_have_no_name(&[(1, 5.0, 4.5)]);
}

#[test]
#[ignore = "nightly: two diagnoses, 10 s"]
fn other_wrong_values_of_an_axis_are_not_presliding() {
    wrong_values_have_no_name(&[(4, 11.0, 1.8), (7, 12.0, 4.8)]);
}

fn wrong_values_have_no_name(cases: &[(u64, f64, f64)]) {
    for &(seed, viscous, dry) in cases {
        let machine = Machine { inertia: 2.3, viscous, forward: dry, backward: dry, ..AXIS };
        let take = |part: u64| axis::record(machine, BENCH, seed + part, mixed(14.0, (seed + part) as f64));
        let outcome = diagnosed(&rig(WHOLE, "", "", BENCH.counts), &[take(0), take(1)], &[take(2)]);
        assert_eq!(outcome.report.verdict, Verdict::ParametersOnly, "{}", outcome.report.sentence);
    }
}

#[test]
fn cogging_of_a_bare_rotor_is_not_compliance() {
    cogging_alone_is_named(2000.0);
}

#[test]
#[ignore = "nightly: 15 s"]
fn cogging_read_by_a_fine_encoder_is_not_compliance() {
    cogging_alone_is_named(2e5);
}

fn cogging_alone_is_named(counts: f64) {
    let machine = Machine { cogging: 6.0, ..AXIS };
    {
        let take = |seed| axis::record(machine, Taken { counts, ..BENCH }, seed, mixed(16.0, seed as f64));
        let outcome = diagnosed(&rig(WHOLE, "", "", counts), &[take(1), take(2)], &[take(3)]);
        assert_eq!(names(&outcome), [N::Cogging], "{counts} counts a radian");
    }
}

/// With less than a turn of travel, orders whose period fits in twice are searched, and the report
/// says that the others are not.
#[test]
fn a_part_of_a_turn_shows_the_orders_that_fit_twice() {
    let turn = format!("turn = {TAU}");
    let fast = |seed: f64| move |t: f64| mixed(28.0, seed)(2.0 * t);
    let said = |cogging: f64| {
        let machine = Machine { cogging, ..AXIS };
        let take = |seed| axis::record(machine, BENCH, seed, fast(seed as f64));
        let all = [take(1), take(2), take(3)];
        // Both fitted recordings start at the same place.
        let counts: Vec<f64> = all[..2].iter().flat_map(|one| one.position_counts.clone()).collect();
        let turns = range(&counts) / BENCH.counts / TAU;
        let [one, two, holdout] = all;
        (turns, diagnosed(&rig(WHOLE, &turn, "", BENCH.counts), &[one, two], &[holdout]))
    };
    let (turns, outcome) = said(6.0);
    assert!(12.0 * turns > 2.0 && turns < 0.6, "{turns} turns hold order 12 twice");
    assert_eq!(names(&outcome), [N::Cogging]);
    let (turns, outcome) = said(0.0);
    assert!(names(&outcome).is_empty());
    let untested = outcome.report.untested.iter().find(|one| one.name == N::Cogging);
    let said = &untested.expect("the low orders of cogging are not tested").because;
    let highest = (2.0 / turns).ceil() - 1.0;
    assert!(said.contains(&format!("orders 1 to {highest};")), "{said}: {turns} turns");
}

/// A spring of unknown rest place is a constant force if it has no stiffness: taken for one, it
/// ended the search before friction that differs with direction was tried.
#[test]
fn a_spring_without_stiffness_hides_no_friction_of_direction() {
    let machine = Machine { forward: 5.0, backward: 1.0, ..AXIS };
    let coarse = Taken { counts: 300.0, ..BENCH };
    let take = |seed| axis::record(machine, coarse, seed, mixed(12.0, seed as f64));
    let rig = rig(WHOLE, "start_spread = 0.1", "", coarse.counts);
    let outcome = diagnosed(&rig, &[take(1), take(2)], &[take(3)]);
    assert_eq!(names(&outcome), [N::AsymmetricFriction]);
}

fn range(values: &[f64]) -> f64 {
    values.iter().copied().fold(f64::MIN, f64::max) - values.iter().copied().fold(f64::MAX, f64::min)
}

#[test]
fn a_force_that_repeats_with_the_trajectory_is_not_said_not_to() {
    let machine = Machine { push: 2.0, ..AXIS };
    let take = |seed| axis::record(machine, BENCH, seed, mixed(14.0, 1.0));
    let report = diagnosed(&rig(WHOLE, "", "", BENCH.counts), &[take(1), take(2)], &[take(3)]).report;
    assert_ne!(report.verdict, Verdict::RandomDisturbance, "{}", report.sentence);
    assert!(report.effects.is_empty(), "{}", report.sentence);
    assert!(report.sentence.contains("repeat"), "{}", report.sentence);
}

#[test]
fn a_belt_that_stretches_as_the_drive_switches_loses_no_counts() {
    let machine = Machine { belt_hz: 13.0, ..AXIS };
    let switched = |phase: f64| {
        move |t: f64| {
            let slow = mixed(10.0, phase)(t);
            slow + if (t / 0.37 + phase).fract() < 0.5 { 12.0 } else { -12.0 }
        }
    };
    let take = |seed| axis::record(machine, Taken { counts: 5000.0, ..BENCH }, seed, switched(seed as f64));
    let outcome = diagnosed(&rig(WHOLE, "", "", 5000.0), &[take(1), take(2)], &[take(3)]);
    for effect in &outcome.report.effects {
        assert!(!effect.class.contains(&N::MissedCounts), "{:?}", effect.class);
    }
}

#[test]
fn a_gravity_that_is_missing_is_no_unit_that_is_off() {
    let machine = Machine { gravity: 30.0, ..AXIS };
    let take =
        |seed| axis::record(machine, Taken { counts: 5000.0, ..BENCH }, seed, mixed(40.0, seed as f64));
    let outcome = diagnosed(&rig(WHOLE, "", "", 5000.0), &[take(1), take(2)], &[take(3)]);
    assert_eq!(outcome.report.verdict, Verdict::MissingPhysics, "{}", outcome.report.sentence);
    assert!(outcome.report.effects[0].class.contains(&N::MassImbalance), "{}", outcome.report.sentence);
}

/// A command that answers the noise of the encoder lets regressors that know the future take it for
/// an effect.
#[test]
fn under_feedback_no_effect_predicts_a_nulls_residual() {
    no_effect_gains_on_a_null(&[5]);
}

#[test]
#[ignore = "nightly: two diagnoses, 10 s"]
fn no_effect_predicts_the_residual_of_other_nulls() {
    no_effect_gains_on_a_null(&[6, 7]);
}

fn no_effect_gains_on_a_null(seeds: &[u64]) {
    for &seed in seeds {
        let null = Setup { closed: true, seed, ..bench("none") };
        let outcome = on_bench(&null, &null);
        assert!(names(&outcome).is_empty(), "{}", outcome.summary());
        for hypothesis in &outcome.report.hypotheses {
            let gain = hypothesis.holdout_gain.unwrap_or(0.0);
            assert!(gain < 15.0, "{} gains {gain} nats on a null", hypothesis.name);
        }
    }
}

#[test]
fn a_hypothesis_and_its_reason_have_one_held_out_gain() {
    gains_are_those_of_the_reasons(&["gain_drift"]);
}

#[test]
#[ignore = "nightly: two diagnoses, 10 s"]
fn other_hypotheses_and_their_reasons_have_one_held_out_gain() {
    gains_are_those_of_the_reasons(&["stribeck_friction", "cogging"]);
}

fn gains_are_those_of_the_reasons(effects: &[&'static str]) {
    let mut told = 0;
    for &effect in effects {
        let outcome = on_bench(&bench(effect), &bench(effect));
        for hypothesis in &outcome.report.hypotheses {
            let Some(reason) = &hypothesis.rejected_because else {
                assert!(hypothesis.holdout_gain.is_some_and(|gain| gain > 0.0), "{hypothesis:?}");
                continue;
            };
            let says = |before: &str, after: &str| -> Option<f64> {
                reason.split_once(before)?.1.split_once(after)?.0.parse().ok()
            };
            let loses = says("less likely with it, by ", " nats").map(|x| -x);
            let gains = says("its gain on held-out recordings, ", " nats");
            if let Some(nats) = loses.or(gains) {
                told += 1;
                assert!(
                    (hypothesis.holdout_gain.expect("it was judged") - nats).abs() < 0.51,
                    "{hypothesis:?}"
                );
            }
            let is_of_search = ["a slow disturbance explains as much", "the search found it unsure"];
            if is_of_search.iter().any(|words| reason.contains(words)) {
                told += 1;
                assert_eq!(hypothesis.holdout_gain, None, "{hypothesis:?}");
            }
        }
    }
    assert!(told > 0, "no reason tells a gain or that none was read");
}

#[test]
fn a_small_deadband_is_found() {
    small_effects_are_found(&[("command_deadband", 0.3, N::CommandDeadband)]);
}

#[test]
#[ignore = "nightly: two diagnoses, 15 s"]
fn a_small_gain_drift_and_the_slip_of_a_light_needle_are_found() {
    small_effects_are_found(&[
        ("gain_drift", 0.4, N::GainDrift),
        ("grip_of_a_light_needle", 1.0, N::RollerSlip),
    ]);
}

fn small_effects_are_found(effects: &[(&'static str, f64, N)]) {
    for &(effect, size, name) in effects {
        let setup = Setup { size, ..bench(effect) };
        let outcome = on_bench(&setup, &setup);
        let class = outcome.report.effects.first().map(|effect| effect.class.clone()).unwrap_or_default();
        assert!(class.contains(&name), "{effect}: {}", outcome.summary());
    }
}

#[test]
#[ignore = "nightly: 60,000 rows, 15 s"]
fn a_gain_that_falls_with_copper_loss_is_found_with_its_size() {
    let setup = Setup { seconds: 20.0, ..bench("gain_drift_by_loss") };
    let outcome = on_bench(&setup, &setup);
    let found = outcome
        .report
        .effects
        .first()
        .unwrap_or_else(|| panic!("{:?} {}", outcome.report.hypotheses, outcome.summary()));
    assert_eq!(found.name, N::GainDrift, "{}", outcome.summary());
    let drift = outcome.patched_rig.effects.last().expect("the patched rig has it");
    let mean_square = *drift.shape.get("mean_square").expect("it follows the loss, not the time alone");
    let change = found.parameters["change"].value * WARM_SQUARE / mean_square;
    assert!((change / -0.15 - 1.0).abs() < 0.15, "{change}: {}", outcome.summary());
    let time_s = found.parameters["time_constant"].value;
    assert!((time_s / (0.2 * setup.seconds) - 1.0).abs() < 0.2, "{time_s}: {}", outcome.summary());
}

/// Commands beyond a clip say nothing of the drive: here the largest is five times what it gives.
#[test]
fn a_clip_far_below_the_largest_command_is_found() {
    let machine = Machine { limit: 40.0, ..AXIS };
    let take = |seed: u64| {
        let phase = seed as f64;
        let command = move |t: f64| {
            40.0 * (12.0 * t).sin()
                + 25.0 * (33.0 * t + phase).sin()
                + 160.0 * (1.6 * t + phase).sin().powi(31)
        };
        axis::record(machine, BENCH, seed, command)
    };
    let outcome = diagnosed(&rig(WHOLE, "", "", BENCH.counts), &[take(1), take(2)], &[take(3)]);
    assert_eq!(names(&outcome), [N::CommandSaturation], "{}", outcome.report.sentence);
    let limit = outcome.report.effects[0].parameters["limit"].value;
    assert!((limit / 40.0 - 1.0).abs() < 0.1, "{limit}");
}
