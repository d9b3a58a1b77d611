//! The judge's inverse dynamics against cases whose truth is at hand: the true model leaves the
//! noise.

use std::fmt::Write as _;

use super::JudgeDynamics;
use crate::generator::case::{Case, build};
use crate::generator::clock::Stamping;
use crate::generator::files;
use crate::generator::spec::Spec;
use crate::key::Category;
use crate::report_residuals::ResidualRms;

/// A case of the effect on a machine whose stamps are true and that does not creep: of one that
/// does, so few rows lie away from a reversal that they are not like the others.
fn case(name: &'static str) -> Case {
    let spec = Spec {
        id: 1,
        category: Category::Single,
        hidden: vec![name],
        strength: 10.0,
        repeat: 0,
        poor: None,
        recorder: None,
    };
    let drawn = (1..40).filter_map(|seed| build(&spec, seed, true));
    let mut fit = drawn
        .filter(|c| c.machine.stamping == Stamping::True && c.machine.name != "slow axis" && c.level == 10.0);
    fit.next().expect("one of the seeds has such a machine")
}

/// The true rig with `effects` in it.
fn true_rig(case: &Case, effects: &str) -> String {
    let p = &case.plant;
    let kind = if case.machine.rotary { "rotary" } else { "linear" };
    let mut text = format!("format = 1\nkind = \"{kind}\"\n[model]\ninertia = {:e}\n", p.inertia);
    let n = &case.nominal;
    for (key, there, value) in [
        ("viscous", n.viscous.is_some(), p.viscous),
        ("coulomb", n.coulomb.is_some(), p.dry.coulomb),
        ("offset", n.offset.is_some(), p.offset),
        ("weight", n.weight.is_some(), p.weight),
    ] {
        if there {
            let _ = writeln!(text, "{key} = {value:e}");
        }
    }
    let _ = writeln!(
        text,
        "[actuator]\ngain = {:e}\nlimit = {:e}\n[encoder]\ncounts_per_unit = {:e}",
        p.gain, case.machine.limit, p.counts_per_unit
    );
    text + effects
}

fn judged(case: &Case, effects: &str) -> Result<ResidualRms, String> {
    let dir =
        std::env::temp_dir().join(format!("proof-dynamics-{}-{}", std::process::id(), case.spec.hidden[0]));
    let paths = files::write_case(case, &dir).unwrap();
    let patched = dir.join("patched-rig.toml");
    std::fs::write(&patched, true_rig(case, effects)).unwrap();
    let key = files::key(case);
    let bench = JudgeDynamics::new(&paths, &key).unwrap();
    let left = bench.patched(&patched).map(|patched| ResidualRms { refit: bench.refit(), patched });
    std::fs::remove_dir_all(&dir).unwrap();
    left
}

/// The true model leaves about the floor, and the refit about what the oracle's does.
fn check(case: &Case, effects: &str) {
    let left = judged(case, effects).unwrap();
    let oracle = files::key(case).oracle.unwrap();
    let name = case.spec.hidden[0];
    let (floor, refit) = (left.patched / oracle.floor, left.refit / oracle.refit);
    assert!((0.6..1.6).contains(&floor), "{name}: the true model leaves {floor} of the floor");
    assert!((0.7..1.3).contains(&refit), "{name}: the refit leaves {refit} of the oracle's");
    // And without the effect there is nothing left of the gain.
    let without = judged(case, "").unwrap();
    assert!(without.patched > 0.6 * oracle.refit, "{name}: {} of {}", without.patched, oracle.refit);
}

#[test]
fn the_true_drag_leaves_the_noise() {
    let case = case("quadratic_drag");
    let effect = format!(
        "[[effect]]\nname = \"quadratic_drag\"\n[effect.coefficients]\ncoefficient = {:e}\n",
        case.plant.drag
    );
    check(&case, &effect);
}

#[test]
fn the_true_delay_leaves_the_noise() {
    let case = case("command_delay");
    let effect =
        format!("[[effect]]\nname = \"command_delay\"\n[effect.shape]\ndelay = {:e}\n", case.plant.delay);
    check(&case, &effect);
}

#[test]
fn true_cogging_leaves_only_noise_for_any_encoder_zero() {
    let case = case("cogging");
    let (mut shape, mut coefficients) = (format!("turn = {:e}\n", case.plant.turn), String::new());
    for (i, h) in case.plant.cogging.iter().enumerate() {
        let _ = writeln!(shape, "order_{i} = {:e}", h.order);
        // A phase at another zero than the recording's.
        let phase = h.phase + 0.7 * h.order;
        let _ = writeln!(
            coefficients,
            "cos_{i} = {:e}\nsin_{i} = {:e}",
            h.amplitude * phase.sin(),
            h.amplitude * phase.cos()
        );
    }
    let effect = format!(
        "[[effect]]\nname = \"cogging\"\n[effect.shape]\n{shape}[effect.coefficients]\n{coefficients}"
    );
    check(&case, &effect);
}

#[test]
fn a_law_that_the_judge_does_not_know_is_reported() {
    let case = case("tilt_gravity");
    assert!(judged(&case, "[[effect]]\nname = \"magic\"\n").unwrap_err().contains("`magic`"));
}
