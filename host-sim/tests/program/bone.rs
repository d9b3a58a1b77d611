//! A needle that is driven onto bone: it stops there, however hard the hand pushes.

use crate::common::{folder, run_well, text};
use device_sim::needle::NeedleTrack;
use device_sim::profile::Profile;
use recording::read::Recording;
use recording::stretches::stretches;

/// 30 mm past the joint's surface, by a hand of 5 N/mm.
const PROCEDURE: &str = "format = 1\nname = \"bone\"\nstart_mm = -2.0\n\
     [hand]\nstiffness_n_per_mm = 5.0\ndamping_n_s_per_mm = 0.02\ntremor_mm = 0.0\nseed = 1\n\
     [[step]]\nname = \"in\"\nto_mm = DEPTH\nspeed_mm_s = 10.0\n\
     [[step]]\nname = \"press\"\nseconds = 1.0\n\
     [[step]]\nname = \"out\"\nto_mm = -2.0\nspeed_mm_s = 20.0\n";

#[test]
fn bone_stops_the_needle_and_says_so() {
    stops("shoulder-joint");
}

/// The cartilage of the level shoulder is 3 mm thick.
#[test]
fn bone_under_level_layers_stops_the_needle_too() {
    let profile = Profile::find("shoulder").expect("it is built in");
    let cartilage = profile.config.patient.layers.last().expect("layers");
    let wanted_mm = (cartilage.depth.0.to_num::<f64>() + 3.0) / 45_f64.to_radians().sin();
    assert!((stops("shoulder") - wanted_mm).abs() < 1e-3);
}

/// Drives a needle onto the bone of `patient` and returns where it is, mm along the needle.
fn stops(patient: &str) -> f64 {
    let profile = Profile::find(patient).expect("it is built in");
    let bone_mm = NeedleTrack::new(&profile).bone_mm().expect("there is bone");
    let dir = folder(&format!("bone-{patient}"));
    let (procedure, recorded) = (dir.join("bone.toml"), dir.join("a.mcap"));
    // A hand of 5 N/mm that wants to be 4 mm inside it presses with 20 N.
    let wanted = format!("{:.2}", bone_mm + 4.0);
    std::fs::write(&procedure, PROCEDURE.replace("DEPTH", &wanted)).expect("it can be written");
    let arguments = ["run", "--headless", "--fast", "--profile", patient, "--seconds", "9"];
    let files = ["--procedure", text(&procedure), "--record", text(&recorded)];
    run_well(&[&arguments[..], &files].concat());
    let stretch = stretches(&Recording::read(&recorded).expect("it was recorded")).remove(0);
    let deepest = stretch.samples.iter().map(|sample| sample.count).max().expect("samples");
    let deepest_mm = f64::from(deepest) * stretch.hello.mm_per_count;
    assert!((deepest_mm - bone_mm).abs() < 0.25, "{deepest_mm:.2} mm, and bone is at {bone_mm:.2}");
    let largest_n = profile.plan.largest_force().0.to_num::<f64>();
    let forces = stretch.samples.iter().map(|sample| stretch.hello.force_n(sample.dac));
    let peak_n = forces.fold(0.0, f64::max);
    assert!(peak_n <= largest_n + 0.02, "{peak_n:.2} N of {largest_n:.2}");
    assert_eq!(stretch.tasks.iter().filter(|done| done.name == "bone").count(), 1, "{:?}", stretch.tasks);
    bone_mm
}
