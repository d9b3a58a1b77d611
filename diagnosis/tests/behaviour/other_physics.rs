//! Effects beside physics without a name that is far above the noise: shares of the force error decide there.

use crate::axis::{AXIS, BENCH, Machine, diagnosed, mixed, names, record, rig};
use diagnosis::Outcome;
use diagnosis::effects::EffectName as N;

/// An axis that something pushes at times of its own, with a rig that holds what `model` says.
fn pushed(machine: Machine, model: &str) -> Outcome {
    let taken = |seed: u64| record(machine, BENCH, seed, mixed(40.0, seed as f64));
    let rig = rig(model, "", "", BENCH.counts);
    diagnosed(&rig, &[taken(1), taken(2)], &[taken(3)])
}

#[test]
fn dry_friction_is_named_beside_a_push_that_has_no_name() {
    let machine = Machine { push: 2.0, forward: 6.0, backward: 6.0, ..AXIS };
    let outcome = pushed(machine, "inertia = 2.0\nviscous = 8.0");
    assert!(names(&outcome).contains(&N::CoulombFriction), "{}", outcome.report.sentence);
}

#[test]
fn a_push_that_has_no_name_alone_is_not_named() {
    let outcome = pushed(Machine { push: 2.0, ..AXIS }, "inertia = 2.0\nviscous = 8.0\ncoulomb = 3.0");
    assert!(names(&outcome).is_empty(), "{}", outcome.report.sentence);
}
