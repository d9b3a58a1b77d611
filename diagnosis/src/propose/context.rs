//! The context of every search: the recordings with their nominal model, and fits of a model to
//! them.

use crate::fit::band_fit::in_band;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::effective_command::effective_commands;
use crate::fit::filter::Noise;
use crate::fit::force_residual::Estimator;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::noise::{self, Colour};
use crate::fit::nominal::Nominal;
use crate::laws::definition::Span;
use crate::laws::{Effect, EffectName};
use crate::propose::candidates;
use numerics::parallel;

/// A model fitted with the noise that goes with it.
pub(crate) struct FittedModel {
    pub(crate) model: Model,
    pub(crate) noise: Noise,
    pub(crate) fit: Fit,
    /// Log-likelihood less what its freedom costs.
    pub(crate) log_score: f64,
}

/// Everything that selection works on.
pub(crate) struct FitContext<'a> {
    pub(crate) nominal: &'a Nominal,
    pub(crate) tracks: &'a [BlockedRecording],
    pub(crate) span: &'a Span,
    /// Acceleration that the command makes: the scale of the noise search.
    pub(crate) scale: f64,
    /// Effects that are not sought, whatever the likelihood says.
    pub(crate) unsought: &'a [EffectName],
}

/// Cost of one fitted value in log-likelihood: half the logarithm of the number of independent
/// stretches is about 3; shapes are searched and cost more.
pub(crate) const PER_COEFFICIENT: f64 = 2.5;
const PER_SHAPE: f64 = 4.0;
/// Most effects that are named together.
pub(crate) const MOST_EFFECTS: usize = 3;

/// Returns the cost of an effect's freedom, nats.
pub(crate) fn cost(effect: &Effect, tracks: usize, span: &Span) -> f64 {
    let movable = candidates::movable(effect, span).len() as f64;
    let coefficients = effect.name.definition().freedom(effect, tracks);
    PER_COEFFICIENT * coefficients as f64 + PER_SHAPE * movable
}

impl FitContext<'_> {
    /// Fits a model with noise of its own, starting from known noise.
    pub(crate) fn fit(&self, model: Model, from: &Noise, colour: Colour) -> FittedModel {
        let first = Fit::new(&model, self.nominal, self.tracks, from);
        let totals = first.totals(self.tracks);
        let noise = noise::estimate(self.tracks, &totals, from, self.scale, colour);
        let fit = Fit::new(&model, self.nominal, self.tracks, &noise);
        let log_score = fit.log_likelihood - self.spent(&model);
        FittedModel { model, noise, fit, log_score }
    }

    /// Fits a model whose values are shown. Where shares of the force error select, its values are
    /// fitted to the force in the band that people see: likelihoods count what is fast most, where
    /// a machine is least like its model.
    pub(crate) fn fit_shown(&self, model: Model, from: &Noise, by_shares: bool) -> FittedModel {
        let nominal = self.nominal.shown();
        let shown = FitContext { nominal: &nominal, ..*self };
        let white = shown.fit(model, from, Colour::White);
        if by_shares { shown.fit_in_band(white) } else { white }
    }

    /// Fits a model again, to the force in the band that people see.
    pub(crate) fn fit_in_band(&self, white: FittedModel) -> FittedModel {
        let estimator = Estimator::new(self.tracks, &white.noise, self.scale);
        let fit = in_band(white.fit, self.tracks, &estimator);
        FittedModel { fit, ..white }
    }

    /// Returns the cost of the freedom of all effects of a model, nats.
    fn spent(&self, model: &Model) -> f64 {
        model.effects.iter().map(|effect| cost(effect, self.tracks.len(), self.span)).sum()
    }

    /// Fits a model under known noise.
    pub(crate) fn fit_at(&self, model: Model, noise: &Noise) -> FittedModel {
        let fit = Fit::new(&model, self.nominal, self.tracks, noise);
        let log_score = fit.log_likelihood - self.spent(&model);
        FittedModel { model, noise: *noise, fit, log_score }
    }

    /// The best of fits under coloured noise from several starts: where the noise may be slow, what
    /// a model explains and what a disturbance explains are two optima.
    pub(crate) fn fit_coloured(&self, model: Model, starts: &[&Noise]) -> FittedModel {
        let fits = parallel::map_all(starts, |from| self.fit(model.clone(), from, Colour::Slow));
        fits.into_iter().max_by(|a, b| a.log_score.total_cmp(&b.log_score)).expect("at least one start")
    }

    /// Log-likelihood of a model's fit under some noise, where its last effect may be what its
    /// shape says.
    pub(crate) fn log_score_of(&self, model: &Model, noise: &Noise) -> f64 {
        let effect = model.effects.last().expect("there is an effect to polish");
        let effective = effective_commands(self.tracks, &model.effects);
        let ignores = |effective: Vec<Vec<f64>>| self.nominal.ignores_too_much(self.tracks, &effective);
        if !effect.name.definition().is_possible(effect) || effective.is_some_and(ignores) {
            return f64::NEG_INFINITY;
        }
        Fit::new(model, self.nominal, self.tracks, noise).log_likelihood
    }
}
