//! The line of a needle that has turned in tissue: the layers go where it meets them, without a
//! jump of the force, without an event, and under the same limits as a patient.

use crate::needle::{Needle, force};
use crate::refusals::q;
use crate::{sparte, xr};
use control_core::config::{FrictionLaw, Law, Layer, Patient, Tissue};
use control_core::event::VesselState;
use control_core::plan::Field;
use control_core::units::{Millimetres, MillinewtonMetres, Milliradians, Newtons, Stiffness};
use control_core::{Config, NeedleLine, Plan, Refusal, TickOutput};
use proptest::prelude::*;
use proptest::test_runner::TestCaseError;

const STRAIGHT: Milliradians = Milliradians(1_571);
/// A line is taken within so many ticks, and the next one not before.
const TICKS: usize = 144;
/// The largest change of the force by a line, N.
const LARGEST_STEP: f64 = 0.010;

fn line(depths: impl IntoIterator<Item = f64>) -> NeedleLine {
    NeedleLine { depths: depths.into_iter().map(|depth| Millimetres(q(depth))).collect() }
}

/// The patient's own, each layer moved by its share of `moves`.
fn moved(patient: &Patient, moves: &[f64]) -> NeedleLine {
    line(patient.layers.iter().zip(moves).map(|(layer, by)| layer.depth.0.to_num::<f64>() + by))
}

fn jog(law: FrictionLaw) -> Config {
    let mut config = Config::commissioned_virtual();
    config.patient.law = Law::Jog(law);
    config
}

fn paper() -> FrictionLaw {
    FrictionLaw::Paper {
        level_length: Millimetres(q(3.0)),
        level_cap: q(2.0),
        anchor_ms: 60,
        stiffness: Stiffness(q(0.5)),
        limit: Newtons(q(0.8)),
        limit_out: Newtons(q(0.6)),
    }
}

/// Each law of force and of friction, and walls as steep as the device lets them be.
fn configs() -> [Config; 7] {
    let cone = |stiffness: f64| FrictionLaw::Cone { stiffness: Stiffness(q(stiffness)) };
    let mut steep = jog(cone(0.2));
    for wall in steep.patient.layers.iter_mut().filter_map(|layer| layer.wall.as_mut()) {
        wall.puncture_travel.0 = q(1.0);
        wall.elastic.compliance.0 = q(1.3);
        (wall.relief.vertex.0, wall.relief.compliance.0) = (q(1.1), q(0.05));
        wall.unload.0 = q(1.5);
    }
    let sticking = FrictionLaw::StickSlip { stiffness: Stiffness(q(1.0)), sliding: q(0.3) };
    let mut rubbing = jog(cone(1.0));
    rubbing.patient.layers.iter_mut().for_each(|layer| layer.friction.0 = q(0.03));
    [jog(cone(1.0)), steep, rubbing, jog(paper()), jog(sticking), sparte::shoulder(), xr::that_gives_way()]
}

/// Runs a needle with the next line and one without for as long as a line takes: the largest
/// difference of their forces. Neither may see an event, nor ask for more than the ceiling.
fn step(needle: &mut Needle, line: &NeedleLine) -> Result<f64, TestCaseError> {
    let mut without = Needle { core: needle.core.clone(), at_mm: needle.at_mm, tilt: needle.tilt };
    needle.core.take_line(&line.depths);
    let mut largest = 0.0_f64;
    for _ in 0..TICKS {
        let (out, other) = (needle.tick(), without.tick());
        largest = largest.max((force(&out) - force(&other)).abs());
        prop_assert!(out.tripped.is_none());
        prop_assert_eq!(out.transitions, other.transitions, "a line makes no event");
        is_within_ceiling(needle.core.plan(), &out)?;
    }
    Ok(largest)
}

fn is_within_ceiling(plan: &Plan, out: &TickOutput) -> Result<(), TestCaseError> {
    let device = plan.device();
    let share = device.limits.torque.0.to_num::<f64>() / device.full_scale_torque.0.to_num::<f64>();
    let most = share * f64::from(device.dac.span()) + 1.0;
    let given = f64::from(out.dac.0) - f64::from(plan.zero_torque_code().0);
    prop_assert!(given.abs() <= most, "{} codes for {}", given, most);
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// A needle anywhere, pushed in and drawn back a little, at any angle, feels at most 10 mN of
    /// each line.
    #[test]
    fn a_line_changes_the_force_by_at_most_10_mn(
        choice in 0..7_usize,
        degrees in 12.0..90.0_f64,
        share in 0.0..1.0_f64,
        back in -0.6..0.3_f64,
        lines in prop::collection::vec(prop::collection::vec(-3.0..6.0_f64, 6), 1..12),
        repeated in 1..12_usize,
    ) {
        let config = &configs()[choice];
        let tilt = Milliradians((degrees.to_radians() * 1e3) as i16);
        let mut needle = Needle::new(config, tilt);
        let deepest = config.patient.layers.last().map_or(0.0, |layer| layer.depth.0.to_num::<f64>());
        let to = (share * (deepest + 3.0) / degrees.to_radians().sin()).min(58.0);
        needle.go(to, 40.0, |_| {});
        needle.go(to + back, 20.0, |_| {});
        // Faded in, and the needle has stopped.
        needle.rest(0.35);
        let mut taken = 0;
        for moves in &lines {
            let line = moved(&config.patient, moves);
            if needle.core.plan().check_line(&line).is_err() {
                continue;
            }
            taken += 1;
            for _ in 0..repeated {
                let step = step(&mut needle, &line)?;
                prop_assert!(step <= LARGEST_STEP, "config {}: {} N by a line", choice, step);
            }
        }
        // The deepest patient's layers may move by little.
        prop_assume!(taken > 0);
    }

    /// A needle that moves all the while, and lines as often as they are taken.
    #[test]
    fn no_line_raises_the_ceiling_of_a_needle_that_moves(
        choice in 0..7_usize,
        legs in prop::collection::vec((-1.0..40.0_f64, 5.0..60.0_f64), 1..5),
        lines in prop::collection::vec(prop::collection::vec(-3.0..6.0_f64, 6), 4),
    ) {
        let mut config = configs()[choice].clone();
        config.device.limits.torque = MillinewtonMetres(q(20.0));
        config.patient.scale = q(0.5);
        prop_assume!(config.plan().is_ok());
        let lines: Vec<NeedleLine> = lines.iter().map(|moves| moved(&config.patient, moves)).collect();
        let mut needle = Needle::new(&config, STRAIGHT);
        let plan = needle.core.plan().clone();
        let mut ticks = 0;
        for (mm, mm_per_s) in legs {
            let step = mm_per_s / 1e4 * (mm - needle.at_mm).signum();
            while (mm - needle.at_mm).abs() > step.abs() {
                needle.at_mm += step;
                ticks += 1;
                let line = &lines[ticks / TICKS % lines.len()];
                if ticks % 32 == 0 && plan.check_line(line).is_ok() {
                    needle.core.take_line(&line.depths);
                }
                let out = needle.tick();
                is_within_ceiling(&plan, &out)?;
                if out.tripped.is_some() {
                    // A hand so fast that it looks like a motor wired the wrong way.
                    return Ok(());
                }
            }
        }
    }

    /// A line is taken where a patient with these layers would be, and refused for the same reason.
    #[test]
    fn a_line_is_refused_as_a_patient_would_be(
        choice in 0..7_usize,
        depths in prop::collection::vec(-1.0..62.0_f64, 6),
        is_sorted in prop::bool::weighted(0.9),
        per_mm in 0.0..0.1_f64,
    ) {
        let mut config = configs()[choice].clone();
        config.patient.layers.iter_mut().for_each(|layer| layer.friction.0 = q(per_mm));
        let Ok(plan) = config.plan() else { return Ok(()) };
        let mut depths: Vec<f64> = depths.into_iter().take(config.patient.layers.len()).collect();
        if is_sorted {
            depths.sort_by(f64::total_cmp);
        }
        let line = line(depths);
        for (layer, depth) in config.patient.layers.iter_mut().zip(&line.depths) {
            layer.depth = *depth;
        }
        prop_assert_eq!(plan.check_line(&line).err(), config.plan().err());
    }
}

#[test]
fn a_line_has_a_depth_for_each_layer() {
    let plan = Config::commissioned_virtual().plan().expect("sound");
    for found in [0, 3, 5, 6] {
        let refused = plan.check_line(&line((0..found).map(f64::from)));
        let wanted = Refusal::Count { field: Field::LayerDepth, found: found as u16, wanted: 4 };
        assert_eq!(refused, Err(wanted));
    }
}

#[test]
fn a_layer_is_met_where_the_line_says() {
    for degrees in [90.0_f64, 30.0] {
        let tilt = Milliradians((degrees.to_radians() * 1e3) as i16);
        let mut needle = Needle::new(&Config::commissioned_virtual(), tilt);
        needle.core.take_line(&line([0.0, 2.0, 6.2, 9.0]).depths);
        let mut met = Vec::new();
        needle.go(14.0 / degrees.to_radians().sin(), 20.0, |out| {
            if out.transitions.contact != 0 {
                met.push(out.depth.0.to_num::<f64>() * degrees.to_radians().sin());
            }
        });
        assert!((met[2] - 6.2).abs() < 0.05, "the vein at {degrees}°: {met:?}");
    }
}

/// A layer that the tip has touched goes to its place by 10 mN a line, and stays there.
#[test]
fn a_wall_under_the_tip_arrives_after_enough_lines() {
    let mut needle = Needle::new(&Config::commissioned_virtual(), STRAIGHT);
    needle.go(2.0, 20.0, |_| {});
    let before = force(&needle.rest(0.5));
    // (2 mm)² over 9 mm²/N, and then (1 mm)².
    let line = line([1.0, 2.5, 5.5, 8.5]);
    let mut steps = 0;
    while (force(&needle.rest(0.0144)) - 1.0 / 9.0).abs() > 0.002 {
        needle.core.take_line(&line.depths);
        steps += 1;
        assert!(steps < 500, "{} N", force(&needle.tick()));
    }
    assert!((before - 4.0 / 9.0).abs() < 0.01, "{before} N");
    let least = (before - 1.0 / 9.0) / LARGEST_STEP;
    assert!(f64::from(steps) >= least, "{steps} lines for {least} steps of 10 mN");
    assert!((force(&needle.rest(0.5)) - 1.0 / 9.0).abs() < 0.002, "without another line it stays");
}

/// The line would carry the vein's wall past the tip, or the tip through it: the next movement
/// does.
#[test]
fn what_a_line_would_do_the_needle_does() {
    let mut needle = Needle::new(&Config::commissioned_virtual(), STRAIGHT);
    needle.go(4.0, 20.0, |_| {});
    needle.rest(0.1);
    let line = line([0.0, 2.0, 3.0, 7.8]);
    for _ in 0..100 {
        needle.core.take_line(&line.depths);
        let out = needle.rest(0.0144);
        assert_eq!((out.transitions, out.vessel), (Default::default(), VesselState::Outside));
    }
    let mut contact = 0;
    needle.go(4.03, 20.0, |out| contact |= out.transitions.contact);
    assert_eq!(contact, 1 << 2, "with the next count");
}

/// A needle in the vein is lowered by 10° in 1.4 s about the vein's wall and advanced: it has left
/// nothing and meets nothing again.
#[test]
fn what_the_tip_has_passed_turns_with_the_needle() {
    let sine = |degrees: f64| degrees.to_radians().sin();
    let tilt = |degrees: f64| Milliradians((degrees.to_radians() * 1e3).round() as i16);
    let mut needle = Needle::new(&Config::commissioned_virtual(), tilt(25.0));
    needle.go(13.4, 20.0, |_| {});
    assert_eq!(needle.rest(0.2).vessel, VesselState::InLumen);
    let [fat_mm, wall_mm] = [2.0, 4.8].map(|depth| depth / sine(25.0));
    for step in 0..=100 {
        let degrees = 25.0 - 0.1 * f64::from(step);
        needle.tilt = tilt(degrees);
        let far_mm = wall_mm + 3.0 / sine(degrees);
        let met = [0.0, fat_mm, wall_mm, far_mm].map(|mm| mm * sine(degrees));
        needle.core.take_line(&line(met).depths);
        for _ in 0..TICKS {
            let out = needle.tick();
            assert_eq!(
                (out.transitions, out.vessel),
                (Default::default(), VesselState::InLumen),
                "{degrees}°"
            );
        }
    }
    needle.go(16.4, 5.0, |out| assert_eq!(out.transitions, Default::default()));
}

/// One that the link lets through for another patient, and one that is refused.
#[test]
fn a_line_for_another_patient_changes_nothing() {
    let mut needle = Needle::new(&Config::commissioned_virtual(), STRAIGHT);
    needle.go(2.0, 20.0, |_| {});
    let mut other = Needle { core: needle.core.clone(), ..needle };
    other.core.take_line(&line([1.0, 2.0, 3.0]).depths);
    for mm in [4.0, 12.0, -1.0] {
        let (mut seen, mut also) = (Vec::new(), Vec::new());
        needle.go(mm, 30.0, |out| seen.push(format!("{out:?}")));
        other.go(mm, 30.0, |out| also.push(format!("{out:?}")));
        assert_eq!(seen, also);
    }
}

/// A needle that passes beside the vessel passes it where the line says.
#[test]
fn a_vessel_beside_the_needle_begins_where_the_line_says() {
    let mut config = Config::commissioned_virtual();
    config.patient.vessel =
        Some(control_core::config::Vessel { width: Millimetres(q(3.0)), offset: Millimetres(q(5.0)) });
    let mut needle = Needle::new(&config, STRAIGHT);
    needle.core.take_line(&line([0.0, 2.0, 7.0, 10.0]).depths);
    let mut beside = f64::MAX;
    needle.go(9.0, 20.0, |out| {
        if out.vessel == VesselState::Beside {
            beside = beside.min(out.depth.0.to_num());
        }
    });
    assert!((beside - 7.0).abs() < 0.05, "{beside} mm");
    let layers: &[Layer] = &config.patient.layers;
    assert_eq!(layers[2].tissue, Tissue::Vessel);
}
