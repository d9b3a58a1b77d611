//! Bodies: what a line through them becomes for the device.

use crate::named_files::Text;
use crate::procedure::Procedure;
use crate::profile::{BUILT_IN, Entry, Profile};

fn find(name: &str) -> Profile {
    Profile::find(name).expect("it is built in")
}

fn layers(profile: &Profile) -> Vec<(String, f64)> {
    let sine = profile.entry_rad.sin();
    let layers = profile.config.patient.layers.iter().zip(0..);
    let name = |number| profile.layer_name(number).expect("it has a name");
    layers.map(|(layer, number)| (name(number), layer.depth.0.to_num::<f64>() / sine)).collect()
}

/// At any inclination the device meets each structure at the same mm along the needle as the
/// line does.
#[test]
fn the_devices_layers_are_those_of_the_line() {
    for (name, degrees) in [("forearm", 25.0), ("shoulder-joint", 45.0), ("hip", 80.0), ("knee", 45.0)] {
        let profile = find(name).at_angle(degrees).expect("it goes in");
        let body = profile.body.as_ref().expect("a body");
        let told = layers(&profile);
        assert!(told.len() >= 4, "{name}: {told:?}");
        for (layer, from_mm) in told {
            let mut edges = body.pieces.iter().flat_map(|piece| [piece.from_mm, piece.to_mm]);
            assert!(edges.any(|edge| (edge - from_mm).abs() < 2e-3), "{name}: {layer} at {from_mm} mm");
        }
    }
}

#[test]
fn another_entry_meets_other_structures() {
    let at = |around: f64| {
        find("shoulder-joint").entered(&Entry {
            angle_deg: Some(85.0),
            along_mm: Some(30.0),
            around_deg: Some(around),
            turn_deg: Some(-around),
            azimuth_deg: None,
        })
    };
    let (over, beside) = (at(39.2).expect("it goes in"), at(20.0).expect("it goes in"));
    let has = |profile: &Profile, name: &str| layers(profile).iter().any(|(own, _)| own == name);
    assert!(has(&over, "vein") && !has(&beside, "vein"));
    let vein = layers(&over).iter().position(|(name, _)| name == "vein").expect("it is met") as u8;
    assert!(over.spared.contains(&vein) && !beside.spared.contains(&vein));
    // The bursa is the target, and here it is out of the way: it can only be missed.
    let goal = beside.goal().expect("a target");
    assert_eq!((goal.name.as_str(), goal.layer), ("bursa", NOT_ON_THE_LINE));
    assert!(Procedure::find("bursa", &beside).is_ok(), "the scripted hand finds a way");
}

const NOT_ON_THE_LINE: u8 = u8::MAX;

#[test]
fn a_vein_that_is_missed_leaves_fat_and_muscle() {
    let beside = Entry { around_deg: Some(25.0), ..Entry::default() };
    let beside = find("forearm").entered(&beside).expect("it goes in");
    let names: Vec<_> = layers(&beside).into_iter().map(|(name, _)| name).collect();
    assert_eq!(names, ["skin", "fat", "muscle"]);
    let over: Vec<_> = layers(&find("forearm")).into_iter().map(|(name, _)| name).collect();
    assert_eq!(over, ["skin", "fat", "vein", "far wall", "muscle"]);
}

#[test]
fn a_body_that_cannot_be_entered_is_refused_with_its_reason() {
    let forearm = BUILT_IN.iter().find(|(name, _)| *name == "forearm").expect("it is built in").1;
    for (right, wrong, hint) in [
        ("along_mm = 0.0", "along_mm = 300.0", "body.along_mm is 300"),
        ("along_mm = 0.0", "along_mm = nan", "body.along_mm is NaN"),
        ("turn_deg = 0.0", "turn_deg = 90.0", "turn the limb"),
        ("turn_deg = 0.0", "turn_deg = 0.0\nfat_mm = 0.0", "body.fat_mm is 0"),
        ("tissue = \"fat\"", "tissue = \"fat\"\ndepth_mm = 2.0", "remove depth_mm"),
        ("tissue = \"muscle\"", "tissue = \"bursa\"", "forces of the muscle"),
        ("site = \"forearm\"", "site = \"neck\"", "neck"),
        ("[body]", "[vessel]\nwidth_mm = 3.0\n\n[body]", "remove [vessel]"),
    ] {
        let text = forearm.replacen(right, wrong, 1);
        assert_ne!(text, forearm, "{right} is in the file");
        let said = Profile::parse(Text { origin: "test.toml".into(), text }).expect_err(wrong).to_string();
        assert!(said.contains(hint) && said.contains("test.toml") && !said.contains('\n'), "{said}");
    }
}
