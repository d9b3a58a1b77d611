use super::*;
use crate::data::recording::Recording;
use crate::data::rig::Rig;
use crate::fit::filter::Noise;
use crate::fit::model::Model;
use crate::fit::nominal::Nominal;
use crate::laws::{Effect, EffectName};
use numerics::bootstrap::Random;

#[test]
fn two_parts_of_one_jump_agree_in_sign() {
    let (now, next) = ([1.0, -0.6, 0.1, 0.0, 0.0], [0.0, 1.0, -0.6, 0.1, 0.0]);
    let residual =
        |a: f64, b: f64| -> Vec<f64> { now.iter().zip(next).map(|(x, y)| a * x + b * y).collect() };
    let pair = |left: &[f64]| Pair::new(&now, &next, left);
    let half = pair(&residual(2.0, 2.0));
    let all: f64 = residual(2.0, 2.0).iter().map(|x| x * x).sum();
    assert!((half.size() - 4.0).abs() < 1e-9 && (half.gain - 0.5 * all).abs() < 1e-9);
    assert!((pair(&residual(1.0, 3.0)).later() - 0.75).abs() < 1e-9);
    let opposed = pair(&residual(3.0, -1.0));
    assert!(
        opposed.second == 0.0 && opposed.gain < 0.5 * residual(3.0, -1.0).iter().map(|x| x * x).sum::<f64>()
    );
    assert!(pair(&residual(0.0, 5.0)).second > 4.9);
}

const ROWS_PER_S: f64 = 5000.0;

/// An axis that turns without force, whose reading moves by `counts`: its recording in blocks, its
/// model, and a count in rad.
fn turning(mut counts: impl FnMut(f64) -> f64) -> ([BlockedRecording; 1], Nominal, f64) {
    let time_s: Vec<f64> = (0..10_000).map(|row| f64::from(row) / ROWS_PER_S).collect();
    let recording = Recording {
        command: vec![0.0; time_s.len()],
        position_counts: time_s.iter().map(|t| counts(*t).floor()).collect(),
        time_s,
        ..Recording::default()
    };
    let rig = Rig::of_values(0.01, 0.0, 0.0);
    let mut tracks = [BlockedRecording::new(&recording, &rig)];
    tracks[0].motion.v.fill(3.0);
    let nominal = Nominal { is_balanced: true, ..Nominal::of(&rig) };
    (tracks, nominal, 1.0 / rig.encoder.counts_per_unit)
}

/// Returns the counts found to be lost, and the blocks' starts, s, of an axis whose reading
/// moves by `counts`.
fn lost(counts: impl Fn(f64) -> f64, asked: JumpPrior) -> (Vec<f64>, Vec<f64>) {
    let (tracks, nominal, count) = turning(counts);
    let noise = Noise { sensor: 1.0, white: 1e-3, slow: 1e-9, tau: 0.1, rest: 1.0, blur: 0.0 };
    let fit = Fit::new(&Model::default(), &nominal, &tracks, &noise);
    let lost = find(&tracks[0], &fit, count, asked, None).lost;
    (lost.iter().map(|lost| lost / count).collect(), tracks[0].blocks.start.clone())
}

#[test]
fn lost_counts_are_found_with_their_moment_and_number() {
    let after = |at: f64, t: f64| f64::from(u8::from(t >= at));
    let reads = |t: f64| 3000.3 * t - 2.0 * after(0.6003, t) - after(1.2349, t);
    let (lost, start) = lost(reads, JumpPrior::UNKNOWN);
    let lost_at = |t: f64| lost[start.partition_point(|start| *start < t)];
    assert_eq!(lost_at(0.58), 0.0);
    assert!(
        (lost_at(0.62) + 2.0).abs() < 0.1 && (lost_at(1.26) + 3.0).abs() < 0.1,
        "{} {}",
        lost_at(0.62),
        lost_at(1.26)
    );
}

#[test]
fn a_single_loss_needs_other_losses_unlike_an_impact() {
    let once = |t: f64| 3000.3 * t - if t < 0.6 { 0.0 } else { 3.0 };
    let any = |lost: (Vec<f64>, Vec<f64>)| lost.0.iter().any(|lost| *lost != 0.0);
    assert!(!any(lost(once, JumpPrior::UNKNOWN)) && any(lost(once, JumpPrior::KNOWN)));
    let impact = |t: f64| 3000.3 * t - 60.0 * (t - 0.6).max(0.0);
    assert!(!any(lost(impact, JumpPrior::KNOWN)));
}

/// The price is what keeps a search of the very recording that is judged from gaining by
/// chance.
#[test]
fn jumps_that_chance_makes_cost_more_than_they_gain() {
    let any = JumpPrior { gain: 2.0, least: 0.0, fewest: 1 };
    let (mut gained, mut paid, mut jumps) = (0.0, 0.0, 0);
    for seed in 1..21 {
        let mut random = Random::new(seed);
        let mut chance = || (0..12).map(|_| random.below(1000) as f64 / 1000.0).sum::<f64>() - 6.0;
        let (mut tracks, nominal, count) = turning(|t| 3000.3 * t + 3.0 * chance());
        tracks[0].motion.rest.fill(false);
        let noise = Noise { sensor: 75.0, white: 1e-3, slow: 1e-9, tau: 0.1, rest: 1.0, blur: 0.0 };
        let fit = Fit::new(&Model::default(), &nominal, &tracks, &noise);
        let found = find(&tracks[0], &fit, count, any, Some(2.0 * count));
        jumps += found.sizes.len();
        paid += found.price.iter().sum::<f64>();
        (tracks[0].jumps.lost, tracks[0].jumps.price) = (found.lost, found.price);
        let effects = vec![Effect::shaped(EffectName::MissedCounts, &[])];
        let with = Fit::new(&Model { effects, ..Model::default() }, &nominal, &tracks, &noise);
        gained += with.log_likelihood - fit.log_likelihood;
    }
    assert!(jumps > 10, "chance makes only {jumps}");
    assert!(gained < 0.0 && gained + paid > 0.0, "{jumps} jumps pay {paid} nats and gain {gained} by it");
}

#[test]
fn jumps_just_after_the_command_has_changed_are_no_lost_counts() {
    let rows = 10_000;
    let time_s: Vec<f64> = (0..rows).map(|row| f64::from(row) / ROWS_PER_S).collect();
    let recording = Recording {
        command: time_s.iter().map(|t| if (t / 0.1) as i32 % 2 == 0 { 1.0 } else { -1.0 }).collect(),
        position_counts: vec![0.0; time_s.len()],
        time_s,
        ..Recording::default()
    };
    let mut track = BlockedRecording::new(&recording, &Rig::of_values(0.01, 0.0, 0.0));
    track.motion.rest.fill(false);
    let noise = Noise { sensor: 1.0, white: 1e-3, slow: 1e-9, tau: 0.1, rest: 1.0, blur: 0.0 };
    let gains = Gains::new(&track.observed(), &noise);
    let jump_at = |time: f64| {
        let block = track.blocks.start.partition_point(|start| *start < time);
        Jump::new(&track, &gains, block, 0.0)
    };
    let switched: Vec<Jump> = (1..12).map(|i| jump_at(0.1 * f64::from(i) + 0.006)).collect();
    assert!(follows_command(&track, &switched));
    let anywhere: Vec<Jump> = (1..12).map(|i| jump_at(0.137 * f64::from(i) + 0.02)).collect();
    assert!(!follows_command(&track, &anywhere));
}
