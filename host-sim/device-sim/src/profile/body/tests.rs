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

/// The artery of the forearm, a tube of 4 mm across, is met through two walls, also under the
/// vein, where the device has room for six layers.
#[test]
fn an_artery_has_a_far_wall() {
    for (angle, around, azimuth, names) in [
        (60.0, -8.0, 0.0, vec!["skin", "fat", "muscle", "artery", "far arterial wall"]),
        (68.5, 4.0, -90.0, vec!["skin", "fat", "vein", "far wall", "artery", "far arterial wall"]),
    ] {
        let entry = Entry {
            angle_deg: Some(angle),
            along_mm: Some(10.0),
            around_deg: Some(around),
            azimuth_deg: Some(azimuth),
            turn_deg: None,
        };
        let profile = find("forearm").entered(&entry).expect("it goes in");
        let told = layers(&profile);
        assert_eq!(told.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>(), names);
        let body = profile.body.as_ref().expect("a body");
        let piece = body.pieces.iter().find(|piece| body.body.structures[piece.structure].name == "artery");
        let piece = piece.expect("it is met");
        let at = told.iter().position(|(name, _)| name == "artery").expect("it is met");
        assert!((told[at].1 - piece.from_mm).abs() < 2e-3 && (told[at + 1].1 - piece.to_mm).abs() < 2e-3);
        let wall = |layer: usize| profile.config.patient.layers[layer].wall.expect("a wall").puncture_travel;
        assert_eq!(wall(at), wall(at + 1), "the far wall is as strong as the near one");
        assert_eq!(profile.spared, [at as u8], "only the artery is to be spared");
        // A needle that turns meets both walls where its line does.
        let tops = body.tops_mm([0.0; 2], profile.entry_rad);
        assert!(tops[at].zip(tops[at + 1]).is_some_and(|(near, far)| far > near + 1.0), "{tops:?}");
    }
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
