//! Table 1 of Paper 000 in place of the limb: skin, vessel and skin as three slabs, with the
//! paper's spacing, volume and bending.

use crate::drawn::Given;
use tissue::Configuration;
use tissue::needle::WallName;

/// Returns the tissue of Table 1 with the depths of the scene's vessel, and which of its walls
/// belongs to which layer of the scene; an error if the scene has no vessel between two walls.
pub(crate) fn configure(
    given: &[Given],
    bottom_mm: f32,
) -> Result<(Configuration, Vec<Option<WallName>>), String> {
    let place = |wanted: fn(&Given) -> bool| given.iter().position(wanted);
    let (Some(near), Some(far)) = (place(|layer| layer.is_vessel), place(|layer| layer.is_far)) else {
        return Err("Table 1 is skin, vessel and skin, and this patient has no vessel".into());
    };
    let [near_mm, far_mm] = [near, far].map(|layer| given[layer].depth_mm);
    let gives_mm = [0, near, far].map(|wall| given[wall].travel_mm);
    let configuration = Configuration::table_1(near_mm, far_mm, bottom_mm, gives_mm)
        .ok_or("the vessel's walls are not one below the other")?;
    let mut walls = vec![None; given.len()];
    for (number, wall) in [0, near, far].into_iter().enumerate() {
        walls[wall] = Some(WallName::Layer(number));
    }
    Ok((configuration, walls))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawn::Kind;
    use crate::picture::Picture;
    use tissue::PunctureState;

    /// Skin, vessel at 4 mm, bottom skin at 7 mm, entered at 60°; the last number chooses the
    /// tissue.
    fn phantom(table_1: f32) -> Vec<f32> {
        let mut numbers = vec![3.0, 0.0, 0.0, 2.8, 0.0, 7.0, 4.0, 0.9, 0.0, 8.0, 7.0, 1.2, 0.0];
        numbers.extend([3.0, 0.0, 1.05, 0.82, table_1]);
        numbers
    }

    #[test]
    fn the_table_keeps_its_ratios() {
        let given =
            |is_vessel, is_far, depth_mm| Given { kind: 0, depth_mm, travel_mm: 1.0, is_vessel, is_far };
        let scene = [given(false, false, 0.0), given(true, false, 4.0), given(false, true, 7.0)];
        let (configuration, walls) = configure(&scene, 14.8).expect("it has a vessel");
        let table: Vec<_> = configuration
            .layers
            .iter()
            .map(|layer| ((layer.spacing_mm * 5.0).round(), layer.volume_ratio, layer.bending_deg))
            .collect();
        assert_eq!(table, [(10.0, 1.0, Some(180.0)), (15.0, 0.8, Some(0.0)), (12.0, 1.0, Some(180.0))]);
        assert_eq!(walls, [0, 1, 2].map(|number| Some(WallName::Layer(number))));
        assert!(configure(&scene[..1], 14.8).is_err(), "no vessel");
    }

    #[test]
    fn it_is_drawn_as_slabs_and_pierced_by_the_devices_events() {
        let mut picture = Picture::new(&phantom(1.0)).expect("it can be built");
        let count = |picture: &Picture, kind| picture.surfaces().iter().filter(|s| s.kind == kind).count();
        assert_eq!((count(&picture, Kind::Section), count(&picture, Kind::VesselBehind)), (3, 0));
        let limb = Picture::new(&phantom(0.0)).expect("it can be built");
        assert!(count(&limb, Kind::VesselBehind) == 1 && limb.points().len() != picture.points().len());
        for step in 0..=120 {
            picture.step(1.0 / 60.0, -2.0 + 4.0 * step as f32 / 120.0, 1.05, [0.0; 2]);
        }
        assert_eq!(picture.wall_state(0), PunctureState::Touching);
        picture.tell(0, PunctureState::Inserted);
        for step in 0..=120 {
            picture.step(1.0 / 60.0, 2.0 + 4.0 * step as f32 / 120.0, 1.05, [0.0; 2]);
        }
        assert_eq!(picture.wall_state(0), PunctureState::Inserted);
        assert!(picture.points().iter().flatten().all(|number| number.abs() < 100.0), "it holds together");
    }

    /// The places of the particles after a needle went 16 mm in, in pictures of so many a second.
    fn after_a_needle(pictures_per_s: f32) -> Vec<[f32; 4]> {
        let mut picture = Picture::new(&phantom(1.0)).expect("it can be built");
        let mut go = |seconds: f32, depth_mm: &dyn Fn(f32) -> f32| {
            let pictures = (seconds * pictures_per_s) as usize;
            for number in 1..=pictures {
                let share = number as f32 / pictures as f32;
                picture.step(1.0 / pictures_per_s, depth_mm(share), 0.44, [0.0; 2]);
            }
            picture.tell(0, PunctureState::Inserted);
            picture.tell(1, PunctureState::Inserted);
        };
        go(1.0, &|share| -3.0 + 6.0 * share);
        go(2.0, &|share| 3.0 + 13.0 * share);
        go(3.0, &|_| 16.0);
        picture.points().to_vec()
    }

    #[test]
    fn slow_pictures_fold_no_wall() {
        let (smooth, slow) = (after_a_needle(60.0), after_a_needle(4.0));
        let apart_mm = smooth.iter().zip(&slow).map(|(a, b)| (a[2] - b[2]).abs()).fold(0.0, f32::max);
        assert!(apart_mm < 0.3, "{apart_mm} mm");
    }
}
