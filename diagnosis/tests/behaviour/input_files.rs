//! Whatever a file holds is answered with a recording or one clear sentence, never a panic.

use crate::common::{self, Random};
use diagnosis::recording::Recording;
use diagnosis::rig::Rig;

#[test]
fn errors_name_file_and_line() {
    let cases = [
        ("time_s,command,position_counts\n0,0,0\n0.1,0\n", "line 3"),
        ("time_s,command,position_counts\n0,0,0\n0.2,0,1\n0.1,0,2\n", "line 4"),
        ("time_s,command,position_counts\n0,0,0\n0.1,NaN,1\n", "line 3"),
        ("time_s,command,position_counts\n0,0,0\n0.1,inf,1\n", "line 3"),
        ("time_s,command,position_counts\n0,0,0\n\n0.1,0,1\n", "line 3"),
        ("time_s,command\n0,0\n", "position_counts"),
        ("time_s,command,position_counts,time_s\n0,0,0,0\n", "two columns time_s"),
        ("time_s,command,position_counts\n0,,0\n", "line 2"),
        ("", "time_s"),
    ];
    for (text, wanted) in cases {
        let error = Recording::parse(text, "x.csv").expect_err(text).to_string();
        assert!(error.contains("x.csv") && error.contains(wanted), "{error}");
        assert!(!error.contains('\n'));
    }
}

#[test]
fn unknown_columns_are_kept_out_of_the_way() {
    let text = "note,time_s,command,position_counts\na,0,1,2\nb,0.1,3,4\n";
    let recording = Recording::parse(text, "x.csv").expect("usable");
    assert_eq!(recording.command, [1.0, 3.0]);
    assert!(recording.force.is_none());
}

#[test]
fn random_bytes_never_panic() {
    let mut random = Random::new(1);
    let pieces = [
        "time_s",
        "command",
        "position_counts",
        ",",
        "\n",
        "1",
        "-",
        "e",
        "NaN",
        "0.5",
        "\"",
        "\r\n",
        "é",
        "tilt_rad",
        "[model]",
        "inertia",
        "=",
        "format = 1\n",
        " ",
    ];
    for _ in 0..3000 {
        let length = (random.unit() * 60.0) as usize;
        let text: String =
            (0..length).map(|_| pieces[(random.unit() * pieces.len() as f64) as usize]).collect();
        let _ = Recording::parse(&text, "x.csv");
        let _ = Rig::parse(&text, "x.toml");
        let full = format!("time_s,command,position_counts\n{text}");
        let _ = Recording::parse(&full, "x.csv");
    }
}

#[test]
fn random_rows_never_panic() {
    for seed in 0..24 {
        let mut random = Random::new(seed + 50);
        let rows = 400 + (random.unit() * 1500.0) as usize;
        let size = 10f64.powf(random.between(-6.0, 9.0));
        let mut t = 0.0;
        let mut recording = || {
            let mut r = Recording { file: "random.csv".into(), ..Recording::default() };
            for _ in 0..rows {
                t += random.between(1e-4, 4e-3);
                r.time_s.push(t);
                r.command.push(random.normal() * size);
                r.position_counts.push((random.normal() * size * 100.0).round());
            }
            r
        };
        let (fit, held) = (recording(), recording());
        if let Ok(outcome) =
            diagnosis::diagnose_recordings(&common::rig([0.0; 4], ""), &[fit], &[held], &|_, _| ())
        {
            assert!(
                outcome.report.effects.iter().all(|e| e.confidence < 0.9),
                "noise is named: {}",
                outcome.summary()
            );
        }
    }
}

#[test]
fn rigs_are_checked() {
    let good = common::rig([0.0; 4], "").to_toml();
    assert!(Rig::parse(&good, "rig.toml").is_ok());
    for (from, to) in [
        ("format = 1", "format = 2"),
        ("inertia = ", "inertia = -"),
        ("kind = \"rotary\"", "kind = \"bent\""),
    ] {
        let error = Rig::parse(&good.replacen(from, to, 1), "rig.toml").expect_err(to).to_string();
        assert!(error.contains("rig.toml") && !error.contains('\n'), "{error}");
    }
}
