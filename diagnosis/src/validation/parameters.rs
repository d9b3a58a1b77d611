//! From coefficients to the numbers of the report: values in the rig's units with intervals, by the contract's names.

use crate::effects::{Effect, EffectName as N, bristle_lengths, legendre};
use crate::estimation::blocked_recording::BlockedRecording;
use crate::estimation::model::{Key, Nominal};
use crate::io::schema::Parameter;
use crate::numerics::linear::Square;
use crate::selection::search::{FitContext, FittedModel};
use crate::validation::holdout::waves_of;
use std::collections::BTreeMap;

/// Relative standard deviation of a value for the form of its law alone: the machine's law is never quite ours, and an
/// interval that only noise makes is too narrow. From recordings of machines with other laws of the same names, none of
/// which judges.
fn form_sd(name: N, value: &str) -> f64 {
    match (name, value) {
        (N::StribeckFriction, "peak") => 0.2,
        (N::StribeckFriction, _) => 0.18,
        (N::PositionDependentFriction | N::PositionDependentDamping | N::PositionSpring, _) => 0.13,
        (N::RollerSlip | N::PreslidingFriction, _) => 0.15,
        (N::Backlash, _) => 0.4,
        (N::FrictionDrift | N::GainDrift, "time_constant") => 0.06,
        (N::EncoderEccentricity, _) => 0.05,
        (N::ElectricalLag | N::FrictionDrift | N::GainDrift, _) => 0.04,
        (N::DriveCompliance, _) => 0.035,
        (N::CommandDeadband | N::LoadDependentFriction | N::TiltGravity, _) => 0.03,
        (N::AsymmetricFriction, _) => 0.025,
        (N::TorqueRipple, _) => 0.03,
        (N::CommandDelay, _) => 0.015,
        (N::CommandSaturation, _) => 0.02,
        _ => 0.005,
    }
}

/// Inertia and gain that go with a fitted ratio of the two, by what the rig declares of each; and the relative standard
/// deviation of their common scale, which no recording of motion can narrow.
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
    let at = |factor: f64| {
        let mut model = candidate.model.clone();
        let value = model.effects[effect].shape[key];
        model.effects[effect].shape.insert(key.to_owned(), value * factor);
        crate::estimation::fit::Fit::new(&model, context.nominal, context.tracks, &candidate.noise)
            .log_likelihood
    };
    let here = candidate.fit.log_likelihood;
    let mut step = 0.02_f64;
    for _ in 0..5 {
        let drop = here - 0.5 * (at(step.exp()) + at((-step).exp()));
        if drop > 0.5 {
            // Twofold for shapes of another family than the one fitted.
            return (step * step / (2.0 * drop)).sqrt() * 1.5;
        }
        step *= 2.2;
    }
    step
}

/// Whether at least one of the values that say how large an effect is cannot be zero.
pub(crate) fn is_there(name: N, parameters: &BTreeMap<String, Parameter>) -> bool {
    let drifts = matches!(name, N::FrictionDrift | N::GainDrift);
    let where_or_when = |key: &str| key.starts_with("period") || (drifts && key == "time_constant");
    parameters.is_empty()
        || parameters.iter().any(|(key, p)| !where_or_when(key) && p.ci95[0] * p.ci95[1] > 0.0)
}

/// Why an effect without a size is none.
pub(crate) const NO_SIZE: &str = "its size cannot be told from zero";

/// Why an effect of a fitted model may not be named although it explains something: it does by what it shares with others.
pub(crate) fn absence(context: &FitContext, fitted: &FittedModel, effect: usize) -> Option<String> {
    let name = fitted.model.effects[effect].name;
    let is_there = is_there(name, &parameters(context, fitted, effect));
    (!is_there).then(|| NO_SIZE.to_owned())
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
    let covariance = robust_covariance(candidate);
    let fit = &candidate.fit;
    let ratio = fit.value(Key::Gain).unwrap_or(1.0);
    let theta = fit.theta(0);
    let column = |key: Key| fit.prepared[0].columns.iter().position(|c| c.key == key);
    let term = |k: usize| -> (f64, f64) {
        column(Key::Term { effect, term: k }).map_or((0.0, 0.0), |i| {
            let place = fit.places[0][i];
            (theta[i], covariance.at(place, place).max(0.0).sqrt())
        })
    };
    let kind = nominal.rig.kind;
    let (force, length) = (kind.force(), kind.length());
    let command = nominal.rig.actuator.command_unit.clone();
    let mut out = BTreeMap::new();
    let mut put = |name: &str, value: f64, sd: f64, unit: String| {
        let reach = 1.96 * sd.hypot(form_sd(found.name, name) * value);
        out.insert(name.to_owned(), Parameter { value, ci95: [value - reach, value + reach], unit });
    };
    // A force: the coefficient times the inertia, whose scale is known no better than the rig says.
    let scaled = |(x, sd): (f64, f64)| {
        let value = x * inertia;
        (value, ((sd * inertia).powi(2) + (value * common).powi(2)).sqrt())
    };
    let shape = |key: &str| -> (f64, f64) {
        let value = found.shape_or(key, 0.0);
        (value, value * shape_sd(context, candidate, effect, key))
    };
    let sized = |pairs: &[(f64, f64)]| -> (f64, f64) {
        let square: f64 = pairs.iter().map(|(x, _)| x * x).sum();
        let size = square.sqrt();
        let sd = pairs.iter().map(|(x, s)| (x * s).powi(2)).sum::<f64>().sqrt() / size.max(1e-300);
        (size, sd)
    };
    match found.name {
        N::ViscousFriction => {
            let (v, s) = scaled(term(0));
            put("viscous", v, s, format!("{force}·s/{length}"));
        }
        N::CoulombFriction => {
            let (v, s) = scaled(term(0));
            put("coulomb", v, s, force.into());
        }
        N::TiltGravity => {
            let (v, s) = scaled(term(0));
            put("weight", v, s, force.into());
        }
        N::QuadraticDrag => {
            let (v, s) = scaled(term(0));
            put("coefficient", v, s, format!("{force}·s²/{length}²"));
        }
        N::LoadDependentFriction => {
            let (v, s) = scaled(term(0));
            put("coefficient", v, s, "1".into());
        }
        N::PositionSpring => {
            let (v, s) = scaled(term(0));
            put("stiffness", v, s, format!("{force}/{length}"));
        }
        N::AsymmetricFriction => {
            let pick = |key: Key, name: N| {
                fit.value(key).or_else(|| {
                    let other = candidate.model.effects.iter().position(|e| e.name == name)?;
                    fit.value(Key::Term { effect: other, term: 0 })
                })
            };
            if let Some(b) = pick(Key::Viscous, N::ViscousFriction).filter(|b| *b != 0.0) {
                put("viscous_asymmetry", term(0).0 / b, (term(0).1 / b).abs(), "1".into());
            }
            if let (Some(c), true) =
                (pick(Key::Coulomb, N::CoulombFriction).filter(|c| *c != 0.0), term(1).1 > 0.0)
            {
                put("coulomb_asymmetry", term(1).0 / c, (term(1).1 / c).abs(), "1".into());
            }
        }
        N::StribeckFriction => {
            let (v, s) = scaled(term(0));
            put("peak", v, s, force.into());
            let (v, s) = shape("speed");
            put("speed", v, s, format!("{length}/s"));
        }
        N::PreslidingFriction => {
            let (c, cs) = scaled(term(0));
            // How far they bend may be hardly known where how much they hold is.
            put("breakaway", c, cs, force.into());
            let (d, ds) = shape("deflection");
            // From straight, before any slides.
            let lengths = bristle_lengths(found);
            let value = c * lengths.iter().map(|length| length.recip()).sum::<f64>() / lengths.len() as f64;
            put(
                "stiffness",
                value,
                value.abs() * ((cs / c).powi(2) + (ds / d).powi(2)).sqrt(),
                format!("{force}/{length}"),
            );
        }
        N::PositionDependentFriction | N::PositionDependentDamping => {
            // Largest less smallest of the fitted polynomial over the travel.
            let degree = found.shape_or("degree", 3.0) as usize;
            let c: Vec<f64> = (0..degree).map(|k| term(k).0).collect();
            let mut basis = vec![0.0; degree];
            let values: Vec<f64> = (0..=60)
                .map(|i| {
                    legendre(-1.0 + f64::from(i) / 30.0, 1.0, &mut basis);
                    c.iter().zip(&basis).map(|(c, b)| c * b).sum()
                })
                .collect();
            let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
            let low = values.iter().copied().fold(f64::INFINITY, f64::min);
            let sd = 2.0 * (0..degree).map(|k| term(k).1.powi(2)).sum::<f64>().sqrt();
            let (v, s) = scaled((high - low, sd));
            let unit = if found.name == N::PositionDependentFriction {
                force.into()
            } else {
                format!("{force}·s/{length}")
            };
            put("span", v, s, unit);
        }
        N::FrictionDrift => {
            let base = fit.value(Key::Coulomb).unwrap_or(0.0).abs();
            if base > 0.0 {
                put("change", term(0).0 / base, term(0).1 / base, "1".into());
            }
            let (v, s) = shape("time_constant");
            put("time_constant", v, s, "s".into());
        }
        N::GainDrift => {
            put("change", term(0).0 / ratio, (term(0).1 / ratio).abs(), "1".into());
            let (v, s) = shape("time_constant");
            put("time_constant", v, s, "s".into());
        }
        N::Cogging | N::TorqueRipple => {
            let relative = found.name == N::TorqueRipple;
            let waves = waves_of(&candidate.model, effect);
            let turn = found.shape.get("turn").copied();
            // Free periods are numbered from the strongest.
            let size = |k: usize| term(2 * k).0.hypot(term(2 * k + 1).0);
            let mut by_size: Vec<usize> = (0..waves.len()).collect();
            by_size.sort_by(|a, b| size(*b).total_cmp(&size(*a)));
            let mut square = (0.0, 0.0);
            for (rank, k) in by_size.into_iter().enumerate() {
                let wave = waves[k];
                let (x, s) = sized(&[term(2 * k), term(2 * k + 1)]);
                let (v, s) = if relative { ((x / ratio).abs(), (s / ratio).abs()) } else { scaled((x, s)) };
                let unit = if relative { "1" } else { force };
                match turn {
                    Some(turn) => {
                        let order = (wave * turn / std::f64::consts::TAU).round();
                        put(&format!("order_{order}"), v, s, unit.into());
                    }
                    None => {
                        put(&format!("amplitude_{}", rank + 1), v, s, unit.into());
                        let period = std::f64::consts::TAU / wave;
                        let name =
                            if rank == 0 { "period".to_owned() } else { format!("period_{}", rank + 1) };
                        put(&name, period, 0.002 * period, length.into());
                    }
                }
                square.0 += 0.5 * v * v;
                square.1 += (0.5 * v * s).powi(2);
            }
            let rms: f64 = square.0.sqrt();
            put(
                "rms",
                rms,
                square.1.sqrt() / rms.max(1e-300),
                if relative { "1".into() } else { force.into() },
            );
        }
        N::MassImbalance => {
            let (v, s) = scaled(sized(&[term(0), term(1)]));
            put("amplitude", v, s, force.into());
        }
        N::EncoderEccentricity => {
            let (v, s) = sized(&[term(0), term(1)]);
            put("amplitude", v, s, length.into());
        }
        N::CommandDeadband => {
            let (v, s) = shape("half_width");
            put("half_width", v, s, command);
        }
        N::CommandSaturation => {
            let (v, s) = shape("limit");
            put("limit", v, s, command);
        }
        N::RollerSlip => {
            // The load's part of what the drive would need to press as hard.
            let (limit, s) = shape("limit");
            let ratio_of_load = (term(0).0 / ratio).abs();
            let part = ratio_of_load / (1.0 + ratio_of_load);
            let part_sd = (term(0).1 / ratio).abs() / (1.0 + ratio_of_load).powi(2);
            let drive = limit * inertia * found.shape_or("per_command", ratio).abs();
            let value = part * drive;
            let sd =
                ((part * s / limit * drive).powi(2) + (part_sd * drive).powi(2) + (value * common).powi(2))
                    .sqrt();
            put("ceiling", value, sd, force.into());
        }
        N::CommandDelay => {
            let (v, s) = shape("delay");
            put("delay", v, s, "s".into());
        }
        N::ElectricalLag => {
            let (v, s) = shape("time_constant");
            put("time_constant", v, s, "s".into());
        }
        N::Backlash => {
            let (v, s) = shape("gap");
            put("gap", v, s, length.into());
        }
        N::DriveCompliance => {
            let (f, s) = shape("resonance_hz");
            let load = (term(0).0 / ratio).max(0.0);
            let part = (1.0 + load).sqrt();
            let sd = ((s / part).powi(2) + (0.5 * f / part.powi(3) * term(0).1 / ratio).powi(2)).sqrt();
            put("antiresonance_hz", f / part, sd, "Hz".into());
        }
        N::MissedCounts => {
            // All the counts that were lost in the fitted recordings, whichever way.
            let counts = nominal.rig.encoder.counts_per_unit;
            let lost =
                |track: &BlockedRecording| track.lost.windows(2).map(|w| (w[1] - w[0]).abs()).sum::<f64>();
            let sum = context.tracks.iter().map(lost).sum::<f64>() * counts * term(0).0;
            let square = (0.05 * sum).powi(2) + 1.0;
            put("lost", sum, square.sqrt(), "counts".into());
        }
    }
    out
}
