//! Commissioning the virtual device over the link, with what a bench gets wrong in its wires.

use control_core::Device;
use device_sim::error::Error;
use diagnosis::rig::Rig;
use lab::characterise::mechanism::{Channel, Wiring};
use lab::characterise::{self, writer};
use lab::commission::mechanism::VirtualLine;
use lab::commission::{self, CommissioningOutcome, CommissioningStep, WeighOutcome, WeighWish, Wish};

const RADIUS_MM: f64 = 12.5;
const WISH: Wish = Wish { turns: 5, pull_mm: 100.0, counts_per_turn: None };

fn rig() -> Rig {
    let scale = characterise::scale(&characterise::configuration()).expect("the default is sound");
    writer::nominal_rig(&scale)
}

fn commission_on(
    rig: &Rig,
    wiring: Wiring,
    tilt: (f64, f64),
) -> (Result<CommissioningOutcome, Error>, Vec<CommissioningStep>, Device) {
    let line = VirtualLine::new(rig, "the test's rig", wiring, RADIUS_MM).expect("rotary, in DAC steps");
    let mut line = line.with_tilt(tilt.0, tilt.1);
    let mut steps = Vec::new();
    let outcome = commission::commission(&mut line, &WISH, |step| {
        steps.push(step);
        Ok(())
    });
    (outcome, steps, *line.device().plan().device())
}

fn commissioned(wiring: Wiring) -> CommissioningOutcome {
    let (outcome, _, in_force) = commission_on(&rig(), wiring, (0.1, 1.0));
    let outcome = outcome.expect("it passes");
    assert_eq!(outcome.record.device, in_force, "the device has what was found");
    assert!(outcome.record.device.commissioned);
    outcome
}

fn refused(wiring: Wiring, hints: &[&str]) {
    let (outcome, _, in_force) = commission_on(&rig(), wiring, (0.0, 1.0));
    let said = outcome.map(|outcome| outcome.lines()).expect_err("it does not pass").to_string();
    assert!(hints.iter().all(|hint| said.contains(hint)), "{said}");
    assert!(!in_force.commissioned);
}

#[test]
fn a_device_that_is_right_is_measured() {
    let rig = rig();
    let (_, steps, _) = commission_on(&rig, Wiring::default(), (0.1, 1.0));
    assert!(!steps.contains(&CommissioningStep::GuardSupply), "a virtual device has no supply: {steps:?}");
    let found = commissioned(Wiring::default());
    assert!(!found.channels_swapped && !found.leads_reversed);
    let device = &found.record.device;
    assert_eq!((device.counts_per_turn, device.dac_zero), (4_000, 0));
    assert!((found.radius_mm / RADIUS_MM - 1.0).abs() < 0.005, "{} mm", found.radius_mm);
    assert!((device.skin_tilt.0 - 100).abs() <= 1, "{} mrad", device.skin_tilt.0);
    let (inertia, dry) = (rig.model.inertia, rig.model.coulomb.expect("the nominal rig has dry friction"));
    println!(
        "inertia {:.4e} of {inertia:.4e}, dry {:.4e} of {dry:.4e}",
        found.mechanism.inertia, found.mechanism.dry
    );
    assert!((found.mechanism.inertia / inertia - 1.0).abs() < 0.1, "{} kg·m²", found.mechanism.inertia);
    assert!((found.mechanism.dry / dry - 1.0).abs() < 0.1, "{} N·m", found.mechanism.dry);
    let along = device.mechanism;
    let (mass, friction) = (along.mass.0.to_num::<f64>(), along.dry_friction.0.to_num::<f64>());
    assert!((mass * 1e-3 * (RADIUS_MM * 1e-3).powi(2) / inertia - 1.0).abs() < 0.1, "{mass} g");
    assert!((friction * RADIUS_MM * 1e-3 / dry - 1.0).abs() < 0.1, "{friction} N");
    assert!(!found.stiffness_lowered, "{}", device.limits.stiffness);
}

#[test]
fn with_little_friction_the_device_allows_less_stiffness() {
    let mut rig = rig();
    rig.model.coulomb = rig.model.coulomb.map(|dry| dry / 6.0);
    let (outcome, ..) = commission_on(&rig, Wiring::default(), (0.1, 1.0));
    let found = outcome.expect("it passes");
    let lines = found.lines().join("\n");
    assert!(found.stiffness_lowered && lines.contains("lowered"), "{lines}");
    assert_eq!(found.record.device.limits.stiffness, control_core::stiffest(&found.record.device));
}

#[test]
fn each_wrong_wire_is_named_and_put_right() {
    for (leads_reversed, channels_swapped) in [(true, false), (false, true), (true, true)] {
        let found = commissioned(Wiring { leads_reversed, channels_swapped, ..Wiring::default() });
        assert_eq!((found.leads_reversed, found.channels_swapped), (leads_reversed, channels_swapped));
        assert_eq!(
            (found.record.device.motor_reversed, found.record.device.encoder_reversed),
            (leads_reversed, channels_swapped)
        );
        let lines = found.lines().join("\n");
        assert_eq!(lines.contains("motor leads reversed"), leads_reversed, "{lines}");
        assert_eq!(lines.contains("encoder channels swapped"), channels_swapped, "{lines}");
    }
}

#[test]
fn a_dead_channel_is_found_before_the_motor_moves() {
    for dead in [Channel::A, Channel::B] {
        let wiring = Wiring { dead: Some(dead), ..Wiring::default() };
        refused(wiring, &["one of the encoder's channels is dead", "check the wires"]);
        let (_, steps, _) = commission_on(&rig(), wiring, (0.0, 1.0));
        assert!(steps.iter().all(|step| !step.moves()), "{steps:?}");
    }
}

#[test]
fn a_motor_without_current_is_named() {
    refused(Wiring { leads_off: true, ..Wiring::default() }, &["the motor did not move", "leads"]);
}

#[test]
fn a_tilt_sensor_the_wrong_way_round_is_named() {
    for (sign, hint) in [(-1.0, "the wrong way round"), (0.0, "did not follow")] {
        let (outcome, steps, _) = commission_on(&rig(), Wiring::default(), (0.1, sign));
        let said = outcome.map(|outcome| outcome.lines()).expect_err("it does not pass").to_string();
        assert!(said.contains(hint), "{said}");
        assert!(steps.iter().all(|step| !step.moves()), "{steps:?}");
    }
}

/// An amplifier that gives 0.3 mN·m where nothing is asked of it: 21 codes.
#[test]
fn the_converters_zero_is_found_whichever_way_the_leads_are() {
    for leads_reversed in [false, true] {
        let mut rig = rig();
        rig.model.offset = Some(0.3e-3);
        let wiring = Wiring { leads_reversed, ..Wiring::default() };
        let (outcome, ..) = commission_on(&rig, wiring, (0.0, 1.0));
        let zero = outcome.expect("it passes").record.device.dac_zero;
        let codes = 0.3 / 28.8 * 2_047.0 * if leads_reversed { 1.0 } else { -1.0 };
        assert!((f64::from(zero) - codes).abs() < 3.0, "{zero} codes for {codes}");
    }
}

#[test]
fn an_offset_above_the_friction_is_named() {
    let mut rig = rig();
    rig.model.offset = Some(0.9e-3);
    let (outcome, ..) = commission_on(&rig, Wiring::default(), (0.0, 1.0));
    let said = outcome.map(|outcome| outcome.lines()).expect_err("it does not pass").to_string();
    assert!(said.contains("offset"), "{said}");
}

#[test]
fn a_written_record_is_read_back() {
    let found = commissioned(Wiring { leads_reversed: true, ..Wiring::default() });
    let text = found.to_toml("bench 3").expect("it can be written");
    let source = device_sim::named_files::Text { origin: "device.toml".into(), text };
    let part = device_sim::device::device_config::DeviceConfig::parse(source).expect("it is sound");
    assert_eq!(part.device, found.record.device);
}

/// Weighs 100 g on a motor that gives `gain` times what it is asked for.
fn weighed(gain: f64, wiring: Wiring, correct: bool) -> (Result<WeighOutcome, Error>, Device) {
    let mut rig = rig();
    rig.actuator.gain *= gain;
    // The 30 g and 0.06 N of the record: what commissioning finds with the wrong torque.
    (rig.model.inertia, rig.model.coulomb) = (3e-6 * gain, Some(6e-4 * gain));
    let line = VirtualLine::commissioned(&rig, "the test's rig", 10.0).expect("rotary, in DAC steps");
    let mut line = line.wired(wiring);
    let outcome = commission::weigh(&mut line, &WeighWish { grams: 100.0, correct }, |_| Ok(()));
    (outcome, *line.device().plan().device())
}

#[test]
fn a_weight_shows_what_a_newton_is() {
    let right = Device::commissioned_virtual();
    for gain in [0.5, 0.8, 1.0, 1.25, 2.0] {
        let (outcome, in_force) = weighed(gain, Wiring::default(), true);
        let outcome = outcome.unwrap_or_else(|why| panic!("{gain}: {why}"));
        let within = f64::from(in_force.torque_uncertainty) * 1e-3;
        println!("{gain}: {}", outcome.lines().join("; "));
        assert_eq!(outcome.record.device, in_force);
        assert!(in_force.commissioned && (1e-3..0.1).contains(&within), "{gain}: {within}");
        assert!((outcome.factor / gain - 1.0).abs() <= within, "{gain}: {} of it", outcome.factor);
        let wanted = if gain == 1.0 { 28.8 } else { 28.8 * gain };
        let found = in_force.full_scale_torque.0.to_num::<f64>();
        assert!((found / wanted - 1.0).abs() <= within, "{gain}: {found} mN·m");
        assert_eq!(outcome.is_corrected, gain != 1.0);
        assert!(in_force.limits.torque <= right.limits.torque, "{gain}: no ceiling rises");
    }
    let (outcome, in_force) = weighed(0.5, Wiring::default(), false);
    let why = outcome.expect_err("nobody asked for a correction").to_string();
    assert!(why.contains("0.5") && why.contains("--correct"), "{why}");
    assert_eq!(in_force, right);
}

#[test]
fn a_weight_that_shows_another_mistake_is_refused() {
    let other_way = Wiring { leads_reversed: true, channels_swapped: true, ..Wiring::default() };
    let leads = Wiring { leads_reversed: true, ..Wiring::default() };
    for (gain, wiring, hint) in [
        (1.0, other_way, "outwards"),
        (1.0, leads, "ran away"),
        (5.0, Wiring::default(), "hangs free"),
        (0.2, Wiring::default(), "hold the needle"),
    ] {
        let (outcome, in_force) = weighed(gain, wiring, true);
        let why = outcome.map(|outcome| outcome.lines()).expect_err(hint).to_string();
        assert!(why.contains(hint) && why.contains(';') | why.contains(':'), "{why}");
        assert_eq!(in_force, Device::commissioned_virtual(), "{hint}: nothing was changed");
    }
    let line = VirtualLine::commissioned(&rig(), "the test's rig", 10.0);
    let mut line = line.expect("rotary, in DAC steps");
    let heavy = commission::weigh(&mut line, &WeighWish { grams: 2_000.0, correct: true }, |_| Ok(()));
    let why = heavy.map(|outcome| outcome.lines()).expect_err("the motor does not carry it").to_string();
    assert!(why.contains("it must be from") && why.contains("2000 g"), "{why}");
}
