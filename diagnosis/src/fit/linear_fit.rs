//! The linear fit of a model to several recordings in the domain of whitened innovations, counted
//! per segment of time.

use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::filter::{Gains, Noise, robust_loss};
use crate::fit::input::{Input, Total};
use crate::fit::model::{Column, Model, total};
use crate::fit::nominal::{Key, Nominal};
use crate::fit::whitened::{grams, nominal_columns};
use numerics::linear::{Prior, Solution, Square, bounded};
use numerics::parallel;
use std::ops::Range;

/// A model over one recording under one noise: residuals at the reference and whitened columns.
pub(crate) struct Prepared {
    pub(crate) columns: Vec<Column>,
    /// Coefficients about which residuals are taken: the priors' means.
    pub(crate) reference: Vec<f64>,
    /// Whitened innovations at the reference.
    pub(crate) residual: Vec<f64>,
    /// Whitened responses, one vector per column.
    pub(crate) responses: Vec<Vec<f64>>,
    pub(crate) gains: Gains,
    /// Per segment: (XᵀX with the residual as the last row and column).
    pub(crate) segments: Vec<Square>,
    /// The price per segment of the jumps found in this recording itself, in log-likelihood.
    surcharges: Vec<f64>,
    /// Bounds of the segments in blocks, and the weight of each.
    bounds: Vec<usize>,
    weight: Vec<f64>,
}

impl Prepared {
    pub(crate) fn new(model: &Model, nominal: &Nominal, track: &BlockedRecording, noise: &Noise) -> Self {
        let columns = model.columns(nominal, track, noise);
        let reference: Vec<f64> = columns.iter().map(|c| c.prior.mean).collect();
        let known = nominal_columns(track, noise, &columns);
        let further: Vec<&Input> = columns[known.responses.len()..].iter().map(|c| &c.input).collect();
        let mut responses = known.responses.clone();
        responses.extend(known.gains.all_responses(&track.observed(), &further));
        let segments = grams(track, &responses, &known.residual, Some(&known));
        let (gains, residual) = (known.gains.clone(), known.residual.clone());
        let bounds = track.blocks.segments.clone();
        let weight = vec![1.0; segments.len()];
        let surcharges = surcharges(track, model);
        Self { columns, reference, residual, responses, gains, segments, surcharges, bounds, weight }
    }

    /// Weighted residual square of each segment at a step from the reference.
    pub(crate) fn squares(&self, places: &[usize], x: &[f64]) -> Vec<f64> {
        let p = places.len();
        let mut step: Vec<f64> = places.iter().map(|place| -x[*place]).collect();
        step.push(1.0);
        self.segments
            .iter()
            .map(|m| {
                let mut sum = 0.0;
                for i in 0..=p {
                    let row: f64 = (0..=p).map(|j| m.at(i, j) * step[j]).sum();
                    sum += step[i] * row;
                }
                sum.max(0.0)
            })
            .collect()
    }

    /// Whitened residual of a block at a step from the reference, as weighed.
    pub(crate) fn residual_at(&self, block: usize, places: &[usize], x: &[f64]) -> f64 {
        let explained: f64 =
            self.responses.iter().zip(places).map(|(response, place)| x[*place] * response[block]).sum();
        self.residual[block] - explained
    }

    /// The blocks of a segment, and its weight.
    pub(crate) fn segment(&self, segment: usize) -> (Range<usize>, f64) {
        (self.bounds[segment]..self.bounds[segment + 1], self.weight[segment])
    }

    /// Returns the price of the jumps found in this recording itself, in log-likelihood.
    pub(crate) fn surcharge(&self) -> f64 {
        self.surcharges.iter().sum()
    }

    /// Weight and number of blocks of each segment.
    pub(crate) fn weights(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.weight.iter().zip(self.bounds.windows(2)).map(|(weight, w)| (*weight, (w[1] - w[0]) as f64))
    }

    /// Cost of each segment at a step from the reference, in log-likelihood.
    pub(crate) fn costs(&self, places: &[usize], x: &[f64]) -> Vec<f64> {
        let squares = self.squares(places, x);
        let each = squares.iter().zip(self.weights()).zip(&self.surcharges);
        each.map(|((square, (weight, count)), surcharge)| {
            0.5 * count * robust_loss(square / weight / count).0 + surcharge
        })
        .collect()
    }

    /// The same model with residual and responses in another domain, every segment in full.
    pub(crate) fn over(&self, residual: Vec<f64>, responses: Vec<Vec<f64>>, segments: Vec<Square>) -> Self {
        let columns = self.columns.clone();
        let (reference, gains) = (self.reference.clone(), self.gains.clone());
        let (surcharges, bounds) = (self.surcharges.clone(), self.bounds.clone());
        let weight = vec![1.0; segments.len()];
        Self { columns, reference, residual, responses, gains, segments, surcharges, bounds, weight }
    }

    /// Multiplies residual and responses.
    pub(crate) fn scale(&mut self, by: f64) {
        let all = self.responses.iter_mut().chain(std::iter::once(&mut self.residual));
        all.for_each(|column| column.iter_mut().for_each(|x| *x *= by));
        self.segments.iter_mut().for_each(|m| m.a.iter_mut().for_each(|x| *x *= by * by));
    }

    /// Weighs each segment by how far its residual square is above the noise.
    fn weigh(&mut self, squares: &[f64]) {
        for s in 0..self.segments.len() {
            let (from, to) = (self.bounds[s], self.bounds[s + 1]);
            let plain = squares[s] / self.weight[s] / (to - from) as f64;
            let weight = robust_loss(plain).1;
            let change = weight / self.weight[s];
            if change == 1.0 {
                continue;
            }
            self.weight[s] = weight;
            let root = change.sqrt();
            for x in &mut self.segments[s].a {
                *x *= change;
            }
            let stretch = |column: &mut Vec<f64>| column[from..to].iter_mut().for_each(|x| *x *= root);
            stretch(&mut self.residual);
            stretch(&mut self.gains.weight);
            self.responses.iter_mut().for_each(stretch);
        }
    }
}

/// Returns the price that a model with lost counts pays for the jumps found in each segment of a
/// recording, in log-likelihood.
fn surcharges(track: &BlockedRecording, model: &Model) -> Vec<f64> {
    let has_jumps = model.effects.iter().any(|effect| effect.name.definition().is_of_jumps());
    let paid = |bounds: &[usize]| match track.jumps.price.get(bounds[0]..bounds[1]) {
        Some(prices) if has_jumps => prices.iter().sum(),
        _ => 0.0,
    };
    track.blocks.segments.windows(2).map(paid).collect()
}

/// A fitted model.
pub(crate) struct Fit {
    pub(crate) prepared: Vec<Prepared>,
    /// For each recording the place of each column in the common solution.
    pub(crate) places: Vec<Vec<usize>>,
    /// The key of each place and, where it is a recording's own, which.
    pub(crate) keys: Vec<Place>,
    pub(crate) solution: Solution,
    /// Log-likelihood with the noise it was fitted under, up to a constant of the data.
    pub(crate) log_likelihood: f64,
}

/// A place in the common vector: its key and, where it is a recording's own, which.
pub(crate) type Place = (Key, Option<usize>);

/// Returns the place of each column of each recording in the common vector of coefficients.
pub(crate) fn layout(prepared: &[Prepared]) -> (Vec<Vec<usize>>, Vec<Place>) {
    let mut keys: Vec<Place> = Vec::new();
    let places = prepared
        .iter()
        .enumerate()
        .map(|(r, one)| {
            one.columns
                .iter()
                .map(|column| {
                    let key = (column.key, column.own.then_some(r));
                    keys.iter().position(|k| *k == key).unwrap_or_else(|| {
                        keys.push(key);
                        keys.len() - 1
                    })
                })
                .collect()
        })
        .collect();
    (places, keys)
}

impl Fit {
    /// Fits a model to recordings.
    pub(crate) fn new(model: &Model, nominal: &Nominal, tracks: &[BlockedRecording], noise: &Noise) -> Self {
        let prepared = parallel::map_all(tracks, |track| Prepared::new(model, nominal, track, noise));
        Self::of(prepared)
    }

    /// Solves for recordings already prepared, and again with stretches that are worse than the
    /// noise weighed down.
    fn of(prepared: Vec<Prepared>) -> Self {
        let mut fit = Self::solve(prepared);
        for _ in 0..2 {
            let mut prepared = fit.prepared;
            for (one, places) in prepared.iter_mut().zip(&fit.places) {
                let squares = one.squares(places, &fit.solution.x);
                one.weigh(&squares);
            }
            fit = Self::solve(prepared);
        }
        let mut cost = fit.solution.prior_cost;
        for (one, places) in fit.prepared.iter().zip(&fit.places) {
            cost += one.costs(places, &fit.solution.x).iter().sum::<f64>();
        }
        fit.log_likelihood = fit.prepared.iter().map(|one| one.gains.log_det).sum::<f64>() - cost;
        fit
    }

    /// Solves normal equations once, without a weight.
    pub(crate) fn solve(prepared: Vec<Prepared>) -> Self {
        let (places, keys) = layout(&prepared);
        let mut priors = vec![Prior::FREE; keys.len()];
        for (one, places) in prepared.iter().zip(&places) {
            for (column, place) in one.columns.iter().zip(places) {
                // The solution is a step from the reference.
                let p = column.prior;
                priors[*place] = Prior { mean: 0.0, sd: p.sd, low: p.low - p.mean, high: p.high - p.mean };
            }
        }
        let (m, b) = normal(&prepared, &places, keys.len());
        let solution = bounded(&m, &b, &priors);
        Self { prepared, places, keys, solution, log_likelihood: 0.0 }
    }

    /// Coefficients of the columns of one recording.
    pub(crate) fn theta(&self, r: usize) -> Vec<f64> {
        let one = &self.prepared[r];
        self.places[r]
            .iter()
            .zip(&one.reference)
            .map(|(place, mean)| mean + self.solution.x[*place])
            .collect()
    }

    /// A shared coefficient by its key (the first recording's where each has its own).
    pub(crate) fn value(&self, key: Key) -> Option<f64> {
        self.value_on(0, key)
    }

    /// Acceleration by the force that is there all the time in one recording.
    pub(crate) fn bias(&self, r: usize) -> f64 {
        self.value_on(r, Key::Offset).unwrap_or(0.0)
    }

    fn value_on(&self, r: usize, key: Key) -> Option<f64> {
        let column = self.prepared[r].columns.iter().position(|c| c.key == key)?;
        Some(self.theta(r)[column])
    }

    /// Amplitudes of an effect whose terms are pairs of cosine and sine, in the first recording.
    pub(crate) fn amplitudes(&self, effect: usize) -> Vec<f64> {
        let of_effect = |(column, theta): (&Column, f64)| {
            matches!(column.key, Key::Term { effect: e, .. } if e == effect).then_some(theta)
        };
        let terms: Vec<f64> =
            self.prepared[0].columns.iter().zip(self.theta(0)).filter_map(of_effect).collect();
        terms.chunks_exact(2).map(|pair| pair[0].hypot(pair[1])).collect()
    }

    /// The total input of the fitted model over each recording.
    pub(crate) fn totals(&self, tracks: &[BlockedRecording]) -> Vec<Total> {
        tracks
            .iter()
            .enumerate()
            .map(|(r, track)| total(track, &self.prepared[r].columns, &self.theta(r)))
            .collect()
    }

    /// Whitened innovations of one recording at the solution.
    pub(crate) fn residual(&self, r: usize) -> Vec<f64> {
        let one = &self.prepared[r];
        let mut out = one.residual.clone();
        for (response, place) in one.responses.iter().zip(&self.places[r]) {
            let step = self.solution.x[*place];
            if step != 0.0 {
                for (out, x) in out.iter_mut().zip(response) {
                    *out -= step * x;
                }
            }
        }
        out
    }
}

/// Normal equations of all recordings.
pub(crate) fn normal(prepared: &[Prepared], places: &[Vec<usize>], size: usize) -> (Square, Vec<f64>) {
    normal_of(prepared, places, size, |_, _| true)
}

/// Normal equations of those segments (by recording and place in it) that are kept.
pub(crate) fn normal_of(
    prepared: &[Prepared],
    places: &[Vec<usize>],
    size: usize,
    is_kept: impl Fn(usize, usize) -> bool,
) -> (Square, Vec<f64>) {
    let mut m = Square::zero(size);
    let mut b = vec![0.0; size];
    for (recording, (one, places)) in prepared.iter().zip(places).enumerate() {
        let p = places.len();
        for (_, segment) in one.segments.iter().enumerate().filter(|(s, _)| is_kept(recording, *s)) {
            for i in 0..p {
                b[places[i]] += segment.at(i, p);
                for j in 0..p {
                    m.add(places[i], places[j], segment.at(i, j));
                }
            }
        }
    }
    (m, b)
}
