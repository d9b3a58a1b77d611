use super::*;

/// To and fro over 4 mm at each speed, mm/s; rows of a millisecond.
fn to_and_fro(speeds: &[f64]) -> Vec<Moment> {
    let mut rows = Vec::new();
    let mut row = |depth_mm: f64| {
        rows.push(Moment { time_s: rows.len() as f64 * 1e-3, depth_mm, angle_deg: 90.0, force_n: 0.0 });
    };
    for speed in speeds {
        let steps = (4000.0 / speed) as usize;
        (0..steps).for_each(|n| row(8.0 + n as f64 * speed * 1e-3));
        (0..steps).for_each(|n| row(12.0 - n as f64 * speed * 1e-3));
    }
    rows
}

#[test]
fn ways_end_where_the_needle_turns() {
    let rows = to_and_fro(&[2.0, 10.0]);
    let ways = ways(&rows);
    let speeds: Vec<f64> = ways.iter().map(|way| speed(&rows[way.0..=way.1])).collect();
    assert_eq!(ways.len(), 4, "{ways:?}");
    for (found, wanted) in speeds.iter().zip([2.0, 2.0, 10.0, 10.0]) {
        assert!((found / wanted - 1.0).abs() < 0.01, "{speeds:?}");
    }
}

/// By the closed form: a needle that slides at v has bristles bent to g(v).
#[test]
fn a_sliding_needle_is_held_by_g() {
    let friction = Lugre {
        stiffness_n_per_mm: 2.0,
        sliding_n: 0.3,
        sticking_n: 0.5,
        stribeck_mm_s: 4.0,
        damping_n_s_per_mm: 0.0,
        viscous_n_s_per_mm: 0.01,
        zero_n: 0.1,
    };
    for speed in [1.0, 4.0, 12.0] {
        let rows = to_and_fro(&[speed]);
        let forces = friction.forces(&Motion::of(&rows));
        let last_of_the_way_in = forces[rows.len() / 2 - 20];
        let wanted = 0.1 + 0.3 + 0.2 * (-(speed / 4.0_f64).powi(2)).exp() + 0.01 * speed;
        assert!((last_of_the_way_in - wanted).abs() < 2e-3, "{last_of_the_way_in} N, not {wanted} N");
    }
}

/// A file of these rows under a force of their direction, N.
fn file(name: &str, rows: &[Moment], force: impl Fn(f64) -> f64) -> std::path::PathBuf {
    let speeds = Motion::of(rows).speeds_mm_s;
    let lines = rows
        .iter()
        .zip(speeds)
        .map(|(row, speed)| format!("{:.4},{:.5},{:.5}\n", row.time_s, row.depth_mm, force(speed.signum())));
    let path = std::env::temp_dir().join(format!("friction-{}-{name}.csv", std::process::id()));
    std::fs::write(&path, format!("time_s,depth_mm,force_n\n{}", lines.collect::<String>())).expect("a file");
    path
}

#[test]
fn what_tells_no_friction_is_refused() {
    let speeds = [1.0, 10.0, 3.0];
    for (name, speeds, force, why) in [
        ("turns", &speeds[..2], 0.3, "turns round 3 times"),
        ("alike", &[3.0, 4.0, 3.0][..], 0.3, "record slow and fast ones"),
        ("none", &speeds[..], 0.0, "not that of friction"),
        ("in-mn", &speeds[..], 300.0, "divide it by 1000"),
    ] {
        let path = file(name, &to_and_fro(speeds), |direction| force * direction);
        let said = fit(&path).expect_err(why).to_string();
        assert!(said.contains(why) && said.contains("friction-"), "{said}");
        std::fs::remove_file(path).expect("it is there");
    }
}
