//! Conceals an effect in a recording. Where J·q̈ = k·u + F holds, J·q̈ = k·u′ + F + f holds for
//! u′ = u − f/k: the recorded motion with the command u′ is a recording of the same machine with
//! one effect more. A command is held over a row, so f is its mean over the row. A map of the
//! command is inverted; an error of reading goes into the counts.

use std::f64::consts::TAU;

use super::banded_recording::State;
use super::rig_file::RigFile;
use super::shapes::{HiddenLaw, Side, Wave};
use crate::dynamics::recording::Recording;
use crate::rng::Rng;

/// Points in a row at which a force is taken for its mean.
const POINTS: usize = 8;

/// An effect with its size in one machine.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Concealed {
    pub(crate) law: HiddenLaw,
    pub(crate) size: f64,
    /// Speed and travel that make the law's terms about one.
    pub(crate) fast: f64,
    pub(crate) travel: f64,
    /// The largest |command| of the machine's recordings.
    pub(crate) strongest: f64,
    pub(crate) seed: u64,
}

/// A recording with the effect concealed in it.
#[derive(Clone, Debug)]
pub(crate) struct Changed {
    pub(crate) command: Vec<f64>,
    pub(crate) counts: Vec<f64>,
    /// Error of reading at the rows, rad or m; empty for an effect without one.
    pub(crate) error: Vec<f64>,
}

impl Changed {
    /// Force that the concealed effect puts on the axis, mean of each row, N·m or N.
    pub(crate) fn force(&self, r: &Recording, gain: f64) -> Vec<f64> {
        r.command.iter().zip(&self.command).map(|(u, changed)| gain * (u - changed)).collect()
    }
}

/// The recording with the effect in it; `index` distinguishes recordings: each has an encoder's
/// zero of its own.
pub(crate) fn conceal(
    effect: &Concealed,
    r: &Recording,
    state: &State,
    rig: &RigFile,
    index: usize,
) -> Changed {
    let mut rng = Rng::new(effect.seed).fork(&format!("recording/{index}"));
    let zero = if rig.absolute { 0.0 } else { rng.range(0.0, TAU) };
    let mut changed = Changed { command: r.command.clone(), counts: r.counts.clone(), error: Vec::new() };
    match effect.law.side() {
        Side::Force => {
            let force = forces(effect, r, state, rig, zero);
            changed.command.iter_mut().zip(force).for_each(|(u, f)| *u -= f / rig.gain);
        }
        Side::Command => changed.command = inverted(effect, r, state, rig, zero),
        Side::Reading => {
            changed.error = reading(effect, state, rig, zero, &mut rng);
            let whole = r.counts.iter().all(|c| c.fract() == 0.0);
            for (counts, error) in changed.counts.iter_mut().zip(&changed.error) {
                let read = *counts + rig.counts_per_unit * error;
                *counts = if whole { read.round() } else { read };
            }
        }
    }
    changed
}

/// Place, speed and time at the points of row `i`.
fn points(state: &State, i: usize) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
    let next = (i + 1).min(state.time.len() - 1);
    (0..POINTS).map(move |p| {
        let x = (p as f64 + 0.5) / POINTS as f64;
        let mix = |a: f64, b: f64| a + (b - a) * x;
        (
            mix(state.place[i], state.place[next]),
            mix(state.speed[i], state.speed[next]),
            mix(state.time[i], state.time[next]),
        )
    })
}

/// Mean over every row of a function of place, speed and time.
fn means(state: &State, mut value: impl FnMut(f64, f64, f64) -> f64) -> Vec<f64> {
    (0..state.time.len())
        .map(|i| points(state, i).map(|(q, v, t)| value(q, v, t)).sum::<f64>() / POINTS as f64)
        .collect()
}

fn wave(list: &[Wave], angle: f64, zero: f64) -> f64 {
    list.iter().map(|w| w.amplitude * (w.order * (angle + zero) + w.phase).sin()).sum()
}

/// Rms of a sum of waves.
fn wave_rms(list: &[Wave]) -> f64 {
    list.iter().map(|w| 0.5 * w.amplitude * w.amplitude).sum::<f64>().sqrt()
}

fn forces(effect: &Concealed, r: &Recording, state: &State, rig: &RigFile, zero: f64) -> Vec<f64> {
    let (fast, travel) = (effect.fast, effect.travel);
    let per_turn = rig.turn.map_or(0.0, |turn| TAU / turn);
    // At rest dry friction is a reaction: more of it moves nothing and asks for no command.
    let side = |v: f64| if v.abs() > state.slow { v.signum() } else { 0.0 };
    let size = effect.size;
    match &effect.law {
        HiddenLaw::Viscous => means(state, |_, v, _| -size * v / fast),
        HiddenLaw::Coulomb => means(state, |_, v, _| -size * side(v)),
        HiddenLaw::OneWay(way) => means(state, |_, v, _| if v * way > 0.0 { -size * v / fast } else { 0.0 }),
        HiddenLaw::Stribeck { speed, power } => {
            means(state, |_, v, _| -size * side(v) * (-(v.abs() / speed).powf(*power)).exp())
        }
        HiddenLaw::Bristles { length } => bristles(state, *length).iter().map(|z| -size * z).collect(),
        HiddenLaw::Drag(power) => means(state, |_, v, _| -size * v.signum() * (v.abs() / fast).powf(*power)),
        HiddenLaw::FrictionAlong(along) => means(state, |q, v, _| -size * side(v) * along.at(q)),
        HiddenLaw::DampingAlong(along) => means(state, |q, v, _| -size * v / fast * along.at(q)),
        HiddenLaw::Load => {
            let direction = means(state, |_, v, _| side(v));
            direction.iter().zip(&r.force).map(|(d, load)| -size * d * load.abs()).collect()
        }
        HiddenLaw::WarmingUp(seconds) => means(state, |_, v, t| -size * side(v) * (-t / seconds).exp()),
        HiddenLaw::Cogging(list) => {
            let rms = wave_rms(list);
            means(state, |q, _, _| size / rms * wave(list, per_turn * q, zero))
        }
        HiddenLaw::Imbalance => means(state, |q, _, _| size * (q + zero).sin()),
        HiddenLaw::Spring(cubic) => {
            let middle = state.place.iter().sum::<f64>() / state.place.len() as f64;
            let origin = if rig.absolute { 0.0 } else { middle };
            means(state, |q, _, _| {
                let x = (q - origin) / (0.5 * travel);
                -size * x * (1.0 + cubic * x * x)
            })
        }
        HiddenLaw::Weight => r.tilt.iter().map(|t| size * t.sin()).collect(),
        _ => vec![0.0; state.time.len()],
    }
}

/// Force of Maxwell-slip bristles over their sliding force, mean of each row: eight in parallel,
/// break lengths spread over a decade about the one given.
fn bristles(state: &State, length: f64) -> Vec<f64> {
    const COUNT: usize = 8;
    let lengths: Vec<f64> =
        (0..COUNT).map(|i| length * 10_f64.powf(i as f64 / (COUNT - 1) as f64 - 0.5)).collect();
    let mut bent = [0.0; COUNT];
    let mut last = state.place[0];
    means(state, |q, _, _| {
        let moved = q - last;
        last = q;
        let mut sum = 0.0;
        for (z, length) in bent.iter_mut().zip(&lengths) {
            *z = (*z + moved).clamp(-length, *length);
            sum += *z / length;
        }
        sum / COUNT as f64
    })
}

/// The command of which the map makes the recorded one.
fn inverted(effect: &Concealed, r: &Recording, state: &State, rig: &RigFile, zero: f64) -> Vec<f64> {
    let (u, size) = (&r.command, effect.size);
    let n = u.len();
    match &effect.law {
        HiddenLaw::Ripple(list) => {
            let (per_turn, rms) = (rig.turn.map_or(0.0, |turn| TAU / turn), wave_rms(list));
            let factor = means(state, |q, _, _| 1.0 + size / rms * wave(list, per_turn * q, zero));
            u.iter().zip(factor).map(|(u, f)| u / f.max(0.2)).collect()
        }
        HiddenLaw::Deadband(leak) => u
            .iter()
            .map(|&u| {
                if u.abs() < leak * size {
                    u / leak
                } else {
                    u + if u == 0.0 { 0.0 } else { (1.0 - leak) * size * u.signum() }
                }
            })
            .collect(),
        HiddenLaw::Clip(power) => {
            // The drive makes u of u′: u = u′ / (1 + |u′/L|^p)^(1/p), which stays below L.
            let limit = effect.strongest * (1.0 + 1.0 / size);
            u.iter().map(|u| u / (1.0 - (u.abs() / limit).powf(*power)).powf(1.0 / power)).collect()
        }
        HiddenLaw::Delay => {
            let rows = size.round() as usize;
            (0..n).map(|i| u[(i + rows).min(n - 1)]).collect()
        }
        HiddenLaw::Lag => {
            // The current passes half way between two rows where they meet.
            let between = |i: usize| 0.5 * (u[i.saturating_sub(1)] + u[i.min(n - 1)]);
            let step = |i: usize| {
                let next = (i + 1).min(n - 1);
                if next > i { state.time[next] - state.time[i] } else { state.time[i] - state.time[i - 1] }
            };
            (0..n)
                .map(|i| {
                    let keep = (-step(i) / size).exp();
                    (between(i + 1) - keep * between(i)) / (1.0 - keep)
                })
                .collect()
        }
        HiddenLaw::Heating { seconds, by_current } => heated(u, state, size, *seconds, *by_current),
        _ => u.clone(),
    }
}

fn heated(u: &[f64], state: &State, size: f64, seconds: f64, by_current: bool) -> Vec<f64> {
    let mean = u.iter().map(|u| u * u).sum::<f64>() / u.len() as f64;
    let mut warmth = 0.0;
    (0..u.len())
        .map(|i| {
            let sent = u[i] / (1.0 - size * warmth).max(0.2);
            let step = if i + 1 < u.len() { state.time[i + 1] - state.time[i] } else { 0.0 };
            let towards = if by_current { (sent * sent / mean).min(20.0) } else { 1.0 };
            warmth += (towards - warmth) * (1.0 - (-step / seconds).exp());
            warmth = warmth.min(1.5);
            sent
        })
        .collect()
}

/// Error of reading at the rows, rad or m.
fn reading(effect: &Concealed, state: &State, rig: &RigFile, zero: f64, rng: &mut Rng) -> Vec<f64> {
    match &effect.law {
        HiddenLaw::Eccentric => {
            let at = |q: f64| effect.size * (q + zero).sin();
            state.place.iter().map(|q| at(*q) - at(state.place[0])).collect()
        }
        HiddenLaw::LostCounts { rate, above } => {
            let mut lost = 0.0;
            (0..state.time.len())
                .map(|i| {
                    let step = if i > 0 { state.time[i] - state.time[i - 1] } else { 0.0 };
                    let v = state.speed[i];
                    if v.abs() > above.max(state.slow) && rng.chance(1.0 - (-rate * step).exp()) {
                        lost +=
                            (v.signum() * effect.size * rng.range(0.6, 1.4)).round() / rig.counts_per_unit;
                    }
                    -lost
                })
                .collect()
        }
        _ => vec![0.0; state.time.len()],
    }
}
