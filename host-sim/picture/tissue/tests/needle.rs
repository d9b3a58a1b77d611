//! The needle in the tissue: what is pushed in, what is dragged along, and that nothing it does
//! breaks the picture.

use proptest::prelude::*;
use tissue::body::Part;
use tissue::needle::WallName;
use tissue::{Configuration, Needle, PunctureState, Punctures, Tissue};

const STEP_S: f32 = 1.0 / 60.0;
const ANGLE: f32 = 0.6;

fn limb() -> Tissue {
    Tissue::new(&Configuration::default()).expect("the default can be built")
}

fn at(depth: f32) -> Needle {
    Needle::entering(depth, ANGLE, 0.0)
}

fn state(tissue: &Tissue, wall: WallName) -> PunctureState {
    tissue.states().find(|(name, ..)| *name == wall).expect("there is such a wall").1
}

/// Moves the needle from `from` to `to` mm at 20 mm/s and leaves it there for a while.
fn drive(tissue: &mut Tissue, from: f32, to: f32) {
    let steps = ((to - from).abs() / 20.0 / STEP_S).ceil() as usize;
    for step in 1..=steps {
        tissue.step(&at(from + (to - from) * step as f32 / steps as f32), STEP_S);
    }
    for _ in 0..60 {
        tissue.step(&at(to), STEP_S);
    }
}

/// Returns the position of the skin's entry point along the needle, mm past its rest.
fn skin_along(tissue: &Tissue) -> f32 {
    let direction = at(1.0).direction;
    let place = tissue.moved([0.0, 0.0, 0.0]).expect("it lies in the block");
    place[0] * direction[0] + place[1] * direction[1] + place[2] * direction[2]
}

fn farthest_from_rest(tissue: &Tissue) -> f32 {
    let gap = |(p, r): (&[f32; 4], &[f32; 4])| {
        ((p[0] - r[0]).powi(2) + (p[1] - r[1]).powi(2) + (p[2] - r[2]).powi(2)).sqrt()
    };
    tissue.points().iter().zip(tissue.rest()).map(gap).fold(0.0, f32::max)
}

#[test]
fn at_rest_it_stays_at_rest() {
    let mut tissue = limb();
    for _ in 0..120 {
        tissue.step(&at(-5.0), STEP_S);
    }
    assert!(farthest_from_rest(&tissue) < 1e-3, "{} mm", farthest_from_rest(&tissue));
}

#[test]
fn skin_is_pushed_in_springs_back_and_is_dragged_on_withdrawal() {
    let mut tissue = limb();
    drive(&mut tissue, -2.0, 2.5);
    assert_eq!(state(&tissue, WallName::Layer(0)), PunctureState::Touching);
    assert_eq!(
        state(&tissue, WallName::Layer(1)),
        PunctureState::Away,
        "the skin carries what lies under it"
    );
    let pushed = skin_along(&tissue);
    assert!((2.2..=2.6).contains(&pushed), "the skin is pushed in by {pushed} mm");
    let under = tissue.moved([0.0, 0.0, 2.5]).expect("it lies in the block")[2] - 2.5;
    assert!((0.15..1.5).contains(&under), "what lies under it is pushed by {under} mm");

    drive(&mut tissue, 2.5, 4.2);
    assert_eq!(state(&tissue, WallName::Layer(0)), PunctureState::Inserted);
    let relieved = skin_along(&tissue);
    assert!((0.2..1.2).contains(&relieved), "after the puncture {relieved} mm are left");

    drive(&mut tissue, 4.2, 2.0);
    let drawn = skin_along(&tissue);
    assert!(drawn < -0.2, "drawn back it goes along: {drawn} mm");
    assert_eq!(state(&tissue, WallName::Layer(0)), PunctureState::Inserted, "it is still in it");

    drive(&mut tissue, 2.0, -6.0);
    assert_eq!(state(&tissue, WallName::Layer(0)), PunctureState::Away);
    assert!(farthest_from_rest(&tissue) < 0.05, "{} mm are left", farthest_from_rest(&tissue));
}

#[test]
fn layers_and_vessel_walls_are_passed_in_anatomical_order() {
    let mut tissue = limb();
    let mut order = vec![];
    for step in 0..300 {
        tissue.step(&at(step as f32 * 0.06 - 1.0), STEP_S);
        for (name, state, _) in tissue.states() {
            if state == PunctureState::Inserted && !order.contains(&name) {
                order.push(name);
            }
        }
    }
    assert_eq!(order, [WallName::Layer(0), WallName::Layer(1), WallName::Near, WallName::Far]);
}

#[test]
fn a_tip_beside_the_vessel_does_not_touch_it() {
    let mut configuration = Configuration::default();
    configuration.vessel.as_mut().expect("there is one").centre_mm[1] = 5.0;
    let mut tissue = Tissue::new(&configuration).expect("it can be built");
    drive(&mut tissue, -1.0, 14.0);
    assert_eq!(state(&tissue, WallName::Layer(1)), PunctureState::Inserted);
    assert_eq!(state(&tissue, WallName::Near), PunctureState::Away);
}

#[test]
fn the_near_wall_dents_the_vessel_before_it_gives_way() {
    let mut tissue = limb();
    let open = lumen_height(&tissue);
    let mut flattest = open;
    for step in 0..200 {
        tissue.step(&at(step as f32 * 0.06 - 1.0), STEP_S);
        if state(&tissue, WallName::Near) == PunctureState::Touching {
            flattest = flattest.min(lumen_height(&tissue));
        }
    }
    assert!(flattest < 0.96 * open, "the lumen goes from {open} to {flattest} mm");
}

/// Height of the vessel where it is lowest, mm.
fn lumen_height(tissue: &Tissue) -> f32 {
    let vessel = tissue.surfaces().iter().find(|s| s.part == Part::Vessel).expect("there is one");
    let mut columns = std::collections::BTreeMap::new();
    for index in vessel.triangles.iter().flatten() {
        let rest = tissue.rest()[*index as usize];
        let z = tissue.points()[*index as usize][2];
        let column = columns.entry((rest[0] * 10.0) as i32).or_insert([f32::MAX, f32::MIN]);
        *column = [column[0].min(z), column[1].max(z)];
    }
    columns.values().map(|[low, high]| high - low).fold(f32::MAX, f32::min)
}

#[test]
fn a_wall_waits_for_the_device_where_the_device_decides() {
    let mut tissue = limb();
    tissue.set_punctures(Punctures::Told);
    drive(&mut tissue, -1.0, 4.0);
    assert_eq!(
        state(&tissue, WallName::Layer(0)),
        PunctureState::Touching,
        "beyond its own 3 mm it still holds"
    );
    tissue.tell(WallName::Layer(0), PunctureState::Inserted);
    tissue.step(&at(4.0), STEP_S);
    assert_eq!(state(&tissue, WallName::Layer(0)), PunctureState::Inserted);
}

#[test]
fn table_1_of_paper_000_is_pierced_layer_by_layer() {
    let configuration = Configuration::paper_000();
    let table: Vec<_> =
        configuration.layers.iter().map(|l| (l.spacing_mm, l.volume_ratio, l.bending_deg)).collect();
    assert_eq!(table, [(10.0, 1.0, Some(180.0)), (15.0, 0.8, Some(0.0)), (12.0, 1.0, Some(180.0))]);
    let mut tissue = Tissue::new(&configuration).expect("it can be built");
    let settle = |tissue: &mut Tissue| {
        for _ in 0..200 {
            tissue.step(&Needle::entering(-10.0, 1.0, 0.0), STEP_S);
        }
    };
    settle(&mut tissue);
    assert!(farthest_from_rest(&tissue) < 15.0, "the vessel shrinks and does not fold away");
    let mut order = vec![];
    for step in 0..400 {
        tissue.step(&Needle::entering(step as f32 * 0.25 - 5.0, 1.0, 0.0), STEP_S);
        for (name, state, _) in tissue.states() {
            if state == PunctureState::Inserted && !order.contains(&name) {
                order.push(name);
            }
        }
    }
    assert_eq!(order, [WallName::Layer(0), WallName::Layer(1), WallName::Layer(2)]);
    assert!(tissue.solver().bendings().iter().any(|b| b.rest.abs() < 1e-6), "180 degrees is flat");
}

#[test]
fn unbuildable_tissue_is_refused_with_layer_and_value() {
    let mut configuration = Configuration::default();
    configuration.layers[1].stiffness_kpa = f32::NAN;
    let said = Tissue::new(&configuration).expect_err("NaN is no stiffness").to_string();
    assert!(said.contains("layer 1") && said.contains("stiffness_kpa"), "{said}");
    let mut configuration = Configuration::default();
    configuration.layers[1].top_mm = 5.0;
    assert!(Tissue::new(&configuration).expect_err("a gap").to_string().contains("ends at 2 mm"));
    let mut configuration = Configuration::default();
    configuration.layers[0].spacing_mm = 0.1;
    assert!(Tissue::new(&configuration).is_err(), "too many particles");
}

/// A needle that nobody holds still: jumps, turns, numbers that are not finite.
fn violent() -> impl Strategy<Value = Vec<(f32, f32, f32, f32)>> {
    let number =
        |range: std::ops::Range<f32>| prop_oneof![8 => range, 1 => Just(f32::NAN), 1 => Just(f32::INFINITY)];
    proptest::collection::vec(
        (number(-60.0..60.0), number(-3.2..3.2), number(-3.2..3.2), 0.0_f32..0.05),
        1..120,
    )
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 10, ..ProptestConfig::default() })]
    #[test]
    fn no_motion_of_the_needle_breaks_the_tissue(motion in violent()) {
        // Coarser, for the sake of time.
        let mut configuration = Configuration::default();
        for layer in &mut configuration.layers {
            layer.spacing_mm = 2.0;
        }
        let mut tissue = Tissue::new(&configuration).expect("it can be built");
        for (depth, angle, azimuth, dt) in motion {
            let direction = [angle.cos() * azimuth.cos(), angle.cos() * azimuth.sin(), angle.sin()];
            let tip = direction.map(|component| component * depth);
            tissue.step(&Needle { tip, direction }, dt);
            let energy = tissue.solver().energy();
            // 5 mm of the stiffest layer all over; a needle that jumps by 100 mm a step came to
            // 1.1e9.
            prop_assert!(energy.is_finite() && energy < 1e10, "energy {energy} nJ");
            prop_assert!(farthest_from_rest(&tissue) < 20.0, "{} mm", farthest_from_rest(&tissue));
        }
        for _ in 0..240 {
            tissue.step(&at(-20.0), STEP_S);
        }
        prop_assert!(farthest_from_rest(&tissue) < 0.3, "{} mm are left", farthest_from_rest(&tissue));
    }
}
