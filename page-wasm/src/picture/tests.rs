//! The picture from the numbers of a page.

use super::*;

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
            picture.step(1.0 / 60.0, from + (to - from) * step as f32 / 60.0, 0.52);
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
fn numbers_that_are_none_are_refused_or_drawn_as_something() {
    assert!(Picture::new(&[]).is_err());
    assert!(Picture::new(&[f32::NAN, 1.0]).is_err());
    assert!(Picture::new(&ADULT[..10]).is_err());
    for slot in 1..ADULT.len() {
        for wrong in [f32::NAN, f32::INFINITY, -1e9, 1e9] {
            let mut numbers = ADULT;
            numbers[slot] = wrong;
            if let Ok(mut picture) = Picture::new(&numbers) {
                picture.step(0.016, 1.0, 0.5);
                assert!(picture.points().iter().flatten().all(|number| number.is_finite()), "slot {slot}");
            }
        }
    }
}
