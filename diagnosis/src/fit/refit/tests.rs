use super::*;
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use std::sync::Arc;

/// Blocks of 2.5 ms on which an axis passes one count each and from 40 on, for five blocks,
/// none.
fn stopped_for_a_moment() -> BlockedRecording {
    let count = |row: i32| f64::from(if row <= 40 { row } else { (row - 5).max(40) });
    let recording = Recording {
        time_s: (0..101).map(|row| f64::from(row) * 2.5e-3).collect(),
        command: vec![0.0; 101],
        position_counts: (0..101).map(count).collect(),
        ..Recording::default()
    };
    BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.0))
}

#[test]
fn an_axis_rests_where_expected_counts_do_not_come() {
    let track = stopped_for_a_moment();
    let count = track.blocks.z[1] - track.blocks.z[0];
    let still_at = |counts_per_block: f64| {
        let v: Vec<f64> = track.blocks.span.iter().map(|h| counts_per_block * count / h).collect();
        still(&track, &v, count)
    };
    let resting = |at: &[bool]| (0..at.len()).filter(|j| at[*j]).collect::<Vec<_>>();
    assert_eq!(resting(&still_at(0.6)), [40, 41, 42, 43, 44, 45], "3.6 counts promised");
    assert!(resting(&still_at(0.2)).is_empty(), "1.2 counts are one more block's");
}

#[test]
fn a_reversal_that_is_driven_through_allows_any_force() {
    // Half a radian at 8 rad/s by the command that this takes, against a friction of a
    // thirtieth of it, and shaken by a force as large.
    let position = |row: f64| 500.0 * (row * 0.02).cos() + 3.0 * (row * 0.05).cos();
    let recording = Recording {
        time_s: (0..800).map(|row| f64::from(row) * 2.5e-3).collect(),
        command: (0..800).map(|row| -0.01 * 32.0 / 0.1 * (f64::from(row) * 0.02).cos()).collect(),
        position_counts: (0..800).map(|row| position(f64::from(row)).round()).collect(),
        ..Recording::default()
    };
    let rig = Rig::of_values(0.01, 0.0, 0.01);
    let mut tracks = [BlockedRecording::new(&recording, &rig)];
    let (_, fit) = settle(&mut Nominal::of(&rig), &mut tracks);
    assert!(fit.log_likelihood.is_finite());
    let motion = &tracks[0].motion;
    let turns: Vec<usize> =
        (4..motion.v.len() - 5).filter(|j| motion.v[*j] * motion.v[j + 1] < 0.0).collect();
    assert!(turns.len() >= 3, "{turns:?}");
    for turn in turns {
        assert!(!motion.rest[turn] && motion.any_force[turn], "block {turn}");
    }
}

#[test]
fn a_reversal_judges_where_more_is_left_than_it_hides() {
    let mut track = stopped_for_a_moment();
    Arc::make_mut(&mut track.blocks).stops_from = 0.5 * 10.0 * 2.5e-3;
    let noise = |slow: f64| Noise { sensor: 1.0, white: 0.0, slow, tau: 0.1, rest: 1.0, blur: 0.0 };
    let is_outweighed = |disturbance: f64| outweighs_reversals(&track, &noise(disturbance * disturbance));
    assert!(!is_outweighed(1.9) && is_outweighed(2.1), "a fifth of a friction of 10 rad/s²");
}

#[test]
fn an_axis_driven_through_a_reversal_does_not_rest_there() {
    let swept_at = |of: [f64; 8], by_friction: f64| {
        let swept = swept(&of, &[false; 8], 0.1, by_friction);
        (0..8).filter(|j| swept[*j]).collect::<Vec<_>>()
    };
    let driven = [-7.0, -5.0, -3.0, -1.0, 1.0, 3.0, 5.0, 7.0];
    assert_eq!(swept_at(driven, 0.1), [3, 4]);
    assert!(swept_at(driven, 0.0).is_empty(), "the rig does not know the friction");
    assert!(swept_at(driven, 0.3).is_empty(), "friction changes the speed by more than a tenth as much");
    assert!(
        swept_at([-7.0, -5.0, 3.0, -1.0, 1.0, 3.0, 5.0, 7.0], 1e-3).is_empty(),
        "it has just turned back"
    );
    assert!(
        swept_at([-3.0, -1.0, -0.2, 0.0, 0.0, 0.0, 0.2, 1.0], 1e-3).is_empty(),
        "it stops for three blocks"
    );
    assert!(swept_at([-0.7, -0.5, -0.3, -0.1, 0.1, 0.2, 0.3, 0.5], 1e-3).is_empty(), "too slow to be sure");
    let mut holds = [false; 8];
    holds[4] = true;
    assert!(!swept(&driven, &holds, 0.1, 0.1).contains(&true), "the encoder gives no count there");
}
