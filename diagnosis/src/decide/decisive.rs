//! The decisive picture of a name: the force that the refitted simulation leaves, against the state
//! that the named law acts on, and what the law takes of it.

use crate::decide::weighed_model::WeighedModel;
use crate::evidence::comparison::ModelComparison;
use crate::evidence::effect_evidence::Rival;
use crate::evidence::law_band::{Band, Reach};
use crate::evidence::residual_maps::variable as variable_of;
use crate::evidence::residuals::Residuals;
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
/// Part of what the laws take that has to show over the state.
const SEEN: f64 = 0.3;

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
    /// True if forces count positive in the direction of motion: what brakes either way would
    /// cancel itself over any other state than speed.
    pub along_motion: bool,
    /// Middles of the bins, in the state's unit.
    pub at: Vec<f64>,
    /// The residual on fitted and on held-out recordings, where a bin has enough of it.
    pub fitted: Vec<Option<Bin>>,
    /// See `fitted`.
    pub held_out: Vec<Option<Bin>>,
    /// The force that the named laws take of it, on the fitted recordings.
    pub law: Vec<Option<f64>>,
    /// Ends of that force where the laws' values are at the ends of their 95 % intervals.
    pub band: Vec<Option<[f64; 2]>>,
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

/// One block.
#[derive(Clone, Copy)]
struct Row {
    state: f64,
    /// The residual of the refit.
    left: f64,
    /// The part of it that the laws take, and the band of that.
    law: f64,
    reach: Reach,
    /// The part of it that the laws with the rival take.
    rival: f64,
}

/// Fits the model with the nearest rival instead of a named effect; none where no other effect
/// was fitted instead.
pub(crate) fn nearest_rival<'a>(
    name: EffectName,
    weighed: &'a WeighedModel,
    shown: &ModelComparison,
    fitted: impl Fn(Model) -> ModelComparison,
) -> Option<(&'a Rival, ModelComparison)> {
    let found = &weighed.effects.iter().find(|one| one.found.effect.name == name)?.found;
    let mut model = shown.patched.model.clone();
    let is_new = |rival: &&Rival| model.effects.iter().all(|effect| effect.name != rival.name);
    let nearest = found.rivals.iter().filter(is_new).min_by(|a, b| a.z.total_cmp(&b.z))?;
    *model.effects.iter_mut().find(|effect| effect.name == name)? = nearest.effect.clone();
    Some((nearest, fitted(model)))
}

/// The residuals that a picture is made of.
pub(crate) struct Residual<'a> {
    pub(crate) shown: &'a ModelComparison,
    /// On the fitted recordings.
    pub(crate) band: Band,
    pub(crate) rival: Option<(&'a Rival, ModelComparison)>,
    pub(crate) fit: &'a [BlockedRecording],
    pub(crate) holdout: &'a [BlockedRecording],
    pub(crate) estimator: &'a Estimator,
}

/// The state of a picture.
#[derive(Clone, Copy)]
struct State {
    variable: &'static str,
    period: Option<f64>,
    along_motion: bool,
}

impl Residual<'_> {
    /// The blocks of some recordings that move, over a state.
    fn rows(&self, state: State, held_out: bool) -> Vec<Row> {
        let (tracks, of) =
            if held_out { (self.holdout, &self.shown.on_holdout) } else { (self.fit, &self.shown.on_fit) };
        let rival = self.rival.as_ref().filter(|_| !held_out).map(|(_, shown)| &shown.on_fit);
        let band = (!held_out).then_some(&self.band);
        let mut rows = Vec::new();
        for (r, track) in tracks.iter().enumerate() {
            let moving = self.estimator.moving(track);
            let at = variable_of(track, state.variable, state.period);
            let way = |j: usize| if state.along_motion { track.motion.v[j].signum() } else { 1.0 };
            // What reaches below one way reaches above the other.
            let reach = |[low, high]: Reach, j: usize| if way(j) < 0.0 { [high, low] } else { [low, high] };
            let taken = |by: &Residuals, j: usize| way(j) * (of.refit[r][j] - by.patched[r][j]);
            let row = |j: usize| Row {
                state: at[j],
                left: way(j) * of.refit[r][j],
                law: taken(of, j),
                reach: band.map_or([0.0; 2], |band| reach(band.reach(r, j, taken(of, j)), j)),
                rival: rival.map_or(0.0, |rival| taken(rival, j)),
            };
            let of_recording: Vec<Row> = (0..at.len()).filter(|j| moving[*j]).map(row).collect();
            match state.period {
                Some(period) => rows.extend(in_phase(&of_recording, period)),
                None => rows.extend(of_recording),
            }
        }
        rows
    }

    /// The period of the wave that takes most, rad or m; none where the law has no waves.
    fn period(&self, effect: &Effect) -> Option<f64> {
        let waves = effect.waves().into_iter().map(|(_, wave)| wave).filter(|wave| *wave != 0.0);
        let largest = waves.max_by(|a, b| self.amplitude(*a).total_cmp(&self.amplitude(*b)))?;
        Some(std::f64::consts::TAU / largest.abs())
    }

    /// The amplitudes of a wave, rad per unit of travel, in what the laws take, summed over
    /// recordings; to compare waves.
    fn amplitude(&self, wave: f64) -> f64 {
        let of = &self.shown.on_fit;
        let amplitude = |(r, track): (usize, &BlockedRecording)| {
            let law = of.refit[r].iter().zip(&of.patched[r]).map(|(refit, patched)| refit - patched);
            let sum = law.zip(track.places()).fold((0.0, 0.0), |(a, b): (f64, f64), (law, x)| {
                let (sin, cos) = (wave * x).sin_cos();
                (a + law * cos, b + law * sin)
            });
            sum.0.hypot(sum.1)
        };
        self.fit.iter().enumerate().map(amplitude).sum()
    }

    /// The picture for an effect; none where too little moves, or where the state says little of
    /// what the laws take: a delay shows over no state.
    pub(crate) fn decisive(&self, effect: &Effect) -> Option<Decisive> {
        let variable = effect.name.definition().variable();
        let period = if variable == "angle" { self.period(effect) } else { None };
        let over = |along_motion| self.over(effect.name, State { variable, period, along_motion });
        // Along the motion only where that shows clearly more.
        let all = [over(false), over(true).map(|(plot, unsaid)| (plot, 1.5 * unsaid))];
        all.into_iter().flatten().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(plot, _)| plot)
    }

    /// The picture over a state, and the part of what the laws take that the state does not say;
    /// none where that is too large.
    fn over(&self, name: EffectName, state: State) -> Option<(Decisive, f64)> {
        let (fitted, held_out) = (self.rows(state, false), self.rows(state, true));
        let mut states: Vec<f64> = fitted.iter().map(|row| row.state).collect();
        states.sort_by(f64::total_cmp);
        let end = |part: f64| states.get((part * states.len().saturating_sub(1) as f64) as usize).copied();
        let (low, high) = (end(ENDS)?, end(1.0 - ENDS)?);
        if high <= low {
            return None;
        }
        let width = (high - low) / BINS as f64;
        let place = |row: &Row| (((row.state - low) / width) as usize).min(BINS - 1);
        let bins = |rows: &[Row], value: fn(&Row) -> f64| -> Vec<Option<Bin>> {
            let mut inside = vec![Vec::new(); BINS];
            for row in rows.iter().filter(|row| (low..high).contains(&row.state)) {
                inside[place(row)].push(value(row));
            }
            inside.iter().map(|values| bin(values)).collect()
        };
        let curve = |value: fn(&Row) -> f64| -> Vec<Option<f64>> {
            bins(&fitted, value).into_iter().map(|bin| bin.map(|bin| bin.mean)).collect()
        };
        let law = curve(|row| row.law);
        let ends = curve(|row| row.law - row.reach[0]).into_iter().zip(curve(|row| row.law + row.reach[1]));
        let rival = self.rival.as_ref().map(|(rival, _)| RivalLaw {
            name: rival.name,
            behind: rival.held_out_lead,
            law: curve(|row| row.rival),
        });
        let unsaid = |row: &Row| row.law - law[place(row)].unwrap_or(0.0);
        let square = |of: &dyn Fn(&Row) -> f64| fitted.iter().map(|row| of(row).powi(2)).sum::<f64>();
        let unsaid = square(&unsaid) / square(&|row| row.law).max(1e-300);
        if unsaid >= 1.0 - SEEN {
            return None;
        }
        let picture = Decisive {
            name,
            variable: state.variable,
            period: state.period,
            along_motion: state.along_motion,
            at: (0..BINS).map(|i| low + (i as f64 + 0.5) * width).collect(),
            band: ends.map(|(low, high)| Some([low?, high?])).collect(),
            law,
            rival,
            fitted: bins(&fitted, |row| row.left),
            held_out: bins(&held_out, |row| row.left),
        };
        Some((picture, unsaid))
    }
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
    let sum = |wave: fn(f64) -> f64| rows.iter().map(|row| row.law * wave(turn * row.state)).sum::<f64>();
    let early = sum(f64::cos).atan2(sum(f64::sin)) / turn;
    let moved = |row: &Row| Row { state: (row.state + early).rem_euclid(period), ..*row };
    rows.iter().map(moved).collect()
}
