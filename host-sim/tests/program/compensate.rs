//! `compensate` on the virtual device, whose mechanism has forces that only the diagnosis has
//! found. Both rigs are those that the tests on the board use; `docs/guide/compensation.md` has the
//! commands that made them.

use control_core::Device;
use control_core::compensation::Gain;
use device_sim::device::device_config::{self, DeviceConfig};
use device_sim::named_files::Text;
use diagnosis::rig::Rig;
use fixed::types::I16F16;
use lab::commission::mechanism::VirtualLine;
use lab::compensate::{self, Wish, coefficients, page};
use std::path::PathBuf;

fn rig(name: &str) -> Rig {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/fixtures").join(name);
    Rig::read(&path).expect("a rig")
}

fn line(hidden: &Rig) -> VirtualLine {
    VirtualLine::commissioned(hidden, "hidden.toml", 10.0).expect("a device")
}

#[test]
fn compensation_leaves_a_quarter_of_the_found_force() {
    let mut steps = Vec::new();
    let mut line = line(&rig("hidden.toml"));
    let outcome = compensate::compensate(&mut line, &rig("hidden-found.toml"), Wish::default(), |step| {
        steps.push(step.to_string());
        Ok(())
    })
    .expect("it is compensated");
    assert_eq!(steps.len(), 3, "each step is said before it is done");
    let (before, after) = (outcome.before, outcome.after);
    println!("before {before:?}\nafter {after:?}");
    assert!(
        before.all() > 0.08 && after.all() <= before.all() / 4.0,
        "{} after {} N",
        after.all(),
        before.all()
    );
    for (tenth, (before, after)) in before.by_tenth.iter().zip(&after.by_tenth).enumerate() {
        assert!(after <= before, "tenth {tenth}: {after} N after {before} N");
    }
    // The device has it, and a file keeps it to the last place.
    assert_eq!(line.device().plan().device(), &outcome.record.device);
    let text = device_config::to_toml("mine", &outcome.record).expect("it can be written");
    let read = DeviceConfig::parse(Text { origin: "device.toml".into(), text }).expect("sound");
    assert_eq!(read.device, outcome.record.device);
    let html = page::html(&outcome);
    assert!(html.contains("7 times a turn") && !html.contains("http"), "{html}");
}

/// Compensates and checks that no phase is felt more afterwards than before.
fn compensated(found: &Rig) -> (VirtualLine, compensate::CompensationOutcome, Vec<String>) {
    let (mut line, mut steps) = (line(rig_hidden()), Vec::new());
    let outcome = compensate::compensate(&mut line, found, Wish::default(), |step| {
        steps.push(step.to_string());
        Ok(())
    })
    .expect("it is compensated");
    println!("{:?}\n{:?}\n{:?} {:?}", outcome.before, outcome.after, outcome.weight_mnm, outcome.taken_back);
    for ((phase, before), (_, after)) in outcome.before.phases().into_iter().zip(outcome.after.phases()) {
        assert!(after <= before + f64::max(2e-3, 0.05 * before), "{phase}: {after} N after {before} N");
    }
    (line, outcome, steps)
}

#[test]
fn a_weight_that_the_report_does_not_have_is_measured() {
    let mut found = rig("hidden-found.toml");
    found.model.weight = None;
    let (_, outcome, steps) = compensated(&found);
    let weight = outcome.weight_mnm.expect("it shows");
    assert!((weight / 1.5 - 1.0).abs() < 0.05, "{weight} mN·m, hidden.toml has 1.5");
    assert!(
        steps[0].contains("lay the device level") && steps[1].contains("to find the weight"),
        "{steps:?}"
    );
    assert!(outcome.taken_back.is_empty(), "{:?}", outcome.taken_back);
    assert!(outcome.after.all() <= outcome.before.all() / 4.0, "{:?}", outcome.after);
}

#[test]
fn no_part_is_tried_without_beyond_the_motion_allowed() {
    let mut wrong = rig("hidden-found.toml");
    // hidden.toml has no offset, so that not all of it helps.
    wrong.model.offset = Some(1.0e-3);
    let (mut line, mut steps) = (line(rig_hidden()), Vec::new());
    let wish = Wish { motion_s: 50.0, ..Wish::default() };
    let outcome = compensate::compensate(&mut line, &wrong, wish, |step| {
        steps.push(step.to_string());
        Ok(())
    })
    .expect("it ends well");
    assert!(outcome.motion_s <= 50.0, "{} s", outcome.motion_s);
    assert_eq!(steps.len(), 3, "tilt, before and after: {steps:?}");
    assert!(!outcome.is_compensated);
    assert!(outcome.taken_back[0].contains("the motion allowed"), "{:?}", outcome.taken_back);
}

#[test]
fn nothing_moves_where_the_motion_allowed_is_too_short() {
    let (mut line, mut steps) = (line(rig_hidden()), Vec::new());
    let wish = Wish { motion_s: 20.0, ..Wish::default() };
    let refused = compensate::compensate(&mut line, &rig("hidden-found.toml"), wish, |step| {
        steps.push(step.to_string());
        Ok(())
    });
    let said = refused.expect_err("it needs more").to_string();
    assert!(said.contains("20 s are allowed") && steps.is_empty(), "{said} {steps:?}");
}

#[test]
fn parts_that_the_hand_feels_more_are_undone() {
    let mut wrong = rig("hidden-found.toml");
    // hidden.toml has no offset.
    wrong.model.offset = Some(1.0e-3);
    let (line, outcome, steps) = compensated(&wrong);
    assert!(outcome.is_compensated);
    assert_eq!(outcome.taken_back.len(), 1, "{:?}", outcome.taken_back);
    assert!(outcome.taken_back[0].starts_with("the drive's offset"), "{:?}", outcome.taken_back);
    assert!(steps.iter().any(|step| step.contains("the same without friction")), "{steps:?}");
    let kept = line.device().plan().device().compensation;
    assert_eq!(kept.gains.drive, Gain(0));
    assert!(kept.gains.friction > Gain(0) && kept.gains.angle > Gain(0));
    assert!(outcome.after.all() <= outcome.before.all() / 4.0, "{:?}", outcome.after);
}

#[test]
fn a_report_of_nothing_that_helps_leaves_the_device_as_it_was() {
    let mut wrong = rig("hidden-found.toml");
    wrong.effects.clear();
    wrong.model.offset = Some(1.5e-3);
    (wrong.model.coulomb, wrong.model.viscous, wrong.model.weight) = (None, None, Some(0.0));
    let (line, outcome, _) = compensated(&wrong);
    assert!(!outcome.is_compensated && outcome.taken_back.len() == 1, "{:?}", outcome.taken_back);
    assert!(!line.device().plan().device().compensation.is_some());
    assert!(page::html(&outcome).contains("the device is as it was before"));
}

#[test]
fn what_was_fed_forward_before_stays_where_it_is_felt_less() {
    let (mut line, _, _) = compensated(&rig("hidden-found.toml"));
    let had = *line.device().plan().device();
    let mut less = rig("hidden-found.toml");
    // A report that found the friction only; alone it helps, and the device had more.
    less.effects.clear();
    let outcome =
        compensate::compensate(&mut line, &less, Wish::default(), |_| Ok(())).expect("it ends well");
    let was = outcome.as_it_was.expect("the device fed something forward").all();
    assert!(was <= outcome.before.all() / 4.0, "{was} N of {}", outcome.before.all());
    assert!(!outcome.is_compensated, "{:?} after {was} N", outcome.after.all());
    let told = outcome.taken_back.join("; ");
    assert!(told.contains("fed forward before") && told.contains("compensate --align"), "{told}");
    assert_eq!(*line.device().plan().device(), had);
    assert!((outcome.after.all() - was).abs() < 1e-12, "it feels as it was");
}

#[test]
fn the_numbers_are_those_of_the_mechanism_on_the_devices_scale() {
    let found =
        coefficients::found(&rig("hidden-found.toml"), &Device::commissioned_virtual(), 1.0).expect("sound");
    let near = |got: I16F16, wanted: f64| {
        let got = got.to_num::<f64>();
        assert!((got / wanted - 1.0).abs() < 0.02, "{got} for {wanted}");
    };
    // As hidden.toml has them, in mN·m.
    near(found.compensation.inwards.dry.0, 0.6);
    near(found.compensation.outwards.dry.0, 0.6);
    near(found.compensation.weight.0, 1.5);
    near(found.compensation.angle[0].amplitude, 0.3_f64.hypot(0.6));
    near(found.compensation.angle[1].amplitude, 0.5);
    assert_eq!((found.compensation.angle[0].order, found.compensation.angle[1].order), (14, 7));
    // 0.4 in 256ths: gains are shares of what is usual.
    let half =
        coefficients::found(&rig("hidden-found.toml"), &Device::commissioned_virtual(), 0.5).expect("sound");
    assert_eq!(half.compensation.gains.friction, Gain(102));
}

#[test]
fn an_unstable_or_foreign_compensation_is_refused_at_rest() {
    let asked = |rig: &Rig, share: f64| {
        let mut asked = false;
        let why =
            compensate::compensate(&mut line(rig_hidden()), rig, Wish { share, ..Wish::default() }, |_| {
                asked = true;
                Ok(())
            })
            .expect_err("it is refused");
        assert!(!asked, "a step was asked for: {why}");
        why.to_string()
    };
    let mut strong = rig("hidden-found.toml");
    strong.model.weight = Some(9e-3);
    assert!(asked(&strong, 1.0).contains("quarter of the torque ceiling"));
    let mut steep = rig("hidden-found.toml");
    for value in steep.effects[0].coefficients.values_mut() {
        *value *= 3.0;
    }
    steep.effects[0].shape.insert("order_14".into(), 140.0);
    assert!(asked(&steep, 1.0).contains("would ring"));
    let mut other = rig("hidden-found.toml");
    other.actuator.command_unit = "A".into();
    assert!(asked(&other, 1.0).contains("not of this device"));
}

fn rig_hidden() -> &'static Rig {
    static HIDDEN: std::sync::OnceLock<Rig> = std::sync::OnceLock::new();
    HIDDEN.get_or_init(|| rig("hidden.toml"))
}

#[test]
fn the_slow_turn_detects_a_different_mechanism() {
    let mut other = rig("hidden.toml");
    other.effects.clear();
    let why =
        compensate::compensate(&mut line(&other), &rig("hidden-found.toml"), Wish::default(), |_| Ok(()));
    let why = why.expect_err("it has no cogging").to_string();
    assert!(why.contains("the rotor's angle was not found"), "{why}");
}
