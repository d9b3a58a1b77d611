//! A plain regression of what a model leaves on what was recorded: speed, its sign, travel, angle,
//! and the command a little earlier. A mismatch is called random only where none of them predicts
//! it on recordings that it was not fitted to.

use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::force_residual::Estimator;
use crate::thresholds::SURE_Z;
use crate::validation::residuals::{Residuals, relative_gain};
use numerics::linear::{Factor, Square};
use std::f64::consts::TAU;

/// Part of the residual's mean square that a regression must predict on held-out recordings.
const PREDICTS: f64 = 0.1;
/// Delays of the command that are tried, s.
const DELAYS_S: [f64; 6] = [0.002, 0.005, 0.01, 0.02, 0.04, 0.08];
/// Factor between the sizes of a delay by the recorded command and by the one that the motion asks
/// for.
const SAME_SIZE: f64 = 2.0;
/// Orders of a turn that are tried together.
const ORDERS: u32 = 24;

/// Recordings with what a model leaves on them and the drive's force, per block.
pub(crate) struct Left<'a> {
    tracks: &'a [BlockedRecording],
    residual: &'a [Vec<f64>],
    force: &'a [Vec<f64>],
    moving: Vec<Vec<bool>>,
}

impl<'a> Left<'a> {
    /// The residual of the patched model.
    pub(crate) fn new(tracks: &'a [BlockedRecording], of: &'a Residuals, estimator: &Estimator) -> Self {
        let moving = tracks.iter().map(|track| estimator.moving(track)).collect();
        Self { tracks, residual: &of.patched, force: &of.force, moving }
    }
}

/// Columns of a regression: per recording, per column, per block.
type Columns = Vec<Vec<Vec<f64>>>;

/// Returns the best predictor of the residual on the held-out recordings, as a noun phrase, and the
/// share that it predicts; none if nothing does. `turn` is the travel of one turn, rad or m, where
/// the axis has turns.
pub(crate) fn follows(
    fit: &Left,
    holdout: &Left,
    estimator: &Estimator,
    turn: Option<f64>,
) -> Option<(&'static str, f64)> {
    let predicted = |columns: &dyn Fn(&Left) -> Columns, is_possible: &dyn Fn(&[f64]) -> bool| {
        let theta = solve(fit, &columns(fit))?;
        is_possible(&theta).then(|| gain(holdout, &columns(holdout), &theta, estimator)).flatten()
    };
    // A disturbance that accelerates the axis goes along with its speed, and friction against it.
    let against = |theta: &[f64]| theta[0] < 0.0;
    let any = |_: &[f64]| true;
    let all = [
        (
            "a force against the motion in proportion to speed, as viscous friction is,",
            predicted(&|left| of_motion(left, &|track, j| vec![track.motion.v[j]]), &against),
        ),
        (
            "a force against the motion of one size, as dry friction is,",
            predicted(&|left| of_motion(left, &|track, j| vec![track.motion.v[j].signum()]), &against),
        ),
        (
            "a force along the travel",
            predicted(
                &|left| of_motion(left, &|track, j| vec![track.motion.x[j], track.motion.x[j].powi(2)]),
                &any,
            ),
        ),
        (
            "a force over the angle of the turn",
            turn.and_then(|turn| {
                predicted(&|left| of_motion(left, &|track, j| waves(track.motion.x[j] / turn)), &any)
            }),
        ),
    ];
    let delayed =
        delay(fit, holdout, estimator).map(|part| ("a command that acts later than it is recorded", part));
    let all = all.into_iter().filter_map(|(what, part)| Some((what, part?))).chain(delayed);
    let together = || Some(("speed, travel and angle together", together(fit, holdout, estimator, turn)?));
    all.max_by(|a, b| a.1.total_cmp(&b.1)).or_else(together)
}

/// The part that forces against the motion, along the travel and over the turn predict together,
/// where none does alone.
fn together(fit: &Left, holdout: &Left, estimator: &Estimator, turn: Option<f64>) -> Option<f64> {
    let columns = |left: &Left, against: [bool; 2]| {
        of_motion(left, &|track, j| {
            let (x, v) = (track.motion.x[j], track.motion.v[j]);
            let of_speed = [v, v.signum()].into_iter().zip(against).filter(|(_, is_in)| *is_in);
            let of_turn = turn.map_or_else(Vec::new, |turn| waves(x / turn));
            of_speed.map(|(column, _)| column).chain([x, x * x]).chain(of_turn).collect()
        })
    };
    // As alone: only a force against the motion counts.
    let mut against = [true; 2];
    let first = solve(fit, &columns(fit, against))?;
    against = [first[0] < 0.0, first[1] < 0.0];
    let theta = solve(fit, &columns(fit, against))?;
    let friction = against.iter().filter(|is_in| **is_in).count();
    if theta[..friction].iter().any(|x| *x > 0.0) {
        return None;
    }
    gain(holdout, &columns(holdout, against), &theta, estimator)
}

/// Cosine and sine of the first orders of a turn, at a place in turns.
fn waves(turns: f64) -> Vec<f64> {
    (1..=ORDERS)
        .flat_map(|order| [(TAU * f64::from(order) * turns).cos(), (TAU * f64::from(order) * turns).sin()])
        .collect()
}

/// Columns of the motion, block by block.
fn of_motion(left: &Left, of: &dyn Fn(&BlockedRecording, usize) -> Vec<f64>) -> Columns {
    let one = |track: &BlockedRecording| {
        let rows: Vec<Vec<f64>> = (0..track.block_count()).map(|j| of(track, j)).collect();
        let count = rows.first().map_or(0, Vec::len);
        (0..count).map(|k| rows.iter().map(|row| row[k]).collect()).collect()
    };
    left.tracks.iter().map(one).collect()
}

/// The part that the best delay of the command predicts. Under feedback the command follows the
/// disturbance, and without it the motion does: only what both the recorded command and the one
/// that the motion asks for show is a delay.
fn delay(fit: &Left, holdout: &Left, estimator: &Estimator) -> Option<f64> {
    let later = |left: &Left, seconds: f64| -> Columns {
        shifted(left, seconds, |force, _, j, by| force[j.saturating_sub(by)] - force[j])
    };
    let asked = |left: &Left, seconds: f64| -> Columns {
        shifted(left, seconds, |force, residual, j, by| {
            let at = |j: usize| force[j] + residual[j];
            at(j) - at((j + by).min(force.len() - 1))
        })
    };
    let of = |seconds: f64| {
        let (by_command, by_motion) = (solve(fit, &later(fit, seconds))?, solve(fit, &asked(fit, seconds))?);
        let ratio = by_command[0] / by_motion[0];
        if !(ratio > 1.0 / SAME_SIZE && ratio < SAME_SIZE && by_command[0] > 0.0) {
            return None;
        }
        let command = gain(holdout, &later(holdout, seconds), &by_command, estimator)?;
        let motion = gain(holdout, &asked(holdout, seconds), &by_motion, estimator)?;
        Some(command.min(motion))
    };
    DELAYS_S.into_iter().filter_map(of).max_by(f64::total_cmp)
}

fn shifted(left: &Left, seconds: f64, of: impl Fn(&[f64], &[f64], usize, usize) -> f64) -> Columns {
    let all = left.tracks.iter().zip(left.force).zip(left.residual);
    all.map(|((track, force), residual)| {
        let by = (seconds * track.block_rate()).round().max(1.0) as usize;
        vec![(0..force.len()).map(|j| of(force, residual, j, by)).collect()]
    })
    .collect()
}

/// A column less its mean over the rows that move: each recording has an offset of its own.
fn centred(column: &[f64], moving: &[bool]) -> Vec<f64> {
    let (sum, n) = column
        .iter()
        .zip(moving)
        .filter(|(_, moves)| **moves)
        .fold((0.0, 0.0), |(sum, n), (x, _)| (sum + x, n + 1.0));
    let mean = if n > 0.0 { sum / n } else { 0.0 };
    column.iter().map(|x| x - mean).collect()
}

/// Least squares of the residual on the columns, over all recordings; none where the columns do not
/// change.
fn solve(left: &Left, columns: &Columns) -> Option<Vec<f64>> {
    let count = columns.first()?.len();
    let (mut information, mut score) = (Square::zero(count), vec![0.0; count]);
    for ((columns, residual), moving) in columns.iter().zip(left.residual).zip(&left.moving) {
        let columns: Vec<Vec<f64>> = columns.iter().map(|column| centred(column, moving)).collect();
        let residual = centred(residual, moving);
        for j in (0..residual.len()).filter(|j| moving[*j]) {
            for i in 0..count {
                score[i] += columns[i][j] * residual[j];
                for k in 0..count {
                    information.add(i, k, columns[i][j] * columns[k][j]);
                }
            }
        }
    }
    let theta = Factor::new(&information).solve(&score);
    (theta.iter().all(|x| x.is_finite()) && theta.iter().any(|x| *x != 0.0)).then_some(theta)
}

/// Part of the residual's mean square that coefficients predict; none where that is not sure or is
/// little.
fn gain(left: &Left, columns: &Columns, theta: &[f64], estimator: &Estimator) -> Option<f64> {
    let (mut before, mut after) = (Vec::new(), Vec::new());
    for ((columns, residual), moving) in columns.iter().zip(left.residual).zip(&left.moving) {
        let residual = centred(residual, moving);
        let columns: Vec<Vec<f64>> = columns.iter().map(|column| centred(column, moving)).collect();
        let predicted = |j: usize| columns.iter().zip(theta).map(|(column, x)| x * column[j]).sum::<f64>();
        after.push((0..residual.len()).map(|j| residual[j] - predicted(j)).collect());
        before.push(residual);
    }
    let gain = relative_gain(estimator, left.tracks, &before, &after);
    (gain.sum >= PREDICTS && gain.low > 0.0 && gain.z >= SURE_Z).then_some(gain.sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::io::recording::Recording;
    use crate::io::rig::Rig;

    const ESTIMATOR: Estimator = Estimator { bandwidth_hz: 20.0 };
    const TURN: f64 = 0.5;

    /// An axis that swings over a few turns of [`TURN`]; its rows begin `from` s into the swing.
    fn track(from: f64) -> BlockedRecording {
        let time_s: Vec<f64> = (0..8000).map(|row| f64::from(row) * 1e-3).collect();
        let angle = |t: f64| 0.9 * (1.3 * t).sin() + 0.4 * (3.1 * t).sin();
        let speed = |t: f64| 1.17 * (1.3 * t).cos() + 1.24 * (3.1 * t).cos();
        let recording = Recording {
            command: time_s.iter().map(|t| (4.0 * (t + from)).sin()).collect(),
            position_counts: time_s.iter().map(|t| (1e5 * angle(t + from)).round()).collect(),
            time_s,
            ..Recording::default()
        };
        let mut rig = Rig::of_values(0.01, 0.0, 0.0);
        rig.encoder.counts_per_unit = 1e5;
        let mut track = BlockedRecording::new(&recording, &rig);
        let at: Vec<f64> = track.blocks.start.iter().map(|start| start + from).collect();
        track.motion.v = at.iter().map(|t| speed(*t)).collect();
        track.motion.x = at.iter().map(|t| angle(*t)).collect();
        track
    }

    /// The predictor that is found where a model leaves `rest` of a track at a block and noise of a
    /// unit, under a drive's force of `force`.
    fn found(
        rest: &dyn Fn(&BlockedRecording, usize) -> f64,
        force: &dyn Fn(&BlockedRecording, usize) -> f64,
    ) -> Option<&'static str> {
        let mut random = 7_u64;
        let mut noise = move || {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (random >> 11) as f64 / (1_u64 << 53) as f64 * 3.46 - 1.73
        };
        let tracks = [track(0.0), track(11.0)];
        let mut of = |track: &BlockedRecording| Residuals {
            force: vec![(0..track.block_count()).map(|j| force(track, j)).collect()],
            nominal: Vec::new(),
            refit: Vec::new(),
            patched: vec![(0..track.block_count()).map(|j| rest(track, j) + noise()).collect()],
        };
        let all = tracks.each_ref().map(&mut of);
        let left = |i: usize| Left::new(&tracks[i..=i], &all[i], &ESTIMATOR);
        follows(&left(0), &left(1), &ESTIMATOR, Some(TURN)).map(|(what, _)| what)
    }

    fn no_force(_: &BlockedRecording, _: usize) -> f64 {
        0.0
    }

    #[test]
    fn noise_follows_nothing() {
        assert_eq!(found(&no_force, &no_force), None);
    }

    #[test]
    fn a_residual_of_speed_place_or_angle_does_not_pass_for_random() {
        let found = |rest| found(rest, &no_force);
        let size = |what: Option<&'static str>, word: &str| {
            assert!(what.is_some_and(|what| what.contains(word)), "{word}: {what:?}")
        };
        size(found(&|track, j| -2.0 * track.motion.v[j].signum()), "dry friction");
        size(found(&|track, j| -1.5 * track.motion.v[j]), "viscous friction");
        size(found(&|track, j| 3.0 * track.motion.x[j]), "along the travel");
        size(found(&|track, j| 2.0 * (TAU * 2.0 * track.motion.x[j] / TURN).sin()), "angle of the turn");
    }

    #[test]
    fn a_force_along_the_motion_is_no_friction() {
        assert_eq!(found(&|track, j| 2.0 * track.motion.v[j].signum(), &no_force), None);
    }

    #[test]
    fn a_delay_counts_only_if_command_and_motion_agree_on_it() {
        let force = |track: &BlockedRecording, j: usize| 20.0 * (4.0 * track.blocks.start[j]).sin();
        let late = |track: &BlockedRecording, j: usize| {
            20.0 * (4.0 * (track.blocks.start[j] - 0.04)).sin() - force(track, j)
        };
        assert!(found(&late, &force).is_some_and(|what| what.contains("acts later")));
    }
}
