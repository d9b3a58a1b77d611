//! Shapes moved to where all effects of a model together leave least force in the band that people
//! see. The first was found before the later ones were known, by a likelihood that counts what is
//! fast most, where a machine is least like its model.

use crate::fit::band_fit::in_band;
use crate::fit::effective_command::effective_commands;
use crate::fit::filter::Noise;
use crate::fit::force_residual::Estimator;
use crate::fit::linear_fit::Fit;
use crate::fit::model::Model;
use crate::fit::noise::Colour;
use crate::laws::Effect;
use crate::laws::definition::Movable;
use crate::propose::candidates;
use crate::propose::context::{FitContext, FittedModel};
use numerics::golden_section::golden;

/// Steps of a line search, and how far it goes: a golden section narrows to a tenth of that.
const STEPS: usize = 6;
const REACH: f64 = 2.2;

/// True if the shape of an effect is searched in a way of its own: waves and joints have many
/// optima.
fn is_searched(effect: &Effect) -> bool {
    effect.name.definition().is_periodic() || effect.is_joint()
}

impl FitContext<'_> {
    /// A model with the shapes of its effects where all together leave least force in the band.
    pub(crate) fn with_shapes_in_band(&self, now: FittedModel) -> FittedModel {
        let mut model = now.model;
        let mut least = self.left_in_band(&model, &now.noise);
        for place in 0..model.effects.len() {
            let effect = model.effects[place].clone();
            let movable =
                if is_searched(&effect) { Vec::new() } else { candidates::movable(&effect, self.span) };
            for value in movable {
                let moved = self.with_value_in_band(&model, place, value, &now.noise);
                if let Some((left, moved)) = moved.filter(|(left, _)| *left < least) {
                    (least, model) = (left, moved);
                }
            }
        }
        self.fit(model, &now.noise, Colour::White)
    }

    /// A model with one value of an effect's shape where it leaves least, and what it leaves; none
    /// where the value has no room.
    fn with_value_in_band(
        &self,
        model: &Model,
        place: usize,
        (key, low, high): Movable,
        noise: &Noise,
    ) -> Option<(f64, Model)> {
        let at = model.effects[place].shape[key];
        let (low, high) = ((at / REACH).max(low).ln(), (at * REACH).min(high).ln());
        let moved_to = |x: f64| {
            let mut moved = model.clone();
            moved.effects[place].shape.insert(key.to_owned(), x.exp());
            moved
        };
        (high > low).then(|| {
            let moved = moved_to(golden(low, high, STEPS, |x| -self.left_in_band(&moved_to(x), noise)));
            (self.left_in_band(&moved, noise), moved)
        })
    }

    /// Acceleration in the band that a model leaves, root mean square; infinite where one of its
    /// effects cannot be what its shape says.
    fn left_in_band(&self, model: &Model, noise: &Noise) -> f64 {
        let ignores = |effective: Vec<Vec<f64>>| self.nominal.ignores_too_much(self.tracks, &effective);
        if !model.effects.iter().all(|effect| effect.name.definition().is_possible(effect))
            || effective_commands(self.tracks, &model.effects).is_some_and(ignores)
        {
            return f64::INFINITY;
        }
        let estimator = Estimator::new(self.tracks, noise, self.scale);
        let fit = in_band(Fit::new(model, self.nominal, self.tracks, noise), self.tracks, &estimator);
        let totals = fit.totals(self.tracks);
        let left: Vec<Vec<f64>> =
            self.tracks.iter().zip(&totals).map(|(track, total)| estimator.residual(track, total)).collect();
        estimator.rms(&left, self.tracks)
    }
}
