//! Columns against closed forms and finite differences.

use super::*;
use std::f64::consts::TAU;

const H: f64 = 1e-3;

/// States of a motion that is known at every time; nothing is masked.
fn machine(q: impl Fn(f64) -> f64, asked: impl Fn(f64) -> f64) -> Machine {
    let t: Vec<f64> = (0..4000).map(|i| f64::from(i) * H).collect();
    let over_time = |f: &dyn Fn(f64) -> f64| t.iter().map(|t| f(*t)).collect::<Vec<f64>>();
    let v = over_time(&|t| (q(t + 1e-5) - q(t - 1e-5)) / 2e-5);
    let a = over_time(&|t| (q(t + 1e-4) - 2.0 * q(t) + q(t - 1e-4)) / 1e-8);
    let one = vec![1.0; t.len()];
    let states = States {
        h: H,
        q: over_time(&q),
        seen_a: a.clone(),
        direction: v.iter().map(|v| v.signum()).collect(),
        moving: one.clone(),
        since: one.clone(),
        force: over_time(&asked),
        tilt: None,
        load: None,
        jumps: vec![0.0; t.len()],
        t: t.clone(),
        v,
        a,
    };
    let value = |nominal| crate::data::Value { nominal, spread: None };
    let rig = Rig {
        rotary: true,
        inertia: value(2.0),
        viscous: Some(value(3.0)),
        coulomb: None,
        weight: None,
        gravity: None,
        has_offset: true,
        gain: value(1.0),
        known_delay_s: 0.0,
        known_lags_s: Vec::new(),
        counts_per_unit: 1e6,
        absolute: true,
        noise_counts: 0.0,
        turn: Some(TAU),
        start_spread: None,
    };
    let scales = Scales {
        band_hz: 40.0,
        lowest_hz: 0.5,
        rate_hz: 1.0 / H,
        fast: 10.0,
        hard: 100.0,
        stroke: 1.0,
        short_stroke: 1.0,
        middle: 0.0,
        half_travel: 10.0,
        least_travel: 20.0,
        most_travel: 20.0,
        seconds: 4.0,
        noise: 1e-6,
        driven: true,
        large_asked: 1.0,
    };
    Machine { rig, states: vec![states], scales, asked: vec![over_time(&asked)] }
}

fn column(m: &Machine, name: &str, form: &'static str, value: f64) -> Vec<Vec<f64>> {
    let law = library().find(|law| law.key == name).expect("a law of the library");
    (law.columns)(m, 0, &Shape::fixed(form, value))
}

fn near(x: &[f64], expected: impl Fn(f64) -> f64, within: f64, name: &str) {
    for (k, x) in x.iter().enumerate().skip(200).take(3600) {
        let (t, scale) = (k as f64 * H, within);
        assert!((x - expected(t)).abs() < scale, "{name} at {t}: {x} and not {}", expected(t));
    }
}

#[test]
fn a_bristle_bends_exponentially_after_a_reversal() {
    let m = machine(|t| if t < 2.0 { t } else { 4.0 - t }, |_| 0.0);
    let z = motion::bristle(&m.states[0].q, 0.1);
    for (k, z) in z.iter().enumerate().skip(2001) {
        let travelled = k as f64 * H - 2.0;
        let expected = -1.0 + 2.0 * (-travelled / 0.1).exp();
        assert!((z - expected).abs() < 1e-6, "{z} {expected}");
    }
}

#[test]
fn a_spring_of_positive_size_pulls_back_on_either_side() {
    let m = machine(|t| 8.0 * (2.0 * t).sin(), |_| 0.0);
    for side in [1.0, -1.0] {
        let force = &column(&m, "position_spring", "one side", side)[0];
        for (force, q) in force.iter().zip(&m.states[0].q) {
            assert!(force * q >= 0.0 && (*force != 0.0) == (q * side > 0.0), "{side}: {force} at {q}");
        }
    }
}

#[test]
fn eccentricity_is_the_force_of_the_reading_error() {
    let q = |t: f64| 3.0 * t + 0.4 * (2.0 * t).sin();
    let m = machine(q, |_| 0.0);
    let columns = column(&m, "encoder_eccentricity", "order", TAU);
    let e = move |t: f64| q(t).sin();
    let d = 1e-4;
    let force =
        move |t: f64| (e(t + d) - 2.0 * e(t) + e(t - d)) / (d * d) + 1.5 * (e(t + d) - e(t - d)) / (2.0 * d);
    near(&columns[0], force, 2e-3, "eccentricity");
}

#[test]
fn lag_and_delay_are_the_inverse_maps_of_the_force() {
    let u = |t: f64| (5.0 * t).sin();
    let m = machine(|t| t, u);
    near(&column(&m, "electrical_lag", "", 0.0)[0], |t| 5.0 * (5.0 * t).cos(), 1e-5, "lag");
    let late = 0.0123;
    let expected = |t: f64| (u(t + late) - u(t)) / late;
    near(&column(&m, "command_delay", "", late)[0], expected, 1e-3, "delay");
}

#[test]
fn a_clip_and_a_deadband_are_undone() {
    let u = |t: f64| 0.9 * (5.0 * t).sin();
    let m = machine(|t| t, u);
    // The drive gives c/(1 + |c|^6)^(1/6) of a command c: its command beyond the force is the
    // column.
    let soft = |c: f64| c / (1.0 + c.abs().powi(6)).powf(1.0 / 6.0);
    for (f, extra) in m.asked[0].iter().zip(&column(&m, "command_saturation", "6", 1.0)[0]) {
        assert!((soft(f + extra) - f).abs() < 1e-9, "{f} {extra}");
    }
    let band = &column(&m, "command_deadband", "", 0.01)[0];
    for (f, extra) in m.asked[0].iter().zip(band).filter(|(f, _)| f.abs() > 0.01) {
        let command = f + 0.2 * extra;
        assert!((command - 0.2 * command.signum() - f).abs() < 1e-12);
    }
}

#[test]
fn a_load_on_a_spring_answers_as_its_transfer_function() {
    // At w the load moves (1 + 2ζjr)/(1 − r² + 2ζjr) of the motor, r = w/w0.
    let (w, f0, zeta): (f64, f64, f64) = (20.0, 8.0, 0.06);
    let m = machine(|t| (w * t).sin(), |_| 0.0);
    let r = w / (TAU * f0);
    let (nr, ni, dr, di) = (1.0, 2.0 * zeta * r, 1.0 - r * r, 2.0 * zeta * r);
    let size = dr * dr + di * di;
    let (re, im) = ((nr * dr + ni * di) / size - 1.0, (ni * dr - nr * di) / size);
    let expected = |t: f64| -w * w * (re * (w * t).sin() + im * (w * t).cos());
    let load = &column(&m, "drive_compliance", "", f0)[0];
    // The start has died out after three seconds: exp(−0.06·50·3).
    for (k, x) in load.iter().enumerate().skip(3000).take(900) {
        let t = k as f64 * H;
        assert!((x - expected(t)).abs() < 0.02 * w * w, "{t}: {x} and not {}", expected(t));
    }
}

#[test]
fn gain_drift_heats_towards_the_mean_power() {
    let m = machine(|t| t, |_| 2.0);
    let expected = |t: f64| 2.0 * (1.0 - (-t / 0.4).exp());
    near(&column(&m, "gain_drift", "heat", 0.1)[0], expected, 5e-3, "heat");
    near(&column(&m, "gain_drift", "time", 0.1)[0], expected, 1e-9, "time");
}
