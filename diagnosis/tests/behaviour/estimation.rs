//! Faults of input and estimation that recordings of real machines showed, each on a small
//! simulated one: starts in motion, free swings, slow rates, idle stretches, short recordings,
//! plain forces in pairs, machines without inertia to speak of.

use crate::axis::{AXIS, BENCH, Machine, Taken, WHOLE, diagnosed, mixed, names, record, rig};
use diagnosis::Verdict;
use diagnosis::laws::EffectName as N;
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;
use diagnosis::simulation::{Plant, Surroundings};
use std::f64::consts::TAU;

#[test]
fn a_start_in_motion_leaves_no_force_in_any_unit() {
    let taken = Taken { start: (0.0, 2.5), ..BENCH };
    let take = |seed| record(AXIS, taken, seed, mixed(14.0, seed as f64));
    let (fit, holdout) = (take(1), take(2));
    let at_start = |scale: f64| {
        // A unit of length of 1/scale: forces are in kg·m/s² times the scale.
        let model = format!("inertia = 2.0\nviscous = 8.0\ncoulomb = {}", 3.0 * scale);
        let mut rig = rig(&model, "", "", BENCH.counts / scale);
        rig.actuator.gain = scale;
        let outcome = diagnosed(&rig, std::slice::from_ref(&fit), std::slice::from_ref(&holdout));
        assert!(names(&outcome).is_empty(), "nothing was left out");
        let series = &outcome.evidence.series[0];
        let largest = |from: f64, to: f64| {
            let of = series.time_s.iter().zip(&series.refit);
            of.filter(|(t, _)| **t >= from && **t < to)
                .filter_map(|(_, x)| *x)
                .fold(0.0_f64, |most, x| most.max(x.abs()))
                / scale
        };
        (largest(0.0, 0.3), largest(0.3, 8.0))
    };
    let (at_once, later) = at_start(1.0);
    assert!(at_once < 1.5 * later.max(0.3), "{at_once} N at the start, {later} N later");
    let (in_mm, later_mm) = at_start(1000.0);
    assert!((in_mm - at_once).abs() < 0.05 && (later_mm - later).abs() < 0.05, "{in_mm} {at_once}");
}

#[test]
fn a_free_swing_needs_no_command_and_shows_its_gravity() {
    let pendulum =
        Machine { inertia: 0.02, viscous: 4e-4, forward: 4e-3, backward: 4e-3, gravity: 0.7, ..AXIS };
    let swing = |start: f64, seed| {
        record(pendulum, Taken { start: (start, 0.0), counts: 2000.0, ..BENCH }, seed, |_| 0.0)
    };
    let rig = rig("inertia = 0.02\nviscous = 4e-4", "", "", 2000.0);
    let outcome = diagnosed(&rig, &[swing(1.2, 1), swing(-0.9, 2)], &[swing(1.0, 3)]);
    assert_eq!(outcome.report.verdict, Verdict::MissingPhysics);
    let class = &outcome.report.effects[0].class;
    assert!(class.contains(&N::MassImbalance), "{class:?}");
}

#[test]
fn fifty_rows_a_second_are_enough_where_the_motion_is_slow() {
    let taken = Taken { rate: 50.0, seconds: 20.0, ..BENCH };
    let take = |seed| record(AXIS, taken, seed, mixed(14.0, seed as f64));
    let outcome =
        diagnosed(&rig("inertia = 2.0\nviscous = 8.0", "", "", BENCH.counts), &[take(1)], &[take(2)]);
    assert_eq!(names(&outcome).first(), Some(&N::CoulombFriction));
}

#[test]
fn a_minute_of_rest_costs_no_answer() {
    let take = |seed| {
        let moving = record(AXIS, BENCH, seed, mixed(14.0, seed as f64));
        let idle = (60.0 * BENCH.rate) as usize;
        let mut all = Recording { file: moving.file.clone(), ..Recording::default() };
        all.time_s = (0..2 * idle + moving.len()).map(|i| i as f64 / BENCH.rate).collect();
        let rest = |at: f64| vec![at; idle];
        all.command = [rest(0.0), moving.command.clone(), rest(0.0)].concat();
        let end = moving.position_counts[moving.len() - 1];
        all.position_counts = [rest(moving.position_counts[0]), moving.position_counts, rest(end)].concat();
        all
    };
    let rig = rig("inertia = 2.0\nviscous = 8.0", "", "", BENCH.counts);
    let outcome = diagnosed(&rig, &[take(1)], &[take(2)]);
    assert_eq!(names(&outcome).first(), Some(&N::CoulombFriction));
    let series = &outcome.evidence.series[0];
    assert!(series.time_s[0] > 59.0, "times are those of the file");
}

#[test]
fn ten_recordings_show_together_what_none_shows_alone() {
    let taken = Taken { seconds: 1.0, ..BENCH };
    let take = |seed| record(AXIS, taken, seed, mixed(20.0, 2.0 * seed as f64));
    let rig = rig("inertia = 2.0\nviscous = 8.0", "", "", BENCH.counts);
    let fit: Vec<Recording> = (1..8).map(take).collect();
    let holdout: Vec<Recording> = (8..11).map(take).collect();
    let outcome = diagnosed(&rig, &fit, &holdout);
    assert_eq!(names(&outcome).first(), Some(&N::CoulombFriction));
    let alone = diagnosed(&rig, &fit[..1], &holdout[..1]);
    assert_eq!(alone.report.verdict, Verdict::InsufficientExcitation, "one second alone is too little");
}

#[test]
fn asymmetric_friction_is_found_with_no_friction_in_the_rig() {
    let machine = Machine { forward: 2.0, backward: 4.5, ..AXIS };
    let take = |seed| record(machine, BENCH, seed, mixed(16.0, seed as f64));
    let rig = rig("inertia = 2.0\nviscous = 8.0", "", "", BENCH.counts);
    let outcome = diagnosed(&rig, &[take(1), take(2)], &[take(3)]);
    let mut names = names(&outcome);
    names.sort();
    assert_eq!(names, [N::CoulombFriction, N::AsymmetricFriction]);
}

#[test]
fn a_machine_of_little_inertia_has_friction_and_a_live_drive() {
    let machine = Machine { inertia: 1e-4, viscous: 2.0, ..AXIS };
    let taken = Taken { seconds: 12.0, counts: 5000.0, ..BENCH };
    let slow = |phase: f64| {
        move |t: f64| 5.0 * (TAU * 0.2 * t + phase).sin() + 3.0 * (TAU * 0.47 * t + 2.0 * phase).sin()
    };
    let take = |seed| record(machine, taken, seed, slow(seed as f64));
    let rig = rig("inertia = 1e-4\nviscous = 2.0", "", "", taken.counts);
    let outcome = diagnosed(&rig, &[take(1), take(2)], &[take(3)]);
    assert_eq!(names(&outcome), [N::CoulombFriction]);
    let dry = outcome.report.effects[0].parameters["coulomb"].value;
    assert!((2.5..3.5).contains(&dry), "{dry} N·m");
    assert!((1e-5..1e-2).contains(&outcome.patched_rig.model.inertia), "what was added is taken out again");
}

#[test]
fn a_refit_that_is_worse_on_held_out_recordings_is_dropped() {
    let other = Machine { inertia: 2.6, viscous: 11.0, ..AXIS };
    let fit = record(other, BENCH, 1, mixed(14.0, 1.0));
    let holdout = record(AXIS, BENCH, 2, mixed(14.0, 2.0));
    let report = diagnosed(&rig(WHOLE, "", "", BENCH.counts), &[fit], &[holdout]).report;
    assert!(report.fit.refit.holdout <= report.fit.nominal.holdout);
}

#[test]
fn a_delay_that_the_rig_knows_is_not_missing() {
    let machine = Machine { delay_s: 0.012, ..AXIS };
    let take = |seed| record(machine, BENCH, seed, mixed(16.0, seed as f64));
    let (fit, holdout) = ([take(1)], [take(2)]);
    let unknown = diagnosed(&rig(WHOLE, "", "", BENCH.counts), &fit, &holdout);
    let class = &unknown.report.effects[0].class;
    assert!(class.contains(&N::CommandDelay), "{class:?}");
    let known = diagnosed(&rig(WHOLE, "", "delay_s = 0.012", BENCH.counts), &fit, &holdout);
    assert!(names(&known).is_empty());
}

#[test]
fn a_declared_lag_offset_and_filter_are_not_missing() {
    let model = format!("{WHOLE}\noffset = 1.5");
    let machine = Machine { lag_s: 0.02, offset: 1.5, filter_s: 0.004, ..AXIS };
    let take = |seed| record(machine, BENCH, seed, mixed(16.0, seed as f64));
    let (fit, holdout) = ([take(1)], [take(2)]);
    let truth = rig(&model, "filter_s = 0.004", "lag_s = 0.02", BENCH.counts);
    let known = diagnosed(&truth, &fit, &holdout);
    assert!(names(&known).is_empty(), "{}", known.report.sentence);
    assert!(known.report.fit.nominal.holdout < 0.02 * known.report.fit.force_rms.holdout);
    let unknown = diagnosed(&rig(&model, "", "", BENCH.counts), &fit, &holdout);
    let class = &unknown.report.effects[0].class;
    assert!(class.contains(&N::ElectricalLag), "{class:?}");
}

#[test]
fn dry_friction_is_found_before_a_known_filter() {
    behind_a_known_filter(&[0.03], &["friction"]);
}

#[test]
#[ignore = "nightly: six diagnoses, 40 s"]
fn a_known_filter_is_behind_dry_friction_and_cogging() {
    behind_a_known_filter(&[0.004, 0.03], &["nothing", "friction", "cogging"]);
}

fn behind_a_known_filter(filters_s: &[f64], missing: &[&str]) {
    for &filter_s in filters_s {
        let machine = Machine { filter_s, disturbance: 0.0, ..AXIS };
        let encoder = format!("filter_s = {filter_s}");
        let of = |machine, model| {
            let take = |seed| record(machine, BENCH, seed, mixed(16.0, seed as f64));
            let outcome = diagnosed(&rig(model, &encoder, "", BENCH.counts), &[take(1), take(2)], &[take(3)]);
            (names(&outcome), outcome)
        };
        if missing.contains(&"nothing") {
            let (found, outcome) = of(machine, WHOLE);
            assert!(found.is_empty(), "{filter_s} s: {}", outcome.report.sentence);
        }
        if missing.contains(&"friction") {
            let (found, _) = of(machine, "inertia = 2.0\nviscous = 8.0");
            assert_eq!(found, [N::CoulombFriction], "{filter_s} s");
        }
        if missing.contains(&"cogging") {
            let (found, outcome) = of(Machine { cogging: 1.5, ..machine }, WHOLE);
            assert_eq!(found, [N::Cogging], "{filter_s} s");
            let amplitude = outcome.report.effects[0].parameters["amplitude_1"].value;
            assert!((1.45..1.55).contains(&amplitude), "{amplitude} N·m behind {filter_s} s");
        }
    }
}

#[test]
fn a_virtual_device_behind_a_known_filter_leaves_nothing_out() {
    without_noise_nothing_is_missing(&[0.03]);
}

#[test]
#[ignore = "nightly: two diagnoses, 15 s"]
fn a_virtual_device_without_noise_leaves_nothing_out() {
    without_noise_nothing_is_missing(&[0.0, 0.004]);
}

fn without_noise_nothing_is_missing(filters_s: &[f64]) {
    for &filter_s in filters_s {
        let rig = rig(WHOLE, &format!("filter_s = {filter_s}"), "", BENCH.counts);
        let take = |phase: f64| {
            let (command, mut plant) = (mixed(16.0, phase), Plant::new(&rig));
            let mut out = Recording { file: format!("{phase}.csv"), ..Recording::default() };
            for row in 0..(BENCH.rate * BENCH.seconds) as u32 {
                let t = f64::from(row) / BENCH.rate;
                out.time_s.push(t);
                out.command.push(command(t));
                out.position_counts.push(plant.counts());
                for _ in 0..20 {
                    plant.step(command(t), Surroundings::default(), 1e-4);
                }
            }
            out
        };
        let outcome = diagnosed(&rig, &[take(1.0), take(2.0)], &[take(3.0)]);
        assert!(names(&outcome).is_empty(), "{filter_s} s: {}", outcome.report.sentence);
    }
}

#[test]
fn twenty_rows_a_second_are_enough_and_ten_are_not() {
    let said = "20 rows a second: shows what happens below about 4 Hz; delays and lags much shorter than 50.00 ms do not show";
    friction_shows_at(20.0, 60.0, 0.3, said);
    let slow = at_rate(10.0, 60.0, 0.3).report;
    assert!(slow.sentence.contains("rows a second where 20 to 20000 are read"), "{}", slow.sentence);
}

#[test]
#[ignore = "nightly: 320,000 rows, 20 s"]
fn twenty_thousand_rows_a_second_are_read() {
    let said = "20000 rows a second: shows what happens below about 4000 Hz; delays and lags much shorter than 0.05 ms do not show";
    friction_shows_at(20_000.0, 8.0, 1.0, said);
}

fn friction_shows_at(rate: f64, seconds: f64, slower: f64, said: &str) {
    let outcome = at_rate(rate, seconds, slower);
    assert_eq!(names(&outcome).first(), Some(&N::CoulombFriction), "{rate} Hz");
    assert!(outcome.summary().contains(said), "{}", outcome.summary());
}

fn at_rate(rate: f64, seconds: f64, slower: f64) -> diagnosis::Outcome {
    let rig = rig("inertia = 2.0\nviscous = 8.0", "", "", BENCH.counts);
    let taken = Taken { rate, seconds, ..BENCH };
    let take = |seed| {
        let command = mixed(14.0, seed as f64);
        record(AXIS, taken, seed, move |t| command(slower * t))
    };
    diagnosed(&rig, &[take(1)], &[take(2)])
}

#[test]
fn a_gravity_that_the_rig_knows_is_not_missing() {
    let machine = Machine { gravity: 9.0, ..AXIS };
    let take = |seed| record(machine, Taken { counts: 5000.0, ..BENCH }, seed, mixed(20.0, seed as f64));
    let model = format!("{WHOLE}\ngravity = 9.0");
    let outcome = diagnosed(&rig(&model, "absolute = true", "", 5000.0), &[take(1)], &[take(2)]);
    assert!(names(&outcome).is_empty());
    assert!(outcome.report.fit.refit.holdout < 0.05 * outcome.report.fit.force_rms.holdout);
    let without = Rig::parse(
        &rig(&model, "absolute = true", "", 5000.0).to_toml().replace("absolute = true", ""),
        "a.toml",
    );
    assert!(without.expect_err("gravity needs absolute counts").to_string().contains("absolute"));
}

#[test]
fn a_drive_that_is_limited_in_few_rows_is_no_outlier() {
    let machine = Machine { limit: 27.0, ..AXIS };
    let take = |seed| record(machine, BENCH, seed, mixed(14.0, seed as f64));
    let (fit, holdout) = ([take(1), take(2)], [take(3)]);
    let all = fit.iter().chain(&holdout).flat_map(|one| &one.command);
    let (limited, rows) =
        all.fold((0, 0), |(limited, rows), u| (limited + u32::from(u.abs() > 27.0), rows + 1));
    let part = f64::from(limited) / f64::from(rows);
    assert!((0.01..0.06).contains(&part), "{part} of the rows");
    let outcome = diagnosed(&rig(WHOLE, "", "", BENCH.counts), &fit, &holdout);
    assert_eq!(names(&outcome), [N::CommandSaturation]);
    let limit = outcome.report.effects[0].parameters["limit"].value;
    assert!((26.0..28.0).contains(&limit), "{limit}");
}

/// The axis swings at up to 12 Hz: nearly all that the drive withholds it withholds within 10 ms of
/// a reversal.
#[test]
fn a_drive_that_clips_softly_at_reversals_is_named() {
    let swings = |f: f64| move |t: f64| 30.0 * (TAU * f * t).sin() * (0.55 + 0.45 * (TAU * 0.4 * t).sin());
    let machine = Machine { limit: 24.0, soft_power: Some(8.0), ..AXIS };
    let take = |seed, f| record(machine, BENCH, seed, swings(f));
    let (fit, holdout) = ([take(1, 9.0), take(2, 12.0)], [take(3, 11.0)]);
    let outcome = diagnosed(&rig(WHOLE, "", "", BENCH.counts), &fit, &holdout);
    assert_eq!(names(&outcome), [N::CommandSaturation], "{}", outcome.report.sentence);
    let limit = outcome.report.effects[0].parameters["limit"].value;
    assert!((23.0..25.0).contains(&limit), "{limit}");
}

#[test]
#[ignore = "nightly: 15 s"]
fn unmodelled_friction_is_not_reported_as_a_command_effect() {
    // The inertia takes two per cent of the drive's force.
    let machine = Machine { inertia: 0.02, viscous: 2.0, slow_grip: 2.5, ..AXIS };
    let taken = Taken { seconds: 12.0, ..BENCH };
    let take = |seed| record(machine, taken, seed, mixed(6.0, seed as f64));
    let rig = rig("inertia = 0.02\nviscous = 2.0\ncoulomb = 3.0", "", "", BENCH.counts);
    let outcome = diagnosed(&rig, &[take(1), take(2)], &[take(3)]);
    let of_command =
        [N::CommandDeadband, N::CommandSaturation, N::CommandDelay, N::ElectricalLag, N::TorqueRipple];
    let names = names(&outcome);
    assert!(names.iter().all(|name| !of_command.contains(name)), "{names:?}");
}
