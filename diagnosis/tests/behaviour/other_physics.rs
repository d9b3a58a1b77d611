//! Effects together with physics without a name that is far above the noise: shares of the force
//! error decide there.

use crate::axis::{AXIS, BENCH, Machine, Taken, diagnosed, mixed, names, record, rig};
use diagnosis::Outcome;
use diagnosis::laws::EffectName as N;

/// An axis that something pushes at times of its own, with a rig that holds what `model` says.
fn pushed(machine: Machine, model: &str) -> Outcome {
    let taken = |seed: u64| record(machine, BENCH, seed, mixed(40.0, seed as f64));
    let rig = rig(model, "", "", BENCH.counts);
    diagnosed(&rig, &[taken(1), taken(2)], &[taken(3)])
}

#[test]
fn dry_friction_is_named_with_a_push_that_has_no_name() {
    let machine = Machine { push: 2.0, forward: 6.0, backward: 6.0, ..AXIS };
    let outcome = pushed(machine, "inertia = 2.0\nviscous = 8.0");
    assert!(names(&outcome).contains(&N::CoulombFriction), "{}", outcome.report.sentence);
}

#[test]
fn a_push_that_has_no_name_alone_is_not_named() {
    let outcome = pushed(Machine { push: 2.0, ..AXIS }, "inertia = 2.0\nviscous = 8.0\ncoulomb = 3.0");
    assert!(names(&outcome).is_empty(), "{}", outcome.report.sentence);
}

#[test]
fn friction_of_a_cold_axis_is_found_without_it_in_the_rig() {
    let machine = Machine { push: 2.0, forward: 0.2, backward: 0.2, cold: 60.0, disturbance: 0.0, ..AXIS };
    let outcome = pushed(machine, "inertia = 2.0\nviscous = 8.0");
    let named = outcome.report.effects.iter().find(|effect| effect.name == N::FrictionDrift);
    let drift = named.unwrap_or_else(|| panic!("{}", outcome.summary()));
    let change = drift.parameters["change"].value;
    assert!((-1.05..-0.9).contains(&change), "{change}: from 12.2 N to 0.2 N");
}

#[test]
fn a_delay_of_four_rows_is_named_at_fifty_rows_a_second() {
    let machine = Machine { delay_s: 0.08, ..AXIS };
    let slow = Taken { rate: 50.0, seconds: 30.0, ..BENCH };
    let taken = |seed: u64| record(machine, slow, seed, mixed(40.0, seed as f64));
    let rig = rig("inertia = 2.0\nviscous = 8.0\ncoulomb = 3.0", "", "", slow.counts);
    let outcome = diagnosed(&rig, &[taken(1), taken(2)], &[taken(3)]);
    assert!(names(&outcome).contains(&N::CommandDelay), "{}", outcome.report.sentence);
}

#[test]
fn a_drive_that_loses_more_than_half_its_force_drifts() {
    let outcome = pushed(Machine { push: 4.0, fades: 0.6, ..AXIS }, crate::axis::WHOLE);
    // Where half of the force is gone the forces are out of balance, and a form without a name may
    // stand for the drift.
    let told = outcome.report.sentence.contains("a part of the command's force that grows with time");
    assert!(told || names(&outcome).contains(&N::GainDrift), "{}", outcome.report.sentence);
}

#[test]
fn friction_under_gravity_a_thousand_times_larger_is_named() {
    let machine = Machine { gravity: 400.0, forward: 1.5, backward: 1.5, disturbance: 0.002, ..AXIS };
    let taken = |seed: u64| record(machine, Taken { counts: 2e4, ..BENCH }, seed, mixed(300.0, seed as f64));
    let rig = rig("inertia = 2.0\nviscous = 8.0", "", "", 2e4);
    let outcome = diagnosed(&rig, &[taken(1), taken(2)], &[taken(3)]);
    assert!(names(&outcome).contains(&N::CoulombFriction), "{}", outcome.report.sentence);
}
