//! Recordings that other programs wrote, and what `import` makes of them. tests/foreign/make.py
//! wrote them; the motion in all of them is the one of [`angle`] and [`torque`].

use crate::common::{folder, host_sim, run_well, text};
use diagnosis::recording::Recording;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

pub(crate) fn angle(t: f64) -> f64 {
    0.8 * (TAU * 0.9 * t).sin() + 0.3 * (TAU * 2.3 * t).sin()
}

fn torque(t: f64) -> f64 {
    0.4 * (TAU * 0.9 * t).cos()
}

pub(crate) fn foreign(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/foreign").join(name)
}

/// Imports files with options: what was said, and the recordings with their counts per rad.
fn import(files: &[&str], options: &[&str]) -> (String, Vec<Recording>, Option<f64>) {
    let (said, recordings, rig) = import_with_rig(files, options);
    let per_unit =
        rig.lines().find_map(|line| line.strip_prefix("counts_per_unit = ")).expect("it has a resolution");
    let per_unit =
        per_unit.split_whitespace().next().and_then(|x| x.parse().ok()).filter(|x: &f64| x.is_finite());
    (said, recordings, per_unit)
}

/// The same with the text of rig.toml.
fn import_with_rig(files: &[&str], options: &[&str]) -> (String, Vec<Recording>, String) {
    let out = folder(&format!(
        "import-{}{}",
        files.join("-"),
        options.concat().replace([' ', '/', ':', '[', ']'], "")
    ));
    let files: Vec<PathBuf> = files.iter().map(|name| foreign(name)).collect();
    let mut arguments = vec!["import"];
    arguments.extend(files.iter().map(|path| text(path)));
    arguments.extend(["--out", text(&out)]);
    arguments.extend(options);
    let said = run_well(&arguments);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(&out)
        .expect("the folder is there")
        .map(|entry| entry.expect("it can be read").path())
        .filter(|path| path.extension().is_some_and(|e| e == "csv"))
        .collect();
    paths.sort();
    let recordings = paths.iter().map(|path| Recording::read(path).expect("it keeps the contract")).collect();
    let rig = std::fs::read_to_string(out.join("rig.toml")).expect("a rig is written");
    (said, recordings, rig)
}

/// That a recording holds the motion, from `begin` s on, within `close` rad and with its torque
/// times `gain`.
fn holds_the_motion(recording: &Recording, per_unit: f64, begin: f64, gain: f64, close: f64) {
    let zero = recording.position_counts[0] / per_unit - angle(begin);
    for ((t, u), counts) in recording.time_s.iter().zip(&recording.command).zip(&recording.position_counts) {
        let at = begin + t;
        assert!((counts / per_unit - zero - angle(at)).abs() < close, "{} at {at} s", counts / per_unit);
        assert!((u - gain * torque(at)).abs() < 1e-5 * gain, "{u} at {at} s");
    }
}

#[test]
fn pandas_numpy_matlab_and_json_give_the_same_motion() {
    let cases: [(&str, &[&str], f64, &[&str]); 12] = [
        ("pandas.csv", &[], 1.0, &["position is theta_deg, in rad", "command is tau [Nm], in N·m"]),
        (
            "semicolons.csv",
            &[],
            1.0,
            &[
                "between semicolons, decimal commas",
                "command is Moment (mNm), in N·m after a factor of 0.001",
            ],
        ),
        ("matlab.csv", &[], 2.0, &["between tabs, 1 comment lines left out", "current, in A"]),
        (
            "arrays.npz",
            &["--column", "position=q:rad"],
            1.0,
            &["read as NumPy: 3 columns", "mass, name left out"],
        ),
        ("columns.json", &[], 1.0, &["read as JSON: 3 columns"]),
        ("records.json", &[], 1.0, &["read as JSON: 3 columns"]),
        ("split.json", &[], 1.0, &["read as JSON: 3 columns"]),
        ("lines.jsonl", &[], 1.0, &["read as JSON: 3 columns"]),
        ("vectors.mat", &[], 1.0, &["read as MATLAB: 3 columns", "note, mass left out"]),
        (
            "structure.mat",
            &["--column", "position=log.signals.values.1:rad", "--column", "command=log.signals.values.2:Nm"],
            1.0,
            &["read as MATLAB: 4 columns"],
        ),
        ("rows.csv", &[], 1.0, &["channels are in rows, 3 of 500 values: taken as columns"]),
        (
            "matrix.json",
            &["--column", "time=0:s", "--column", "position=1:rad", "--column", "command=2:Nm"],
            1.0,
            &["read as JSON: 3 columns"],
        ),
    ];
    for (file, options, gain, sentences) in cases {
        let (said, recordings, per_unit) = import(&[file], options);
        println!("{file}: {said}");
        for sentence in sentences.iter().chain(&["200 rows a second"]) {
            assert!(said.contains(sentence), "{file} does not say \"{sentence}\": {said}");
        }
        assert_eq!((recordings.len(), recordings[0].len()), (1, 500), "{file}");
        holds_the_motion(&recordings[0], per_unit.expect("it is known"), 0.0, gain, 2e-6);
    }
}

#[test]
fn an_mcap_of_python_gives_the_motion_in_either_compression() {
    for file in ["zstd.mcap", "lz4.mcap"] {
        let (said, recordings, per_unit) = import(&[file], &[]);
        assert!(said.contains("topics /joint, /drive") && said.contains("on the clock of /joint"), "{said}");
        let recording = &recordings[0];
        assert_eq!(recording.len(), 500, "{said}");
        let per_unit = per_unit.expect("it is known");
        for (i, t) in recording.time_s.iter().enumerate() {
            assert!((t - i as f64 / 200.0).abs() < 1e-6, "{t}");
            assert!((recording.position_counts[i] / per_unit - angle(*t)).abs() < 2e-6);
            // The drive's topic has every second row, which holds.
            let held = (i / 2 * 2) as f64 / 200.0;
            assert!((recording.command[i] - torque(held)).abs() < 1e-9);
        }
    }
}

#[cfg(feature = "ros")]
#[test]
fn a_ros_2_bag_of_rosbags_gives_the_motion_of_a_joint() {
    let (said, recordings, per_unit) = import(
        &["ros2-bag"],
        &[
            "--column",
            "position=joint_states.position.wrist:rad",
            "--column",
            "command=joint_states.effort.wrist:Nm",
        ],
    );
    assert!(said.contains("topics /joint_states"), "{said}");
    assert_eq!(recordings[0].len(), 500, "{said}");
    holds_the_motion(&recordings[0], per_unit.expect("it is known"), 0.0, 1.0, 2e-6);
}

#[cfg(feature = "parquet")]
#[test]
fn the_episodes_of_a_lerobot_dataset_are_runs_of_their_own() {
    let options = [
        "--column",
        "position=observation.state.wrist.pos:rad",
        "--column",
        "command=observation.effort.wrist.torque:Nm",
    ];
    let (said, recordings, per_unit) = import(&["lerobot"], &options);
    assert!(said.contains("read as Parquet of a LeRobot dataset"), "{said}");
    assert!(said.contains("the clock starts again 1 times"), "{said}");
    assert_eq!(recordings.len(), 2, "{said}");
    for recording in &recordings {
        holds_the_motion(recording, per_unit.expect("it is known"), 0.0, 1.0, 2e-6);
    }
}

#[cfg(feature = "hdf5")]
#[test]
fn hdf5_of_h5py_and_of_matlab_gives_the_motion() {
    let (said, recordings, per_unit) = import(&["datasets.h5"], &[]);
    assert!(said.contains("read as HDF5") && said.contains("bench.operator"), "{said}");
    assert_eq!(recordings[0].len(), 500);
    holds_the_motion(&recordings[0], per_unit.expect("it is known"), 0.0, 1.0, 2e-6);
    let (said, recordings, per_unit) = import(&["v73.mat"], &["--column", "command=torque.1:Nm"]);
    assert!(said.contains("read as MATLAB -v7.3: 4 columns") && said.contains("note left out"), "{said}");
    holds_the_motion(&recordings[0], per_unit.expect("it is known"), 0.0, 1.0, 2e-6);
}

#[cfg(feature = "hdf5")]
#[test]
fn damaged_hdf5_is_refused_or_read_and_never_panics() {
    let out = folder("import-damaged-hdf5");
    let whole = std::fs::read(foreign("datasets.h5")).expect("it is there");
    let file = out.join("damaged.h5");
    for i in 0..200 {
        let mut damaged = whole.clone();
        // The structure is in the first part; cut the file now and then.
        damaged[8 + (i * 37) % 6000] ^= 1 << (i % 8);
        damaged.truncate(if i % 5 == 0 { whole.len() * (i + 1) / 201 } else { whole.len() });
        std::fs::write(&file, &damaged).expect("written");
        let to = out.join("done");
        let output = host_sim(&["import", text(&file), "--out", text(&to)]).output().expect("it runs");
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(matches!(output.status.code(), Some(0 | 2)), "damage {i}: {said}");
    }
}

#[cfg(not(feature = "ros"))]
#[test]
fn a_ros_2_bag_is_refused_with_the_build_that_reads_it() {
    let bag = foreign("ros2-bag");
    let output = host_sim(&["import", text(&bag), "--out", text(&folder("import-no-ros"))]).output();
    let output = output.expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("build with `--features ros`"), "{said}");
}

#[test]
fn two_files_of_one_run_give_their_columns_by_file() {
    let (said, recordings, per_unit) = import(
        &["angle.csv", "torque.csv"],
        &["--column", "position=angle.csv/value:deg", "--column", "command=torque/value:Nm"],
    );
    assert!(said.contains("columns of 2 tables put on the clock of"), "{said}");
    assert_eq!(recordings.len(), 1, "{said}");
    holds_the_motion(&recordings[0], per_unit.expect("it is known"), 0.0, 1.0, 2e-6);
}

#[test]
fn a_role_may_stay_empty_and_a_reference_shares_the_unit() {
    let out = folder("import-reference");
    let rows: String = (0..400)
        .map(|i| {
            let t = i as f64 * 0.005;
            format!("{t},{},{},{}\n", angle(t).to_degrees(), angle(t + 0.01).to_degrees(), torque(t))
        })
        .collect();
    let file = out.join("loop.csv");
    std::fs::write(&file, format!("t,theta_deg,theta_ref,tau_Nm\n{rows}")).expect("written");
    let columns = |extra: &[&str]| {
        let to = out.join("done");
        let mut arguments = vec!["import", text(&file), "--out", text(&to)];
        arguments.extend(extra);
        let said = run_well(&arguments);
        let written = std::fs::read_to_string(to.join("recording.csv")).expect("it is written");
        (said, written.lines().next().expect("it has a header").to_owned())
    };
    let (said, header) = columns(&[]);
    assert!(said.contains("theta_ref has no unit: taken to have the position's"), "{said}");
    assert_eq!(header, "time_s,command,position_counts,reference_counts");
    let (_, header) = columns(&["--column", "reference=none"]);
    assert_eq!(header, "time_s,command,position_counts");
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_of_arrow_gives_the_motion() {
    let (said, recordings, per_unit) = import(&["arrow.parquet"], &[]);
    assert!(said.contains("read as Parquet"), "{said}");
    assert_eq!(recordings[0].len(), 500);
    holds_the_motion(&recordings[0], per_unit.expect("it is known"), 0.0, 1.0, 2e-6);
}

#[test]
fn wraps_and_speeds_alone_become_positions() {
    let (said, recordings, per_unit) = import(&["wrapped.csv"], &[]);
    assert!(said.contains("the position wraps"), "{said}");
    let per_unit = per_unit.expect("it is known");
    for (t, counts) in recordings[0].time_s.iter().zip(&recordings[0].position_counts) {
        assert!((counts / per_unit - 9.0 * angle(*t)).abs() < 2e-5, "{counts} at {t}");
    }
    let (said, recordings, per_unit) = import(&["speed.csv"], &[]);
    assert!(said.contains("only the speed was recorded: the position is its integral"), "{said}");
    holds_the_motion(&recordings[0], per_unit.expect("it is known"), 0.0, 1.0, 2e-3);
}

#[test]
fn a_coarse_clock_gaps_and_continued_files_are_mended_and_noted() {
    const PER_UNIT: f64 = 4096.0 / TAU;
    const COUNT: f64 = 1.01 / PER_UNIT;
    let (said, recordings, per_unit) = import(&["coarse.csv"], &["--column", "time=t:ms"]);
    assert!(said.contains("375 rows have the stamp of the row before: spread evenly"), "{said}");
    assert_eq!(per_unit, None, "nothing tells of how many counts a turn has");
    assert!(said.contains("fill in the values that stand as nan"), "{said}");
    assert_eq!(recordings[0].len(), 500);
    holds_the_motion(&recordings[0], PER_UNIT, 0.0, 1.0, COUNT);

    let (said, recordings, per_unit) = import(&["gap.csv"], &["--counts-per-turn", "4096"]);
    assert!(said.contains("cut at 1 gaps longer than 0.100 s"), "{said}");
    assert_eq!(recordings.len(), 2);
    let per_unit = per_unit.expect("it was said");
    assert!((per_unit - PER_UNIT).abs() < 1e-9);
    holds_the_motion(&recordings[0], per_unit, 0.0, 1.0, COUNT);
    holds_the_motion(&recordings[1], per_unit, 1.405, 1.0, COUNT);

    let (said, recordings, _) = import(&["rest.csv"], &["--counts-per-turn", "4096"]);
    assert!(said.contains("s at rest left out; --keep-idle keeps them"), "{said}");
    let rows = recordings[0].len();
    assert!((690..=710).contains(&rows), "{rows} rows: half a second of rest at either end");
    let (_, recordings, _) = import(&["rest.csv"], &["--counts-per-turn", "4096", "--keep-idle"]);
    assert_eq!(recordings[0].len(), 1700);

    let (said, recordings, _) = import(&["first.csv", "second.csv"], &["--counts-per-turn", "4096"]);
    assert!(said.contains("a file goes on where the one before ends: joined to one run"), "{said}");
    assert_eq!((recordings.len(), recordings[0].len()), (1, 500));
    holds_the_motion(&recordings[0], PER_UNIT, 0.0, 1.0, COUNT);
}

#[test]
fn sign_rig_values_and_hold_out_cut_are_taken_as_given() {
    let options = ["--column", "command=-tau [Nm]", "--split", "0.5", "--inertia", "0.02", "--gain", "1.5"];
    let (said, recordings, rig) = import_with_rig(&["pandas.csv"], &options);
    assert!(said.contains("its sign turned") && said.contains("next: host-sim diagnose --rig"), "{said}");
    assert_eq!(recordings.len(), 2);
    assert!((recordings[0].command[0] + 0.4).abs() < 1e-9, "{}", recordings[0].command[0]);
    assert!(!said.contains("nan"), "everything was given: {said}");
    let rig = diagnosis::rig::Rig::parse(&rig, "rig.toml").expect("the rig is complete");
    assert_eq!((rig.model.inertia, rig.actuator.gain), (0.02, 1.5));
    assert_eq!(rig.encoder.counts_per_unit, 1e6);
}

#[test]
fn files_that_may_or_may_not_be_runs_are_asked_about() {
    let out = folder("import-runs");
    let rows: String =
        (0..400).map(|i| format!("{},{},{}\n", i as f64 * 0.005, angle(i as f64 * 0.005), i % 7)).collect();
    let files: Vec<PathBuf> = ["motor.csv", "load.csv"].iter().map(|name| out.join(name)).collect();
    for file in &files {
        std::fs::write(file, format!("t,theta_rad,u\n{rows}")).expect("written");
    }
    let to = out.join("result");
    let arguments = ["import", text(&files[0]), text(&files[1]), "--out", text(&to)];
    let output = host_sim(&arguments).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("have the same columns over the same time") && said.contains("--runs"), "{said}");
    run_well(&[&arguments[..], &["--runs"]].concat());
    assert!(to.join("recording-2.csv").exists());
}
