//! The null: the nominal structure refitted within its uncertainty, with the noise and the smoothed
//! motion that go with it.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::{Noise, Observed};
use crate::fit::input::Total;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::noise::{self, Colour};
use crate::fit::nominal::{Key, Nominal};
use crate::fit::seen_inertia;
use crate::fit::smoother::{Knows, motion};

/// Rests are dilated by this many blocks: the sign is uncertain next to a reversal.
const MARGIN: usize = 1;

/// No count for this long is rest, s: the slowest motion that is distinguished from it makes fifty
/// counts a second.
const STILL_S: f64 = 0.02;

/// Counts that a smoothed motion passes and the encoder does not before they contradict each other:
/// the motion rests there.
const CONTRADICTED: f64 = 2.0;

/// Blocks at rest whatever a filter makes of the speed `v`: the encoder gives no count for a while,
/// or for less where by that speed it should have given some.
fn still(track: &BlockedRecording, v: &[f64], count: f64) -> Vec<bool> {
    let n = track.block_count();
    let reach = ((STILL_S * track.block_rate()).ceil() as usize).max(2);
    let mut out = vec![false; n];
    let mut from = 0;
    while from < n {
        // The mean of a block within which a count falls is no whole count.
        let same = |j: &usize| (track.blocks.z[*j] - track.blocks.z[from]).abs() <= 1e-3 * count;
        let to = (from + 1..n).take_while(same).last().unwrap_or(from);
        let passed: f64 = (from..=to).map(|j| v[j] * track.blocks.span[j]).sum();
        if to - from >= reach || (to > from && passed.abs() > CONTRADICTED * count) {
            out[from..=to].fill(true);
        }
        from = to + 1;
    }
    out
}

/// Time over which the reading of a held axis is looked at, s.
const HELD_S: f64 = 0.05;

/// Part of the fast speed below which a reading that goes no further in that time is jitter about a
/// place, not motion.
const JITTER: f64 = 0.004;

/// Blocks at which a drive holds the axis: a fine encoder counts the jitter of a loop or a frame
/// there, and the friction is a reaction. `fast` is the fast speed of the recording, rad/s or m/s.
fn held(track: &BlockedRecording, fast: f64) -> Vec<bool> {
    let (n, rate) = (track.block_count(), track.block_rate());
    let half = ((0.5 * HELD_S * rate).round() as usize).max(1);
    let most = JITTER * fast * (2 * half) as f64 / rate;
    let is_held = |j: usize| {
        let near = &track.blocks.z[j.saturating_sub(half)..(j + half + 1).min(n)];
        let (low, high) = near.iter().fold((f64::MAX, f64::MIN), |(l, h), z| (l.min(*z), h.max(*z)));
        high - low < most
    };
    (0..n).map(is_held).collect()
}

/// Multiple of the slowest speed that noise lets be seen which an axis has a block before and a
/// block after a reversal that it sweeps through.
const SWEPT: f64 = 3.0;

/// Blocks before and after such a reversal in which the axis runs one way: shorter swings turn back
/// within a block.
const ONE_WAY: usize = 4;

/// Multiple of the change of speed that the rig's dry friction makes over the same time which the
/// drive makes there: when exactly the friction changes its sign then hardly matters.
const DRIVEN: f64 = 10.0;

/// Part of the dry friction that is not known in the block of a reversal, because the speeds of two
/// blocks show only roughly when the axis turns back. Set by hand: a tenth of a block too early or
/// too late changes the mean friction by twice that part.
const UNSURE: f64 = 0.2;

/// True if the disturbance is larger than what is not known of the friction at a reversal, so that
/// such blocks may judge a model.
fn outweighs_reversals(track: &BlockedRecording, noise: &Noise) -> bool {
    // Friction takes off twice as much in a block as it stops within half of one.
    let friction = 2.0 * track.blocks.stops_from * track.block_rate();
    noise.slow.sqrt() >= UNSURE * friction
}

/// Blocks on both sides of a reversal through which the axis is driven without a stop, so that the
/// direction is known: its speed `v` is large before and after, and it is not held in between.
/// `floor` is the slowest speed that is seen, `by_friction` the change of speed over a block that
/// dry friction makes: where that is zero, the rig does not know the friction, and every reversal
/// may be a stop.
fn swept(v: &[f64], holds: &[bool], floor: f64, by_friction: f64) -> Vec<bool> {
    let mut out = vec![false; v.len()];
    for k in ONE_WAY - 1..v.len().saturating_sub(ONE_WAY) {
        let (before, after) = (v[k - 1], v[k + 2]);
        let is_fast = before.abs().min(after.abs()) >= SWEPT * floor;
        let is_driven = by_friction > 0.0 && (after - before).abs() >= 3.0 * DRIVEN * by_friction;
        let runs = |blocks: &[f64], way: f64| blocks.iter().all(|v| v * way > 0.0);
        let turns = runs(&v[k + 1 - ONE_WAY..=k], before) && runs(&v[k + 1..=k + ONE_WAY], -before);
        if turns && is_fast && is_driven && !holds[k - 1..=k + 2].contains(&true) {
            out[k..=k + 1].fill(true);
        }
    }
    out
}

/// Blocks next to one that is `slow` or next to a change of the sign of the speed `v`, except those
/// that are `swept`.
fn near_rest(v: &[f64], slow: &[bool], swept: &[bool]) -> Vec<bool> {
    let n = v.len();
    let is_beside = |j: usize| {
        let (a, b) = (j.saturating_sub(MARGIN), (j + MARGIN).min(n - 1));
        let is_swept = |k: usize| v[k] * v[k + 1] > 0.0 || (swept[k] && swept[k + 1]);
        let turns = v[a] * v[b] <= 0.0 && !(a..b).all(is_swept);
        turns || (a..=b).any(|k| slow[k] && !swept[k])
    };
    (0..n).map(is_beside).collect()
}

/// Estimates the motion of every recording under a model's input and marks where the axis rests;
/// `count` is one of the encoder's.
pub(crate) fn estimate_motion(
    tracks: &mut [BlockedRecording],
    totals: &[Total],
    noise: &Noise,
    count: f64,
    knows: Knows,
) {
    for (track, total) in tracks.iter_mut().zip(totals) {
        // The fit allows any force at a reversal, the motion does not: where the axis is driven
        // through, its speed is known there.
        let observed = Observed { any_force: &track.motion.rest, ..track.observed() };
        let state = motion(&observed, noise, total, knows);
        let mut sd: Vec<f64> = state
            .v_sd
            .iter()
            .zip(&track.motion.rest)
            .filter(|(_, rest)| !**rest)
            .map(|(sd, _)| *sd)
            .collect();
        if sd.len() < 10 {
            sd = state.v_sd.clone();
        }
        sd.sort_by(f64::total_cmp);
        let typical = sd[sd.len() / 2];
        let mut speeds: Vec<f64> = state.v.iter().map(|v| v.abs()).collect();
        speeds.sort_by(f64::total_cmp);
        // A quarter of the fast speed is moving, whatever the noise estimate says.
        let fast = speeds[speeds.len() * 95 / 100];
        let floor = (2.5 * typical).min(0.25 * fast).max(1e-6 * fast);
        let still = still(track, &state.v, count);
        let n = still.len();
        let held = held(track, fast);
        let holds: Vec<bool> = (0..n).map(|j| still[j] || held[j]).collect();
        let swept = match outweighs_reversals(track, noise) {
            true => swept(&state.v, &holds, floor, 2.0 * track.blocks.stops_from),
            false => vec![false; n],
        };
        let slow: Vec<bool> = (0..n).map(|j| holds[j] || state.v[j].abs() < floor).collect();
        track.motion.rest = near_rest(&state.v, &slow, &swept);
        track.motion.any_force = near_rest(&state.v, &slow, &vec![false; n]);
        track.motion.stuck = still;
        track.motion.speed_floor = floor;
        track.motion.x = state.x;
        track.motion.v = state.v;
    }
}

/// Relative standard deviation of gain over inertia above which the rig hardly knows it.
const LOOSE: f64 = 0.5;

/// The sign with which the measured load acts, where it is seen to act as a load does.
fn load_sign(nominal: &Nominal, fit: &Fit) -> Option<f64> {
    let seen = fit.value(Key::External)? * nominal.rig.model.inertia;
    (seen.abs() > 0.5 && seen.abs() < 2.0).then(|| seen.signum())
}

/// Scale of acceleration of the recordings: what the command makes or, where something else drives
/// the motion, what is seen.
pub(crate) fn acceleration_scale(nominal: &Nominal, tracks: &[BlockedRecording]) -> f64 {
    let (mut square, mut rows) = (0.0, 0.0);
    for track in tracks {
        square += track.rows.command.iter().map(|u| u * u).sum::<f64>();
        rows += track.rows.command.len() as f64;
    }
    let of_command = nominal.known_gain().abs() * (square / rows).sqrt();
    let of_motion = tracks.iter().map(seen_acceleration).fold(0.0, f64::max);
    let least = DRIVEN_ELSEWHERE * of_motion;
    if of_command >= least { of_command.max(1e-12) } else { of_motion.max(1e-12) }
}

/// True if the command drives the motion, rather than weight or a push at the start.
pub(crate) fn is_driven(nominal: &Nominal, tracks: &[BlockedRecording]) -> bool {
    let square: f64 = tracks.iter().flat_map(|track| track.rows.command.iter()).map(|u| u * u).sum();
    let rows: f64 = tracks.iter().map(|track| track.rows.command.len() as f64).sum();
    let seen = tracks.iter().map(seen_acceleration).fold(0.0, f64::max);
    nominal.known_gain().abs() * (square / rows).sqrt() >= DRIVEN_ELSEWHERE * seen
}

/// Part of the acceleration seen below which the command does not drive the motion.
const DRIVEN_ELSEWHERE: f64 = 0.2;
/// Times the error of reading that a second difference must be to be an acceleration.
const CLEAR: f64 = 5.0;

/// Acceleration that positions show over the shortest time that shows any, root mean square.
pub(crate) fn seen_acceleration(track: &BlockedRecording) -> f64 {
    let n = track.block_count();
    let h = 1.0 / track.block_rate();
    let mean = |values: &mut dyn Iterator<Item = f64>| {
        let (sum, count) = values.fold((0.0, 0.0_f64), |(sum, count), x| (sum + x, count + 1.0));
        sum / count.max(1.0)
    };
    let error = mean(&mut track.blocks.quantum.iter().copied());
    let mut reach = 1;
    while 8 * reach < n {
        let step = (reach as f64 * h).powi(2);
        let second = |j: usize| {
            (track.blocks.z[j + reach] - 2.0 * track.blocks.z[j] + track.blocks.z[j - reach]) / step
        };
        let square = mean(&mut (reach..n - reach).map(|j| second(j).powi(2)));
        if square > CLEAR * CLEAR * 6.0 * error / (step * step) {
            return square.sqrt();
        }
        reach *= 2;
    }
    0.0
}

/// Finds noise, motion and refitted values together, a few times round, from a first look without
/// friction.
pub(crate) fn settle(nominal: &mut Nominal, tracks: &mut [BlockedRecording]) -> (Noise, Fit) {
    let mut scale = acceleration_scale(nominal, tracks);
    let mut noise = noise::guess(tracks, scale);
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    let totals: Vec<Total> = tracks.iter().map(|track| track.command_total(nominal.gain())).collect();
    noise = noise::estimate(tracks, &totals, &noise, scale, Colour::Slow);
    estimate_motion(tracks, &totals, &noise, count, Knows::All);
    let model = Model::default();
    let mut fit = Fit::new(&model, nominal, tracks, &noise);
    for round in 0..2 {
        if round == 0 && nominal.gain_sd() > LOOSE {
            let white = noise::estimate(tracks, &totals, &noise, scale, Colour::White);
            seen_inertia::anchor(nominal, tracks, &white, scale);
            scale = acceleration_scale(nominal, tracks);
            fit = Fit::new(&model, nominal, tracks, &noise);
        }
        let totals = fit.totals(tracks);
        noise = noise::estimate(tracks, &totals, &noise, scale, Colour::Slow);
        estimate_motion(tracks, &totals, &noise, count, Knows::All);
        fit = Fit::new(&model, nominal, tracks, &noise);
    }
    if let Some(sign) = load_sign(nominal, &fit) {
        nominal.external = sign;
        fit = Fit::new(&model, nominal, tracks, &noise);
    }
    (noise, fit)
}

#[cfg(test)]
mod tests;
