//! The picture from the numbers of a page.

use super::*;
use crate::drawn::Kind;

/// The adult profile: skin, fat, vein from 4.8 to 7.8 mm.
const ADULT: [f32; 21] = [
    4.0, 0.0, 0.0, 3.0, 0.02, 1.0, 2.0, -1.0, 0.02, 7.0, 4.8, 1.41, 0.02, 8.0, 7.8, 1.41, 0.02, 4.46, 0.0,
    0.52, 0.82,
];

#[test]
fn the_image_is_as_deep_as_the_anatomy() {
    let depth_mm = |numbers: &[f32]| Picture::new(numbers).expect("it can be built").image_depth_mm();
    assert_eq!(depth_mm(&ADULT), 16.0);
    // Skin, muscle to 20 mm, bursa.
    let deep = [3.0, 0.0, 0.0, 1.2, 0.0, 2.0, 6.0, -1.0, 0.0, 4.0, 20.0, -1.0, 0.0, f32::NAN, 0.0, 0.8, 0.82];
    assert_eq!(depth_mm(&deep), 24.0);
    let sections = |numbers: &[f32]| {
        let picture = Picture::new(numbers).expect("it can be built");
        picture.surfaces().iter().filter(|surface| surface.kind == Kind::Section).count()
    };
    assert_eq!((sections(&ADULT), sections(&deep)), (2, 3), "every layer is drawn");
    // Deeper than any that is drawn.
    let beyond = [1.0, 0.0, 90.0, 1.2, 0.0, f32::NAN, 0.0, 0.8, 0.82];
    assert!(Picture::new(&beyond).map_or(40.0, |picture| picture.image_depth_mm()) <= 40.0);
}

#[test]
fn the_picture_follows_the_devices_punctures_and_needle() {
    let mut picture = Picture::new(&ADULT).expect("it can be built");
    let drive = |picture: &mut Picture, from: f32, to: f32| {
        for step in 0..=60 {
            picture.step(1.0 / 60.0, from + (to - from) * step as f32 / 60.0, 0.52, [0.0; 2]);
        }
    };
    drive(&mut picture, -2.0, 3.5);
    assert_eq!(picture.wall_state(0), PunctureState::Touching);
    picture.tell(0, PunctureState::Inserted);
    drive(&mut picture, 3.5, 11.0);
    assert_eq!(picture.wall_state(0), PunctureState::Inserted);
    assert_eq!(picture.wall_state(2), PunctureState::Touching);
    picture.tell(2, PunctureState::Inserted);
    drive(&mut picture, 11.0, 12.0);
    assert_eq!(picture.wall_state(2), PunctureState::Inserted);
    assert_eq!(picture.wall_state(3), PunctureState::Away);
    picture.hold_probe(8.0, 0.0, 0.0, 0.0);
    picture.image(0.1, 0.0);
    assert!(picture.seen(0) > 0.9 && picture.seen(1) == 1.0);
    picture.hold_probe(8.0, 5.0, 0.0, 0.0);
    picture.image(0.1, 0.0);
    assert!(picture.seen(0) == 0.0 && (picture.seen(3) - 0.5).abs() < 1e-3);
}

#[test]
fn vessel_walls_in_the_needles_plane_match_the_profile() {
    let picture = Picture::new(&ADULT).expect("it can be built");
    for [upper, lower] in picture.lumen() {
        assert!((upper - 4.8).abs() < 0.15 && (lower - 7.8).abs() < 0.15, "{upper} to {lower} mm");
    }
}

#[test]
fn numbers_that_are_not_finite_are_refused_or_drawn() {
    assert!(Picture::new(&[]).is_err());
    assert!(Picture::new(&[f32::NAN, 1.0]).is_err());
    assert!(Picture::new(&ADULT[..10]).is_err());
    for slot in 1..ADULT.len() {
        for wrong in [f32::NAN, f32::INFINITY, -1e9, 1e9] {
            let mut numbers = ADULT;
            numbers[slot] = wrong;
            if let Ok(mut picture) = Picture::new(&numbers) {
                picture.step(0.016, 1.0, 0.5, [0.0; 2]);
                assert!(picture.points().iter().flatten().all(|number| number.is_finite()), "slot {slot}");
            }
        }
    }
}

/// The shoulder's layers on its usual line, then the body's numbers.
fn shoulder(around: f32, turn: f32) -> Vec<f32> {
    let mut numbers = vec![6.0];
    for (kind, depth, travel) in [
        (0.0, 0.0, 1.2),
        (1.0, 2.5, -1.0),
        (2.0, 6.9, -1.0),
        (4.0, 19.4, -1.0),
        (5.0, 22.0, -1.0),
        (6.0, 28.1, -1.0),
    ] {
        numbers.extend([kind, depth, travel, 0.0]);
    }
    numbers.extend([f32::NAN, 0.0, 0.785, 0.82, 2.0, 0.0, 25.0, around, 180.0, turn, 45.0, 5.79]);
    numbers
}

#[test]
fn a_body_is_drawn_cut_and_imaged() {
    let mut picture = Picture::new(&shoulder(0.0, 0.0)).expect("it can be built");
    let tissues = |kind: Kind| {
        let mut all: Vec<u32> =
            picture.surfaces().iter().filter(|s| s.kind == kind).map(|s| s.tissue).collect();
        all.sort_unstable();
        all.dedup();
        all
    };
    // Skin, fat, muscle, bursa, tendon and cartilage are cut; bursa, tendon and cartilage are
    // bodies of their own.
    assert_eq!(tissues(Kind::Section), [0, 1, 2, 4, 5, 6]);
    assert_eq!(tissues(Kind::InsideBehind), [4, 5, 6]);
    for step in 0..120 {
        picture.step(1.0 / 60.0, -2.0 + step as f32 * 0.05, 0.785, [0.0; 2]);
    }
    assert!(picture.points().iter().flatten().all(|number| number.abs() < 400.0), "it holds together");
    // Bone reflects: straight down from over the humerus the image is bright at its depth, and dark
    // where there is only muscle.
    picture.hold_probe(25.0, 0.0, 0.0, 0.0);
    let brightest = picture.image(0.1, 0.0).iter().copied().max();
    assert!(brightest > Some(150), "{brightest:?}");
}

#[test]
fn the_skin_is_met_where_one_looks_and_turns_with_the_limb() {
    let level = Picture::new(&shoulder(0.0, 0.0)).expect("it can be built");
    let found = level.pick([0.0, 0.0, -80.0], [0.0, 0.0, 1.0]).expect("the entry is under it");
    let wanted = [0.0, 0.0, 0.0, 25.0, 0.0];
    assert!(found.iter().zip(wanted).all(|(a, b)| (a - b).abs() < 1e-3), "{found:?}");
    assert!(level.pick([0.0, 0.0, -80.0], [0.0, 0.0, -1.0]).is_none(), "nothing but sky");
    // With the limb turned under it the same skin slopes, and the probe leans with it.
    let turned = Picture::new(&shoulder(0.0, 20.0)).expect("it can be built");
    let [_, lean] = turned.on_skin([0.0, 0.0], 0.0);
    assert!((lean.abs().to_degrees() - 20.0).abs() < 1.0, "{}", lean.to_degrees());
    assert!(level.on_skin([0.0, 0.0], 0.0)[1].abs() < 1e-3);
}

#[test]
fn a_vein_on_the_line_gives_way_at_the_devices_word() {
    // Straight down on the shoulder's vein, 39 degrees around at 30 mm along; its layers: skin,
    // fat, vein, fat.
    let mut numbers = vec![4.0];
    for (kind, depth, travel) in [(0.0, 0.0, 1.2), (1.0, 2.5, -1.0), (7.0, 5.6, -1.0), (1.0, 8.6, -1.0)] {
        numbers.extend([kind, depth, travel, 0.0]);
    }
    numbers.extend([f32::NAN, 0.0, 1.48, 0.82, 2.0, 0.0, 30.0, 39.24, 0.0, -39.24, 85.0, 5.79]);
    let mut picture = Picture::new(&numbers).expect("it can be built");
    let vessel = picture.surfaces().iter().filter(|s| s.kind == Kind::VesselBehind).count();
    assert_eq!(vessel, 3, "the vein is part of the tissue that moves, and goes on beyond it at both ends");
    let cut: Vec<f32> = picture.lumen().iter().map(|[top, bottom]| bottom - top).collect();
    assert!(cut.iter().any(|high| (*high - 3.0).abs() < 0.6), "{cut:?}");
    picture.tell(0, PunctureState::Inserted);
    for step in 0..200 {
        picture.step(1.0 / 60.0, -2.0 + step as f32 * 0.042, 1.48, [0.0; 2]);
    }
    assert_ne!(picture.wall_state(2), PunctureState::Away);
}

/// Lowered by 10° about a point 11 mm along it: that point stays, worked by hand.
#[test]
fn a_needle_turns_about_the_point_that_holds_it() {
    let mut picture = Picture::new(&ADULT).expect("it can be built");
    let [steep, flat] = [25_f32, 15.0].map(f32::to_radians);
    let along = |angle: f32| [11.0 * angle.cos(), 11.0 * angle.sin()];
    let origin_mm = [along(steep)[0] - along(flat)[0], along(steep)[1] - along(flat)[1]];
    picture.step(1.0 / 60.0, 11.0, flat, origin_mm);
    let [x, _, z] = picture.shaft.tip_mm;
    let held = along(steep);
    assert!((x - held[0]).abs() < 1e-4 && (z - held[1]).abs() < 1e-4, "{x}, {z}, not {held:?}");
}
