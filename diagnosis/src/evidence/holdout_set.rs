//! Held-out recordings with the motion that a fitted model sees in them, in two estimates: a causal
//! one for likelihoods and a smoothed one for force errors.

use crate::evidence::holdout_likelihood::evaluate_all;
use crate::evidence::known_travel::known;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::input::Total;
use crate::fit::model::Model;
use crate::fit::noise::guess;
use crate::fit::nominal::Nominal;
use crate::fit::refit::estimate_motion;
use crate::fit::smoother::Knows;
use crate::laws::definition::Span;
use crate::propose::context::FittedModel;
use std::borrow::Cow;

/// Held-out recordings, both times in the order given.
#[derive(Debug, Clone, Default)]
pub(crate) struct HoldoutSet {
    /// Each block's motion from the rows until then. Likelihood gains come from here: a smoother
    /// knows the disturbance from which a force is to be distinguished.
    pub(crate) filtered: Vec<BlockedRecording>,
    /// Each block's motion from all rows. Force errors come from here: where counts are coarse the
    /// error of a filtered speed would be most of them.
    pub(crate) smoothed: Vec<BlockedRecording>,
}

impl HoldoutSet {
    /// Recordings of which nothing has been estimated yet.
    pub(crate) fn new(tracks: Vec<BlockedRecording>) -> Self {
        Self { filtered: tracks.clone(), smoothed: tracks }
    }

    /// Estimates both motions with a fitted model; `scale` is the acceleration that the command
    /// makes.
    pub(crate) fn follow(&mut self, candidate: &FittedModel, nominal: &Nominal, span: &Span, scale: f64) {
        follow(candidate, nominal, span, &mut self.filtered, scale, Knows::Past);
        follow(candidate, nominal, span, &mut self.smoothed, scale, Knows::All);
    }

    /// Takes the jumps of the reading that were found in the filtered motion for both.
    pub(crate) fn share_jumps(&mut self) {
        for (smoothed, filtered) in self.smoothed.iter_mut().zip(&self.filtered) {
            smoothed.jumps.lost.clone_from(&filtered.jumps.lost);
            smoothed.jumps.price.clone_from(&filtered.jumps.price);
        }
    }

    /// The filtered recordings with the blocks marked of which a model knows nothing.
    pub(crate) fn judging(&self, model: &Model, span: &Span) -> Cow<'_, [BlockedRecording]> {
        known(&self.filtered, model, span)
    }

    /// The smoothed recordings with the blocks marked of which a model knows nothing.
    pub(crate) fn shown(&self, model: &Model, span: &Span) -> Cow<'_, [BlockedRecording]> {
        known(&self.smoothed, model, span)
    }
}

fn follow(
    candidate: &FittedModel,
    nominal: &Nominal,
    span: &Span,
    tracks: &mut [BlockedRecording],
    scale: f64,
    knows: Knows,
) {
    let count = 1.0 / nominal.rig.encoder.counts_per_unit;
    // The first look trusts no friction: its sign is not known yet, and a filter that believes in
    // the wrong one keeps to it.
    let drives: Vec<Total> = tracks.iter().map(|track| track.command_total(nominal.gain())).collect();
    let first = guess(tracks, scale);
    estimate_motion(tracks, &drives, &first, count, knows);
    for _ in 0..3 {
        let evaluated =
            evaluate_all(candidate, nominal, &known(tracks, &candidate.model, span), &candidate.noise);
        for (track, evaluated) in tracks.iter_mut().zip(&evaluated) {
            track.bias = evaluated.bias;
        }
        let totals: Vec<Total> = evaluated.into_iter().map(|evaluated| evaluated.total).collect();
        estimate_motion(tracks, &totals, &candidate.noise, count, knows);
    }
}
