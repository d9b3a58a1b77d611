//! Files as strangers have them, of one axis whose truth is known: `import` gives the right values
//! or asks, and is never wrong in silence. Each file is made here.

use crate::common::axis::{EXACT, PER_UNIT, asked, file, holds, import, motion, reading, table, torque};
use std::f64::consts::TAU;

#[test]
fn prefixes_before_units_count_in_every_spelling() {
    for (header, torque_factor, angle_factor) in [
        ("t_s,tau_mNm,theta_rad", 1e3, 1.0),
        ("t_s,tauMilliNewtonMetres,theta_rad", 1e3, 1.0),
        ("t_s,torque_kNm,theta_mRad", 1e-3, 1e3),
        ("t_s,torque (mN·m),angleMRad", 1e3, 1e3),
        ("t_s,torque_N_mm,theta [mrad]", 1e3, 1e3),
        ("t_s,torque_uNm,theta_deg", 1e6, 360.0 / TAU),
        ("t_s,current_mA,theta_rad", 1e3, 1.0),
        ("t_s,Iq_mA,theta_rad", 1e3, 1.0),
        ("t_s,motorCurrent [mA],theta_rad", 1e3, 1.0),
        ("t_s,iqmA,theta_rad", 1e3, 1.0),
    ] {
        let rows = table(header, 4.0, |_, t| {
            format!("{t:.4},{:.9},{:.9}", torque_factor * torque(t), angle_factor * reading(t))
        });
        let (path, out) = file("prefix.csv", &rows);
        let (_, recordings) = import(&path, &out, &["--counts-per-turn", "4096"]);
        holds(header, &recordings[0], 0.0, EXACT);
    }
    for (name, unit) in [("tau_m_Nm", "Nm"), ("tau_MNm", "mNm")] {
        let factor = if unit == "Nm" { 1.0 } else { 1e3 };
        let rows = table(&format!("t_s,{name},theta_rad"), 4.0, |_, t| {
            format!("{t:.4},{},{:.9}", factor * torque(t), reading(t))
        });
        let (path, out) = file("unsure.csv", &rows);
        let flag = format!("command={name}:{unit}");
        asked(&path, &out, &[], &[&format!("--column {flag}"), "may be in mNm or in"]);
        let (_, recordings) = import(&path, &out, &["--column", &flag, "--counts-per-turn", "4096"]);
        holds(name, &recordings[0], 0.0, EXACT);
    }
}

#[test]
fn each_column_holds_on_its_own_stamps_and_clock() {
    // Torque and position on rows of their own, half of the rows each, in ns since 1970.
    let sparse = table("__time,joint/position_rad,motor/torque_Nm", 6.0, |i, t| {
        let (has_position, has_torque) = (i % 3 != 1 || i == 0, i % 3 != 2 || i == 0);
        let stamp = 1_766_147_454_233_218_075_u64 + i as u64 * 2_000_000;
        let place = if has_position { format!("{:.6}", reading(t)) } else { String::new() };
        let u = if has_torque { format!("{:.6}", torque(t)) } else { String::new() };
        format!("{stamp},{place},{u}")
    });
    let channels = |offset: f64| {
        table("t1_ms;Torque (Nm);t2_ms;Angle (deg)", 6.0, move |_, t| {
            let later = t + offset;
            format!("{:.1};{:.6};{:.1};{:.4}", later * 1e3, torque(later), t * 1e3, reading(t).to_degrees())
        })
    };
    let scope = format!(
        "Name;bench3\nFile;bench3.svdx\nStarttime of export;133123456789012345;02.05.2022 13:56:24,376\n\nName;MAIN.fTorque;Name;MAIN.fActPos\nSymbolComment;;SymbolComment;\nData-Type;REAL64;Data-Type;REAL64\nSampleTime[ms];4;SampleTime[ms];2\nVariableSize;8;VariableSize;8\nUnit;Nm;Unit;°\n{}EOF\n",
        table("", 6.0, |i, t| {
            let slow = 2.0 * t;
            let of_torque = if slow < 6.0 {
                format!("{:.0};{:.6}", slow * 1e3, 0.5 * (torque(slow) + torque(slow + 0.002)))
            } else {
                ";".into()
            };
            format!("{of_torque};{};{:.4}", i * 2, reading(t).to_degrees()).replace('.', ",")
        })
    );
    for (name, content, options, close) in [
        ("sparse", sparse, &[][..], 0.004),
        ("alternating", channels(0.3), &[], 1e-6),
        (
            "scope",
            scope,
            &["--column", "command=MAIN.fTorque:Nm", "--column", "position=MAIN.fActPos:deg"],
            0.004,
        ),
    ] {
        let (path, out) = file(&format!("{name}.csv"), &content);
        let (said, recordings) = import(&path, &out, &[options, &["--counts-per-turn", "4096"]].concat());
        assert_eq!(recordings.len(), 1, "{name}: {said}");
        let begin = if name == "alternating" { 0.3 } else { 0.0 };
        holds(name, &recordings[0], begin, (PER_UNIT, 1.0, close));
    }
}

#[test]
fn clocks_that_nothing_pairs_are_asked() {
    let rows = table("t1,t2,tau_Nm,theta_rad", 6.0, |_, t| {
        format!("{:.4},{:.4},{:.6},{:.6}", t + 0.3, t, torque(t + 0.3), reading(t))
    });
    let (path, out) = file("clocks.csv", &rows);
    asked(
        &path,
        &out,
        &[],
        &["t1 and t2 are different clocks", "--clock command=t1 --clock position=t2", "--column time=t1"],
    );
    let options = ["--clock", "command=t1:s", "--clock", "position=t2:s", "--counts-per-turn", "4096"];
    let (_, recordings) = import(&path, &out, &options);
    holds("clocks", &recordings[0], 0.3, EXACT);
    let rows = table("t_s,pulse_ms,theta_rad", 4.0, |i, t| format!("{t:.4},{},{:.6}", i % 7, reading(t)));
    let (path, out) = file("pulse.csv", &rows);
    asked(&path, &out, &[], &["no column is known to be the command"]);
}

#[test]
fn a_column_of_something_else_is_not_taken() {
    let rows = table(
        "time_ms;input_voltage;control_mode;q_axis_current;temp_mos;encoder_position_deg",
        4.0,
        |i, t| {
            format!(
                "{:.1};{};3;{:.6};31;{:.5}",
                t * 1e3,
                24.0 + 0.01 * (i % 9) as f64,
                torque(t),
                reading(t).to_degrees()
            )
        },
    );
    let (path, out) = file("vesc.csv", &rows);
    let (said, recordings) = import(&path, &out, &["--counts-per-turn", "4096"]);
    assert!(said.contains("command is q_axis_current"), "{said}");
    holds("vesc", &recordings[0], 0.0, EXACT);

    let header =
        "time,q_shoulder_rad,q_elbow_rad,goal_elbow_rad,goal_shoulder_rad,tau_elbow_Nm,tau_shoulder_Nm";
    let rows = table(header, 4.0, |_, t| {
        format!("{t:.4},{:.6},{:.6},7,{:.6},9,{:.6}", reading(t), 2.0 - t, motion(t, 0), torque(t))
    });
    let (path, out) = file("joints.csv", &rows);
    asked(
        &path,
        &out,
        &[],
        &[
            "q_shoulder_rad and q_elbow_rad could both be the position; say which with --column position=q_shoulder_rad",
        ],
    );
    let (said, recordings) =
        import(&path, &out, &["--column", "position=q_shoulder_rad", "--counts-per-turn", "4096"]);
    assert!(said.contains("reference is goal_shoulder_rad"), "{said}");
    holds("joints", &recordings[0], 0.0, EXACT);
    let rows = rows.replacen("tau_shoulder", "tau_wrist", 1);
    let (path, out) = file("other.csv", &rows);
    asked(&path, &out, &["--column", "position=q_shoulder_rad"], &["no column is known to be the command"]);

    let rows = table("", 4.0, |i, t| {
        format!(
            "1700000{:03},{},base_link,shoulder,elbow,{:.6},-1.6,{:.6},0.1",
            i / 500,
            i % 500 * 2_000_000,
            reading(t),
            torque(t)
        )
    });
    let (path, out) = file("echo.csv", &rows);
    let options = ["--column", "position=6:rad", "--column", "command=8:Nm", "--counts-per-turn", "4096"];
    let (said, recordings) = import(&path, &out, &options);
    assert!(said.contains("column1 and column2 together"), "{said}");
    holds("echo", &recordings[0], 0.0, EXACT);
}

#[test]
fn bad_readings_are_named_and_left_out_or_cut() {
    let bad = |of: &dyn Fn(usize, f64) -> f64| {
        table("t_s,tau_Nm,theta_rad", 8.0, |i, t| format!("{t:.4},{:.6},{:.6}", torque(t), of(i, t)))
    };
    let far = |t: f64| reading(t) + 3.3 - 3.3 % (1.0 / PER_UNIT);
    let options = ["--counts-per-turn", "4096"];
    for (name, content, words, begins) in [
        (
            "zero",
            bad(&|i, t| if i == 3333 { 0.0 } else { far(t) }),
            "1 rows whose position jumps away and back",
            &[0.0][..],
        ),
        (
            "small",
            bad(&|i, t| far(t) + if i == 1000 { 0.2 } else { 0.0 }),
            "1 rows whose position jumps",
            &[0.0],
        ),
        (
            "dropout",
            bad(&|i, t| if (2000..2006).contains(&i) { -1.0 } else { far(t) }),
            "6 rows whose position jumps",
            &[0.0],
        ),
        (
            "sentinel",
            bad(&|i, t| if i % 500 == 7 { 9999.0 } else { far(t) }),
            "8 rows whose position is 9.999e3",
            &[0.0],
        ),
        (
            "reset",
            bad(&|i, t| if i < 2000 { far(t) } else { far(t) - far(4.0) }),
            "the position begins again at",
            &[0.0, 4.0],
        ),
    ] {
        let (path, out) = file(&format!("{name}.csv"), &content);
        let (said, recordings) = import(&path, &out, &options);
        assert!(said.contains(words), "{name}: {said}");
        assert_eq!(recordings.len(), begins.len(), "{name}: {said}");
        for (recording, begin) in recordings.iter().zip(begins) {
            holds(name, recording, *begin, (PER_UNIT, 1.0, 1e-3));
        }
    }
    let spike = table("t_s,tau_Nm,theta_rad", 4.0, |i, t| {
        format!("{t:.4},{:.6},{:.6}", if i == 900 { 73.2 } else { torque(t) }, reading(t))
    });
    let (path, out) = file("spike.csv", &spike);
    let (said, recordings) = import(&path, &out, &options);
    assert!(said.contains("1 rows whose command is far from all others"), "{said}");
    holds("spike", &recordings[0], 0.0, (PER_UNIT, 1.0, 1e-4));
    let two = bad(&|i, t| if i % 2 == 0 { far(t) } else { 0.2 * reading(t) });
    let (path, out) = file("two.csv", &two);
    asked(&path, &out, &[], &["alternates between axes", "--rows 1/2"]);
    let (_, recordings) = import(&path, &out, &[&options[..], &["--rows", "1/2"]].concat());
    holds("two", &recordings[0], 0.0, (PER_UNIT, 1.0, 0.01));
    let uneven =
        bad(&|i, t| if (i as f64 * 12.9898).sin().fract().abs() < 0.5 { far(t) } else { 0.2 * reading(t) });
    let (path, out) = file("uneven.csv", &uneven);
    asked(&path, &out, &[], &["alternates between"]);
}

#[test]
fn positions_that_wrap_at_any_range_are_made_continuous() {
    for modulus in [2.5, TAU, 25.0 / 12.0] {
        let rows = table("t_s,tau_Nm,position_rad", 8.0, |_, t| {
            format!("{t:.4},{:.6},{:.6}", torque(t), (3.0 * reading(t)).rem_euclid(modulus) - modulus / 2.0)
        });
        let (path, out) = file("wraps.csv", &rows);
        let (said, recordings) = import(&path, &out, &["--counts-per-unit", "1e6"]);
        assert!(said.contains("made continuous"), "{said}");
        holds("wraps", &recordings[0], 0.0, (3e6, 1.0, 1e-6));
    }
}

#[test]
fn a_missing_command_cuts_and_registers_are_asked() {
    let rows = table("t_s,tau_Nm,theta_rad", 12.0, |i, t| {
        let u = if (2000..4000).contains(&i) { String::new() } else { format!("{:.6}", torque(t)) };
        format!("{t:.4},{u},{:.6}", reading(t))
    });
    let (path, out) = file("missing.csv", &rows);
    let (said, recordings) = import(&path, &out, &["--counts-per-turn", "4096"]);
    assert!(said.contains("there is no command for long"), "{said}");
    assert_eq!(recordings.len(), 2, "{said}");
    holds("before", &recordings[0], 0.0, (PER_UNIT, 1.0, 1e-4));
    holds("after", &recordings[1], 8.0, (PER_UNIT, 1.0, 1e-4));

    let step = 2e-4;
    for (encoding, raw) in [
        ("int16", (|n| if n < 0.0 { n + 65_536.0 } else { n }) as fn(f64) -> f64),
        ("sign10", |n| if n < 0.0 { 1_024.0 - n } else { n }),
        ("sign11", |n| if n < 0.0 { 2_048.0 - n } else { n }),
        ("sign15", |n| if n < 0.0 { 32_768.0 - n } else { n }),
    ] {
        let rows = table("t_s,present_current,theta_rad", 6.0, |_, t| {
            format!("{t:.4},{},{:.6}", raw((torque(t) / step).round()), reading(t))
        });
        let (path, out) = file(&format!("{encoding}.csv"), &rows);
        asked(
            &path,
            &out,
            &[],
            &["present_current", &format!("--encoding command={encoding}"), "--encoding command=plain"],
        );
        let flag = format!("command={encoding}");
        let (_, recordings) = import(&path, &out, &["--encoding", &flag, "--counts-per-turn", "4096"]);
        holds(encoding, &recordings[0], 0.0, (PER_UNIT, step, step));
    }
}

#[test]
fn points_and_commas_in_one_file_are_asked() {
    let thousands = |n: f64| {
        let n = n.round() as i64;
        format!("{},{:03}", n / 1000, n % 1000)
    };
    let rows = table("Time (ms);Torque (Nm);Encoder (counts)", 4.0, |_, t| {
        format!("{:.1};{:.6};{}", t * 1e3, torque(t), thousands(motion(t, 0) * 1e4 + 5e4))
    });
    let (path, out) = file("thousands.csv", &rows);
    asked(&path, &out, &[], &["--decimal point", "--decimal comma"]);
    let (_, recordings) = import(&path, &out, &["--decimal", "point", "--counts-per-unit", "10000"]);
    holds("thousands", &recordings[0], 0.0, (1e4, 1.0, 1e-6));
    let rows = table("Time (ms);Torque (Nm);Angle (rad)", 4.0, |_, t| {
        format!("{:.1};{:.6};{}", t * 1e3, torque(t), format!("{:.6}", reading(t)).replace('.', ","))
    });
    let (path, out) = file("mixed.csv", &rows);
    asked(&path, &out, &[], &["points and commas in its numbers", "--decimal both"]);
    let (_, recordings) = import(&path, &out, &["--decimal", "both", "--counts-per-turn", "4096"]);
    holds("mixed", &recordings[0], 0.0, EXACT);
}

#[test]
fn a_position_loop_and_an_enable_column_have_a_way_in() {
    let stiffness = 6.0;
    let rows = table("time,target_rad,position_rad", 4.0, |_, t| {
        format!("{t:.4},{:.6},{:.6}", motion(t, 0) + torque(t) / stiffness, motion(t, 0))
    });
    let (path, out) = file("loop.csv", &rows);
    asked(&path, &out, &[], &["--error-as-command", "reference − position"]);
    asked(
        &path,
        &out,
        &["--column", "command=target_rad"],
        &["target_rad seems to be a position", "--error-as-command"],
    );
    asked(
        &path,
        &out,
        &["--column", "command=target_rad:rad"],
        &["a command is not measured in rad", "--error-as-command"],
    );
    let (_, recordings) = import(&path, &out, &["--error-as-command", "--counts-per-unit", "1e6"]);
    holds("loop", &recordings[0], 0.0, (1e6, stiffness, 1e-5));
    let rig = std::fs::read_to_string(out.join("rig.toml")).expect("written");
    assert!(rig.contains("command_unit = \"rad\"") && rig.contains("gain = nan"), "{rig}");

    let (path, out) = file("target.csv", &rows.replacen("target_rad", "cmd", 1));
    asked(&path, &out, &[], &["cmd follows the position", "--column reference=cmd --error-as-command"]);
    import(&path, &out, &["--column", "reference=cmd", "--error-as-command"]);

    let rows = table("timestamp,command_Nm,position_rad,torque_enable", 9.0, |i, t| {
        let on = i / 1500 != 1;
        format!("{t:.4},{:.6},{:.6},{}", if on { torque(t) } else { 6.0 }, reading(t), i32::from(on))
    });
    let (path, out) = file("enable.csv", &rows);
    let (said, recordings) = import(&path, &out, &["--counts-per-turn", "4096"]);
    assert!(said.contains("1500 rows with the drive off left out"), "{said}");
    assert_eq!(recordings.len(), 2, "{said}");
    holds("first", &recordings[0], 0.0, EXACT);
    holds("second", &recordings[1], 6.0, EXACT);
}

#[test]
fn stamps_of_other_programs_are_read_or_named() {
    let clock = |t: f64, point: char| {
        format!("{:02}{point}{:03}", 25 + t as usize, (t.fract() * 1e3).round() as usize)
    };
    let german = table("Zeit;Moment (Nm);Winkel (°)", 4.0, |_, t| {
        format!("01.02.2026 10:30:{};{:.6};{:.4}", clock(t, ','), torque(t), reading(t).to_degrees())
            .replace('.', ",")
            .replacen("01,02,2026", "01.02.2026", 1)
    });
    let logging = table("asctime,tau_Nm,theta_rad", 4.0, |_, t| {
        format!("2026-02-01 10:30:{},{:.6},{:.6}", clock(t, ','), torque(t), reading(t))
    });
    let half_day = table("Time,tau_Nm,theta_rad", 4.0, |_, t| {
        format!("2/1/2026 10:30:{} PM,{:.6},{:.6}", clock(t, '.'), torque(t), reading(t))
    });
    let days = table("Time,tau_Nm,theta_rad", 4.0, |_, t| {
        format!("{:.12},{:.6},{:.6}", 46_054.25 + t / 86_400.0, torque(t), reading(t))
    });
    let parts = table("stamp_sec,stamp_nanosec,tau_Nm,theta_rad", 4.0, |_, t| {
        let ns = 1_769_941_800_300_000_000_u64 + (t * 1e9).round() as u64;
        format!("{},{},{:.6},{:.6}", ns / 1_000_000_000, ns % 1_000_000_000, torque(t), reading(t))
    });
    for (name, content) in
        [("german", german), ("logging", logging), ("half day", half_day), ("days", days), ("parts", parts)]
    {
        let (path, out) = file(&format!("{name}.csv"), &content);
        let (said, recordings) = import(&path, &out, &["--counts-per-turn", "4096"]);
        assert_eq!((recordings.len(), recordings[0].len()), (1, 2000), "{name}: {said}");
        holds(name, &recordings[0], 0.0, EXACT);
    }
    let single = table("time,tau_Nm,theta_rad", 4.0, |_, t| {
        format!("{},{:.6},{:.6}", 1_769_941_800.0_f32 + t as f32, torque(t), reading(t))
    });
    let (path, out) = file("single.csv", &single);
    asked(&path, &out, &[], &["single precision", "--column time=none --rate HZ"]);
    let (_, recordings) =
        import(&path, &out, &["--column", "time=none", "--rate", "500", "--counts-per-turn", "4096"]);
    holds("single", &recordings[0], 0.0, EXACT);
    let wrong = table("time_s,tau_Nm,theta_rad", 4.0, |_, t| {
        format!("{:.1},{:.6},{:.6}", t * 1e3, torque(t), reading(t))
    });
    let (path, out) = file("milliseconds.csv", &wrong);
    asked(&path, &out, &[], &["--column time=time_s:ms"]);
    let (_, recordings) = import(&path, &out, &["--column", "time=time_s:ms", "--counts-per-turn", "4096"]);
    holds("milliseconds", &recordings[0], 0.0, EXACT);
    let strange =
        table("time,tau_Nm,theta_rad", 4.0, |i, t| format!("tick {i},{:.6},{:.6}", torque(t), reading(t)));
    let (path, out) = file("strange.csv", &strange);
    asked(&path, &out, &[], &["\"tick 0\" in line 2"]);
}
