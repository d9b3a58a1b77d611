//! The decisive picture of a name: the force that the refitted simulation leaves, against the state
//! that the named law acts on, and what the law takes of it.

use crate::evidence::acceptance_criteria::Rival;
use crate::evidence::comparison::Shown;
use crate::evidence::residual_maps::variable as variable_of;
use crate::evidence::residuals::Residuals;
use crate::evidence::weighed_model::WeighedModel;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::force_residual::Estimator;
use crate::fit::model::Model;
use crate::laws::{Effect, EffectName};

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
    /// The effect that comes nearest, fitted in place of this one.
    pub rival: Option<RivalLaw>,
}

/// An effect in place of the named one.
#[derive(Debug, Clone, PartialEq)]
pub struct RivalLaw {
    /// Its name.
    pub name: EffectName,
    /// Log-likelihood by which it is behind on held-out recordings, nats.
    pub behind: f64,
    /// The force that the laws with it take of the residual, as in [`Decisive::law`].
    pub law: Vec<Option<f64>>,
}

/// One block: the state, what the refit leaves, and what the laws and those with the rival take of
/// that.
type Row = (f64, f64, f64, f64);

/// Fits the model with the nearest rival instead of a named effect; none where no other effect
/// was fitted instead.
pub(crate) fn nearest_rival<'a>(
    name: EffectName,
    weighed: &'a WeighedModel,
    shown: &Shown,
    fitted: impl Fn(Model) -> Shown,
) -> Option<(&'a Rival, Shown)> {
    let found = &weighed.effects.iter().find(|one| one.found.effect.name == name)?.found;
    let mut model = shown.patched.model.clone();
    let is_new = |rival: &&Rival| model.effects.iter().all(|effect| effect.name != rival.name);
    let nearest = found.rivals.iter().filter(is_new).min_by(|a, b| a.z.total_cmp(&b.z))?;
    *model.effects.iter_mut().find(|effect| effect.name == name)? = nearest.effect.clone();
    Some((nearest, fitted(model)))
}

/// The state of a picture.
struct State<'a> {
    variable: &'static str,
    period: Option<f64>,
    estimator: &'a Estimator,
}

impl State<'_> {
    /// The blocks that move.
    fn rows(&self, tracks: &[BlockedRecording], of: &Residuals, rival: Option<&Residuals>) -> Vec<Row> {
        let one = |(r, track): (usize, &BlockedRecording)| -> Vec<Row> {
            let moving = self.estimator.moving(track);
            let state = variable_of(track, self.variable, self.period);
            let taken = |by: &Residuals, j: usize| of.refit[r][j] - by.patched[r][j];
            let row = |j: usize| {
                (state[j], of.refit[r][j], taken(of, j), rival.map_or(0.0, |rival| taken(rival, j)))
            };
            let rows: Vec<Row> = (0..state.len()).filter(|j| moving[*j]).map(row).collect();
            self.period.map_or_else(|| rows.clone(), |period| in_phase(&rows, period))
        };
        tracks.iter().enumerate().flat_map(one).collect()
    }
}

/// The picture for an effect of a shown model; none where too little moves, or where the state says
/// less than half of what the laws take: a delay shows over no state.
pub(crate) fn decisive(
    effect: &Effect,
    shown: &Shown,
    rival: Option<&(&Rival, Shown)>,
    fit: &[BlockedRecording],
    holdout: &[BlockedRecording],
    estimator: &Estimator,
) -> Option<Decisive> {
    let variable = effect.name.definition().variable();
    let slowest = effect.waves().first().map(|(_, waves)| std::f64::consts::TAU / waves.abs());
    let period = slowest.filter(|period| variable == "angle" && period.is_finite());
    let state = State { variable, period, estimator };
    let fitted = state.rows(fit, &shown.on_fit, rival.map(|(_, shown)| &shown.on_fit));
    let held_out = state.rows(holdout, &shown.on_holdout, None);
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
    let curve = |value: fn(&Row) -> f64| -> Vec<Option<f64>> {
        bins(&fitted, value).into_iter().map(|bin| bin.map(|bin| bin.mean)).collect()
    };
    let law = curve(|row| row.2);
    let rival = rival.map(|(rival, _)| RivalLaw {
        name: rival.name,
        behind: rival.held_out_lead,
        law: curve(|row| row.3),
    });
    let unsaid = |row: &Row| row.2 - law[place(row)].unwrap_or(0.0);
    let square = |of: &dyn Fn(&Row) -> f64| fitted.iter().map(|row| of(row).powi(2)).sum::<f64>();
    let is_seen = square(&unsaid) < 0.5 * square(&|row| row.2);
    is_seen.then(|| Decisive {
        name: effect.name,
        variable,
        period,
        at: (0..BINS).map(|i| low + (i as f64 + 0.5) * width).collect(),
        law,
        rival,
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
    let moved = |(x, left, law, rival): &Row| ((x + early).rem_euclid(period), *left, *law, *rival);
    rows.iter().map(moved).collect()
}
