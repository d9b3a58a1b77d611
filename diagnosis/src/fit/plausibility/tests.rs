use super::*;

const RIG: &str = "format = 1\nkind = \"rotary\"\n[model]\ninertia = 2.0e-3\nviscous = 2.0e-3\n[actuator]\ngain = 1.0\n\
                   command_unit = \"N·m\"\n[encoder]\ncounts_per_unit = 1.0e5\n";

/// A swing from 2 rad that dies out, and the torque that it takes against a spring of
/// `stiffness` N·m/rad.
fn swing(stiffness: f64) -> Recording {
    let mut out = Recording { file: "fit.csv".into(), ..Recording::default() };
    for row in 0..8000 {
        let t = f64::from(row) * 1e-3;
        let (height, (sine, cosine)) = (2.0 * (-0.3 * t).exp(), (3.0 * t).sin_cos());
        let (fast_sine, fast_cosine) = (11.0 * t).sin_cos();
        let position = height * cosine + 0.03 * fast_sine;
        let velocity = -height * (0.3 * cosine + 3.0 * sine) + 0.33 * fast_cosine;
        let acceleration = height * (1.8 * sine - 8.91 * cosine) - 3.63 * fast_sine;
        out.time_s.push(t);
        out.position_counts.push((position * 1e5).floor());
        out.command.push(2.0e-3 * acceleration + 2.0e-3 * velocity + stiffness * position);
    }
    out
}

#[test]
fn a_measured_external_force_is_no_other_unit() {
    let rig = Rig::parse(RIG, "rig.toml").expect("the rig is right");
    let (usual, mut pushed) = (swing(0.0), swing(0.0));
    // A tenth of the force by the drive, the rest by whoever pushes.
    let pushes: Vec<f64> = pushed.command.iter().map(|u| 0.9 * u).collect();
    pushed.command.iter_mut().for_each(|u| *u *= 0.1);
    let all = [&usual, &usual, &pushed];
    assert_eq!(odd_one(&all, &rig).map(|(place, _)| place), Some(2), "nothing is known of a push");
    let measured = Recording { force: Some(pushes), ..pushed.clone() };
    assert_eq!(odd_one(&[&usual, &usual, &measured], &rig), None);
}

#[test]
fn a_spring_that_gives_energy_back_is_no_turned_sign() {
    let rig = Rig::parse(RIG, "rig.toml").expect("the rig is right");
    assert_eq!(mistake(&swing(0.5), &rig), None);
    let mut turned = swing(0.0);
    turned.command.iter_mut().for_each(|u| *u = -*u);
    let sentence = mistake(&turned, &rig).expect("its sign is wrong");
    assert!(sentence.contains("a sign is wrong"), "{sentence}");
}

#[test]
fn a_spring_beside_a_steady_pull_is_no_turned_sign() {
    let rig = RIG.replace("2.0e-3\nviscous = 2.0e-3", "2.5e-4").replace("1.0e5", "1303.8");
    let rig = Rig::parse(&rig, "rig.toml").expect("the rig is right");
    // It stops and comes back, more slowly for its friction, against a spring that takes nearly all
    // of the force.
    let mut pulled = Recording { file: "fit.csv".into(), ..Recording::default() };
    for row in 0..1300 {
        let since = f64::from(row) / 1300.0 - 0.62;
        let pull = if since < 0.0 { 261.0 } else { 152.0 };
        let position = -0.5 * pull * (1.0 + 0.3 * since) * since * since;
        pulled.time_s.push(since + 0.62);
        pulled.position_counts.push((position * 1303.8).floor());
        pulled.command.push(2.5e-4 * -206.5 + 3.6e-3 * position);
    }
    assert_eq!(mistake(&pulled, &rig), None);
}

#[test]
fn an_angle_in_degrees_or_turns_is_a_wrong_unit() {
    let right = Rig::parse(RIG, "rig.toml").expect("the rig is right");
    let all = [swing(0.0), swing(0.0)];
    let all: Vec<&Recording> = all.iter().collect();
    assert_eq!(unit_of_angle(&all, &right), None);
    for (factor, wanted) in [
        (PI / 180.0, "multiply it by 57.2958"),
        (180.0 / PI, "divide it by 57.2958"),
        (TAU, "divide it by 6.28319"),
        (1.0 / TAU, "multiply it by 6.28319"),
    ] {
        let mut rig = right.clone();
        rig.encoder.counts_per_unit *= factor;
        let sentence = unit_of_angle(&all, &rig).expect(wanted);
        assert!(sentence.contains(wanted), "{sentence}");
        rig.uncertainty.inertia = Some(3.0);
        assert_eq!(unit_of_angle(&all, &rig), None, "nobody knows the inertia");
    }
    let mut heavier = right.clone();
    heavier.model.inertia *= 3.0;
    assert_eq!(unit_of_angle(&all, &heavier), None, "a wrong value is not a wrong unit");
    heavier.model.inertia = 5.0 * right.model.inertia;
    assert!(unit_of_angle(&all, &heavier).is_some(), "the rig excludes a fifth of its inertia");
    (heavier.uncertainty.inertia, heavier.uncertainty.gain) = (Some(0.5), Some(0.1));
    assert_eq!(unit_of_angle(&all, &heavier), None, "the rig allows for a fifth of its inertia");
}
