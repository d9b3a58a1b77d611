//! Recordings laid out for a selection, with the laws so far and what they leave.

use super::design::{Design, held_out};
use super::laws::{Asked, Columns, columns};
use super::share::Share;
use super::sight::{FEWEST_ROWS, Scale, Sight, priors};
use crate::effects::{Effect, EffectName as N};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::filter::Noise;
use crate::estimation::force_residual::Estimator;
use crate::selection::candidates;
use crate::selection::context::FitContext;
use crate::selection::periodic::{self, Searched};
use numerics::linear::Prior;
use numerics::parallel;

/// Factors by which a value of a shape is moved, a pair in each round.
const MOVES: [[f64; 2]; 3] = [[0.5, 2.0], [0.7, 1.4], [0.85, 1.18]];
/// The number of values of a shape that are moved.
const MOVED: usize = 2;

/// The recordings of a selection.
pub(crate) struct Selection<'a> {
    pub(super) context: &'a FitContext<'a>,
    noise: Noise,
    pub(super) sights: Vec<Sight<'a>>,
    priors: Vec<Prior>,
    /// Number of sights that are fitted.
    pub(super) fits: usize,
}

impl<'a> Selection<'a> {
    /// Lays out recordings; none where too few rows move.
    pub(crate) fn new(
        context: &'a FitContext<'a>,
        noise: Noise,
        holdout: &'a [BlockedRecording],
    ) -> Option<Self> {
        let estimator = Estimator::new(context.tracks, &noise, context.scale);
        let all: Vec<&BlockedRecording> = context.tracks.iter().chain(holdout).collect();
        let mut sights =
            parallel::map(all.len(), |r| Sight::new(all[r], r, context.nominal, &noise, estimator));
        sights.retain(|sight| sight.rows() >= FEWEST_ROWS);
        let priors = priors(context.nominal, &context.tracks[0], &noise);
        let fits = sights.iter().filter(|sight| sight.track.place.is_some()).count();
        (fits > 0 && fits < sights.len()).then_some(Self { context, noise, sights, priors, fits })
    }

    /// An effect in the shape that takes most of the force error by itself; none where a regression
    /// has no law of it.
    pub(crate) fn best_of(&self, name: N) -> Option<Share> {
        let first = State::new(self, Vec::new());
        first.ranked(&|other| other == name).into_iter().next().map(|(share, _)| share)
    }

    /// The band in which everything is seen, Hz.
    pub(super) fn bandwidth_hz(&self) -> f64 {
        self.sights[0].bandwidth_hz()
    }

    fn designs(&self, laws: &[&Columns]) -> (Design, Design) {
        let of = |from: usize, to: usize| Design::new(&self.sights[from..to], from, &self.priors, laws);
        (of(0, self.fits), of(self.fits, self.sights.len()))
    }
}

/// The laws so far, with what they leave.
pub(super) struct State<'a> {
    pub(super) on: &'a Selection<'a>,
    laws: Vec<&'a Columns>,
    /// Mean squares that are left on folds of the fitted recordings and on held-out ones.
    pub(super) left: (f64, f64),
    square: f64,
    pub(super) asked: Asked,
}

impl<'a> State<'a> {
    pub(super) fn new(on: &'a Selection<'a>, laws: Vec<&'a Columns>) -> Self {
        let (fitted, there) = on.designs(&laws);
        // Once with a guess of the residual, and again with that.
        let guess = fitted.left_by(&fitted.solve(0.01 * fitted.target(), |_| true));
        let x = fitted.solve(guess, |_| true);
        let square = fitted.left_by(&x);
        let left = (fitted.left_out(square), held_out(&fitted, &x, &there, square, &laws));
        let asked = Asked::new(on.sights.iter().map(|sight| asked(on, sight, &x)).collect());
        Self { on, laws, left, square, asked }
    }

    /// Part of the error that a law takes on stretches left out of the fit, with the design.
    pub(super) fn on_fit(&self, tried: &Columns) -> f64 {
        let mut laws = self.laws.clone();
        laws.push(tried);
        let on = self.on;
        let fitted = Design::new(&on.sights[..on.fits], 0, &on.priors, &laws);
        1.0 - (fitted.left_out(self.square) / self.left.0.max(1e-300)).sqrt()
    }

    pub(super) fn share(&self, tried: &Columns) -> Option<Share> {
        let mut laws = self.laws.clone();
        laws.push(tried);
        let (fitted, there) = self.on.designs(&laws);
        let x = fitted.solve(self.square, |_| true);
        let own = there.solve(self.square, |_| true);
        let last = laws.len() - 1;
        let on_holdout = held_out(&fitted, &x, &there, self.square, &laws);
        let share = Share {
            effect: tried.effect.clone(),
            on_fit: 1.0 - (fitted.left_out(self.square) / self.left.0.max(1e-300)).sqrt(),
            on_holdout: 1.0 - (on_holdout / self.left.1.max(1e-300)).sqrt(),
            size: size(&fitted, &x, &there, &own, last, tried.own),
            at_bound: is_at_bound(&fitted, &x, last, &tried.bounds),
        };
        (share.on_fit.is_finite() && share.on_holdout.is_finite()).then_some(share)
    }

    /// The coefficients of a law of one term on fitted and on held-out recordings.
    pub(super) fn sizes(&self, law: &Columns) -> (f64, f64) {
        let mut laws = self.laws.clone();
        laws.push(law);
        let (fitted, there) = self.on.designs(&laws);
        let size = |design: &Design| design.solve(self.square, |_| true)[design.laws[laws.len() - 1][0][0]];
        (size(&fitted), size(&there))
    }

    /// The best shape of every effect that may be added, the one with the largest share first.
    pub(super) fn ranked(&self, wanted: &(dyn Fn(N) -> bool + Sync)) -> Vec<(Share, Columns)> {
        let context = self.on.context;
        let model = crate::estimation::model::Model {
            effects: self.laws.iter().map(|law| law.effect.clone()).collect(),
            ..Default::default()
        };
        let now = context.fit_at(model, &self.on.noise);
        let residuals: Vec<Vec<f64>> = (0..context.tracks.len()).map(|r| now.fit.residual(r)).collect();
        let all = context.that_may_show(&now.model, wanted);
        let is_periodic = |name: &N| name.definition().is_periodic();
        // Waves that are significant as a force may belong to the drive, and the other way round.
        let sought: Vec<N> = match all.iter().any(is_periodic) {
            true => N::ALL.iter().copied().filter(is_periodic).collect(),
            false => Vec::new(),
        };
        let searched = Searched { fit: &now.fit, residuals: &residuals, model: &now.model };
        let waves: Vec<Effect> =
            periodic::search(&sought, context, &searched).into_iter().map(|(effect, _)| effect).collect();
        let best_of = |name: &N| -> Option<(Share, Columns)> {
            let tried = match is_periodic(name) {
                true => self.best_waves(*name, &waves)?,
                false => self.best_shape(*name)?,
            };
            Some((self.share(&tried)?, tried))
        };
        let mut found: Vec<(Share, Columns)> =
            parallel::map_all(&all, best_of).into_iter().flatten().collect();
        found.sort_by(|a, b| b.0.least().total_cmp(&a.0.least()));
        found
    }

    pub(super) fn columns(&self, effect: &Effect) -> Option<Columns> {
        columns(effect, &self.on.sights, self.on.context.nominal, &self.asked)
    }

    /// The shape of an effect that takes most on stretches left out of the fit; none for a joint,
    /// whose shape only the search finds.
    fn best_shape(&self, name: N) -> Option<Columns> {
        let on = self.on;
        if name.definition().coupling().is_some() {
            return None;
        }
        let grid = candidates::shapes(name, on.context.span, on.context.nominal);
        let tried = grid.iter().filter_map(|effect| {
            let columns = self.columns(effect)?;
            Some((self.on_fit(&columns), columns))
        });
        let mut best = tried.max_by(|a, b| a.0.total_cmp(&b.0))?;
        for moves in MOVES {
            for (key, low, high) in candidates::movable(&best.1.effect, on.context.span).iter().take(MOVED) {
                let at = best.1.effect.shape[*key];
                for factor in moves {
                    let mut effect = best.1.effect.clone();
                    effect.shape.insert((*key).to_owned(), (at * factor).clamp(*low, *high));
                    if !name.definition().is_possible(&effect) {
                        continue;
                    }
                    let Some(moved) = self.columns(&effect) else { continue };
                    let share = self.on_fit(&moved);
                    if share > best.0 {
                        best = (share, moved);
                    }
                }
            }
        }
        Some(best.1)
    }
}

/// The drive's force that the nominal terms ask for, with the recording's own offset.
fn asked(on: &Selection, sight: &Sight, x: &[f64]) -> Vec<f64> {
    let none = vec![0.0; sight.track.block_count()];
    let predicted = sight.asked(&x[..sight.nominal.len()], &none);
    let gain = Scale::of(on.context.nominal).gain;
    let drive = sight.blocks_of(&sight.track.rows.command_input);
    let drive: Vec<f64> = drive.iter().map(|u| gain * u).collect();
    let offset = sight.offset(&drive, &predicted);
    predicted.iter().map(|force| force + offset).collect()
}

/// Size of the last law on held-out recordings over that on fitted ones.
fn size(fitted: &Design, x: &[f64], there: &Design, own: &[f64], law: usize, has_own_phase: bool) -> f64 {
    if has_own_phase {
        let square = |x: &[f64], places: &[Vec<usize>]| {
            places.iter().flatten().map(|place| x[*place].powi(2)).sum::<f64>() / places.len() as f64
        };
        return (square(own, &there.laws[law]) / square(x, &fitted.laws[law]).max(1e-300)).sqrt();
    }
    let mut carried = own.to_vec();
    for (from, to) in fitted.laws[law][0].iter().zip(&there.laws[law][0]) {
        carried[*to] = x[*from];
    }
    there.along(law, &carried, own) / there.along(law, &carried, &carried).max(1e-300)
}

/// True if a coefficient of a law is at one of its bounds; zero does not count as one.
fn is_at_bound(design: &Design, x: &[f64], law: usize, bounds: &[(f64, f64)]) -> bool {
    let is_at = |x: f64, bound: f64| bound.is_finite() && bound != 0.0 && (x / bound - 1.0).abs() < 1e-6;
    let places = design.laws[law].iter();
    places
        .flat_map(|of| of.iter().zip(bounds))
        .any(|(place, (low, high))| is_at(x[*place], *low) || is_at(x[*place], *high))
}
