//! The whole way round: the virtual device has an effect in its mechanism that the written rig does not know; it plays its
//! excitations over the link, and the diagnosis of the recordings names the effect.

use diagnosis::effects::{Effect, EffectName};
use diagnosis::report::Verdict;
use lab::characterise::mechanism::BareDevice;
use lab::characterise::{self, programme, written};
use std::path::PathBuf;

/// Characterises a device with `hidden` in its mechanism and diagnoses the recordings.
fn find(hidden: Option<Effect>, folder: &str) -> diagnosis::Outcome {
    let config = characterise::configuration();
    let scale = characterise::scale(&config).expect("the default configuration is sound");
    let nominal = written::nominal_rig(&scale);
    let programmes = programme::programmes(&nominal, scale.roller_radius_mm);
    characterise::check(&config, &programmes).expect("every excitation is within the limits");
    let mut truth = nominal.clone();
    truth.effects.extend(hidden);
    let mut device = BareDevice::new(&truth, "the test's rig").expect("rotary, in DAC steps");
    let tracks = characterise::on_virtual(&mut device, &programmes, |_| {}).expect("nothing trips");
    let dir = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(folder);
    let paths = written::write_all(&dir, &tracks).expect("the folder can be written");
    let [rig, fit, fit2, holdout] = &paths[..] else { panic!("{paths:?}") };
    let request = diagnosis::Request {
        rig: rig.clone(),
        fit: vec![fit.clone(), fit2.clone()],
        effects: None,
        holdout: vec![holdout.clone()],
    };
    let outcome = diagnosis::diagnose(&request, &|_, _| {}).expect("the recordings are sound");
    std::fs::remove_dir_all(&dir).expect("the test's own folder");
    outcome
}

#[test]
fn a_hidden_cogging_is_found_through_the_link() {
    let mut cogging =
        Effect::shaped(EffectName::Cogging, &[("turn", std::f64::consts::TAU), ("order_7", 7.0)]);
    cogging.coefficients.insert("cos_7".into(), 2.0e-4);
    cogging.coefficients.insert("sin_7".into(), 1.0e-4);
    let outcome = find(Some(cogging), "hidden-cogging");
    let report = &outcome.report;
    assert_eq!(report.verdict, Verdict::MissingPhysics, "{}", outcome.summary());
    assert_eq!(report.effects[0].name.to_string(), "cogging", "{}", outcome.summary());
    let found = report.effects[0].parameters["order_7"].value;
    let truth = 5.0_f64.sqrt() * 1.0e-4;
    assert!((found / truth - 1.0).abs() < 0.1, "{found} N·m for {truth} N·m");
}

#[test]
fn a_device_that_is_as_its_rig_says_lacks_nothing() {
    let outcome = find(None, "hidden-nothing");
    assert_eq!(outcome.report.verdict, Verdict::NoMismatch, "{}", outcome.summary());
}
