//! From coefficients to the numbers of the report: values in the rig's units with intervals, by the
//! contract's names.

use crate::data::schema::Parameter;
use crate::fit::blocked_recording::BlockedRecording;
use crate::fit::nominal::{Key, Nominal};
use crate::laws::definition::{Fitted, NominalTerm, Reported};
use crate::laws::{Effect, EffectName as N};
use crate::propose::context::{FitContext, FittedModel};
use numerics::linear::Square;
use std::collections::BTreeMap;

/// Inertia and gain that go with a fitted ratio of the two, by what the rig declares of each; and
/// the relative standard deviation of their common scale, which no recording of motion can narrow.
pub(crate) fn scale(nominal: &Nominal, candidate: &FittedModel) -> (f64, f64, f64) {
    let rig = &nominal.rig;
    let ratio = candidate.fit.value(Key::Gain).unwrap_or(nominal.gain());
    let off = (ratio / nominal.gain()).abs().max(1e-12).ln();
    let (sg, sj) = (rig.gain_sd().powi(2), rig.inertia_sd().powi(2));
    let gain = rig.actuator.gain * (off * sg / (sg + sj)).exp();
    (gain / ratio, gain, (sg * sj / (sg + sj)).sqrt())
}

/// Covariance of the coefficients that allows for residuals that hang together within a segment.
pub(crate) fn robust_covariance(candidate: &FittedModel) -> Square {
    let fit = &candidate.fit;
    let size = fit.keys.len();
    let mut middle = Square::zero(size);
    for (one, places) in fit.prepared.iter().zip(&fit.places) {
        let p = places.len();
        for pair in one.segments.chunks(2) {
            let mut score = vec![0.0; size];
            for segment in pair {
                for i in 0..p {
                    let fitted: f64 = (0..p).map(|j| segment.at(i, j) * fit.solution.x[places[j]]).sum();
                    score[places[i]] += segment.at(i, p) - fitted;
                }
            }
            for i in 0..size {
                for j in 0..size {
                    middle.add(i, j, score[i] * score[j]);
                }
            }
        }
    }
    let c = &fit.solution.covariance;
    let mut half = Square::zero(size);
    let mut out = Square::zero(size);
    for i in 0..size {
        for j in 0..size {
            half.a[i * size + j] = (0..size).map(|k| c.at(i, k) * middle.at(k, j)).sum();
        }
    }
    for i in 0..size {
        for j in 0..size {
            out.a[i * size + j] = (0..size).map(|k| half.at(i, k) * c.at(k, j)).sum();
        }
    }
    // Never narrower than the noise alone would have it.
    for i in 0..size {
        for j in 0..size {
            let ratio = |k: usize| {
                let (a, b) = (out.at(k, k), c.at(k, k));
                if a > 0.0 && b > a { (b / a).sqrt() } else { 1.0 }
            };
            half.a[i * size + j] = out.at(i, j) * ratio(i) * ratio(j);
        }
    }
    half
}

/// Relative standard deviation of a shape value from the curvature of the likelihood.
pub(crate) fn shape_sd(context: &FitContext, candidate: &FittedModel, effect: usize, key: &str) -> f64 {
    let likelihood = |factor: f64| {
        let mut model = candidate.model.clone();
        let value = model.effects[effect].shape[key];
        model.effects[effect].shape.insert(key.to_owned(), value * factor);
        crate::fit::linear_fit::Fit::new(&model, context.nominal, context.tracks, &candidate.noise)
            .log_likelihood
    };
    let here = candidate.fit.log_likelihood;
    let mut step = 0.02_f64;
    for _ in 0..5 {
        let drop = here - 0.5 * (likelihood(step.exp()) + likelihood((-step).exp()));
        if drop > 0.5 {
            // Twofold for shapes of another family than the one fitted.
            return (step * step / (2.0 * drop)).sqrt() * 1.5;
        }
        step *= 2.2;
    }
    step
}

/// True if the interval of at least one size of an effect excludes zero.
pub(crate) fn is_there(name: N, parameters: &BTreeMap<String, Parameter>) -> bool {
    parameters.is_empty() || sizes(name, parameters).any(|p| p.ci95[0] * p.ci95[1] > 0.0)
}

/// True if at least one size of an effect is not zero. That is enough where its shares on fitted
/// and on held-out recordings say that it is there: the interval allows for all else that the model
/// leaves.
pub(crate) fn has_size(name: N, parameters: &BTreeMap<String, Parameter>) -> bool {
    parameters.is_empty() || sizes(name, parameters).any(|p| p.value != 0.0)
}

/// The parameters that are sizes, and do not say where or when an effect acts.
fn sizes(name: N, parameters: &BTreeMap<String, Parameter>) -> impl Iterator<Item = &Parameter> {
    parameters.iter().filter(move |(key, _)| name.definition().is_size(key)).map(|(_, p)| p)
}

/// True if the size of an effect of a fitted model may be zero.
pub(crate) fn is_absent(context: &FitContext, fitted: &FittedModel, effect: usize) -> bool {
    !is_there(fitted.model.effects[effect].name, &parameters(context, fitted, effect))
}

/// The coefficients of an effect of a fitted model with their standard deviations, and their
/// covariance.
fn own_terms(candidate: &FittedModel, effect: usize) -> (Vec<(f64, f64)>, Square) {
    let fit = &candidate.fit;
    let covariance = robust_covariance(candidate);
    let theta = fit.theta(0);
    let own: Vec<(usize, f64)> = fit.prepared[0]
        .columns
        .iter()
        .zip(&fit.places[0])
        .zip(&theta)
        .filter(|((column, _), _)| matches!(column.key, Key::Term { effect: e, .. } if e == effect))
        .map(|((_, place), theta)| (*place, *theta))
        .collect();
    let mut of_terms = Square::zero(own.len());
    for (i, (a, _)) in own.iter().enumerate() {
        for (j, (b, _)) in own.iter().enumerate() {
            of_terms.add(i, j, covariance.at(*a, *b));
        }
    }
    let sd = |place: usize| covariance.at(place, place).max(0.0).sqrt();
    (own.iter().map(|(place, theta)| (*theta, sd(*place))).collect(), of_terms)
}

/// The parameters of an effect of a fitted model.
pub(crate) fn parameters(
    context: &FitContext,
    candidate: &FittedModel,
    effect: usize,
) -> BTreeMap<String, Parameter> {
    let nominal = context.nominal;
    let found: &Effect = &candidate.model.effects[effect];
    let (inertia, _, common) = scale(nominal, candidate);
    let fit = &candidate.fit;
    let ratio = fit.value(Key::Gain).unwrap_or(1.0);
    let (terms, of_terms) = own_terms(candidate, effect);
    let friction = |key: Key, term: NominalTerm| {
        fit.value(key).or_else(|| {
            let is_same = |e: &Effect| e.name.definition().nominal_term() == Some(term);
            let other = candidate.model.effects.iter().position(is_same)?;
            fit.value(Key::Term { effect: other, term: 0 })
        })
    };
    let lost =
        |track: &BlockedRecording| track.jumps.lost.windows(2).map(|w| (w[1] - w[0]).abs()).sum::<f64>();
    let kind = nominal.rig.kind;
    let fitted = Fitted {
        effect: found,
        terms,
        covariance: of_terms,
        inertia,
        common,
        ratio,
        viscous: friction(Key::Viscous, NominalTerm::Viscous),
        dry: friction(Key::Coulomb, NominalTerm::Coulomb),
        own_dry: fit.value(Key::Coulomb).unwrap_or(0.0),
        lost: context.tracks.iter().map(lost).sum::<f64>() * nominal.rig.encoder.counts_per_unit,
        force: kind.force(),
        length: kind.length(),
        command: nominal.rig.actuator.command_unit.clone(),
        shape_sd: &|key| shape_sd(context, candidate, effect, key),
    };
    let definition = found.name.definition();
    let with_interval = |Reported { name, value, sd, unit }| {
        let reach = 1.96 * sd.hypot(definition.form_sd(&name) * value);
        (name, Parameter { value, ci95: [value - reach, value + reach], unit })
    };
    definition.report(&fitted).into_iter().map(with_interval).collect()
}
