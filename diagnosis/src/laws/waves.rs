//! Waves along the travel: means of cosine and sine over a step, shared by all that repeats with
//! the turn.

use super::definition::{Fitted, ForceLaw, Reported, sized};
use super::law::wave_mean;
use super::shape::{Missing, ShapeKey};
use super::{Effect, State};
use std::f64::consts::TAU;

/// The keys of every effect that is made of waves: the travel of a turn, orders of it, or periods
/// where no turn is known, rad or m.
pub(super) const KEYS: &[ShapeKey] = &[
    ShapeKey::new("turn", Missing::Optional),
    ShapeKey::new("order_", Missing::Numbered),
    ShapeKey::new("period_", Missing::Numbered),
];

/// Cosine and sine of each wave, times the drive where that is asked.
#[derive(Debug, Clone)]
pub(super) struct Waves {
    names: Vec<String>,
    waves: Vec<f64>,
    of_drive: bool,
}

impl Waves {
    pub(super) fn new(effect: &Effect, of_drive: bool) -> Self {
        let mut found = effect.waves();
        if found.is_empty() {
            found.push(("1".into(), TAU / effect.turn().unwrap_or(TAU)));
        }
        Self {
            waves: found.iter().map(|wave| wave.1).collect(),
            names: found.iter().flat_map(|(n, _)| [format!("cos_{n}"), format!("sin_{n}")]).collect(),
            of_drive,
        }
    }
}

impl ForceLaw for Waves {
    fn names(&self) -> Vec<String> {
        self.names.clone()
    }
    /// Means over the step: a wave that is passed within it averages out.
    fn terms(&mut self, state: &State, velocity: f64, out: &mut [f64]) {
        let times = if self.of_drive { state.drive } else { 1.0 };
        for (pair, wave) in out.chunks_exact_mut(2).zip(&self.waves) {
            let (cos, sin) = wave_mean(*wave, state.position, velocity * state.dt);
            pair[0] = times * cos;
            pair[1] = times * sin;
        }
    }
    fn copy(&self) -> Box<dyn ForceLaw> {
        Box::new(self.clone())
    }
}

/// Coefficients of an effect made of waves: two each in every recording.
pub(super) fn freedom(effect: &Effect, recordings: usize) -> usize {
    2 * effect.waves().len().max(1) * recordings
}

/// Amplitude of the first wave.
pub(super) fn amplitude(fitted: &Fitted) -> (f64, f64) {
    sized(&[fitted.term(0), fitted.term(1)])
}

/// Amplitudes, periods where no turn is known, and the root mean square of all; relative to the
/// drive where that is asked.
pub(super) fn report(fitted: &Fitted, is_relative: bool) -> Vec<Reported> {
    let mut waves: Vec<f64> = fitted.effect.waves().into_iter().map(|(_, wave)| wave).collect();
    if waves.is_empty() {
        waves.push(TAU / fitted.effect.turn().unwrap_or(TAU));
    }
    let turn = fitted.effect.turn();
    let unit = if is_relative { "1" } else { fitted.force };
    // Free periods are numbered from the strongest.
    let size = |k: usize| fitted.term(2 * k).0.hypot(fitted.term(2 * k + 1).0);
    let mut by_size: Vec<usize> = (0..waves.len()).collect();
    by_size.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
    let mut out = Vec::new();
    let mut square = (0.0, 0.0);
    for (rank, k) in by_size.into_iter().enumerate() {
        let wave = waves[k];
        let (x, s) = sized(&[fitted.term(2 * k), fitted.term(2 * k + 1)]);
        let (v, s) = if is_relative {
            ((x / fitted.ratio).abs(), (s / fitted.ratio).abs())
        } else {
            fitted.scaled((x, s))
        };
        match turn {
            Some(turn) => {
                let order = (wave * turn / TAU).round();
                out.push(Reported::new(format!("order_{order}"), (v, s), unit));
            }
            None => {
                out.push(Reported::new(format!("amplitude_{}", rank + 1), (v, s), unit));
                let period = TAU / wave;
                let name = if rank == 0 { "period".to_owned() } else { format!("period_{}", rank + 1) };
                out.push(Reported::new(name, (period, 0.002 * period), fitted.length));
            }
        }
        square.0 += 0.5 * v * v;
        square.1 += (0.5 * v * s).powi(2);
    }
    let rms: f64 = square.0.sqrt();
    out.push(Reported::new("rms", (rms, square.1.sqrt() / rms.max(1e-300)), unit));
    out
}
