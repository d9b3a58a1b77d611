//! The decisive picture of a name: the force that the refitted simulation leaves, against the state
//! that the named law acts on, and what the law takes of it.

use crate::effects::{Effect, EffectName};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::force_residual::Estimator;
use crate::validation::comparison::Shown;
use crate::validation::residual_maps::variable as variable_of;
use crate::validation::residuals::Residuals;

/// Bins over the state.
const BINS: usize = 32;
/// Fewest blocks of a bin that is shown.
const FEWEST: usize = 8;
/// Part of the blocks that is left out at either end of the state.
const ENDS: f64 = 0.005;

/// Residual forces in one bin, N·m or N.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bin {
    /// Their mean.
    pub mean: f64,
    /// Their standard deviation.
    pub spread: f64,
}

/// The residual of the refitted simulation over one state.
#[derive(Debug, Clone, PartialEq)]
pub struct Decisive {
    /// The effect whose state it is.
    pub name: EffectName,
    /// The state: `speed`, `travel`, `angle`, `command`, `time` or `tilt`.
    pub variable: &'static str,
    /// Travel after which it repeats, rad or m, where it is an angle of a wave.
    pub period: Option<f64>,
    /// Middles of the bins, in the state's unit.
    pub at: Vec<f64>,
    /// The residual on fitted and on held-out recordings, where a bin has enough of it.
    pub fitted: Vec<Option<Bin>>,
    /// See `fitted`.
    pub held_out: Vec<Option<Bin>>,
    /// The force that the named laws take of it, on the fitted recordings.
    pub law: Vec<Option<f64>>,
}

/// One block: the state, what the refit leaves, and what the laws take of that.
type Row = (f64, f64, f64);

/// The picture for an effect of a shown model; none where too little moves, or where the state says
/// less than half of what the laws take: a delay shows over no state.
pub(crate) fn decisive(
    effect: &Effect,
    shown: &Shown,
    fit: &[BlockedRecording],
    holdout: &[BlockedRecording],
    estimator: &Estimator,
) -> Option<Decisive> {
    let variable = effect.name.definition().variable();
    let slowest = effect.waves().first().map(|(_, waves)| std::f64::consts::TAU / waves.abs());
    let period = slowest.filter(|period| variable == "angle" && period.is_finite());
    let rows = |tracks: &[BlockedRecording], of: &Residuals| -> Vec<Row> {
        let one = |(r, track): (usize, &BlockedRecording)| -> Vec<Row> {
            let moving = estimator.moving(track);
            let state = variable_of(track, variable, period);
            let row = |j: usize| (state[j], of.refit[r][j], of.refit[r][j] - of.patched[r][j]);
            let rows: Vec<Row> = (0..state.len()).filter(|j| moving[*j]).map(row).collect();
            period.map_or_else(|| rows.clone(), |period| in_phase(&rows, period))
        };
        tracks.iter().enumerate().flat_map(one).collect()
    };
    let (fitted, held_out) = (rows(fit, &shown.on_fit), rows(holdout, &shown.on_holdout));
    let mut states: Vec<f64> = fitted.iter().map(|row| row.0).collect();
    states.sort_by(f64::total_cmp);
    let end = |part: f64| states.get((part * states.len().saturating_sub(1) as f64) as usize).copied();
    let (low, high) = (end(ENDS)?, end(1.0 - ENDS)?);
    if high <= low {
        return None;
    }
    let width = (high - low) / BINS as f64;
    let place = |row: &Row| (((row.0 - low) / width) as usize).min(BINS - 1);
    let bins = |rows: &[Row], value: fn(&Row) -> f64| -> Vec<Option<Bin>> {
        let mut inside = vec![Vec::new(); BINS];
        for row in rows.iter().filter(|row| (low..high).contains(&row.0)) {
            inside[place(row)].push(value(row));
        }
        inside.iter().map(|values| bin(values)).collect()
    };
    let law: Vec<Option<f64>> =
        bins(&fitted, |row| row.2).into_iter().map(|bin| bin.map(|bin| bin.mean)).collect();
    let unsaid = |row: &Row| row.2 - law[place(row)].unwrap_or(0.0);
    let square = |of: &dyn Fn(&Row) -> f64| fitted.iter().map(|row| of(row).powi(2)).sum::<f64>();
    let is_seen = square(&unsaid) < 0.5 * square(&|row| row.2);
    is_seen.then(|| Decisive {
        name: effect.name,
        variable,
        period,
        at: (0..BINS).map(|i| low + (i as f64 + 0.5) * width).collect(),
        law,
        fitted: bins(&fitted, |row| row.1),
        held_out: bins(&held_out, |row| row.1),
    })
}

fn bin(values: &[f64]) -> Option<Bin> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let spread = (values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    (values.len() >= FEWEST).then_some(Bin { mean, spread })
}

/// The rows of one recording within one period from where the law rises through zero: counts of an
/// encoder that is not absolute begin anywhere, so that each recording has a phase of its own.
fn in_phase(rows: &[Row], period: f64) -> Vec<Row> {
    let turn = std::f64::consts::TAU / period;
    let sum = |wave: fn(f64) -> f64| rows.iter().map(|row| row.2 * wave(turn * row.0)).sum::<f64>();
    let early = sum(f64::cos).atan2(sum(f64::sin)) / turn;
    rows.iter().map(|(x, left, law)| ((x + early).rem_euclid(period), *left, *law)).collect()
}
