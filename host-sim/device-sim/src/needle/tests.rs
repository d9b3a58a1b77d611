use super::*;
use crate::named_files::Text;

fn track(patient: &str) -> NeedleTrack {
    NeedleTrack::new(&Profile::find(patient).expect("it is built in"))
}

fn number(patient: &str, name: &str) -> u8 {
    let profile = Profile::find(patient).expect("it is built in");
    (0..8).find(|number| profile.layer_name(*number).as_deref() == Some(name)).expect("a layer")
}

/// Skin, vein and far wall of the adult at 0, 4.8 and 7.8 mm, worked by hand.
#[test]
fn a_needle_in_the_vein_is_lowered_about_its_wall() {
    let mut needle = track("adult");
    let [steep, flat] = [25_f64, 15.0].map(f64::to_radians);
    needle.move_to(1.0, steep);
    needle.happen(&EventKind::Puncture { layer: 0 });
    let wall_mm = 4.8 / steep.sin();
    needle.move_to(wall_mm + 1.5, steep);
    needle.happen(&EventKind::Puncture { layer: number("adult", "vessel") });
    assert!(needle.is_in_lumen());
    needle.move_to(wall_mm + 1.5, flat);
    let [x, y] = needle.tip_mm();
    assert!((y - (4.8 + 1.5 * flat.sin())).abs() < 1e-3, "{y}");
    assert!((x - (wall_mm * steep.cos() + 1.5 * flat.cos())).abs() < 1e-3, "{x}");
    assert!(needle.is_in_lumen());
    // What it has passed goes along, the far wall is where it was: 3 mm below the near one.
    let tops: Vec<f64> = needle.tops_mm().iter().map(|top| top.expect("met")).collect();
    assert!(
        (tops[2] - wall_mm).abs() < 1e-3 && (tops[3] - wall_mm - 3.0 / flat.sin()).abs() < 1e-3,
        "{tops:?}"
    );
    // Drawn back out of the vein it turns about the skin again.
    needle.move_to(wall_mm - 1.0, flat);
    assert!(!needle.is_in_lumen() && needle.origin_mm() == [0.0; 2]);
    assert!((needle.tops_mm()[2].expect("met") - 4.8 / flat.sin()).abs() < 1e-3);
    needle.move_to(-3.0, steep);
    assert_eq!(needle.layer(), None);
}

#[test]
fn a_body_is_met_along_the_line_as_its_layers_were() {
    for patient in ["forearm", "shoulder-joint", "knee", "hip"] {
        let profile = Profile::find(patient).expect("it is built in");
        let sine = profile.entry_rad.sin();
        let own = profile.config.patient.layers.iter().map(|layer| layer.depth.0.to_num::<f64>() / sine);
        for (own, met) in own.zip(NeedleTrack::new(&profile).tops_mm()) {
            assert!((own - met.expect("it is met")).abs() < 2e-3, "{patient}: {own} and {met:?}");
        }
    }
}

/// Paper 002: the bursa of the level shoulder ends at a place along the skin, and a flat needle
/// passes where there is none.
#[test]
fn a_target_that_ends_is_not_met_beside_it() {
    let mut needle = track("shoulder");
    let bursa = usize::from(number("shoulder", "bursa"));
    assert!(needle.tops_mm()[bursa].is_some());
    needle.move_to(-1.0, 37_f64.to_radians());
    assert_eq!(needle.tops_mm()[bursa], None);
}

/// The humerus is a ball of 23 mm about the origin: under 1.5 mm of cartilage, where the line comes
/// to it.
#[test]
fn bone_lies_under_the_cartilage_of_a_joint() {
    let needle = track("shoulder-joint");
    let humerus = usize::from(number("shoulder-joint", "humerus"));
    let cartilage_mm = needle.tops_mm()[humerus].expect("it is met");
    assert!((needle.bone_mm().expect("there is bone") - cartilage_mm - 1.5).abs() < 1e-9);
    assert_eq!(track("adult").bone_mm(), None);
    let mut beside = track("shoulder-joint");
    beside.move_to(-1.0, 5_f64.to_radians());
    assert_eq!(beside.bone_mm(), None, "a flat needle passes over the joint");
}

/// The adult's vein is an ellipse of 3 mm from 4.8 mm on: 1 and 2 mm beside its axis, half its
/// width of 4.46 mm, it is √(1 − (offset/2.23 mm)²) as high.
#[test]
fn a_vein_beside_the_needle_is_met_where_it_is_cut() {
    for offset_mm in [1.0, -2.0_f64] {
        let adult = include_str!("../../../profiles/adult.toml");
        let text = adult.replace("offset_mm = 0.0", &format!("offset_mm = {offset_mm:.1}"));
        let profile = Profile::parse(Text { origin: "beside.toml".into(), text }).expect("it is a patient");
        let half_mm = 1.5 * (1.0 - (offset_mm / 2.23).powi(2)).sqrt();
        let mut needle = NeedleTrack::new(&profile);
        needle.move_to(-1.0, 45_f64.to_radians());
        for (layer, depth_mm) in [(2, 6.3 - half_mm), (3, 6.3 + half_mm)] {
            let met_mm = needle.tops_mm()[layer].expect("it is met") * 45_f64.to_radians().sin();
            assert!((met_mm - depth_mm).abs() < 2e-3, "{offset_mm} mm beside: {met_mm}, not {depth_mm} mm");
        }
    }
}
