//! Profiles that are taken, and what is said of those that are not.

use super::*;
use crate::session::Source;

fn text(text: impl Into<String>) -> Text {
    Text { origin: "test.toml".into(), text: text.into() }
}

#[test]
fn built_in_profiles_puncture_at_their_stated_forces_and_depths() {
    let table = [
        ("adult", 1.0, 0.5, 4.8, 0.02),
        ("thin-elderly", 0.7, 0.35, 3.0, 0.015),
        ("high-body-mass", 1.2, 0.5, 7.0, 0.03),
        ("firm-skin", 1.5, 0.6, 4.8, 0.025),
    ];
    for (name, skin_n, vein_n, vein_mm, friction) in table {
        let profile = Profile::find(name).expect("it is built in");
        assert!((profile.entry_rad - 30_f64.to_radians()).abs() < 1e-9);
        let scene = profile.scene(Source::Virtual, None);
        let walls: Vec<_> = scene.layers.iter().filter(|l| l.puncture_force_n.is_some()).collect();
        let force = |index: usize| walls[index].puncture_force_n.expect("it is a wall");
        assert!((force(0) - skin_n).abs() < 0.01, "{name}: skin {} N", force(0));
        assert!((force(1) - vein_n).abs() < 0.01, "{name}: vein {} N", force(1));
        assert!(walls[1].is_vessel && (walls[1].depth_mm - vein_mm).abs() < 1e-3);
        assert!(scene.layers.iter().all(|l| (l.friction_n_per_mm - friction).abs() < 1e-4));
    }
}

#[test]
fn a_refusal_names_the_file_the_layer_and_the_reason() {
    let stiff = BUILT_IN[0].1.replacen("compliance_mm2_per_n = 9.0", "compliance_mm2_per_n = 0.1", 1);
    let said = Profile::parse(text(stiff)).expect_err("60 N/mm would ring").to_string();
    assert!(said.contains("test.toml") && said.contains("N/mm") && said.contains("skin"), "{said}");
}

#[test]
fn a_value_out_of_range_is_named_by_its_key_and_layer() {
    for (old, new, wanted) in [
        ("vertex_mm = 4.0", "vertex_mm = 400.0", "vertex_mm is 400.0000"),
        ("friction_n_per_mm = 0.02", "friction_n_per_mm = 500", "friction_n_per_mm is 500.0000"),
        ("unload_n_per_mm = 1.0", "unload_n_per_mm = 100", "unload_n_per_mm is 100.0000"),
    ] {
        let said = Profile::parse(text(BUILT_IN[0].1.replacen(old, new, 1))).expect_err(new).to_string();
        assert!(said.contains(wanted) && said.ends_with("(in layer 0, skin)"), "{said}");
    }
}

#[test]
fn friction_may_have_a_static_and_a_dynamic_level() {
    let with = |keys: &str| {
        let friction = format!("[friction]\nlaw = \"stick-slip\"\n{keys}\n\n[[layer]]");
        Profile::parse(text(BUILT_IN[0].1.replacen("[[layer]]", &friction, 1)))
    };
    let law = with("stiffness_n_per_mm = 1.0\nsliding = 0.5").expect("sound").config.patient.law;
    let half = config::FrictionLaw::StickSlip { stiffness: Stiffness(I16F16::ONE), sliding: I16F16::ONE / 2 };
    assert_eq!(law, config::Law::Jog(half));
    for (keys, wanted) in [
        ("stiffness_n_per_mm = 1.0", "missing field `sliding`"),
        ("stiffness_n_per_mm = 1.0\nsliding = -0.5", "sliding is -0.5000; it must be from 0.2000 to 1.0000"),
        ("stiffness_n_per_mm = 1.0\nsliding = 0.1", "sliding is 0.1000"),
        ("stiffness_n_per_mm = -1.0\nsliding = 0.5", "stiffness_n_per_mm is -1.0000"),
        ("sliding = 0.5", "missing field `stiffness_n_per_mm`"),
    ] {
        let said = with(keys).expect_err(keys).to_string();
        assert!(
            said.contains("test.toml") && said.contains(wanted) && !said.contains("\n\n"),
            "{keys}: {said}"
        );
    }
}

/// Skin to muscle in a shoulder of 176 cm, perpendicular to the skin, mm.
fn skin_to_muscle_mm(name: &str, sex: &str, weight_kg: f64) -> f64 {
    let file = BUILT_IN.iter().find(|(own, _)| *own == name).expect("it is built in").1;
    let file = file.replace("\"male\"", &format!("\"{sex}\"")).replace("82.0", &format!("{weight_kg:.1}"));
    let profile = Profile::parse(text(file)).expect("a person may weigh so much");
    let muscle = profile.config.patient.layers.iter().find(|layer| layer.tissue == Tissue::Muscle);
    muscle.expect("the needle meets it").depth.0.to_num()
}

/// The audit found the same 6.2 mm at 50 and 77 kg, and the same 7.6 mm at 93 and 200 kg.
#[test]
fn no_two_weights_have_the_same_fat() {
    for (name, sex) in [("shoulder", "male"), ("shoulder", "female"), ("shoulder-joint", "female")] {
        let weights_kg = (0..=150).map(|step| 50.0 + f64::from(step));
        let found_mm: Vec<f64> = weights_kg.map(|kg| skin_to_muscle_mm(name, sex, kg)).collect();
        let grows = |pair: &[f64]| (0.02..0.4).contains(&(pair[1] - pair[0]));
        assert!(found_mm.windows(2).all(grows), "{name}, {sex}: {found_mm:.2?}");
    }
    // Poland 1997: means of 8.3 and 11.7 mm from skin to muscle, in people of 82 kg or so.
    for (sex, wanted_mm) in [("male", 8.3), ("female", 11.7)] {
        let found_mm = skin_to_muscle_mm("shoulder", sex, 82.0);
        assert!((found_mm - wanted_mm).abs() < 0.1, "{sex}: {found_mm} mm");
    }
}

#[test]
fn mistakes_are_named_with_their_line() {
    for (wrong, hint) in [
        (BUILT_IN[0].1.replace("depth_mm = 2.0", "depth_mm = \"deep\""), "line 24"),
        (BUILT_IN[0].1.replace("friction_n", "frction_n"), "frction_n_per_mm"),
        (BUILT_IN[0].1.replace("format = 1", "format = 9"), "format is 9"),
        (BUILT_IN[0].1.replace("depth_mm = 2.0", "depth_mm = nan"), "depth_mm"),
        (BUILT_IN[0].1.replace("depth_mm = 2.0", "depth_mm = 1e300"), "depth_mm"),
        (format!("{}\n[limits]\ntorque_mnm = 90.0\n", BUILT_IN[0].1), "limits"),
        (format!("largest_force_n = 9.0\n{}", BUILT_IN[0].1), "ceiling of 2.880 N"),
        (BUILT_IN[0].1.replace("\"far-wall\"", "\"muscle\""), "layer 2 is a vessel without a far wall"),
        ("[[layer]".into(), "line 1"),
        (String::new(), "format"),
    ] {
        let said = Profile::parse(text(wrong)).expect_err(hint).to_string();
        assert!(said.contains(hint) && said.contains("test.toml") && !said.contains('\n'), "{said}");
    }
}

#[test]
fn each_law_has_a_patient_whose_file_says_what_is_its_own() {
    for model in [Model::Jog, Model::Sparte, Model::Xr] {
        assert_eq!(Profile::find(model.patient()).expect("it is built in").model(), model);
    }
    let shoulder = Profile::find("shoulder").expect("it is built in");
    assert_eq!(
        (shoulder.procedure.as_str(), shoulder.person.site),
        ("shoulder-straight", Some(Site::Shoulder))
    );
    let file = |name: &str| BUILT_IN.iter().find(|(known, _)| *known == name).expect("it is built in").1;
    let (shoulder, phantom) = (file("shoulder"), file("phantom"));
    for (wrong, hint) in [
        (shoulder.replace("model = \"sparte\"", "model = \"magic\""), "magic"),
        (shoulder.replace("relax_ms = 300 ", "relax_ms = 9 "), "relax_ms is 9"),
        (shoulder.replace("relax_ms = 300 ", "relaxation = 300 "), "relaxation"),
        (shoulder.replace("force_scale = 0.65", "force_scale = 1.0"), "N/mm"),
        (shoulder.replace("inwards_n = 4.0", "inwards_n = 40.0"), "layer 5 demands 40.4"),
        (shoulder.replace("cutting = { inwards_n = 4.0, outwards_n = 1.2 }", ""), "cutting is missing"),
        (shoulder.replace("depth_mm = 29.0", "depth_mm = -29.0"), "depth_mm of layer 5 is -29"),
        (shoulder.replace("depth_mm = 29.0", "depth_mm = 23.0"), "does not begin below"),
        (shoulder.replace("sliding_n = 0.3", "sliding_n = nan"), "sliding_n is NaN"),
        (shoulder.replace("largest_deg = 10.0", "largest_deg = 190.0"), "largest_deg is 190 degrees"),
        (
            shoulder.replace("largest_deg = 10.0", "largest_deg = 60.0"),
            "largest_deg is 60 degrees; it must be from 0.1 to 45 degrees",
        ),
        (shoulder.replace("site = \"shoulder\"", "site = \"elbow\""), "elbow"),
        (shoulder.replace("age_years = 50", "age_years = 130"), "patient.age_years is 130"),
        (shoulder.replace("height_cm = 176.0", "height_cm = nan"), "patient.height_cm is NaN"),
        (format!("{shoulder}friction_n_per_mm = 0.02\n"), "friction_n_per_mm is the law jog's"),
        (shoulder.replace("sex = \"male\"\n", ""), "thickness by-body-mass needs patient.sex"),
        (shoulder.replace("thickness", "thick"), "thick"),
        (
            shoulder.replace("over_bone_mm = 3.0", "over_bone_mm = nan"),
            "over_bone_mm of the cartilage is NaN",
        ),
        (shoulder.replace("depth_mm = 8.0", "depth_mm = 8.0\nover_bone_mm = 3.0"), "under the muscle"),
        (format!("{shoulder}thickness = \"by-body-mass\"\n"), "none below it"),
        (phantom.replace("[force_table]", "[forces]"), "forces"),
        (phantom.replace("speeds_mm_s = [1.0, 3.0, 5.0]", "speeds_mm_s = [1.0, 3.0]"), "need 6 rows"),
        (phantom.replace("speeds_mm_s = [1.0,", "speeds_mm_s = [0.5, 1.0,"), "at most 3"),
        (phantom.replace("measured = [false,", "measured = ["), "measured has 8 values"),
        (phantom.replace("withdrawal = 0.4 ", "withdrawal = 1.4 "), "withdrawal is 1.4"),
        (phantom.replace("depth_step_mm = 0.8", "depth_step_mm = 0.01"), "depth_step_mm is 0.01"),
        (phantom.replace("depth_step_mm = 0.8", "depth_step_mm = inf"), "depth_step_mm is inf"),
        (phantom.replace("depth_step_mm = 0.8", "depths_mm = [0.0, 1.0]"), "depths_mm must have 16 values"),
        (phantom.replace("depth_step_mm = 0.8", ""), "either depth_step_mm or depths_mm"),
        (phantom.replace("depth_step_mm = 0.8", "depth_step_mm = 40.0"), "a knot at 200 mm"),
        (phantom.replace("gives_way = [3, 6, 10]", "gives_way = [3, 4]"), "gives_way is 4"),
        (phantom.replace("gives_way = [3, 6, 10]", "gives_way = [15]"), "gives_way is 15"),
        (phantom.replace("[0.000,", "[nan,"), "force_n holds NaN"),
        (BUILT_IN[0].1.replacen("friction_n_per_mm = 0.02\n", "", 1), "friction_n_per_mm is missing"),
    ] {
        let said = Profile::parse(text(wrong)).expect_err(hint).to_string();
        assert!(said.contains(hint) && said.contains("test.toml") && !said.contains('\n'), "{hint}: {said}");
    }
}

#[test]
fn an_unknown_name_lists_the_known_ones() {
    let said = Profile::find("giant").expect_err("there is none").to_string();
    assert!(said.contains("giant") && said.contains("adult, thin-elderly"), "{said}");
    let said = Profile::find("/no/such.toml").expect_err("there is none").to_string();
    assert!(said.contains("/no/such.toml") && said.contains("cannot be read"), "{said}");
}
