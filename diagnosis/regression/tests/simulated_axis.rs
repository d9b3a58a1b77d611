//! Laws concealed in a simulated axis are proposed first, and the holdout has no part in the
//! choice. The axis is stepped at 20 kHz by a method of its own.

use regression::{Part, Proposals, Recording, Rig, Value, propose};
use std::f64::consts::TAU;

const INERTIA: f64 = 2e-6;
const VISCOUS: f64 = 1e-6;
const COULOMB: f64 = 1e-4;
const GAIN: f64 = 0.02;
const COUNTS: f64 = 40_000.0 / TAU;
const LOG_HZ: usize = 1000;
const STEPS: usize = 20;

/// The concealed physics: a force of (q, v, t, drive force), a map of the command history, and a
/// change of the reading, and what the reading loses at a speed every 0.4 s.
struct Hidden {
    force: fn(f64, f64, f64, f64) -> f64,
    drive: fn(&[f64]) -> f64,
    reading: fn(f64) -> f64,
    loses: fn(f64) -> f64,
}

const NONE: Hidden = Hidden { force: |_, _, _, _| 0.0, drive: |u| u[0], reading: |q| q, loses: |_| 0.0 };

fn noise(seed: &mut u64) -> f64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    (*seed >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
}

/// The motion asked for: slow strokes over several turns, and faster swings.
fn reference(t: f64, k: f64) -> f64 {
    9.0 * (0.9 * t + k).sin() + 1.5 * (4.1 * t + 2.0 * k).sin() + 0.15 * (23.0 * t + k).sin()
}

fn record(hidden: &Hidden, part: Part, k: u64) -> Recording {
    let dt = 1.0 / (LOG_HZ * STEPS) as f64;
    let phase = k as f64;
    let mut seed = k + 17;
    let start = reference(0.0, phase);
    let (mut q, mut v, mut bias) = (start, 0.0, 0.0);
    let (mut last, mut lost) = (q, 0.0);
    // The command of the last 50 log steps, the newest first.
    let mut history = [0.0; 50 * STEPS];
    let (mut time_s, mut command, mut counts) = (Vec::new(), Vec::new(), Vec::new());
    for i in 0..12 * LOG_HZ {
        let t = i as f64 / LOG_HZ as f64;
        let read = (hidden.reading)(q) - lost;
        if i % 400 == 0 {
            lost += (hidden.loses)(v);
        }
        let speed = (read - last) * LOG_HZ as f64;
        last = read;
        let aim = reference(t, phase);
        let aim_speed = (reference(t + 1e-4, phase) - reference(t - 1e-4, phase)) / 2e-4;
        let u = (6e-4 * (aim - read) + 2.5e-5 * (aim_speed - speed)) / GAIN;
        time_s.push(t);
        command.push(u);
        counts.push((read * COUNTS).floor());
        for _ in 0..STEPS {
            history.rotate_right(1);
            history[0] = u;
            bias += 2e-8 * noise(&mut seed);
            let drive = GAIN * (hidden.drive)(&history);
            let force = drive + (hidden.force)(q, v, t, drive) - VISCOUS * v + bias + 2e-5 * noise(&mut seed);
            // Dry friction as an impulse that may stop the axis and never turns it round.
            let free = v + force / INERTIA * dt;
            let most = COULOMB / INERTIA * dt;
            v = free - free.clamp(-most, most);
            q += v * dt;
        }
    }
    Recording { part, time_s, command, position_counts: counts, tilt_rad: None, load: None }
}

fn rig() -> Rig {
    let value = |nominal, spread| Value { nominal, spread: Some(spread) };
    Rig {
        rotary: true,
        inertia: value(INERTIA, 0.1),
        viscous: Some(value(VISCOUS, 0.5)),
        coulomb: Some(value(COULOMB, 0.5)),
        weight: None,
        gravity: None,
        has_offset: true,
        gain: value(GAIN, 0.05),
        known_delay_s: 0.0,
        known_lags_s: Vec::new(),
        counts_per_unit: COUNTS,
        absolute: false,
        noise_counts: 0.0,
        turn: Some(TAU),
        start_spread: Some(0.2),
    }
}

fn recordings(hidden: &Hidden) -> Vec<Recording> {
    vec![record(hidden, Part::Fit, 1), record(hidden, Part::Fit, 2), record(hidden, Part::Holdout, 3)]
}

fn proposals(rig: &Rig, hidden: &Hidden) -> Proposals {
    propose(rig, &recordings(hidden)).expect("recordings are long enough")
}

#[track_caller]
fn is_first(name: &str, rig: &Rig, hidden: &Hidden) {
    let found = proposals(rig, hidden);
    let first = &found.rounds[0][0];
    let shown: Vec<_> =
        found.rounds[0].iter().take(4).map(|h| (h.law.key, h.evidence.share, h.valid)).collect();
    assert_eq!(first.law.key, name, "{shown:?}");
    let held = first.evidence.held_out.expect("the first law is read on the holdout");
    assert!(first.valid && first.evidence.share > 0.05 && held.share > 0.05, "{shown:?} {held:?}");
}

#[test]
fn nothing_material_is_proposed_where_nothing_is_missing() {
    let found = proposals(&rig(), &NONE);
    let largest = found.rounds.iter().map(|round| round[0].evidence.share).fold(0.0, f64::max);
    assert!(largest < 0.1, "{largest}");
}

#[test]
fn friction_that_the_rig_lacks_is_first() {
    is_first("coulomb_friction", &Rig { coulomb: None, ..rig() }, &NONE);
    let force = |_: f64, v: f64, _: f64, _: f64| -4e-6 * v;
    is_first("viscous_friction", &Rig { viscous: None, ..rig() }, &Hidden { force, ..NONE });
}

#[test]
fn friction_that_changes_is_first() {
    let force = |_: f64, v: f64, _: f64, _: f64| -4e-4 * v.signum() * (-(v / 1.0).abs()).exp();
    is_first("stribeck_friction", &rig(), &Hidden { force, ..NONE });
    let force = |_: f64, v: f64, _: f64, _: f64| -1.2e-6 * v * v.abs();
    is_first("quadratic_drag", &rig(), &Hidden { force, ..NONE });
    let force = |_: f64, v: f64, t: f64, _: f64| -4e-4 * v.signum() * (-t / 2.0).exp();
    is_first("friction_drift", &rig(), &Hidden { force, ..NONE });
}

#[test]
fn forces_of_the_place_are_first() {
    let force = |q: f64, _: f64, _: f64, _: f64| 2e-4 * (7.0 * q + 0.4).sin();
    is_first("cogging", &rig(), &Hidden { force, ..NONE });
    let force = |q: f64, _: f64, _: f64, _: f64| -1e-4 * (q - 2.0);
    is_first("position_spring", &rig(), &Hidden { force, ..NONE });
    let force = |q: f64, v: f64, _: f64, _: f64| -2e-4 * v.signum() * (q / 4.0).tanh();
    is_first("position_dependent_friction", &Rig { absolute: true, ..rig() }, &Hidden { force, ..NONE });
}

#[test]
fn laws_of_the_drive_are_first() {
    // A lag and a delay differ at the top of the band alone (cosine 0.986): both lead.
    for drive in [lagged as fn(&[f64]) -> f64, |u| u[8 * STEPS]] {
        let found = proposals(&rig(), &Hidden { drive, ..NONE });
        let mut near: Vec<&str> = found.rounds[0].iter().take(2).map(|h| h.law.key).collect();
        near.sort_unstable();
        assert_eq!(near, ["command_delay", "electrical_lag"]);
        assert!(found.rounds[0][0].evidence.share > 0.5);
    }
    let drive = |u: &[f64]| u[0] - u[0].clamp(-0.006, 0.006);
    is_first("command_deadband", &rig(), &Hidden { drive, ..NONE });
    let force = |q: f64, _: f64, _: f64, drive: f64| 0.3 * drive * (5.0 * q).sin();
    is_first("torque_ripple", &rig(), &Hidden { force, ..NONE });
}

/// A first-order lag of 8 ms on the held history.
fn lagged(u: &[f64]) -> f64 {
    let keep = (-1.0 / (0.008 * (LOG_HZ * STEPS) as f64)).exp();
    let (mut sum, mut weight) = (0.0, 1.0 - keep);
    for u in u {
        sum += weight * u;
        weight *= keep;
    }
    sum
}

#[test]
fn errors_of_the_reading_are_proposed() {
    let reading = |q: f64| q + 0.03 * (q + 1.0).sin();
    is_first("encoder_eccentricity", &rig(), &Hidden { reading, ..NONE });
    // The size of lost counts comes out at a third of the inertia, which is not valid: see
    // docs/measured/regression.md. That the column takes a share is all that holds so far.
    let loses = |v: f64| if v.abs() > 8.0 { 0.008 * v.signum() } else { 0.0 };
    let found = proposals(&rig(), &Hidden { loses, ..NONE });
    let missed = found.rounds[0].iter().find(|h| h.law.key == "missed_counts").expect("steps are seen");
    assert!(missed.evidence.share > 0.15 && missed.evidence.z > 3.0, "{missed:?}");
}

/// Names, shapes and figures of the fit, for comparison.
fn order(found: &Proposals) -> Vec<String> {
    let all = found.rounds.iter().flatten();
    all.map(|h| format!("{} {:?} {} {}", h.law.key, h.shapes, h.evidence.share, h.evidence.z)).collect()
}

#[test]
fn a_scrambled_hold_out_changes_no_proposal() {
    let force = |q: f64, v: f64, _: f64, _: f64| 2e-4 * (7.0 * q).sin() - 6e-7 * v * v.abs();
    let mut all = recordings(&Hidden { force, ..NONE });
    let before = propose(&rig(), &all).expect("recordings are long enough");
    let held = all.last_mut().expect("the holdout");
    held.command.reverse();
    held.command.rotate_left(777);
    held.position_counts.reverse();
    held.position_counts.iter_mut().for_each(|c| *c = (1.7 * *c).round());
    let after = propose(&rig(), &all).expect("recordings are long enough");
    assert!(order(&before).len() > 20);
    assert_eq!(order(&before), order(&after));
    let held = |p: &Proposals| p.rounds[0][0].evidence.held_out.expect("read").share;
    assert!(held(&before) > held(&after) + 0.1, "the holdout judges: {} {}", held(&before), held(&after));
}
