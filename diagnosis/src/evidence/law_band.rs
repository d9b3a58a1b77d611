//! The band of the force that the named laws take: its ends where their values are at the ends of
//! their 95 % intervals.

use crate::data::schema::Parameter;
use crate::evidence::parameters::{robust_covariance, scale};
use crate::evidence::residuals::forces;
use crate::fit::force_residual::Estimator;
use crate::fit::input::Total;
use crate::fit::model::Model;
use crate::laws::EffectName;
use crate::propose::context::{FitContext, FittedModel};
use std::collections::BTreeMap;

/// Force below and above that of the laws, N·m or N, both positive.
pub(crate) type Reach = [f64; 2];

/// A named effect with its values as the report has them.
pub(crate) type Named<'a> = (EffectName, &'a BTreeMap<String, Parameter>);

/// The band of the named laws.
pub(crate) struct Band {
    /// In each block of each fitted recording: what the fitted values allow.
    blocks: Vec<Vec<Reach>>,
    /// The interval of the first effect's best known size as a part of it. Where the size is at an
    /// end and the other values are fitted again, what the laws take grows or shrinks by this.
    relative: Reach,
}

impl Band {
    /// The band of `fitted`, whose effects are `named` with the intervals of the report.
    pub(crate) fn new(
        context: &FitContext,
        estimator: &Estimator,
        fitted: &FittedModel,
        named: &[Named],
    ) -> Self {
        let mut blocks = by_values(context, estimator, fitted);
        let ends = shapes_at_ends(&fitted.model, named);
        if !ends.is_empty() {
            let left_by = |model: Model| left(context, estimator, &context.fit_at(model, &fitted.noise));
            let here = left_by(fitted.model.clone());
            for end in ends.into_iter().map(left_by) {
                add(&mut blocks, &here, &end);
            }
        }
        Self { blocks, relative: named.first().map(|one| relative(*one)).unwrap_or_default() }
    }

    /// Reach of a force that the laws take in a block of a fitted recording.
    pub(crate) fn reach(&self, recording: usize, block: usize, law: f64) -> Reach {
        let [low, high] = self.blocks[recording][block];
        [low.max(self.relative[0] * law.abs()), high.max(self.relative[1] * law.abs())]
    }
}

/// Adds, as independent ones do, the way from one residual to another.
fn add(blocks: &mut [Vec<Reach>], here: &[Vec<f64>], end: &[Vec<f64>]) {
    for ((blocks, here), end) in blocks.iter_mut().zip(here).zip(end) {
        for ((reach, here), end) in blocks.iter_mut().zip(here).zip(end) {
            // A smaller residual is a larger force of the laws.
            let side = usize::from(here > end);
            reach[side] = reach[side].hypot(here - end);
        }
    }
}

/// The residual force of a fit on its recordings.
fn left(context: &FitContext, estimator: &Estimator, fitted: &FittedModel) -> Vec<Vec<f64>> {
    let totals = fitted.fit.totals(context.tracks);
    forces(estimator, context.tracks, &totals, scale(context.nominal, fitted).0)
}

/// The reach by the covariance of all fitted values, those of the rig too: they move together.
fn by_values(context: &FitContext, estimator: &Estimator, fitted: &FittedModel) -> Vec<Vec<Reach>> {
    let (covariance, inertia) = (robust_covariance(fitted), scale(context.nominal, fitted).0);
    let all = context.tracks.iter().zip(&fitted.fit.prepared).zip(&fitted.fit.places);
    all.map(|((track, prepared), places)| {
        let responses: Vec<Vec<f64>> = prepared
            .columns
            .iter()
            .map(|column| {
                let mut total = Total::zero(track.block_count());
                track.add_input(&mut total, &column.input, 1.0);
                estimator.response(track, &total)
            })
            .collect();
        let variance = |block: usize| -> f64 {
            let pairs = places
                .iter()
                .zip(&responses)
                .flat_map(|a| places.iter().zip(&responses).map(move |b| (a, b)));
            pairs.map(|((i, a), (j, b))| a[block] * b[block] * covariance.at(*i, *j)).sum()
        };
        let reach = |block| [inertia * 1.96 * variance(block).max(0.0).sqrt(); 2];
        (0..track.block_count()).map(reach).collect()
    })
    .collect()
}

/// The model with each value of a shape that has an interval at one of its ends.
fn shapes_at_ends(model: &Model, named: &[Named]) -> Vec<Model> {
    let mut all = Vec::new();
    for (place, effect) in model.effects.iter().enumerate() {
        let Some((_, values)) = named.iter().find(|one| one.0 == effect.name) else { continue };
        // An order of a wave is a key of the shape, and its amplitude is reported by the same name.
        let is_shape = |key: &str, value: f64| {
            effect.shape.get(key).is_some_and(|shape| (shape - value).abs() < 0.01 * value.abs())
        };
        for (key, p) in values.iter().filter(|(key, p)| is_shape(key, p.value)) {
            all.extend(p.ci95.map(|end| {
                let mut moved = model.clone();
                // A value keeps its sign: an interval may hold zero, and a shape may not.
                let by = (end / p.value).max(0.05);
                moved.effects[place].shape.entry(key.clone()).and_modify(|value| *value *= by);
                moved
            }));
        }
    }
    all
}

/// The interval of the best known size of an effect, below and above, as a part of its value.
fn relative((name, values): Named) -> Reach {
    let is_size = |key: &str| name.definition().is_size(key);
    let sizes = values.iter().filter(|(key, p)| is_size(key) && p.value != 0.0);
    let ends = sizes.map(|(_, p)| {
        let ends = p.ci95.map(|end| (end - p.value) / p.value);
        [(-ends[0].min(ends[1])).max(0.0), ends[0].max(ends[1]).max(0.0)]
    });
    ends.min_by(|a, b| (a[0] + a[1]).total_cmp(&(b[0] + b[1]))).unwrap_or_default()
}
