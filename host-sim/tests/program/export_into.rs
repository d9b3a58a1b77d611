//! A found effect in somebody's own MuJoCo model; `tests/clients/mujoco_rig.py` runs such models.

use crate::common::{folder, host_sim, refused, run_well, text};
use std::path::{Path, PathBuf};

const THEIRS: &str = "<?xml version=\"1.0\"?>\r\n<mujoco>\t<!-- <joint name=\"knee\"/> > \u{fc} -->\r\n<worldbody>\n <body>\n  \
    <joint name='hip'  axis = '0 1 0'/>\n  <body>\n   <joint name=\"knee\" damping=\"7\"\n     axis=\"0 1 0\"/>\n\
    <geom size=\".1\" name=\"a > b\"/></body></body></worldbody>\n<actuator><motor joint=\"knee\"></motor>\n</actuator></mujoco>\n";

/// The folder of a report on a demonstration, and their model in it.
fn prepared(name: &str) -> (PathBuf, PathBuf) {
    let dir = folder(name);
    run_well(&["demo", "--no-browser", "--out", text(&dir)]);
    let theirs = dir.join("theirs.xml");
    std::fs::write(&theirs, THEIRS).expect("written");
    (dir.join("missing"), theirs)
}

/// A command that exports the patched rig into their model.
fn export(report: &Path, theirs: &Path, joint: &str) -> std::process::Output {
    let [rig, recording, out] =
        ["patched-rig.toml", "holdout.csv", "simulated"].map(|name| report.join(name));
    let files = ["simulate", "--rig", text(&rig), "--recording", text(&recording), "--out", text(&out)];
    let options = ["--export", "mjcf", "--into", text(theirs), "--joint", joint];
    host_sim(&[&files[..], &options].concat()).output().expect("the program starts")
}

#[test]
fn their_model_changes_in_one_joint_and_its_motor() {
    let (report, theirs) = prepared("export-into");
    assert!(export(&report, &theirs, "knee").status.success());
    let read = |path: &Path| std::fs::read_to_string(path).expect("it is there");
    assert_eq!(read(&theirs), THEIRS);
    let patched = read(&theirs.with_file_name("theirs-patched.xml"));
    let (joint, motor) =
        (THEIRS.find("<joint name=\"knee\" d").expect("it"), THEIRS.find("<motor").expect("it"));
    let after_joint = joint + THEIRS[joint..].find("/>").expect("it");
    assert!(patched.starts_with(&THEIRS[..joint]), "{patched}");
    assert!(patched.contains(&THEIRS[after_joint..motor]), "{patched}");
    assert!(patched.ends_with("\n</actuator></mujoco>\n"), "{patched}");
    let rig: toml::Table = read(&report.join("patched-rig.toml")).parse().expect("it is TOML");
    let damping = rig["model"]["viscous"].as_float().expect("a number");
    let written = patched.split("damping=\"").nth(1).and_then(|rest| rest.split('"').next());
    let written: f64 = written.expect("an attribute").parse().expect("a number");
    assert!((written / damping - 1.0).abs() < 1e-6, "{written} instead of {damping}");
}

#[test]
fn a_joint_that_is_not_there_is_refused_with_those_that_are() {
    let (report, theirs) = prepared("export-into-refused");
    refused(
        &export(&report, &theirs, "elbow"),
        2,
        &["theirs.xml: has no joint \"elbow\"", "its joints are hip, knee"],
    );
    std::fs::write(&theirs, "<mujoco>\n<body></mujoco>").expect("written");
    refused(&export(&report, &theirs, "knee"), 2, &["theirs.xml: is not well-formed XML in line 2"]);
    assert!(!theirs.with_file_name("theirs-patched.xml").exists());
}
